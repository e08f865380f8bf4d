"""The default: all coordinates, with accelerations and projections by a recursion that is written out, judged by the factored matrix."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load
from ncgen.mechanism.run_arguments import InitialState
from ncgen.methods.table import FORMALISMS, number_in_c
from ncgen.solver.engines.acceleration_forms import all_coordinates


def crank_rocker() -> ncgen.Model:
    """A crank that turns and a rocker that swings, whose angle is a coordinate."""
    m = ncgen.Model("crankrocker")
    A, D = (m.point(name, (x, 0.0), fixed=True) for name, x in (("A", 0.0), ("D", 0.4)))
    B, C = m.point("B", (0.1, 0.0)), m.point("C", (0.35, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    for name, pair, mass in (("crank", (A, B), 0.2), ("coupler", (B, C), 0.8), ("rocker", (C, D), 0.6)):
        m.body(name, pair, mass=mass, inertia=2e-3)
    m.angle("phi", start=x, end=C - D, axis=z)
    m.gravity((0, -9.81, 0))
    return m


def apart(run, other) -> float:
    """The largest difference of positions in natural sizes."""
    return float(np.max(np.abs(run.q - other.q) / run.kernels.column_sizes))


@pytest.mark.parametrize("name", ["robot", "arm", "suspension", "slidercrank3d", "stewart", "excavator", "heavytop", "bricard"])
def test_the_default_is_written_out(name):
    """With a tree of bodies and a compiler; the same motion as by the matrix."""
    kernels = ncgen.compile(load(name), "c")
    run = ncgen.simulate(kernels, 0.3, points=5)
    matrix = ncgen.simulate(kernels, 0.3, points=5, engine="c", formalism="lagrange", integrator="dop853", rtol=1e-11, atol=1e-13)
    assert (run.formalism, run.engine, matrix.engine) == ("lagrange", "emitted", "c")
    assert apart(run, matrix) < 100 * 1e-8
    assert np.max(run.violation()) < 1e-12


def test_a_crank_that_turns():
    """The rocker's angle, which stands still twice a turn, is not what is kept of a motion: nothing falls back, and errors are small."""
    kernels = ncgen.compile(crank_rocker(), "c")
    push = {"qd0": {"B.y": 1.2}}
    known = ncgen.simulate(kernels, 2.0, engine="c", rtol=1e-12, **push)
    assert np.ptp(known["B.x"]) > 0.19  # it turns
    for rtol in (1e-8, 1e-10):
        run = ncgen.simulate(kernels, 2.0, rtol=rtol, **push)
        assert run.engine == "emitted" and run.statistics.fallbacks == 0
        assert apart(run, known) < 10 * rtol


def test_steps_link_by_link_factor_no_matrix():
    """Neither for accelerations nor on their way back onto the constraints, unless a trial step leaves them by much: few of many do."""
    kernels = ncgen.compile(crank_rocker(), "c")
    start = ncgen.start(kernels, qd0={"B.y": 1.2})
    given = dict(formalism=number_in_c(FORMALISMS["lagrange"]), project=1, tolerance=1e-9, rtol=1e-8, atol=1e-10)
    done = all_coordinates(kernels, form="emitted").simulate("dop853", [0.0, 1.0], InitialState(start.q, start.qd, kernels.p0), **given)
    assert done.status == "ok" and done.steps > 50
    assert done.factorisations < done.steps / 10 and done.fallbacks == 0
    assert np.max(np.abs(kernels.phi(done.q[-1]) / kernels.row_sizes)) < 1e-13


def test_beside_a_singular_position_the_matrix_is_factored():
    """N-four-bars pass their flat position, where no order of elimination serves; before and behind it the recursion does."""
    kernels = ncgen.compile(load("nfourbar"), "c")
    push = {"qd0": {name: 1.0 for name in kernels.coordinates if name.endswith(".x")}}
    known = ncgen.simulate(kernels, 8.0, engine="c", formalism="lagrange", integrator="dop853", rtol=1e-11, atol=1e-13, **push)
    for rtol in (1e-6, 1e-8):
        run = ncgen.simulate(kernels, 8.0, rtol=rtol, **push)
        assert 0.02 < run.statistics.fallbacks / run.statistics.evaluations < 0.5
        assert apart(run, known) < 300 * rtol


