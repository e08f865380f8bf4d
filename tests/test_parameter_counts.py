"""Functions take at most seven parameters; the two groups that are documented once, the start and the method, count as one each."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from ncgen.solver.groups import MethodArguments, StartArguments

PACKAGE = Path(__file__).resolve().parents[1] / "ncgen"

MAX_PARAMETERS = 7

GROUPS = tuple(frozenset(group.__annotations__) for group in (StartArguments, MethodArguments))

AS_OTHERS_SAY = {
    "cli/measuring.py: bench", "cli/models.py: run", "cli/studies.py: study",
    "model/catalogue.py: _angle_cosine", "model/catalogue.py: _angle_paper", "model/catalogue.py: _angle_sine.formula",
    "model/catalogue.py: _angle_smooth", "model/catalogue.py: _angle_smooth_perpendicular", "model/forces.py: on_directions",
    "solver/integrators/caught.py: ForeignSolver.__init__",
}  # fmt: skip
"""Functions whose parameters are somebody else's: an option of the command line each, an argument of a formula each, or SciPy's."""

VOCABULARY = {
    "exchange/robots/__init__.py: load_robot", "model/contacts.py: Contacts.contact", "model/contacts.py: Contacts.gap_contact",
    "model/frictions.py: Frictions.friction", "model/one_sided.py: OneSided.backlash", "model/one_sided.py: OneSided.stop",
    "model/structure.py: Structure.body", "model/tables.py: from_tables", "studies/definition.py: Study.of",
}  # fmt: skip
"""Public functions whose parameters are the words of model files, of the paper's tables, and of studies."""


def count_of(arguments: ast.arguments) -> int:
    """How many parameters a function has, its object aside; those of a group are one."""
    names = {each.arg for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)} - {"self", "cls"}
    return len(names.difference(*GROUPS)) + sum(not names.isdisjoint(group) for group in GROUPS)


def crowded(source: str) -> Iterator[str]:
    """Names of functions with too many parameters, after those of their classes."""

    def within(node: ast.AST, prefix: str) -> Iterator[str]:
        for child in ast.iter_child_nodes(node):
            name = f"{prefix}{child.name}" if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) else prefix
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)) and count_of(child.args) > MAX_PARAMETERS:
                yield name
            yield from within(child, f"{name}." if name != prefix else prefix)

    return within(ast.parse(source), "")


def test_functions_have_few_parameters():
    paths = sorted(PACKAGE.rglob("*.py"))
    found = {f"{path.relative_to(PACKAGE).as_posix()}: {name}" for path in paths for name in crowded(path.read_text(encoding="utf-8"))}
    assert found == AS_OTHERS_SAY | VOCABULARY


def test_the_count_knows_groups():
    source = "class A:\n def f(self, a, b, c, d, e, *, q0, zd0, rtol, atol): pass\n def g(self, a, b, c, d, e, f, g, *, h): pass"
    assert [*crowded(source)] == ["A.g"]
