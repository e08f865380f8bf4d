"""Batches with locks, clutches, ratchets and friction of loads in C: each state is what it is alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from batched import compare, numbers, together, told
from sliding import sliding_block

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.model.elements import Relative
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.events.many_runs import CHUNK, refusal_in_c

G = 9.81


def discs() -> tuple[ncgen.Model, Relative, Relative]:
    """Two discs on one axis, of 2 and 3 kg m², and their angles."""
    m = ncgen.Model("discs")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for k, inertia in enumerate((2.0, 3.0), 1):
        P = m.point(f"P{k}", (1, 0))
        m.body(f"disc{k}", [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"psi{k}", x, P - O, z))
    return m, *angles


def clutch() -> ncgen.Model:
    m, first, second = discs()
    v = m.parameter("v", 0.5)
    m.torque(second, 6.0)
    m.clutch(first, second, when=v - m.time, until=2 * v - m.time, name="clutch")
    return m


def closed_clutch() -> ncgen.Model:
    m, first, second = discs()
    m.clutch(first, second, ratio=-2.0, closed=True, name="clutch", until=m.parameter("v", 0.5) - m.time)
    return m


def freewheel() -> ncgen.Model:
    m, first, second = discs()
    m.torque(second, m.parameter("v", 6.0))
    m.ratchet(first, second, name="freewheel")
    return m


def pawl(**options: float) -> ncgen.Model:
    """A weight on a ratchet, with a lift of v t."""
    m = ncgen.Model("pawl")
    P = m.point("P", (0, 0), fixed="x")
    m.body("weight", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, m.parameter("v", 1.0) * m.time))
    m.ratchet(P.y, name="pawl", **options)
    return m


def teeth() -> ncgen.Model:
    return pawl(pitch=0.03)


def hit() -> ncgen.Model:
    """A ball hits a ratchet backward."""
    m = ncgen.Model("hit")
    x = []
    for k, place in enumerate((1.0, 0.0)):
        x.append(m.point(f"P{k}", (place, 0), fixed="y").x)
        m.body(f"ball{k}", [m.elements[f"P{k}"]], mass=1.0)
    m.ratchet(x[1], name="pawl")
    m.event("hit", x[0] - x[1] - 0.5, do=ncgen.impact(m.parameter("v", 1.0), order="simultaneous"))
    return m


def four_bar() -> ncgen.Model:
    """Its crank is locked, so that nothing moves, and freed."""
    m = ncgen.load("fourbar")
    psi = m.elements["psi"]
    m.lock(psi, when=psi + m.parameter("v", 0.6), until=0.3 - m.time)
    return m


def winch() -> ncgen.Model:
    m = example_module(".", "winch.py").winch()[0]
    m.parameter("v", 0.0)
    return m


def guide() -> ncgen.Model:
    """A block in a guide that a force presses, first to one side."""
    m = ncgen.Model("guide")
    axis, O, A = m.vector("axis", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=2.0)
    m.force(A, (1.5 * sympy.sin(m.time), 4 * sympy.cos(m.parameter("v", 1.0) * m.time)))
    m.friction(s, coefficient=0.5, load=m.constrain(A.y, label="guide"))
    return m


def pin() -> ncgen.Model:
    m = ncgen.Model("pin")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    m.body("disc", [A, B], mass=2.0, com=(0.2, 0), inertia=0.5)
    turn = m.angle("turn", x, B - A, z)
    m.gravity((0, -G))
    rubs = m.parameter("v", 0.3) * 0.1
    m.friction(turn, coefficient=rubs, load=m.constrain(A.x, label="pin x"), across=m.constrain(A.y, label="pin y"))
    return m


SCENES: dict[str, tuple[Any, float, dict[str, Any], tuple[float, ...], set[str]]] = {
    "clutch": (clutch, 1.5, {"qd0": {"psi1": 10.0, "psi2": 0.0}}, (0.4, 0.7), {"locks", "frees"}),
    "closed clutch": (closed_clutch, 1.0, {"qd0": {"psi1": 10.0, "psi2": 0.0}}, (0.4, 0.7), {"locks", "frees"}),
    "freewheel": (freewheel, 3.0, {"qd0": {"psi1": 2.0, "psi2": 0.0}}, (3.0, 6.0, -6.0), {"catches"}),
    "pawl": (pawl, 10.0, {"qd0": {"P.y": 2.0}}, (0.5, 2.0, 10.0), {"catches", "releases"}),
    "pawl driven back": (pawl, 3.0, {"qd0": {"P.y": -2.0}}, (0.5, 10.0), {"", "catches", "releases"}),
    "teeth": (teeth, 2.0, {"qd0": {"P.y": 2.0}}, (0.0, 1.0), {"", "rests"}),
    "hit": (hit, 1.0, {"qd0": {"P0.x": -1.0, "P1.x": 0.0}}, (0.0, 0.5, 1.0), {""}),
    "four-bar": (four_bar, 0.5, {"zd0": {"psi": -3.0}}, (0.5, 0.6), {"locks", "frees"}),
    "winch": (winch, 4.0, {"qd0": {"motor.angle": 20.0, "drum.angle": 0.0, "wheel.angle": 0.0}}, (0.0,), {"locks", "catches", "slips"}),
    "guide": (guide, 5.0, {"qd0": {"s": 1.0}}, (0.5, 1.0, 3.0), {"sticks", "slips"}),
    "pin": (pin, 4.0, {"qd0": {"turn": 3.0}}, (0.1, 0.9), {"sticks", "turns"}),
}  # fmt: skip
"""A model, seconds, its start, values of v, and what happens in one of the states at least."""


@pytest.mark.parametrize("scene", SCENES)
def test_what_is_held_is_what_it_is_alone(scene, monkeypatch):
    """To rounding, if what is held moves by the matrix alone, too; where it moves by a recursion there, within the tolerance."""
    model, seconds, start, values, happens = SCENES[scene]
    kernels = ncgen.compile(model())
    batch = together(kernels, seconds, values, **start)
    assert {each.transition for events in batch.events for each in events} >= happens
    for close in (1e-9, 1e-6):
        form_of = acceleration_forms.form_of
        if close < 1e-6:
            by_matrix = lambda each, method: "dense" if each is not kernels else form_of(each, method)  # noqa: E731
            monkeypatch.setattr(acceleration_forms, "form_of", by_matrix)
        for i, v in enumerate(values):
            compare(batch, i, ncgen.simulate(kernels, seconds, points=7, p={"v": v}, rtol=1e-9, integrator="dopri5", **start), close)
        monkeypatch.undo()


def test_neighbours_and_threads_make_no_difference():
    kernels = ncgen.compile(clutch())
    values, start = np.linspace(0.1, 0.9, CHUNK + 3), {"qd0": {"psi1": 10.0, "psi2": 0.0}}
    one, two = (together(kernels, 1.0, values, threads=threads, **start) for threads in (1, 2))
    last = together(kernels, 1.0, values[-1:], **start)
    assert one.q.tobytes() == two.q.tobytes() and one.work.tobytes() == two.work.tobytes()
    assert one.q[-1].tobytes() == last.q[0].tobytes()
    for a, b in zip(one.events, two.events, strict=True):
        assert told(a) == told(b) and numbers(a).tobytes() == numbers(b).tobytes()


def test_a_clutch_takes_what_the_closed_form_says():
    """½ J₁J₂/(J₁ + J₂) (ω₁ − ω₂)², where ω₂ = 2 v; closed from the start on, work has its loss, too."""
    batch = together(ncgen.compile(clutch()), 0.95, (0.25, 0.5), qd0={"psi1": 10.0, "psi2": 0.0})
    for events, v in zip(batch.events, (0.25, 0.5), strict=True):
        assert events[0].t == pytest.approx(v, rel=1e-13) and events[0].energy_lost == pytest.approx(0.6 * (10 - 2 * v) ** 2, rel=1e-8)
    batch = together(ncgen.compile(closed_clutch()), 0.1, (0.5,), qd0={"psi1": 10.0, "psi2": 0.0})
    lost = 0.5 * 10.0**2 / (1 / 2 + 4 / 3)
    (closes,) = batch.events[0]
    assert (closes.name, closes.transition, closes.search) == ("clutch", "locks", "start")
    assert closes.energy_lost == pytest.approx(lost, rel=1e-12) and batch.work[0, -1] == pytest.approx(-lost, rel=1e-12)


def test_models_that_differ_by_their_static_friction_alone():
    """Equations are the same, so functions that are cached have to tell them apart: each slips where its force of t N exceeds its own."""
    for static in (2.0, 3.0):
        m, s = sliding_block("pushed")
        m.torque(s, m.parameter("v", 1.0) * m.time)
        m.friction(s, coulomb=1.0, static=static)
        batch = together(ncgen.compile(m), 4.0, (1.0,))
        assert [(each.transition, pytest.approx(each.t, rel=1e-10)) for each in batch.events[0]] == [("sticks", 0.0), ("slips", static)]


def test_a_lock_that_contradicts_a_driver_is_reported_as_alone():
    m, s = sliding_block("driven")
    m.drive(s, m.parameter("v", 1.0) * m.time)
    m.lock(s, when=0.5 - m.time)
    batch = ncgen.simulate(ncgen.compile(m), 1.0, p={"v": np.array([0.0, 1.0])})
    assert batch.alone.tolist() == [False, True] and batch.status[0] == "ok"
    assert batch.status[1].startswith("driven: s.lock cannot be locked at t = 0.5 s")


def test_loads_that_are_not_determined_are_reported_as_alone():
    """A screw whose load is determined for a coefficient of 0.05, and not for 0.2 (Painlevé)."""
    m = ncgen.Model("screw")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, P, A = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0)), m.point("A", (1, 0), fixed="y")
    turn, lift = m.angle("turn", x, P - O, z), m.slide("lift", O, A, x)
    m.body("nut", [O, P], mass=1.0, com=(0, 0), inertia=1e-5)
    m.body("load", [A], mass=10.0)
    cos = 1 / math.hypot(1, 0.05)
    thread = m.constrain(cos * (lift - 1) - 0.05 * cos * 0.02 * turn, label="thread")
    m.torque(lift, -100.0)
    m.friction(turn, other=lift, ratio=-0.05 / 0.02, coefficient=m.parameter("v", 0.1) * 0.02 * cos, load=thread, name="rubbing")
    batch = ncgen.simulate(ncgen.compile(m), 0.01, p={"v": np.array([0.05, 0.2])}, qd0={"turn": -1.0})
    assert batch.ok.tolist() == [True, False] and batch.alone.tolist() == [False, True]
    assert "friction rubbing with coefficient" in batch.status[1] and "not determined" in batch.status[1]


def test_a_load_that_redundant_constraints_share_is_left_to_single_runs():
    m = guide()
    m.constrain(2 * m.elements["A"].y, label="again")
    kernels = ncgen.compile(m)
    assert "is shared with redundant constraints" in refusal_in_c(kernels)
    batch = ncgen.simulate(kernels, 1.0, p={"v": np.array([1.0])})
    assert not batch.ok.any() and "constraint guide, is shared with redundant constraints" in batch.status[0]


def test_studies_of_clutches():
    """J₁ω₁/(J₁ + J₂) after the clutch closes at v, and all of it in C. It may be named without its word, and opens in the first variant."""
    m, first, second = discs()
    v = m.parameter("v", 0.5)
    m.clutch(first, second, when=v - m.time, until=2 * v + 0.5 - m.time, name="clutch")
    keep = ["first_time(clutch)", "energy_lost(clutch locks)", "count(clutch.free)", "rate(psi2)", "energy_drift"]
    result = ncgen.study(m, {"v": [0.2, 0.4]}, keep=keep, duration=1.0, qd0={"psi1": 10.0, "psi2": 0.0}, rtol=1e-10)
    assert "events in C" in result.about["made_with"] and result["first_time(clutch)"] == pytest.approx(result["v"], rel=1e-12)
    assert result["energy_lost(clutch locks)"] == pytest.approx(60.0, rel=1e-9) and result["rate(psi2)"] == pytest.approx(4.0, rel=1e-9)
    assert result["count(clutch.free)"].tolist() == [1, 0] and np.max(result["energy_drift"]) < 1e-8
