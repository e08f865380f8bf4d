"""Docstrings of public names are in NumPy's style and describe the parameters that there are; all are in the terms of the field."""

from __future__ import annotations

import ast
import importlib
from functools import cached_property
from pathlib import Path
from types import FunctionType

import pytest
from terms import misused

import ncgen

validation = pytest.importorskip("numpydoc.validate", reason="numpydoc is not installed; run pip install '.[style]'")

WRONG = {
    "GL06", "GL07", "GL08", "SS01", "SS02", "SS03", "SS04", "SS05", "PR01", "PR02", "PR03", "PR04", "PR05", "PR07", "PR08",
    "PR09", "PR10", "RT01", "RT03", "RT04", "RT05",
}  # fmt: skip
"""Codes of https://numpydoc.readthedocs.io/en/latest/validation.html that are mistakes here: sections, summary, parameters, returns."""


CLASSES = (
    "model.model.Model", "mechanism.kernels.Kernels", "solver.trajectories.trajectory.Trajectory", "solver.joints.joint_space.JointsOfTree",
    "solver.joints.joint_loops.JointsInLoops", "solver.motions.simulation.Simulation", "solver.motions.simulations.Simulations",
    "studies.result.StudyResult", "solver.linear.linearise.Linearisation", "solver.loads.reactions.Reactions",
    "solver.motions.batch.BatchTrajectory", "solver.motions.batch.StateAccelerations", "solver.motions.batch.BatchAccelerations",
    "solver.positions.rank.Freedom", "solver.derivatives.gradients.BatchGradients",
)  # fmt: skip
"""The model, and classes of what public functions return."""


def mistakes(path: str) -> list[str]:
    """What numpydoc finds in the docstring of a name."""
    return [f"{code}: {text}" for code, text in validation.validate(path)["errors"] if code in WRONG]


@pytest.mark.parametrize("name", ncgen.__all__)
def test_public_names(name):
    assert mistakes(f"ncgen.{name}") == []


def methods_of(name: str) -> list[str]:
    """Public methods and properties of a class, those that it inherits from others of the package among them."""
    module, _, word = name.rpartition(".")
    kind = getattr(importlib.import_module(f"ncgen.{module}"), word)
    own = {member: value for base in kind.__mro__[::-1] if base.__module__.startswith("ncgen") for member, value in vars(base).items()}
    return [
        m for m, value in own.items() if not m.startswith("_") and isinstance(value, (FunctionType, property, cached_property, classmethod))
    ]


@pytest.mark.parametrize("name", CLASSES)
def test_methods_and_properties(name):
    wrong = {method: mistakes(f"ncgen.{name}.{method}") for method in methods_of(name)}
    assert {method: found for method, found in wrong.items() if found} == {}


PACKAGE = Path(ncgen.__file__).parent


def docstrings(path: Path) -> list[str]:
    """All docstrings of a module."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [ast.get_docstring(node) or "" for node in nodes if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))]


@pytest.mark.parametrize("part", sorted({path.relative_to(PACKAGE).parts[0] for path in PACKAGE.rglob("*.py")}))
def test_docstrings_have_the_terms_of_the_field(part):
    paths = [PACKAGE / part] if part.endswith(".py") else sorted((PACKAGE / part).rglob("*.py"))
    wrong = {str(path.relative_to(PACKAGE)): [word for text in docstrings(path) for word in misused(text)] for path in paths}
    assert {path: words for path, words in wrong.items() if words} == {}
