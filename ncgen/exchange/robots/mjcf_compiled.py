"""MJCF compiled by MuJoCo in a process of its own, so that no file crashes this one, fills its memory or never ends.

All files that a model is made of are looked at before: included ones are read as the first one is, and meshes and pictures are ordinary
files. What comes back is MuJoCo's own binary model.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator, Sequence
from importlib.util import find_spec
from itertools import chain, product
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from ncgen.errors import ModelError, NcgenError, shown
from ncgen.exchange.robots.markup import Markup, read_markup
from ncgen.exchange.robots.mjcf_bindings import bindings
from ncgen.exchange.robots.mjcf_child import PLAIN_MESHES, UNREAD_FILES
from ncgen.exchange.robots.mjcf_kept import keep_model, kept_model, key_of
from ncgen.exchange.text import placed
from ncgen.files import contents, is_file, is_there, write_text

Compiled: TypeAlias = Any
"""mujoco.MjModel, of a package that need not be there."""

SECONDS = 30
"""Processor time of MuJoCo for one file; 2,000 bodies take 0.5 s."""

WALL_TIME_FACTOR = 2
"""Times SECONDS after which the process is ended, however little of the processor it had."""

MOST_COPIES = 100_000
"""Copies that nested elements may ask for by `count`."""

COPYING = ("replicate", "flexcomp", "composite")
"""Elements that do."""

MOST_FILES = 1000
"""Files that a model includes."""

MAX_COUNTS = {"nbody": 20_000, "njnt": 20_000, "ngeom": 100_000, "neq": 20_000}
"""Bodies and so on that are read: a line of text can ask for millions of copies."""

MESH = 7
"""MuJoCo's number of meshes among geometries."""

WORDS = {"nbody": "bodies", "njnt": "joints", "ngeom": "geoms", "neq": "equalities"}

FOLDERS = ("meshdir", "texturedir", "assetdir", "modeldir")
"""Attributes of <compiler> that say where files are."""

MODELS = ("include", "model")
"""Elements that name files with more of the model."""

PLUGIN, PLUGIN_SETTING = "plugin", "config"
"""The elements, and the attribute, that name a plugin, and the element with a setting of one."""

PLUGINS_WITHOUT_FILES = {f"mujoco.sdf.{shape}" for shape in ("bolt", "bowl", "gear", "nut", "torus")}
"""Plugins of MuJoCo that make shapes of their settings alone, which takes longer than all else."""


class UnreadFile(NamedTuple):
    """Where MuJoCo may look for a file that nothing but looks depends on, and how many dots wide and high a picture (PNG) of its kind is at
    least."""

    path: str
    columns: int = 0
    rows: int = 0


class Family(NamedTuple):
    """The root elements of a file and of all that it includes, and the real paths of all files that the model is made of.

    files is empty where plugins have settings that may open files of their own. folders: where files may be
    """

    roots: list[Markup]
    files: frozenset[str]
    folders: list[Path]

    def unread(self, with_meshes: bool) -> list[UnreadFile]:
        """The files that are textures, and with_meshes also meshes, and nothing else: how bodies move does not depend on them."""
        named = [pair for root in self.roots for pair in named_files(root)]
        needed = {_stripped(name) for element, name in named if element.tag not in (("texture", "mesh") if with_meshes else ("texture",))}
        sizes: dict[str, set[tuple[int, int]]] = {}
        for element, name in named:
            is_mesh = element.tag == "mesh" and name.lower().endswith(PLAIN_MESHES) and "content_type" not in element.attributes
            if (name.endswith(".png") or is_mesh) and _stripped(name) not in needed:
                sizes.setdefault(name, set()).add((0, 0) if is_mesh else _least_size(element))
        paths = [(folder / name, *several) for name, several in sizes.items() if len(several) == 1 for folder in self.folders]
        return [UnreadFile(str(path.absolute()), *size) for path, size in paths if is_file(path)]

    @property
    def seen_meshes(self) -> int:
        """How many geoms name a mesh, if they are all in bodies whose inertia the file gives, and no sensor asks where they are; else 0."""
        elements = [each.attributes for root in self.roots for each in root.walk()]
        is_needed = any(each.get("inertiafromgeom") == "true" or "geom" in (each.get("objtype"), each.get("reftype")) for each in elements)
        count = sum("mesh" in each for each in elements)
        return 0 if is_needed or any(_needs_mesh(root, False) for root in self.roots) else count


def _needs_mesh(element: Markup, is_given: bool) -> bool:
    """Whether anything but what a geom looks like may depend on a mesh; is_given: whether the body around has its inertia in the file."""
    if "mesh" in element.attributes and not (is_given and element.tag == "geom"):
        return True
    inside = {"worldbody": True, "body": element.first("inertial") is not None, "frame": is_given}
    return any(_needs_mesh(child, inside.get(element.tag, False)) for child in element.children)


