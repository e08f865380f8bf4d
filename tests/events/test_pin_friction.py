"""Friction of a pin, whose load is √(λ² + λ'²) of the two constraints that hold it: by closed forms and by an independent integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.errors import ConvergenceError, ModelError
from ncgen.exchange.toml_writer import to_toml

G, MASS, INERTIA, MU, RADIUS = 9.81, 2.0, 0.5, 0.3, 0.1


def pinned(arm: float, couple=0.0, mu=MU, inertia=INERTIA) -> ncgen.Model:
    """A body on a pin. arm: distance of its centre of mass from the pin (m); the angle is 0 where it hangs"""
    m = ncgen.Model("pin")
    down, z = m.vector("down", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    m.body("disc", [A, B], mass=MASS, com=(arm, 0), inertia=inertia)
    turn = m.angle("turn", down, B - A, z)
    m.gravity((G, 0))
    m.torque(turn, couple(m.time) if callable(couple) else couple)
    m.friction(turn, coefficient=mu * RADIUS, load=m.constrain(A.x, label="pin x"), across=m.constrain(A.y, label="pin y"))
    return m


def test_a_disc_on_its_pin():
    """The load is the weight: it slows by μ r m g/J and stops after ω J/(μ r m g)."""
    run = ncgen.simulate(ncgen.compile(pinned(0.0)), 4.0, rtol=1e-11, qd0={"turn": 3.0})
    slowing = MU * RADIUS * MASS * G / INERTIA
    (stops,) = run.events
    assert stops.transition == "sticks" and stops.t == pytest.approx(3.0 / slowing, rel=1e-11)
    assert run["turn"][-1] == pytest.approx(3.0**2 / 2 / slowing, rel=1e-10) and run.energy_drift < 1e-11


def test_it_slips_where_the_couple_exceeds_the_friction_of_its_weight():
    run = ncgen.simulate(ncgen.compile(pinned(0.0, couple=lambda t: t)), 1.0, rtol=1e-11)
    assert [each.transition for each in run.events] == ["sticks", "slips"]
    most = MU * RADIUS * MASS * G
    assert run.events[1].t == pytest.approx(most, rel=1e-11)
    assert run["rate(turn)"][-1] == pytest.approx((1.0 - most) ** 2 / 2 / INERTIA, rel=1e-10)


def reference(arm: float, mu: float, start: float, seconds: float) -> tuple[float, float]:
    """Angle and velocity of a pendulum with friction μ r |N|, N being the root of the equations of Newton and Euler by bisection."""
    about = INERTIA + MASS * arm**2

    def friction(angle: float, rate: float) -> float:
        radial = MASS * (arm * rate**2 + G * math.cos(angle))

        def excess(load: float) -> float:
            turning = (-MASS * G * arm * math.sin(angle) - np.sign(rate) * mu * RADIUS * load) / about
            return math.hypot(radial, MASS * (arm * turning + G * math.sin(angle))) - load

        low, high = 0.0, 1e4
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if excess(middle) > 0 else (low, middle)
        return mu * RADIUS * low

    def slope(t, y):
        return [y[1], (-MASS * G * arm * math.sin(y[0]) - np.sign(y[1]) * friction(*y)) / about]

    found = solve_ivp(slope, (0, seconds), [0.0, start], method="DOP853", rtol=1e-12, atol=1e-13)
    return float(found.y[0, -1]), float(found.y[1, -1])


@pytest.mark.parametrize("arm", [0.2, 0.6])
def test_a_pendulum_whose_load_depends_on_its_friction(arm):
    run = ncgen.simulate(ncgen.compile(pinned(arm)), 0.8, rtol=1e-11, qd0={"turn": 8.0})
    assert not run.events
    assert (run["turn"][-1], run["rate(turn)"][-1]) == pytest.approx(reference(arm, MU, 8.0, 0.8), rel=1e-9)
    assert run.energy_drift < 1e-9


def test_a_load_that_is_not_determined():
    """A friction of 1 N m makes a load of m a/(J + m a²) across: with μ r = 2 m and a = 0.5 m that is 2 · 1 N per N."""
    with pytest.raises(ConvergenceError, match="load of friction turn.friction with coefficient 2 is not determined"):
        ncgen.simulate(ncgen.compile(pinned(0.5, mu=20.0)), 0.1, qd0={"turn": 1.0})
    ncgen.simulate(ncgen.compile(pinned(0.5, mu=9.9)), 0.01, qd0={"turn": 30.0})


def test_files(tmp_path):
    path = tmp_path / "pin.toml"
    path.write_text(to_toml(pinned(0.2)))
    assert 'across = "pin y"' in path.read_text() and to_toml(ncgen.load(path)) == path.read_text()


def test_refusals():
    m = pinned(0.2)
    B = m.elements["B"]
    with pytest.raises(ModelError, match="friction turn.friction follows loads as well.*only such friction"):
        m.friction(B.x, coefficient=0.1, load="pin x")
    with pytest.raises(ModelError, match="same constraint pin x"):
        m.friction(B.x, coefficient=0.1, load="pin x", across="pin x", name="other")
    with pytest.raises(ModelError, match="coefficient and load belong together"):
        m.friction(B.x, coulomb=1.0, across="pin x", name="third")


def test_derivatives_are_refused_by_name():
    with pytest.raises(ModelError, match="friction turn.friction: friction with across has no derivatives yet"):
        ncgen.sensitivities(ncgen.compile(pinned(0.2)), 0.2, 10, by=["rate(B.y)"], qd0={"turn": 8.0})


def test_an_implicit_method():
    run = ncgen.simulate(ncgen.compile(pinned(0.2)), 0.5, integrator="radau", rtol=1e-9, qd0={"turn": 8.0}, points=2)
    assert run["turn"][-1] == pytest.approx(reference(0.2, MU, 8.0, 0.5)[0], rel=1e-8)
