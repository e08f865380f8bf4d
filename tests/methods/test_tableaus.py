"""The table of methods, and explicit methods that check themselves."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

from ncgen.emit.runtime_files import runtime_text
from ncgen.errors import ModelError
from ncgen.methods.explicit import Published
from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, INTEGRATORS, find_integrator, in_c, number_in_c, other_names, partners
from ncgen.methods.tableau import Tableau, WrongTableau, trees
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.integrators.fixed_step import FixedRungeKutta
from ncgen.solver.integrators.solvers import ode_solver

EXPLICIT = {name: entry.coefficients for name, entry in INTEGRATORS.items() if entry.tableau}


def test_trees_are_as_many_as_there_are():
    """Rooted trees of 1 to 8 nodes: 1, 1, 2, 4, 9, 20, 48, 115 (OEIS A000081)."""
    counts = [len(trees(order)) for order in range(1, 9)]
    assert np.diff([0, *counts]).tolist() == [1, 1, 2, 4, 9, 20, 48, 115]


def changed(tableau: Tableau, row: int, place: int, by: Fraction) -> dict:
    rows = [list(each) for each in tableau.a]
    rows[row][place] += by
    return {"a": tuple(map(tuple, rows))}


@pytest.mark.parametrize("name", EXPLICIT)
def test_a_wrong_coefficient_does_not_load(name):
    """Every coefficient that is there, changed in its tenth digit, is found; so is an order that is too high."""
    tableau = EXPLICIT[name]
    for i, row in enumerate(tableau.a):
        for j, value in enumerate(row):
            if value:
                with pytest.raises(WrongTableau):
                    replace(tableau, **changed(tableau, i, j, Fraction(1, 10**8)))
    with pytest.raises(WrongTableau):
        replace(tableau, order=tableau.order + 1)
    with pytest.raises(WrongTableau):
        replace(tableau, dense_order=tableau.dense_order + 1)
    for order, estimate in tableau.errors:
        with pytest.raises(WrongTableau):
            replace(tableau, errors=((order + 1, estimate),))


@pytest.mark.parametrize("name", ["rk23", "dopri5", "dop853"])
def test_coefficients_are_scipys(name):
    """An independent copy of the published numbers."""
    ours, theirs = EXPLICIT[name], getattr(scipy.integrate, {"rk23": "RK23", "dopri5": "RK45", "dop853": "DOP853"}[name])
    stages = ours.stages
    assert [float(x) for x in ours.weights[:stages]] == pytest.approx(theirs.B.tolist(), rel=1e-15)
    for s, row in enumerate(ours.a[: stages - 1], 1):
        assert [float(x) for x in row] == pytest.approx(theirs.A[s, :s].tolist(), rel=1e-15)
    assert [float(x) for x in ours.c[:stages]] == pytest.approx(theirs.C[:stages].tolist(), rel=1e-15)


def test_stability_intervals_are_the_published_ones():
    """On the negative real axis: 2.785 for the classical method, 2.51 and 3.31 for the pairs of order 3 and 5."""
    assert [round(EXPLICIT[name].stability, 1) for name in ("rk4", "rk23", "dopri5")] == [2.8, 2.5, 3.3]


def test_stages_that_follow_from_the_one_before():
    """Kutta's rule in the form that exports print; those of Dormand and Prince follow from several."""
    third, sixth = Fraction(1, 3), Fraction(1, 6)
    assert EXPLICIT["rk4"].successive == ((0, sixth), (Fraction(1, 2), third), (Fraction(1, 2), third), (1, sixth))
    with pytest.raises(WrongTableau, match="^a stage follows from more than the one before it$"):
        _ = EXPLICIT["dopri5"].successive


def test_a_new_method_of_the_table_runs_in_python():
    """Fixed steps are driven from a tableau: Heun's method of order 2 with an estimate of order 1."""
    heun = Tableau(
        stages=2, order=2, c=(Fraction(0), Fraction(1), Fraction(1)), a=((Fraction(1),), (Fraction(1, 2), Fraction(1, 2))), dense_order=2
    )
    fixed = type("heun", (FixedRungeKutta,), {"tableau": heun})
    ends = []
    for step in (0.02, 0.01):
        solver = fixed(lambda t, y: -y, 0.0, np.array([1.0]), 1.0, max_step=step)
        while solver.status == "running":
            solver.step()
        ends.append(abs(solver.y[0] - np.exp(-1.0)))
    assert 1.9 < np.log2(ends[0] / ends[1]) < 2.1


def test_c_has_the_numbers_of_the_table():
    """The header is printed from it."""
    header = runtime_text("ncgen_methods.h")
    for table in (INTEGRATORS, FORMALISMS):
        for name in in_c(table):
            assert f"{table[name].constant} = {number_in_c(table[name])}" in header


def test_every_entry_has_what_it_names():
    """Ordinary integrators have a step-by-step solver, others are in C, formalisms over all coordinates have a function."""
    for entry in INTEGRATORS.values():
        assert ode_solver(entry) if entry.in_python else entry.in_c
    assert all(callable(accelerations_by(entry.name).solve) for entry in FORMALISMS.values() if entry.is_constrained)


def test_other_names():
    assert {other: find_integrator(other.upper()).name for other in other_names()} == other_names()


def test_partners_are_mutual():
    for formalism in FORMALISMS.values():
        for entry in INTEGRATORS.values():
            assert (entry.name in partners(formalism)) == (formalism.name in partners(entry))
            if entry.name not in partners(formalism):
                with pytest.raises(ModelError, match=f"{entry.name} does not go with {formalism.name}"):
                    Method.of(formalism.name, entry.name)


def test_the_method_that_the_page_adds():
    """An entry as docs/contributing.md writes it: a step h of y' = -y ends at 1 - h + h²/2."""
    page = (Path(__file__).parents[2] / "docs" / "contributing.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```python\n(    \"heun\": Published\(.*?)```", page, re.DOTALL)
    (heun,) = map(Tableau.of, eval("{" + text + "}", {"Published": Published}).values())
    slopes, h = [], Fraction(1, 8)
    for row in ((), *heun.a):
        slopes.append(-(1 + h * sum(weight * slope for weight, slope in zip(row, slopes, strict=True))))
    assert -slopes[-1] == 1 - h + h**2 / 2
