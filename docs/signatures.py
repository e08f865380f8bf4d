"""Write the signatures of all public functions and methods before their names and arguments were changed, and now.

    python docs/signatures.py

docs/reports/signatures.txt has all of them, docs/renamed.md the functions of `ncgen` that are different. Both are read from sources, those
before from the git history, so nothing is imported.
"""

from __future__ import annotations

import ast
import io
import subprocess
import tarfile
from collections.abc import Iterator
from copy import deepcopy
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "renamed.md"
REPORT = ROOT / "docs" / "reports" / "signatures.txt"
BEFORE = "c76678de07a7fe0ca46190f0c6f9c5eec0befff5"
"""The commit before names and arguments were changed."""
START, END = "<!-- python docs/signatures.py -->\n", "<!-- end of the table -->"

CLASSES = (
    "model.model.Model", "mechanism.kernels.Kernels", "solver.trajectories.trajectory.Trajectory", "solver.joints.joint_space.JointsOfTree",
    "solver.joints.joint_loops.JointsInLoops", "solver.motions.simulation.Simulation", "solver.motions.simulations.Simulations",
    "studies.result.StudyResult", "solver.linear.linearise.Linearisation", "solver.loads.reactions.Reactions",
    "solver.motions.batch.BatchTrajectory", "solver.motions.batch.StateAccelerations", "solver.motions.batch.BatchAccelerations",
    "solver.positions.rank.Freedom", "solver.derivatives.gradients.BatchGradients",
)  # fmt: skip
"""The model, and classes of what public functions return."""


class Sources:
    """The modules of ncgen at one time. texts: {module: its source}"""

    def __init__(self, texts: dict[str, str]) -> None:
        self.texts = texts
        self._trees: dict[str, ast.Module] = {}

    def tree(self, module: str) -> ast.Module:
        if module not in self._trees:
            self._trees[module] = ast.parse(self.texts.get(module, ""))
        return self._trees[module]

    def defined(self, module: str, name: str) -> tuple[str, ast.stmt] | None:
        """The module in which a name that a module knows is defined, and the definition."""
        for node in self.tree(module).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name and not _is_overload(node):
                return module, node
        for node in ast.walk(self.tree(module)):
            if isinstance(node, ast.ImportFrom) and node.module in self.texts:
                for alias in node.names:
                    if name == (alias.asname or alias.name):
                        return self.defined(node.module, alias.name)
        return None

    @cached_property
    def homes(self) -> dict[str, str]:
        """{public name: its module}."""
        for node in self.tree("ncgen").body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_HOMES" and isinstance(node.value, ast.Dict):
                return ast.literal_eval(node.value)
        lines = [line.split() for line in self.texts["ncgen.pyi"].splitlines() if line.startswith("from ")]
        return {words[5]: words[1] for words in lines}

    def functions(self) -> dict[str, str]:
        """{public function: its parameters}."""
        found = {name: self.defined(module, name) for name, module in self.homes.items()}
        return {name: parameters(each[1]) for name, each in sorted(found.items()) if each and isinstance(each[1], ast.FunctionDef)}

    def methods(self, path: str) -> dict[str, str]:
        """{public method of a class: its parameters}, those that it inherits among them; "" stands for a property."""
        module, _, name = path.rpartition(".")
        return dict(sorted(self._methods(f"ncgen.{module}", name).items()))

    def _methods(self, module: str, name: str) -> dict[str, str]:
        known = self.defined(module, name)
        if known is None or not isinstance(known[1], ast.ClassDef):
            return {}
        methods: dict[str, str] = {}
        for base in reversed(known[1].bases):
            methods |= self._methods(known[0], ast.unparse(base))
        for node in known[1].body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not _is_overload(node):
                methods[node.name] = "" if _is_property(node) else parameters(node)
        return methods


def now() -> Sources:
    """The sources as they are."""
    files = [*(ROOT / "ncgen").rglob("*.py"), ROOT / "ncgen" / "__init__.pyi"]
    return Sources({_module(path.relative_to(ROOT).as_posix()): path.read_text(encoding="utf-8") for path in files})


def before() -> Sources:
    """The sources as they were."""
    packed = subprocess.run(["git", "archive", BEFORE, "ncgen"], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        members = [member for member in archive.getmembers() if member.name.endswith((".py", ".pyi"))]
        contents = {member.name: archive.extractfile(member) for member in members}
        return Sources({_module(name): file.read().decode() for name, file in contents.items() if file})


def parameters(node: ast.stmt) -> str:
    """The parameters of a function as they are written, without self and annotations but for the group that `**` stands for."""
    arguments = deepcopy(node.args)  # type: ignore[attr-defined]
    for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, *filter(None, [arguments.vararg])):
        each.annotation = None
    if arguments.kwarg and arguments.kwarg.annotation:
        kind = arguments.kwarg.annotation
        arguments.kwarg.arg = ast.unparse(kind.slice if isinstance(kind, ast.Subscript) else kind)
        arguments.kwarg.annotation = None
    words = ast.unparse(arguments)
    return f"({words.removeprefix('self').removeprefix('cls').removeprefix(', ')})"


def _module(path: str) -> str:
    name = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    return "ncgen.pyi" if path == "ncgen/__init__.pyi" else name


def _is_overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    return any(ast.unparse(each).endswith("overload") for each in node.decorator_list)


def _is_property(node: ast.FunctionDef) -> bool:
    return any(ast.unparse(each).rpartition(".")[2] in ("property", "cached_property", "setter") for each in node.decorator_list)


def table(old: dict[str, str], new: dict[str, str]) -> str:
    """A row for every public function whose parameters have changed."""
    rows = ["| function | before | now |", "|---|---|---|"]
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            cells = (f"`{each[name]}`" if name in each else "" for each in (old, new))
            rows.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def report(old: Sources, new: Sources) -> Iterator[str]:
    """Lines of all functions and methods: one where nothing has changed, else three."""
    yield f"Public functions and methods before ({BEFORE[:8]}) and now; python docs/signatures.py"
    yield from ("", "# ncgen")
    yield from _compared(old.functions(), new.functions())
    for path in CLASSES:
        yield from ("", f"# {path.rpartition('.')[2]}")
        yield from _compared(old.methods(path), new.methods(path))


def _compared(old: dict[str, str], new: dict[str, str]) -> Iterator[str]:
    for name in sorted({*old, *new}):
        if old.get(name) == new.get(name):
            yield f"{name}{new[name]}"
        else:
            yield from (name, f"    before: {_shown(old, name)}", f"    now:    {_shown(new, name)}")


def _shown(each: dict[str, str], name: str) -> str:
    return "-" if name not in each else each[name] or "a property"


if __name__ == "__main__":
    past, present = before(), now()
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(START)
    changed = table(past.functions(), present.functions())
    PAGE.write_text(f"{head}{START}\n{changed}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    lines = list(report(past, present))
    REPORT.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {changed.count(chr(10)) - 2} functions; {REPORT.relative_to(ROOT)}: {len(lines)} lines")
