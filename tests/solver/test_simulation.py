"""A motion step by step, against the same motion in one run."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven_models import pendulum
from scipy.special import ellipk

import ncgen
from ncgen import ConvergenceError, DomainError, ModelError


@pytest.fixture(scope="module")
def rod():
    return ncgen.compile(pendulum())


def test_held_inputs_are_a_table_with_hold_zero(rod):
    times = np.arange(200) * 5e-3
    taus = 3 * np.sin(7 * times)
    sim = ncgen.start(rod)
    for tau in taus:
        sim.step(5e-3, tau=tau)
    run = ncgen.simulate(rod, 1.0, inputs={"tau": (times, taus, "zero")}, rtol=1e-11)
    assert sim.t == pytest.approx(1.0, abs=1e-12)
    assert np.allclose(sim.q, run.q[-1], rtol=0, atol=1e-9)
    assert np.allclose(sim.qd, run.qd[-1], rtol=0, atol=1e-8)
    assert sim.work == pytest.approx(run.work[-1], abs=1e-9)


@pytest.mark.parametrize("name", ["robot", "disc", "bricard", "pendulum", "suspension"])
def test_examples(name):
    """Loops, rolling, redundant rows, no bodies, drivers: each as in one run."""
    kernels = ncgen.compile(ncgen.load(name))
    asked = {key: value for key, value in kernels.model.simulation_options.items() if key in ("zd0", "qd0", "z", "closing")}
    sim = ncgen.start(kernels, rtol=1e-10, **asked)
    for _ in range(50):
        sim.step(4e-3)
    run = ncgen.simulate(kernels, 0.2, rtol=1e-10, points=2, **asked)
    size = np.max(np.abs(run.q[-1]))
    assert np.allclose(sim.q, run.q[-1], rtol=0, atol=2e-7 * size)
    now = run.qdd[-1]
    assert np.allclose(sim.qdd, now, rtol=0, atol=1e-5 * (1 + np.max(np.abs(now))))


def test_back_to_a_state(rod):
    sim = ncgen.start(rod, zd0={"psi": 1.0})
    sim.step(0.1, tau=2.0)
    kept = sim.state
    first = sim.step(0.05).step(0.05, tau=-1.0).state
    again = sim.reset(kept).step(0.05).step(0.05, tau=-1.0).state
    assert np.array_equal(first.q, again.q)
    assert np.array_equal(first.qd, again.qd)
    assert first.work == again.work
    assert kept.t == pytest.approx(0.1)


def test_looking_at_accelerations_changes_nothing(rod):
    """They are found with velocities brought onto the constraints, which moves these by rounding."""
    sim = ncgen.start(rod, zd0={"psi": 1.0})
    for _ in range(50):
        before = sim.step(5e-3, tau=0.7).state
        assert np.all(np.isfinite(sim.qdd))
        assert np.array_equal(before.qd, sim.qd)


def test_a_fixed_step_costs_the_same_always(rod):
    sim = ncgen.start(rod, integrator="rk4")
    assert {sim.step(1e-3, tau=math.sin(k)).evaluations for k in range(100)} == {5}


def test_rk4_is_of_order_4(rod):
    """From a reference of the default at rtol 1e-12, halving the step divides the error by 16."""
    reference = ncgen.simulate(rod, 0.4, inputs={"tau": 2.0}, rtol=1e-12, points=2)["psi"][-1]
    errors = []
    for steps in (20, 40):
        sim = ncgen.start(rod, integrator="rk4", inputs={"tau": 2.0})
        for _ in range(steps):
            sim.step(0.4 / steps)
        errors.append(abs(sim["psi"] - reference))
    assert 12 < errors[0] / errors[1] < 20


def test_names(rod):
    sim = ncgen.start(rod, zd0={"psi": 1.5}, inputs={"tau": 0.25})
    assert sim["rate(psi)"] == pytest.approx(1.5)
    assert sim["tau"] == 0.25
    assert sim["A.x"] == pytest.approx(0.7)
    with pytest.raises(ModelError, match="driven has no coordinate, rate, input or output 'nobody'"):
        sim["nobody"]


def test_what_is_refused(rod):
    sim = ncgen.start(rod)
    kept = sim.state
    for act, kind, said in (
        (lambda: sim.step(0.0), ModelError, "h is 0.0; it must be positive"),
        (lambda: sim.step("1e-3"), ModelError, "h is '1e-3'; it must be a finite number"),
        (lambda: sim.step(1e-3, tau="1"), ModelError, "step: tau is '1'; it must be a finite number"),
        (lambda: sim.reset(3), ModelError, "reset: 3 given; give a state that was kept, such as kept = sim.state"),
        (lambda: sim.step(math.nan), ModelError, "h is nan; it must be a finite number"),
        (lambda: sim.step(1e-3, nobody=1.0), ModelError, "step: the mechanism has no input nobody; it has tau"),
        (lambda: sim.step(1e-3, tau=math.inf), ModelError, "step: tau is inf; it must be a finite number"),
        (lambda: sim.step(1e-3, tau="much"), ModelError, "step: tau is 'much'; it must be a finite number"),
        (
            lambda: ncgen.start(rod, q=sim.q),
            ModelError,
            "start: there is no argument 'q'; did you mean q0?",
        ),
    ):
        with pytest.raises(kind) as refused:
            act()
        assert said in str(refused.value)
    assert sim.t == kept.t
    assert np.array_equal(sim.q, kept.q)


def test_a_term_that_ends_is_named():
    m = pendulum()
    m.force(m.elements["A"], (0, -((1 - m.time) ** 0.5), 0), label="fading")
    sim = ncgen.start(ncgen.compile(m))
    with pytest.raises((DomainError, ConvergenceError), match="fading"):
        for _ in range(30):
            sim.step(0.05)
    assert sim.t == pytest.approx(0.95)


def test_settle_closes_loops(rod):
    sim = ncgen.start(rod)
    sim.q[rod.index["A.y"]] += 0.05
    sim.project_state()
    assert np.max(np.abs(rod.phi(sim.q))) < 1e-12


def test_who_cannot_be_stepped():
    m = pendulum()
    m.callback(lambda t, q, qd, kernels: np.zeros(kernels.n))
    with pytest.raises(ModelError, match="driven cannot be stepped: the model calls a Python function; use ncgen.simulate"):
        ncgen.start(ncgen.compile(m))
    with pytest.raises(ModelError, match="the kernels are numpy, not compiled"):
        ncgen.start(ncgen.compile(pendulum(), backend="numpy"))
    with pytest.raises(ModelError, match="integrator radau cannot be stepped from outside"):
        ncgen.start(ncgen.compile(pendulum()), integrator="radau")


def test_independent_coordinates_are_those_of_the_end():
    """A pendulum of all coordinates falls from where B.y tells how it moves to where B.x does."""
    model = ncgen.Model("pendulum")
    bob = model.point("B", (1, 0))
    model.body("bob", points=[bob], mass=1.0)
    model.distance(model.point("O", (0, 0), fixed=True), bob)
    model.gravity((0, -9.81, 0))
    kernels = ncgen.compile(model, backend="numpy")
    quarter = float(ellipk(0.5) / np.sqrt(9.81))
    ends = [ncgen.simulate(kernels, share * quarter, formalism="lagrange", points=3).independent for share in (0.1, 1.0, 1.9)]
    assert ends == [("B.y",), ("B.x",), ("B.y",)]
