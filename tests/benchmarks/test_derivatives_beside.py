"""`bench.py MODEL --derivatives` and `--tables`: other people's derivatives are right, and so are those of the state derivative."""

from importlib import import_module

import numpy as np
import pytest

import ncgen
from benchmarks import paper_tables
from benchmarks.derivatives import WiderComparison, state_records
from benchmarks.rivals.casadi_tangents import with_tangents
from benchmarks.state_jacobian import StateJacobian
from ncgen.comparisons.rivals import Inputs, by_differences, relative_error, scale
from ncgen.report import clock


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the times are not looked at."""
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))


@pytest.mark.parametrize("module", ["casadi", "jax", "symforce"])
def test_automatic_differentiation(module, robot):
    """Other tools' derivatives of the same rows, where they are installed, are right to rounding."""
    pytest.importorskip(module)
    inputs = Inputs.typical(robot)
    (rival,) = import_module(f"benchmarks.rivals.{module}").rivals(robot, inputs, ("phi", "phi_q", "gamma"))
    for kernel in ("phi_q", "gamma"):
        ulps = np.abs(rival.values(kernel) - by_differences(robot, kernel, inputs)) / scale(robot, kernel, inputs) / rival.epsilon
        assert np.max(ulps) < 8


@pytest.mark.parametrize("name", ["robot", "andrews"])
def test_tangents_of_casadi(name):
    """∂ẏ/∂y on CasADi's derivatives is that of 50 digits."""
    pytest.importorskip("casadi")
    state = StateJacobian(ncgen.compile(ncgen.load(name), "c"))
    assert relative_error(state.by_tangents(with_tangents(state.kernels)), state.exact()) < 1e-13


def test_first_differences_see_rounding():
    """B0.x starts at zero: the first steps are 1.5e-8 atol, below what Newton's method corrects, and ∂ẏ/∂y is far off."""
    records = list(paper_tables.first_slopes(ncgen.load("nfourbar")))
    assert [r["atol"] for r in records] == [1e-6, 1e-8, 1e-10]
    assert all(r["error"] > 0.1 for r in records)


@pytest.mark.slow
def test_slopes_of_the_state_derivative(robot):
    """Generated tangents at rounding, in C and in Python; differences see what the position problem leaves."""
    records = {r["tool"]: r["error"] for r in state_records(robot)}
    assert records["generated tangents"] < 1e-12 and records["generated tangents, in C"] < 1e-12
    assert records["finite differences, 2 points"] > 1e-9


@pytest.mark.slow
def test_the_wider_comparison():
    """What `ncgen compare` has, sympy next to it, and ∂ẏ/∂y as one more table and plot of the report."""
    comparison = WiderComparison(ncgen.load("fourbar"), [])
    names = [section.name for section in comparison.sections()]
    assert names == ["phi_q", "gamma", "mass", "all", "state"]
    assert {"generated C, auto", "sympy.lambdify(cse=True)"} <= {r["tool"] for r in comparison.records if r["section"] == "phi_q"}
    assert comparison.html().count("<svg") == 5


def test_implicit_integrators_agree_with_either_jacobian():
    """BDF, Radau and LSODA reach the end of the N-four-bar's run with numerical and with generated derivatives."""
    records = list(paper_tables.table_10(ncgen.load("nfourbar")))
    assert {r["source"] for r in records} >= {"generated C, numerical", "generated C, generated"}
    assert all(r["error"] < 1e-4 for r in records)


def test_the_models_own_run_begins_as_the_model_says():
    """A rod without weight turns at 2 rad/s from where the model's simulation lets it begin."""
    m = ncgen.Model("turning")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    m.simulation(duration=0.5, qd0={"B.x": 0.0, "B.y": 2.0}, z=["B.y"])
    run = paper_tables._Partitioned(ncgen.compile(m, "c"))
    assert (run.names, list(run.y0)) == (["B.y"], pytest.approx([2.0, 0.0], abs=1e-12))
    assert run.derivative(0.0, run.y0) == pytest.approx([0.0, 2.0], abs=1e-12)