def _least_size(texture: Markup) -> tuple[int, int]:
    """Columns and rows of the grid of pictures that a file of a texture is; one where it says nothing that can be read."""
    words = dict.get(texture.attributes, "gridsize", "").split()
    rows, columns = words if len(words) == 2 and all(word.isdecimal() and 0 < int(word) < 100 for word in words) else (1, 1)
    return int(columns), int(rows)


def family(root: Markup, path: Path) -> Family:
    """All that a model is made of. Raises ModelError with file and line for what is not read.

    What is not there MuJoCo itself tells.
    """
    members, files = [(root, path)], {_real(path)}
    for each, origin in members:  # which grow
        _check_copies(each, 1)
        models = [(element, name) for element, name in named_files(each) if element.tag in MODELS]
        more = _found(models, _folders((root, each), (path.parent, origin.parent)), files)
        members += [(read_markup(file), file) for file in more if file.suffix.lower() != ".mjb"]
        if len(members) > MOST_FILES:
            root.refuse(f"it includes more than {MOST_FILES} files")
    roots = [each for each, _ in members]
    folders = _folders(roots, dict.fromkeys(origin.parent for _, origin in members))
    files.update(map(_real, _found((named for each in roots for named in named_files(each)), folders, files)))
    elements = list(chain.from_iterable(each.walk() for each in roots))
    plugins = {each.attributes[PLUGIN] for each in elements if each.tag == PLUGIN and PLUGIN in each.attributes}
    settings = any(each.tag == PLUGIN_SETTING for each in elements) and not plugins <= PLUGINS_WITHOUT_FILES
    return Family(roots, frozenset() if settings else frozenset(files), folders)


def _found(named: Iterable[tuple[Markup, str]], folders: Iterable[Path], files: set[str]) -> Iterator[Path]:
    """Files that elements name, of those that are there and not yet among files, which grow.

    A file may lie there without the folder of its name, too (`strippath`). Raises ModelError for what is no ordinary file.
    """
    folders, tried = list(dict.fromkeys(folders)), set[str]()
    for element, name in named:
        if name in tried:
            continue
        tried.add(name)
        for each, folder in product(dict.fromkeys((name, _stripped(name))), folders):
            file = folder / each
            if not is_there(file) or (real := _real(file)) in files:
                continue
            if is_file(file):
                files.add(real)
                yield file
            elif each == name:
                element.refuse(f"{shown(name)} is no ordinary file; a model is made of ordinary files")


def _stripped(name: str) -> str:
    """The name of a file without its folder, in either system."""
    return re.split(r"[/\\]", name)[-1] or name


def _check_copies(element: Markup, copies: int) -> None:
    """Raise ModelError where elements ask for more copies than MOST_COPIES. copies: of what stands around the element"""
    if element.tag in COPYING:
        for text in element.attributes.get("count", "").split()[:3]:
            copies *= max(1, int(text)) if text.isdecimal() and len(text) < 20 else 1
        if copies > MOST_COPIES:
            element.refuse(f"<{element.tag}> asks for {copies} copies, and {MOST_COPIES} are read; take fewer")
    for child in element.children:
        _check_copies(child, copies)


def named_files(root: Markup) -> Iterator[tuple[Markup, str]]:
    """Elements that name files, and the names."""
    for element in root.walk():
        for key, name in element.attributes.items():
            if key.startswith("file") and name and "\0" not in name:
                yield element, name


def _folders(roots: Iterable[Markup], bases: Iterable[Path]) -> list[Path]:
    """Where a file that an element names may be."""
    compilers = [each.attributes for root in roots for each in root.walk() if each.tag == "compiler"]
    inner_folders = [compiler[key] for compiler in compilers for key in FOLDERS if key in compiler]
    return [base / inner for base in bases for inner in ("", *inner_folders)]


def _real(path: Path) -> str:
    return os.path.realpath(path)


# -- compiled ----------------------------------------------------------------------------------------------------------------


def file_of(name: str, root: Markup, path: Path) -> Path | None:
    """The file of a name in a file of MJCF, None where there is no such file. root: of the file at path"""
    candidates = (folder / name for folder in _folders((root,), (path.parent,)) if name and "\0" not in name)
    return next((candidate.resolve() for candidate in candidates if is_file(candidate)), None)


