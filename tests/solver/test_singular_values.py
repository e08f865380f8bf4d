"""Singular values where NumPy's method fails: that of LAPACK did for Φ_q of the falling robot, whose condition is 112."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.model import singular_values as values_of
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.positions.rank import null_space

PACKAGE = Path(ncgen.__file__).parent


@pytest.fixture
def failing(monkeypatch):
    """NumPy's method as it fails."""

    def fail(*arguments, **options):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fail)
    monkeypatch.setattr(np.linalg, "lstsq", fail)


@pytest.mark.parametrize("shape", [(3, 5), (5, 3), (4, 4)])
def test_the_other_method_takes_over(failing, shape):
    matrix = np.random.default_rng(1).standard_normal(shape)
    left, values, right = values_of.svd(matrix)
    assert (left * values) @ right == pytest.approx(matrix, abs=1e-14)
    assert values_of.singular_values(matrix) == pytest.approx(
        np.sqrt(np.linalg.eigvalsh(matrix @ matrix.T)[::-1][: len(values)]), rel=1e-12
    )
    assert null_space(matrix).shape[1] == max(0, shape[1] - shape[0])


def test_numbers_that_are_not_finite_are_no_matter_of_the_method():
    for function in (values_of.svd, values_of.singular_values):
        with pytest.raises(np.linalg.LinAlgError):
            function(np.array([[1.0, np.nan], [0.0, 1.0]]))


def test_a_pseudoinverse_of_redundant_rows():
    """Penrose's four conditions."""
    a = np.random.default_rng(2).standard_normal((3, 5))
    a = np.vstack([a, a[0] - 2 * a[1]])
    b = values_of.pseudoinverse(a, 1e-9)
    for found, expected in ((a @ b @ a, a), (b @ a @ b, b), ((a @ b).T, a @ b), ((b @ a).T, b @ a)):
        assert found == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("shape", [(3, 5), (5, 3), (4, 4)])
def test_least_squares_and_ranks_by_the_other_method(failing, shape):
    """The shortest x of all whose rest is orthogonal to the columns: in the row space, by the normal equations."""
    generator = np.random.default_rng(3)
    matrix, right = generator.standard_normal(shape), generator.standard_normal((shape[0], 2))
    x = values_of.least_squares(matrix, right)
    assert matrix.T @ (matrix @ x - right) == pytest.approx(np.zeros((shape[1], 2)), abs=1e-12)
    if shape[0] < shape[1]:
        assert x == pytest.approx(matrix.T @ np.linalg.solve(matrix @ matrix.T, right), abs=1e-12)
    assert values_of.rank_above(np.array([matrix, 0 * matrix]), 1e-9).tolist() == [min(shape), 0]


def test_nothing_else_calls_the_method_that_may_fail():
    calls = [
        f"{path.relative_to(PACKAGE)}:{number}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"linalg\.(svd|lstsq|pinv|matrix_rank)\(", line) and path.name != "singular_values.py"
    ]
    assert calls == []


def test_accelerations_by_udwadia_and_phohomsiri(failing):
    """A pendulum at rest, 1 m long and horizontal, falls with g."""
    kernels = ncgen.compile(ncgen.load("pendulum"), "numpy")
    now = accelerations_by("udwadia-phohomsiri").motion(kernels, np.array([1.0, 0.0]), np.zeros(2), 0.0, kernels.p0, {})
    assert now.qdd == pytest.approx([0.0, -9.81], abs=1e-12)
