"""Docstrings of public names are in NumPy's style, and describe the parameters that there are."""

from __future__ import annotations

import pytest

import ncgen

validation = pytest.importorskip("numpydoc.validate", reason="numpydoc is not installed; run pip install '.[style]'")

WRONG = {
    "GL06", "GL07", "GL08", "SS01", "SS02", "SS03", "SS04", "SS05", "PR01", "PR02", "PR03", "PR04", "PR05", "PR07", "PR08",
    "PR09", "PR10", "RT01", "RT03", "RT04", "RT05",
}  # fmt: skip
"""Codes of https://numpydoc.readthedocs.io/en/latest/validation.html that are mistakes here: sections, summary, parameters, returns."""


WRITERS = ["Trajectory.to_npz", "Trajectory.to_csv", "Trajectory.to_parquet", "Trajectory.plot", "Trajectory.animate"]


def mistakes(path: str) -> list[str]:
    """What numpydoc finds in the docstring of a name."""
    return [f"{code}: {text}" for code, text in validation.validate(path)["errors"] if code in WRONG]


@pytest.mark.parametrize("name", ncgen.__all__)
def test_public_names(name):
    assert mistakes(f"ncgen.{name}") == []


@pytest.mark.parametrize("name", WRITERS)
def test_methods_that_write(name):
    assert mistakes(f"ncgen.solver.trajectories.trajectory.{name}") == []