def compiled(path: Path, whole: Family | None = None, text: str | None = None) -> Compiled:
    """The model of a file, or what was kept of it by the content of all its files, and warn of what MuJoCo warns of.

    whole: of the file; without it nothing is kept; text: in place of the file's own
    Raises ModelError with what MuJoCo says of it, or how it ended, NcgenError without MuJoCo.
    """
    library, files = _library(path), whole.files if whole else ()
    key = key_of(path, library, text, files) if files else None
    if key and (known := kept_model(key)):
        model, messages = known
    else:
        model, messages = _compiled_by_need(path, library, text, whole)
        for name, most in MAX_COUNTS.items():
            if getattr(model, name) > most:
                raise ModelError(placed(path.name, None, f"it has {getattr(model, name)} {WORDS[name]}, and {most} are read; take fewer"))
        if key:
            keep_model(key, model, messages, files)
    for message in messages:
        warnings.warn(placed(path.name, None, message), stacklevel=2)
    return model


def _library(path: Path) -> Path:
    """MuJoCo's library. Raises NcgenError where there is none for a file."""
    spec = find_spec("mujoco")
    if spec is None or spec.origin is None:
        raise NcgenError(f"{path.name}: MJCF is read by MuJoCo, which is missing; run pip install 'ncgen[robots]'")
    package = Path(spec.origin).parent
    library = next(iter(sorted((*package.glob("libmujoco*"), *package.glob("mujoco.dll")))), None)
    if library is None or not sys.executable:
        missing = f"MuJoCo's library is not in {package}" if library is None else "Python does not know its own program (sys.executable)"
        raise NcgenError(f"{path.name}: MuJoCo reads it in a process of its own, and {missing}; install mujoco again")
    return library


def _compiled_by_need(path: Path, library: Path, text: str | None, whole: Family | None) -> tuple[Compiled, list[str]]:
    """The model of a file, and what MuJoCo warns of; meshes are read where more than looks depends on them."""
    if whole and (count := whole.seen_meshes):
        model, messages = _compiled_now(path, library, text, whole.unread(True))
        if sum(model.geom_type == MESH) == count:  # else shapes of other kinds have the sizes of meshes
            return model, messages
    return _compiled_now(path, library, text, whole.unread(False) if whole else ())


def _compiled_now(path: Path, library: Path, text: str | None, unread: Sequence[UnreadFile]) -> tuple[Compiled, list[str]]:
    """The model of a file, and what MuJoCo warns of; unread: files that are not read. Raises ModelError."""
    with tempfile.TemporaryDirectory(prefix="ncgen-mjcf-") as folder:
        file = path
        if text is not None:
            file = Path(folder) / path.name
            write_text(file, text)
        if unread:
            write_text(Path(folder) / UNREAD_FILES, json.dumps(unread))
        messages = _run(file, library, Path(folder))
        mujoco = bindings()
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(lambda text: None)  # else it writes a file where Python happens to run
        try:
            return mujoco.MjModel.from_binary_path(str(Path(folder) / "model.mjb")), messages
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(placed(path.name, None, " ".join(str(error).split()))) from None
        finally:
            mujoco.set_mju_user_warning(before)


def _run(path: Path, library: Path, folder: Path) -> list[str]:
    """Have a file compiled into folder/model.mjb; what MuJoCo warns of. Raises ModelError."""
    plugins = library.parent / "plugin"
    program = Path(__file__).with_name("mjcf_child.py")
    arguments = [str(library), str(plugins) if plugins.is_dir() else "", str(path), str(folder), str(SECONDS)]
    command = [sys.executable, "-I", "-S", "-B", str(program), *arguments]
    no = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=no, stdout=no, stderr=no) as process:
        try:
            bindings()  # meanwhile
            status = process.wait(WALL_TIME_FACTOR * SECONDS)
        except subprocess.TimeoutExpired:
            status = -getattr(signal, "SIGXCPU", signal.SIGTERM)
        finally:
            process.kill()
    try:
        result = json.loads(contents(folder / "told.json", 1_000_000))
    except (OSError, ValueError):
        raise ModelError(placed(path.name, None, f"{_how(status)}; what it asks for is too much, or damaged")) from None
    if result["error"]:
        raise ModelError(placed(path.name, None, result["error"]))
    return list(map(str, result["warnings"]))


def _how(status: int) -> str:
    """How MuJoCo's process ended without a word."""
    if status == -getattr(signal, "SIGXCPU", signal.SIGTERM):
        return f"MuJoCo is not done with it after {SECONDS} s"
    if status == -getattr(signal, "SIGXFSZ", 0):
        return "MuJoCo makes a model of more than 1 GB of it"
    name = signal.Signals(-status).name if -status in {*signal.Signals} else f"status {status}"
    return f"MuJoCo's process ended by {name} on it"