def test_points_and_bars_have_no_tree():
    run = ncgen.simulate(ncgen.compile(load("chain"), "c"), 0.01)
    assert (run.formalism, run.engine) == ("lagrange", "c")


def test_work_and_drivers():
    """A driven crank: the work of its motor is the energy that the mechanism gains."""
    model = crank_rocker()
    x, z = (model.elements[name] for name in "xz")
    psi = model.angle("psi", start=x, end=model.elements["B"] - model.elements["A"], axis=z)
    model.drive(psi, 3 * model.time + 2 * model.time**2)
    kernels = ncgen.compile(model, "c")
    run = ncgen.simulate(kernels, 1.0, rtol=1e-10)
    assert run.engine == "emitted"
    energy = run.energy()[:, :2].sum(axis=1)
    assert run.work[-1] - run.work[0] == pytest.approx(energy[-1] - energy[0], rel=1e-7)
    assert run["psi"][-1] - run["psi"][0] == pytest.approx(5.0, abs=1e-9)


def test_it_is_compiled_once_for_all_starts_and_parameters():
    kernels = ncgen.compile(load("robot"), "c")
    ncgen.simulate(kernels, 0.01)
    known = dict(kernels._known["constrained dynamics"])
    for rate in (1.0, -2.0):
        ncgen.simulate(kernels, 0.01, qd0={kernels.coordinates[0]: rate})
    assert kernels._known["constrained dynamics"] == known


@pytest.mark.parametrize("engine", ["auto", "emitted"])
def test_angles_at_irregular_places(engine):
    """Their sines and cosines are taken together, by a table where their places among the coordinates follow no rule."""
    m = ncgen.Model("irregular")
    points = [m.point("A", (0, 0), fixed=True)]
    before, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    for i, name in enumerate("BCD"):
        points.append(m.point(name, (i + 1.0, 0.1 * i)))
        body = m.body(f"link{i}", points[i : i + 2], mass=1.0, inertia=0.1)
        if i == 1:
            m.attach_point(body, "P", (1.5, 0.5))
        before = m.angle(f"psi{i}", before, points[i + 1] - points[i], z) and points[i + 1] - points[i]
    m.independent(*(m.elements[f"psi{i}"] for i in range(3)))
    m.gravity((0, -9.81, 0))
    kernels = ncgen.compile(m, "c")
    places = [kernels.index[f"psi{i}"] for i in range(3)]
    assert np.ptp(np.diff(places)) > 0
    run = ncgen.simulate(kernels, 0.3, engine=engine, points=3)
    matrix = ncgen.simulate(kernels, 0.3, engine="c", rtol=1e-10, points=3)
    assert run.engine == "emitted" and apart(run, matrix) < 1e-6


def test_what_cannot_be_seen_with_other_parameters_is_not_written_out():
    """Of three parallel cranks one has a parameter for its length; with another one nothing closes, so nobody knows what depends on it."""
    m = ncgen.Model("parallel")
    length = m.parameter("length", 1.0, "m")
    ends = []
    for i in range(3):
        A, B = m.point(f"A{i}", (float(i), 0.0), fixed=True), m.point(f"B{i}", (float(i), length if i == 2 else 1.0))
        m.body(f"crank{i}", [A, B], mass=1.0, inertia=0.1)
        ends.append(B)
    m.body("coupler", ends[:2], mass=1.0, inertia=0.1)
    m.body("second", ends[1:], mass=1.0, inertia=0.1)
    m.distance(ends[0], ends[2])
    m.gravity((0, -9.81, 0))
    kernels = ncgen.compile(m, "c")
    assert ncgen.simulate(kernels, 0.01, qd0={"B0.x": 0.1}).engine == "c"
