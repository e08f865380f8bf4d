"""The package keeps its order: who may import whom, what loading costs, what lies at the top, and no name stands for two things."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "ncgen"
LAYERS = (
    "model", "symbolic", "program", "methods", "emit", "toolchain", "mechanism", "solver", "compiler", "view", "exchange", "report",
    "studies", "comparisons", "cli",
)  # fmt: skip
ROOMS = {
    "program": ("ir", "algebra", "", "differentiation", "tree", "motions"),
    "solver": (
        "", "positions", "formalisms", "integrators", "trajectories", "loads", "runs", "engines", "events", "motions",
        "derivatives", "linear", "joints",
    ),
}  # fmt: skip
"""Packages in rooms, each of which loads only those before it; "" are the modules beside them."""
BY_NAME = {
    ("model", "ncgen.report.cards"), ("mechanism", "ncgen.report.cards"), ("solver", "ncgen.report.cards"), ("solver", "ncgen.report.bar"),
    ("solver", "ncgen.view.figure"), ("solver", "ncgen.view.film"), ("solver", "ncgen.view.player"),
    ("solver", "ncgen.exchange.toml_writer"), ("solver", "ncgen.compiler"),
}  # fmt: skip
"""What is looked up by name when it is called, since it comes after: pictures, cards and files of objects that users hold, a progress bar,
and the compiler for modes that a run needs. The list only becomes shorter."""
FOR_ALL = {"errors", "files", "archives", "resources", "__version__"}
DOORS = {"__init__", "__main__"}
"""What a user imports: it leads everywhere."""
TOP = {
    "pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", ".gitignore", ".gitattributes", ".ci",
    "docs", "ncgen", "templates", "generated", "examples", "tests",
}  # fmt: skip
HEAVY = ("sympy", "scipy", "matplotlib", "jinja2")


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def part(path: Path) -> str:
    """The package or top-level module that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, absolute dotted name) of everything that is imported, at any depth."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: imports are absolute here"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def looked_up(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """The same of what is imported by a name that is written out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module") and isinstance(node.args[0], ast.Constant):
            yield node.lineno, str(node.args[0].value)


def breaches(own: str, source: str) -> list[str]:
    """Imports by which a part of the package reaches down to a part that comes after it."""
    if own in DOORS:
        return []
    allowed = FOR_ALL | set(LAYERS[: LAYERS.index(own) + 1]) if own in LAYERS else FOR_ALL
    tree = ast.parse(source)
    names = [*imported(tree), *((line, name) for line, name in looked_up(tree) if (own, name) not in BY_NAME)]
    inner = [(line, name.split(".")) for line, name in names if name.split(".")[0] == "ncgen"]
    return [f"line {line}: {own} imports {'.'.join(n)}" for line, n in inner if len(n) == 1 or n[1] not in allowed]


def eager(tree: ast.Module) -> Iterator[str]:
    """Names of modules that are imported as soon as this one is: not in functions, nor for type checkers only."""
    waiting = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from (name for _, name in imported(node))
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
        elif not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            waiting += [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt)]


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_upwards_only(path):
    """No file imports from a package that comes after its own, not even inside a function."""
    assert breaches(part(path), path.read_text(encoding="utf-8")) == []


def test_nothing_that_is_installed_needs_the_tests():
    """Other people's programs are set next to ncgen in tests/benchmarks, which no wheel has."""
    beside = "|".join(["tests", *(path.name for path in (ROOT / "tests").iterdir() if (path / "__init__.py").is_file())])
    wanted = re.compile(rf"^\s*(?:from|import) (?:{beside})\b|import_module\(f?\"(?:{beside})\b", re.MULTILINE)
    assert wanted.search("    from benchmarks.rivals import casadi") and wanted.search('import_module("benchmarks.arms")')
    for path in [*modules(), *(ROOT / "examples").rglob("*.py")]:
        assert not wanted.search(path.read_text(encoding="utf-8")), path


def room(package: str, inner: Sequence[str]) -> str:
    """The room of a package in which a dotted name or a path below it lies."""
    return inner[0] if inner and inner[0] in ROOMS[package] else ""


def climbs(package: str, own: str, source: str) -> list[str]:
    """Modules of later rooms of its package that a source in a room loads."""
    inner = [name.split(".")[2:] for name in eager(ast.parse(source)) if name.startswith(f"ncgen.{package}.")]
    order = ROOMS[package].index
    return [".".join(names) for names in inner if order(room(package, names)) > order(own)]


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_load_only_those_before_them(package):
    """Every folder of the package is a room, and data goes through them in order, but for what a function asks for when it is called."""
    assert {path.parent.name for path in (PACKAGE / package).glob("*/__init__.py")} == set(ROOMS[package]) - {""}
    for path in sorted((PACKAGE / package).rglob("*.py")):
        own = room(package, path.relative_to(PACKAGE / package).parts)
        assert climbs(package, own, path.read_text(encoding="utf-8")) == [], path
    assert climbs("solver", "positions", "from ncgen.solver.runs.run import Run") == ["runs.run.Run"]


def test_every_test_module_has_a_name_of_its_own():
    """pytest imports them by their names alone: where one process meets two of one name it collects neither the second nor what follows."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted({name for name in names if names.count(name) > 1}) == []


def test_no_folder_has_a_name_that_tools_skip():
    """pytest, git and packagers pass over folders called build or dist without a word. (What Python compiled there before is no source.)"""
    skipped = {"build", "dist", "CVS", "_darcs", "node_modules", "venv", "lib", "env", "target", "out"}
    sources = [path.relative_to(ROOT) for root in (PACKAGE, ROOT / "tests") for path in root.rglob("*.*") if path.suffix != ".pyc"]
    assert len(sources) > 400 and not [path for path in sources if skipped & set(path.parts)]


def test_every_part_has_a_place():
    """A package or module that is in no list above would escape the order."""
    assert {part(path) for path in modules()} <= set(LAYERS) | DOORS | FOR_ALL


OPENS = {"open", "read_text", "read_bytes", "write_text", "write_bytes", "touch", "loadtxt", "genfromtxt", "fromfile", "memmap"}
"""Functions and methods that open a file by its name."""

HARMLESS = ("os", "archive")
"""Whose functions of such names open none."""

OWN = {
    "files.py": "opens files for all",
    "resources.py": "files of the package",
    "emit/runtime_files.py": "files of the package", "program/ir/catalogued.py": "files of the package",
    "mechanism/generator_identity.py": "files of the package",
    "mechanism/direct.py": "files of the package", "report/repeat.py": "files of the package", "view/still.py": "files of the package",
    "exchange/xla.py": "files of packages", "exchange/examples.py": "the package's examples",
    "report/machine.py": "/proc", "toolchain/compilers.py": "/proc, and folders that it has made",
    "toolchain/cache.py": "folders that it has made", "exchange/export/fmu.py": "libraries that were just compiled",
    "exchange/robots/mjcf_child.py": "a program that imports nothing of ncgen, in a folder that was made for it",
    "toolchain/generic_wasm.py": "a file of the package, and a folder that it has made",
    "exchange/first_model.py": "takes a name, which follows no link",
}  # fmt: skip
"""{module: what it opens by itself} of those that do."""


def openings(source: str) -> list[str]:
    """Calls by which a source opens files itself."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    found = []
    for call in calls:
        match call.func:
            case ast.Name(id="open"):
                found.append(f"line {call.lineno}: open")
            case ast.Attribute(attr="load", value=ast.Name(id="np")):
                found.append(f"line {call.lineno}: np.load")
            case ast.Attribute(attr=name, value=whose) if name in OPENS and not ast.unparse(whose).startswith(HARMLESS):
                found.append(f"line {call.lineno}: {ast.unparse(call.func)}")
    return found


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_of_users_are_opened_in_one_place(path):
    """By ncgen.files, which neither waits for a pipe nor follows a link where it writes. Comparisons run other programs in folders of
    their own."""
    own = path.relative_to(PACKAGE).as_posix()
    if own not in OWN and not own.startswith("comparisons/"):
        assert openings(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("source", ["open(path)", "path.open('w')", "Path(p).read_text()", "np.load(path)", "path.with_suffix('').touch()"])
def test_the_check_sees_an_opening(source):
    assert len(openings(source)) == 1


@pytest.mark.parametrize(
    "own, source",
    [
        ("model", "from ncgen.symbolic.templates import TIME"),
        ("emit", "def late():\n    from ncgen.toolchain import cache"),
        ("solver", "import ncgen.compiler"),
        ("program", "from ncgen import Model"),
        ("errors", "import ncgen.model"),
        ("solver", 'import_module("ncgen.exchange.export.package")'),
        ("symbolic", "if TYPE_CHECKING:\n    from ncgen.emit.c.c_spelling import number"),
    ],
)
def test_the_check_sees_a_breach(own, source):
    """The check itself fails where it should: eager, late and type-only imports alike."""
    assert len(breaches(own, source)) == 1


@pytest.mark.parametrize("path", [p for p in modules() if part(p) == "model"], ids=lambda path: path.stem)
def test_models_are_described_without_sympy(path):
    """Describing a mechanism loads sympy only when an expression is written."""
    assert "sympy" not in {name.split(".")[0] for name in eager(ast.parse(path.read_text(encoding="utf-8")))}


ADDRESSES = {
    "mechanism/in_python.py": "memory of C as arrays, as long as its table says that it is",
    "mechanism/arguments.py": "the one function that hands an array to compiled code, after looking at it",
    "mechanism/kernel_batch.py": "aligned: where memory of its own begins, to choose a part of it",
    "mechanism/moving.py": "MovingRows: addresses of rows of arrays that it makes, which go into structs of its own",
    "mechanism/direct.py": "arrays on memory that C has made, of the size that it was made with",
    "archives.py": "arrays on bytes of a file, which know their length",
    "exchange/robots/mjcf_kept.py": "arrays on bytes of the cache, which know their length",
    "exchange/xla.py": "arrays on memory of JAX, which has checked their shapes",
    "solver/motions/batch.py": "whether two arrays lie in one place; goes nowhere",
}
"""Modules in which an array's address occurs, each with what makes that safe."""


def addresses(source: str) -> list[int]:
    """Lines in which an array becomes an address: from_buffer, frombuffer, ctypes and addresses of an array's interface."""
    words = ("from_buffer", "frombuffer", "ctypes", "__array_interface__", "__cuda_array_interface__")
    return [node.lineno for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Attribute) and node.attr in words]


def test_arrays_reach_c_through_one_function():
    """C believes what it is told about arrays: `ncgen.mechanism.arguments.pointer` looks at their type, layout and count."""
    found = {str(path.relative_to(PACKAGE)) for path in modules() if addresses(path.read_text(encoding="utf-8"))}
    assert found == set(ADDRESSES)
    assert sorted(addresses("ffi.cast('double *', a.ctypes.data)\nffi.from_buffer('double[]', a)")) == [1, 2]


def test_the_check_tells_eager_from_late():
    """A module-level import counts, one in a function or for type checkers does not, in methods neither."""
    source = "import a\nclass C:\n import b\n def f(self):\n  import c\nif TYPE_CHECKING:\n import d\ntry:\n import e\nfinally:\n pass"
    assert set(eager(ast.parse(source))) == {"a", "b", "e"}


def loaded_after(statements: str) -> set[str]:
    """Top-level modules in a fresh interpreter after some statements."""
    code = f"{statements}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    return {name.split(".")[0] for name in done.stdout.split()}


def test_importing_ncgen_is_quick():
    """`import ncgen` loads none of the heavy libraries."""
    assert loaded_after("import ncgen") & set(HEAVY) == set()


def test_describing_a_mechanism_is_quick():
    """A model of plain numbers needs numpy alone; sympy comes with the first expression."""
    describe = "from ncgen import Model\nm = Model('m')\nA = m.point('A', (0, 0), fixed=True)\nB = m.point('B', (1, 0))\nm.distance(A, B)"
    assert loaded_after(describe) & set(HEAVY) == set()
    assert "sympy" in loaded_after(f"{describe}\nm.constrain(B.x - 1)")


def test_a_run_from_the_cache_loads_no_sympy():
    """What carries runs out is there without it: equations that are in the cache are not derived again."""
    runs = "ncgen.compiler, ncgen.exchange.robots, ncgen.mechanism.runtime, ncgen.solver.motions.simulate"
    assert "sympy" not in loaded_after(f"import {runs}")


def tracked() -> set[str]:
    """Names at the top of the repository: those git knows, else those that lie there."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True) if (ROOT / ".git").exists() else None
    if listed is not None and listed.returncode == 0:
        return {line.split("/")[0] for line in listed.stdout.splitlines()}
    leftovers = {".git", ".pytest_cache", ".hypothesis", ".venv", "dist", "build", "PKG-INFO", "__pycache__"}
    return {path.name for path in ROOT.iterdir()} - leftovers


def test_nothing_else_lies_at_the_top():
    """The names at the top of the repository are fixed."""
    assert tracked() <= TOP
    assert {"ncgen", "templates", "tests", "pyproject.toml"} <= tracked()


RUNTIME = PACKAGE / "runtime"
BESIDE = {"ncgen_dense": "ncgen_constrained", "ncgen_pivots": "ncgen_constrained", "ncgen_redundant": "ncgen_constrained",
          "ncgen_solution": "ncgen_constrained"}  # fmt: skip
"""Sources that implement a part of another room's header."""


def c_rooms() -> dict[str, set[str]]:
    """{room of the C library: rooms that it includes}; a room is a source with the header of its name."""
    rooms: dict[str, set[str]] = {}
    for path in sorted([*RUNTIME.glob("*/*.c"), *RUNTIME.glob("*/*.h")]):
        room = BESIDE.get(path.stem, path.stem)
        included = {BESIDE.get(name, name) for name in re.findall(r'^#include "(\w+)\.h"', path.read_text(encoding="utf-8"), re.M)}
        rooms.setdefault(room, set()).update(included - {room})
    return rooms


def circles(rooms: dict[str, set[str]]) -> list[str]:
    """Rooms from which one comes back to them."""

    def reached(room: str) -> set[str]:
        seen, waiting = set(), [room]
        while waiting:
            new = rooms.get(waiting.pop(), set()) - seen
            seen |= new
            waiting += new
        return seen

    return [room for room in rooms if room in reached(room)]


def test_no_circle_in_the_c_library():
    rooms = c_rooms()
    assert len(rooms) > 20 and "ncgen_state" in rooms["ncgen_constrained"]
    assert circles(rooms) == []
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]


