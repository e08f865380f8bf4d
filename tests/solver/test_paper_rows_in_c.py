"""Rows of the paper's sine-or-cosine rule in C, by every method: a rod that turns over and over, whose angle is told by its end as well."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.methods.table import FORMALISMS, INTEGRATORS, goes_with

QUICK = "lagrange", "coordinate-partitioning", "ali3p"
METHODS = [
    pytest.param(formalism.name, integrator.name, marks=() if formalism.name in QUICK or integrator.name == "dop853" else pytest.mark.slow)
    for formalism in FORMALISMS.values()
    for integrator in INTEGRATORS.values()
    if goes_with(formalism, integrator) and integrator.in_c
]


def rod(form, backend="c"):
    m = ncgen.Model("rod", form=form)
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0), fixed="z")
    m.body("bob", [B], mass=2.0)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))
    m.angle("psi", m.vector("x", (1, 0, 0), fixed=True), B - A, m.vector("z", (0, 0, 1), fixed=True))
    return ncgen.compile(m, backend)


@pytest.fixture(scope="module")
def paper():
    return rod("paper")


@pytest.fixture(scope="module")
def smooth():
    return rod("smooth")


@pytest.mark.parametrize(("formalism", "integrator"), METHODS)
def test_every_method_turns_over(paper, smooth, formalism, integrator):
    """Neither cosine nor sine alone leads through a turn; which one holds makes no difference to the motion but for the length of steps."""
    options = dict(formalism=formalism, integrator=integrator, zd0={"psi": 9.0}, points=21)
    options |= {"max_step": 0.004} if INTEGRATORS[integrator].has_fixed_step else {"rtol": 1e-6 if integrator == "rk23" else 1e-8}
    if formalism == "penalty":
        options["options"] = {"alpha": 1e7, "omega": 100.0}
    run, known = (ncgen.simulate(kernels, 0.8, **options) for kernels in (paper, smooth))
    assert run.engine == "c" and run["psi"].max() > 2 * np.pi
    rounding = 1e-4 if formalism == "penalty" else 1e-9
    assert run["B.x"] == pytest.approx(np.cos(run["psi"]), abs=rounding)
    assert run["B.y"] == pytest.approx(np.sin(run["psi"]), abs=rounding)
    order = 1e-3 if formalism == "penalty" else 1e-4 if INTEGRATORS[integrator].has_fixed_step else 1e-5
    assert run["psi"] == pytest.approx(known["psi"], abs=order)


def test_kernels_of_numpy_choose_as_well(smooth):
    run, known = (ncgen.simulate(k, 1.0, zd0={"psi": 9.0}, points=5, rtol=1e-10) for k in (rod("paper", "numpy"), smooth))
    assert run.engine == "c"
    assert run["psi"] == pytest.approx(known["psi"], abs=1e-7)


@pytest.mark.parametrize("options", [{"engine": "emitted"}, {"number": "float"}], ids=str)
def test_what_chooses_nothing_is_refused(paper, options):
    with pytest.raises(ModelError, match="rod cannot be simulated in C.*: the paper's sine-or-cosine constraints change between steps"):
        ncgen.simulate(paper, 0.1, points=2, **options)
    with pytest.raises(ModelError, match="rod cannot be stepped: the paper's sine-or-cosine constraints"):
        ncgen.start(paper)


def test_what_the_rule_raises_arrives(paper, monkeypatch):
    from ncgen.solver.engines import compiled

    def fails(q, p):
        if q[2] > 1.0:
            raise LookupError("far")
        return p

    monkeypatch.setattr(compiled, "rule_of", lambda kernels: fails)
    with pytest.raises(LookupError, match="far"):
        ncgen.simulate(paper, 1.0, zd0={"psi": 9.0})


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning", "null-space", "augmented-lagrangian", "ali3p"])
def test_rows_of_nothing_that_moves(backend, formalism):
    """A distance between points that are both fixed has a row, whose Jacobian is empty: beside it a ball falls freely."""
    m = ncgen.Model("fall")
    ball = m.point("ball", (1, 0))
    m.distance(m.point("A", (0, 0), fixed=True), m.point("C", (0, 1), fixed=True))
    m.body("body", [ball], mass=1.0)
    m.gravity((0, -9.81))
    step = {"integrator": "trapezoidal", "max_step": 0.01} if formalism == "ali3p" else {}
    run = ncgen.simulate(ncgen.compile(m, backend), 0.5, formalism=formalism, points=3, **step)
    assert not run.engine.startswith("python")
    for each in ("rattle", "energy-momentum", "generalized-alpha") if formalism == "lagrange" else ():
        also = ncgen.simulate(run.kernels, 0.5, integrator=each, max_step=0.01, points=3)
        assert also["ball.y"] == pytest.approx(-9.81 / 2 * run.t**2, abs=1e-4)
    assert run["ball.y"] == pytest.approx(-9.81 / 2 * run.t**2, abs=1e-12)
