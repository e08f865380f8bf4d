"""Scenes with closed forms that break solvers of events, at coarse and fine tolerances: right, and without a warning."""

from __future__ import annotations

import math

import pytest
from sliding import sliding_block

import ncgen


def rattling() -> ncgen.Model:
    m, s = sliding_block("rattling")
    m.stop(s, -0.5, 0.5, restitution=1.0)
    return m


def stopped_at_once() -> ncgen.Model:
    m, s = sliding_block("stopped")
    m.stop(s, upper=0.0, restitution=0.5)
    return m


def pressed_and_pulled() -> ncgen.Model:
    """Bounces accumulate, it rests, and leaves where the force changes its sign at 1 s."""
    m, s = sliding_block("pressed")
    m.torque(s, 4 * (1 - m.time))
    m.stop(s, upper=0.0, restitution=0.3)
    return m


def dragged() -> ncgen.Model:
    """By a spring that is pulled at 1 m/s from 0 on: it slips at 1 s and follows as t − 1 − sin(t − 1)."""
    m, s = sliding_block("dragged")
    m.torque(s, m.time - s)
    m.friction(s, 1.0)
    return m


def locked_solid() -> ncgen.Model:
    m, s = sliding_block("locked")
    m.lock(s)
    m.stop(s, upper=0.0)
    m.torque(s, 5.0)
    m.friction(s, 1.0)
    return m


def deep_in_a_stop() -> ncgen.Model:
    """0.3 m in a stop of 1e6 N/m, out with 300 m/s after half a period of its spring."""
    m, s = sliding_block("deep")
    m.stop(s, upper=0.0, stiffness=1e6)
    return m


SCENES = {
    "rattling": (rattling, 10.25, 0.25, {"qd0": {"s": 1.0}}),
    "stopped at once": (stopped_at_once, 1.0, -0.5, {"qd0": {"s": 1.0}}),
    "pressed and pulled": (pressed_and_pulled, 2.0, -2 / 3, {"q0": {"s": -0.1, "A.x": -0.1}}),
    "dragged": (dragged, 5.0, 4.0 - math.sin(4.0), {}),
    "locked solid": (locked_solid, 1.0, 0.0, {}),
    "deep in a stop": (deep_in_a_stop, 1.0, -300.0 * (1.0 - math.pi / 2000), {"q0": {"s": 0.3, "A.x": 0.3}}),
}
"""{name: (model, duration in s, place at the end in m, start)}"""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("integrator", ["dop853", "radau"])
@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_ends_where_its_closed_form_says(scene, integrator):
    build, duration, place, start = SCENES[scene]
    kernels = ncgen.compile(build())
    for rtol in (1e-4, 1e-6, 1e-9, 1e-12):
        run = ncgen.simulate(kernels, duration, rtol=rtol, integrator=integrator, points=3, **start)
        assert run["s"][-1] == pytest.approx(place, rel=10 * rtol, abs=1e-13)