def module(imported_name: str, names) -> str:
    """The module that an imported name is, or is in."""
    return imported_name if imported_name in names else imported_name.rpartition(".")[0]


def test_no_circle_of_modules():
    """No module of the package needs itself through others as it is loaded."""
    names = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in modules()}
    needs = {name: {module(n, names) for n in eager(ast.parse(path.read_text(encoding="utf-8")))} - {name} for name, path in names.items()}
    assert circles(needs) == []


SHARED_MODULES = {"files"}
"""Names that several modules have: every language in `emit` has a module `files`, and finds it by this name."""

SHARED_CLASSES: set[str] = set()
"""Names that several classes have; the list stays empty."""


def repeated(names: list[str]) -> set[str]:
    """Names that come more than once."""
    return {name for name, count in Counter(names).items() if count > 1}


def classes_of(source: str) -> list[str]:
    """Names of the classes of a module, those within others and within functions among them, but for private ones."""
    names = [node.name for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    return [name for name in names if not name.startswith("_")]


def test_modules_have_names_of_their_own():
    assert repeated([path.stem for path in PACKAGE.rglob("*.py") if path.stem != "__init__"]) == SHARED_MODULES


def test_classes_have_names_of_their_own():
    assert repeated([name for path in PACKAGE.rglob("*.py") for name in classes_of(path.read_text(encoding="utf-8"))]) == SHARED_CLASSES


FEW_FIELDS = 4
"""Fields of a dataclass up to which they may be given by their places."""


def wordless(source: str) -> list[str]:
    """Dataclasses of a module with more than `FEW_FIELDS` fields that take them by their places."""

    def takes_keywords_only(node: ast.ClassDef) -> bool:
        marks = [mark for mark in node.decorator_list if "dataclass" in ast.unparse(mark)]
        return not marks or "kw_only=True" in ast.unparse(marks[0])

    classes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    fields = {
        node.name: [each for each in node.body if isinstance(each, ast.AnnAssign) and "ClassVar" not in ast.unparse(each)]
        for node in classes
    }
    return [node.name for node in classes if len(fields[node.name]) > FEW_FIELDS and not takes_keywords_only(node)]


def test_dataclasses_of_many_fields_take_keywords_only():
    assert [name for path in PACKAGE.rglob("*.py") for name in wordless(path.read_text(encoding="utf-8"))] == []
    assert wordless("@dataclass(frozen=True)\nclass A:\n" + "".join(f"    x{i}: int\n" for i in range(5))) == ["A"]
