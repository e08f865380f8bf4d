"""Models by name or by file: the examples that ncgen ships, files of the user's own in Python or TOML, and robots."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import traceback
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import TypeVar

from ncgen.errors import SHOWN, ModelError, NcgenError, shortened, shown
from ncgen.exchange import robots
from ncgen.exchange.text import as_path, why_no_file
from ncgen.exchange.toml_reader import load_toml
from ncgen.exchange.words import is_required
from ncgen.files import is_file, opened
from ncgen.model import Model
from ncgen.resources import folder

Result = TypeVar("Result")

SUFFIXES = (".toml", ".py", *robots.SUFFIXES)
"""Of files that a model can be in."""


def load(
    name: str | Path,
    *,
    floating: bool | None = None,
    limits: bool = False,
    friction: bool = False,
    motors: bool = False,
    sensors: bool = False,
    loops: str | Path | None = None,
    inertias: str = "refused",
    parameters: str | Sequence[str] = (),
    frames: Sequence[str] = (),
) -> Model:
    """The model of an example, of a TOML file, of a robot's file (URDF, SDF, MJCF), or of a Python file that has a function `build()`
    returning a model.

    floating: a robot's root is a free body (True) or part of the ground (False); None for what its file says
    limits, friction: a robot's joints have the stops and the dry friction of its file, as springs and smooth couples
    motors: a robot's actuators, or its joints where the file says no actuators, have inputs, with gears, servos and limits of the file
    sensors: the sensors of an MJCF file are outputs
    loops: a TOML file that says what closes a robot's loops; None for ROBOT.loops.toml beside its file, if there is one
    inertias: of moments of inertia that no body has "balanced" for their mean, "as given" for the file's numbers, both with a warning
        that counts bodies; "refused" for a ModelError
    parameters: "inertia" for masses, centres of mass and moments of inertia of all links as parameters of the model, with the file's
        values, LINK.mass, LINK.centre.x, LINK.inertia.xy; "geometry" for where joints are in their parents, JOINT.origin.x; names of links
        and joints for those of these: a link may have no inertia in the file, a payload
    frames: names of links, sites and frames of a robot's file whose position and rotation are outputs, NAME.x and NAME.r11 and so on
    Warns, in one line, of how many things of a robot's file that change the motion the model does not have; `left_out` of the model lists
    them. Raises ModelError naming the file and the line where the file fails, or listing the examples if there is none.
    """
    having = {"limits": limits, "friction": friction, "motors": motors, "sensors": sensors}
    path = as_path(name, "the name of an example or the path of a file")
    for word, given in (("floating", False if floating is None else floating), *having.items()):
        if not isinstance(given, bool):
            raise ModelError(f"{word}: {shown(given)} given; give True or False")
    suffix = path.suffix.lower()
    if suffix in robots.SUFFIXES and is_file(path):
        model = robots.load_robot(path, floating, limits, friction, loops, motors, sensors, inertias, parameters, stacklevel=2)
        return robots.with_frame_outputs(model, frames) if frames else model
    for word, given in (
        ("floating", floating is not None),
        *having.items(),
        ("loops", loops is not None),
        ("inertias", inertias != "refused"),
        ("parameters", len(parameters) > 0),
        ("frames", len(frames) > 0),
    ):
        if given:
            raise ModelError(f"{path.name}: {word} is for a robot's file ({', '.join(robots.SUFFIXES)}); a model says itself what it has")
    if str(name) in example_names():
        return _checked(example_module(name))
    if not is_file(path):
        raise _no_such(name, path)
    model = load_toml(path) if suffix == ".toml" else _checked(_import(path))
    model.drawing.folder = path.resolve().parent
    return model


def example_names() -> list[str]:
    """Names of the examples, sorted."""
    return sorted(path.parent.name for path in folder("examples").glob("*/model.py"))


def example_module(name: str | Path, file: str = "model.py") -> ModuleType:
    """An example's Python module, for its variants and numbers."""
    return _import(folder("examples") / str(name) / file)


def lesson(name: str) -> str:
    """The first line of an example's description: what it teaches."""
    text = example_text(name)
    return (ast.get_docstring(ast.parse(text)) or name).splitlines()[0]


def example_text(name: str) -> str:
    """The Python text of an example's model."""
    return (folder("examples") / name / "model.py").read_text(encoding="utf-8")


class _Reader(SourceFileLoader):
    """Reads a module from its source and leaves no bytecode beside it."""

    def get_data(self, path: str) -> bytes:
        with opened(path) as file:
            return file.read()

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _no_such(name: str | Path, path: Path) -> ModelError:
    near = get_close_matches(str(name), example_names(), n=1)
    advice = f"did you mean {near[0]}? `ncgen list` shows all examples" if near else f"the examples are {', '.join(example_names())}"
    missing = f"there is no such file or example; {advice}"
    return ModelError(f"{shortened(str(name), SHOWN) or repr('')}: {why_no_file(path, missing) if str(name) else missing}")


def _import(path: Path) -> ModuleType:
    if path.suffix.lower() != ".py":
        raise ModelError(
            f"{path}: not a model; give a .toml, .urdf, .sdf, .xml or .py file, the last with a function build(), or an example's name"
        )
    path = path.resolve()
    name = f"ncgen_model_{path.parent.name}_{path.stem}"
    loader = _Reader(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    if spec is None:
        raise ModelError(f"{path}: Python cannot load it as a module; give another file")
    module = importlib.util.module_from_spec(spec)
    _guarded(path, lambda: loader.exec_module(module))
    return module


def _checked(module: ModuleType) -> Model:
    path = Path(module.__file__ or module.__name__)
    if not callable(getattr(module, "build", None)):
        raise ModelError(f"{path}: it has no function build(); define one that returns an ncgen.Model")
    if needed := [p.name for p in _guarded(path, lambda: inspect.signature(module.build)).parameters.values() if is_required(p)]:
        raise ModelError(f"{path.name}: build() needs {needed[0]}, but it is called with nothing; give {needed[0]} a default")
    from ncgen.solver.runs.simulation_options import check_options

    model = _guarded(path, module.build)
    if not isinstance(model, Model):
        raise ModelError(f"{path}: build() returns {type(model).__name__}; return an ncgen.Model")
    check_options(model.simulation_options)
    return model


def _guarded(path: Path, run: Callable[[], Result]) -> Result:
    """Run the user's code; its own mistakes become one line with the file and the line number."""
    try:
        return run()
    except NcgenError as error:
        error.args = (shortened(f"{_place(error, path)}: {error}"), *error.args[1:])
        raise
    except SyntaxError as error:
        place = f"{shortened(Path(error.filename or path).name, SHOWN)}{f', line {error.lineno}' if error.lineno else ''}"
        raise ModelError(f"{place}: {error.msg}") from error
    except SystemExit as error:
        raise ModelError(
            f"{_place(error, path)}: it ends Python by sys.exit({error.code!r}); a model file only describes a model"
        ) from error
    except Exception as error:
        raise ModelError(f"{_place(error, path)}: {type(error).__name__}: {error}") from error


def _place(error: BaseException, path: Path) -> str:
    """The file, and the last of its lines that was being run."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    name = shortened(path.name, SHOWN)
    return f"{name}, line {lines[-1]}" if lines else name
