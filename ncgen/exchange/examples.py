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
from typing import Any, TypedDict, TypeVar, Unpack

from ncgen.errors import MAX_ECHO, ModelError, NcgenError, shortened
from ncgen.exchange import robots
from ncgen.exchange.text import as_path, why_no_file
from ncgen.exchange.words import is_required
from ncgen.files import is_file, opened
from ncgen.model import Model
from ncgen.model.argument_readers import truth
from ncgen.resources import folder
from ncgen.solver.groups import takes

Result = TypeVar("Result")

SUFFIXES = (".toml", ".py", *robots.SUFFIXES)
"""Of files that a model can be in."""


class RobotArguments(TypedDict, total=False):
    """What a model has of a robot's file.

    Parameters
    ----------
    floating : bool, optional
        Whether the robot's root is a free body or part of the ground. Default: as the file says.
    limits : bool or str
        Whether joints have the stops of the file: True as springs, "rigid" as stops with restitution, whose parameter is stop_restitution.
    friction : bool or str
        Whether joints have the dry friction of the file: True as smooth couples, which creep, "exact" as friction that sticks.
    motors : bool
        Whether actuators, or joints where the file has no actuators, have inputs, with gears, servos and limits of the file.
    sensors : bool
        Whether the sensors of an MJCF file are outputs.
    loops : path, optional
        TOML file with the joints that close loops. Default: ROBOT.loops.toml next to the robot's file, if it exists.
    inertias : str
        What to do with moments of inertia that no body has: "refused" raises ModelError, "balanced" takes their mean, "as given" the
        file's numbers, both with a warning that counts bodies.
    parameters : str or sequence of str
        What becomes parameters of the model, with the file's values. "inertia": masses, centres of mass and moments of inertia of all
        links, LINK.mass, LINK.centre.x, LINK.inertia.xy. "geometry": positions of joints in their parents, JOINT.origin.x. Names of links
        and joints for those of these; a link may have no inertia in the file, such as a payload.
    frames : sequence of str
        Names of links, sites and frames whose position and rotation are outputs, NAME.x and NAME.r11 and so on.
    """

    floating: bool | None
    limits: bool | str
    friction: bool | str
    motors: bool
    sensors: bool
    loops: str | Path | None
    inertias: str
    parameters: str | Sequence[str]
    frames: Sequence[str]


ROBOT_DEFAULTS: dict[str, Any] = {
    **dict.fromkeys(("limits", "friction", "motors", "sensors"), False),
    **{"floating": None, "loops": None, "inertias": "refused", "parameters": (), "frames": ()},
}
"""{argument: its value where nothing is given}"""


@takes(RobotArguments, former={"name": "path"}, **ROBOT_DEFAULTS)
def load(path: str | Path, **robot: Unpack[RobotArguments]) -> Model:
    """Load the model of an example, a TOML file, a robot's file (URDF, SDF, MJCF), or a Python file with a function `build()`.

    Parameters
    ----------
    path : str or Path
        Name of an example, or path of a file.
    **robot : RobotArguments
        All but the path are for robots' files.

    Returns
    -------
    Model
        The model; its `left_out` lists what the file has and the model does not have.

    Raises
    ------
    ModelError
        With the file and the line where the file is wrong, or with the examples if there is no such file.

    Warns
    -----
    UserWarning
        Once, with the number of things in a robot's file that change the motion and are not modelled.
    """
    from ncgen.exchange.robots.stops import SMOOTH_OR, check_smooth

    options = {**ROBOT_DEFAULTS, **robot}
    having = {word: options[word] for word in ("limits", "friction", "motors", "sensors")}
    floating, loops, inertias, parameters, frames = (options[word] for word in ("floating", "loops", "inertias", "parameters", "frames"))
    file = as_path(path, "the name of an example or the path of a file")
    for word, argument in (("floating", False if floating is None else floating), *having.items()):
        if word in SMOOTH_OR:
            check_smooth(argument, word)
        else:
            truth(argument, word)
    suffix = file.suffix.lower()
    if suffix in robots.SUFFIXES and is_file(file):
        model = robots.load_robot(file, floating, loops=loops, inertias=inertias, parameters=parameters, stacklevel=3, **having)
        return robots.with_frame_outputs(model, frames) if frames else model
    for word, argument in (
        ("floating", floating is not None),
        *having.items(),
        ("loops", loops is not None),
        ("inertias", inertias != "refused"),
        ("parameters", len(parameters) > 0),
        ("frames", len(frames) > 0),
    ):
        if argument:
            raise ModelError(f"{file.name}: {word} is for a robot's file ({', '.join(robots.SUFFIXES)}); a model says itself what it has")
    if str(path) in example_names():
        return _checked(example_module(path))
    if not is_file(file):
        raise _no_such(path, file)
    if suffix == ".toml":
        from ncgen.exchange.toml_reader import load_toml

        model = load_toml(file)
    else:
        model = _checked(_import(file))
    model.drawing.folder = file.resolve().parent
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
    """Reads a module from its source and leaves no bytecode next to it."""

    def get_data(self, path: str) -> bytes:
        with opened(path) as file:
            return file.read()

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _no_such(name: str | Path, path: Path) -> ModelError:
    near = get_close_matches(str(name), example_names(), n=1)
    advice = f"did you mean {near[0]}? `ncgen list` shows all examples" if near else f"the examples are {', '.join(example_names())}"
    missing = f"there is no such file or example; {advice}"
    return ModelError(f"{shortened(str(name), MAX_ECHO) or repr('')}: {why_no_file(path, missing) if str(name) else missing}")


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
        position = f"{shortened(Path(error.filename or path).name, MAX_ECHO)}{f', line {error.lineno}' if error.lineno else ''}"
        raise ModelError(f"{position}: {error.msg}") from error
    except SystemExit as error:
        raise ModelError(
            f"{_place(error, path)}: it ends Python by sys.exit({error.code!r}); a model file only describes a model"
        ) from error
    except Exception as error:
        raise ModelError(f"{_place(error, path)}: {type(error).__name__}: {error}") from error


def _place(error: BaseException, path: Path) -> str:
    """The file, and the last of its lines that was being run."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    name = shortened(path.name, MAX_ECHO)
    return f"{name}, line {lines[-1]}" if lines else name
