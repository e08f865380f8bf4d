"""Integrators that only SciPy has take accelerations and projections of C: against the reference in Python, and a closed form."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import DomainError
from ncgen.solver.engines import motion_in_c

NAMES = ("adams", "bdf", "lsoda")


@pytest.fixture
def asked(monkeypatch):
    """How often C was asked."""
    calls, asks = [], motion_in_c.MotionInC._asks

    def counted(*given, **named):
        calls.append(asks(*given, **named))
        return calls[-1]

    monkeypatch.setattr(motion_in_c.MotionInC, "_asks", counted)
    return calls


@pytest.fixture(scope="module")
def fourbar():
    return ncgen.compile(ncgen.load("fourbar"), "c")


@pytest.mark.parametrize("integrator", NAMES)
def test_scipy_runs_on_c(fourbar, asked, integrator):
    run = ncgen.simulate(fourbar, 0.3, integrator=integrator, rtol=1e-8, points=7)
    assert len(asked) > run.statistics.evaluations > 0 and all(asked)
    python = ncgen.simulate(fourbar, 0.3, integrator=integrator, rtol=1e-8, points=7, engine="python")
    reference = ncgen.simulate(fourbar, 0.3, rtol=1e-11, points=7)
    error, usual = (np.max(np.abs(found.q - reference.q)) for found in (run, python))
    assert error < 3 * usual + 1e-7 and run.violation().max() < 1e-11


FORMALISMS = {"lagrange": "baumgarte", "augmented-lagrangian": "projection", "null-space": "none", "udwadia-phohomsiri": "projection",
              "penalty": "baumgarte"}  # fmt: skip
"""And how each is held on the constraints here."""


@pytest.mark.parametrize("formalism", FORMALISMS)
def test_every_formalism_over_all_coordinates(fourbar, asked, formalism):
    """Its accelerations are those of Python to rounding, so the integrator takes the same steps."""
    options = dict(formalism=formalism, integrator="adams", rtol=1e-7, points=5, options={"stabilisation": FORMALISMS[formalism]})
    run, python = (ncgen.simulate(fourbar, 0.1, zd0={"psi": 9.0}, engine=engine, **options) for engine in ("auto", "python"))
    assert asked and all(asked) and run.engine.startswith("python")
    assert run.statistics.steps == pytest.approx(python.statistics.steps, abs=3)
    assert run.statistics.projections == pytest.approx(python.statistics.projections, abs=3)
    assert run.statistics.largest_projection == pytest.approx(python.statistics.largest_projection, rel=0.01)
    assert (run.statistics.projections > run.statistics.steps) == (FORMALISMS[formalism] == "projection")
    assert run.q == pytest.approx(python.q, abs=1e-6 if formalism == "penalty" else 1e-7)


def test_the_reference_asks_nothing_of_c(fourbar, asked):
    ncgen.simulate(fourbar, 0.01, integrator="adams", points=2, engine="python")
    assert not asked


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_callbacks_and_inputs_are_in_it(asked, backend):
    """m a = -c v + u along a line: v = (1 - exp(-c t / m)) u / c."""
    m = ncgen.Model("slider")
    S = m.point("S", (0.5, 0))
    m.body("block", [S], mass=2.0)
    m.constrain(S.y)
    push = m.input("push")
    m.force(S, (push, 0))
    m.callback(lambda t, q, qd, kernels: -3.0 * qd)
    run = ncgen.simulate(ncgen.compile(m, backend), 1.0, integrator="adams", rtol=1e-9, inputs={"push": lambda t: 6.0}, points=3)
    assert all(asked) and asked
    assert run.qd[:, 0] == pytest.approx(2 * (1 - np.exp(-1.5 * run.t)), abs=1e-7)
    with pytest.raises(LookupError, match="far"):
        m.callback(_fails)
        ncgen.simulate(ncgen.compile(m, backend), 1.0, integrator="adams", inputs={"push": 6.0})


def _fails(t, q, qd, kernels):
    if q[0] > 0.7:
        raise LookupError("far")
    return 0 * q


def test_nan_is_reported_by_name():
    import sympy

    m = ncgen.Model("pendulum")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81))
    m.force(B, (0, sympy.sqrt(B.y + 0.3)), label="lift")
    with pytest.raises(DomainError, match=r"lift.* is not a number at t = 0\.\d+ s \(.*B\.y = -0\.3"):
        ncgen.simulate(ncgen.compile(m, "c"), 1.5, integrator="adams")
