"""Friction that sticks, locks, clutches, ratchets and brakes in exported C: closed forms, and our own runs."""

from __future__ import annotations

import copy
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy
from eventful import G, ball, fourbar, sliding_block
from exported import shell
from living import click, nothing_said, settled, state_of
from test_events_in_wasm import in_node, moved, shown
from test_events_of_exports import run_in_c

import ncgen
from ncgen.exchange.export import export

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "events"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "examples"))

from test_loaded_friction import RADIUS, TAN, WEIGHT, screw  # noqa: E402
from test_locks import two_discs  # noqa: E402
from winch import winch as lift  # noqa: E402


def belt() -> ncgen.Model:
    """T4: a block on a belt, in the belt's frame."""
    m, u = sliding_block("belt")
    m.torque(u, -(u + 3 * m.time))
    m.friction(u, coulomb=3.0, static=5.0, name="belt")
    m.simulation(duration=20.0, q0={"s": 1.0, "A.x": 1.0})
    return m


def oscillator() -> ncgen.Model:
    """T5: mass 1, spring 1, Coulomb 1, from 12 with 6."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    m.simulation(duration=100.0, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 6.0})
    return m


def clutch() -> ncgen.Model:
    """It closes at 0.5 s and opens at 1 s."""
    m, (psi1, psi2) = two_discs()
    m.torque(psi2, 6.0)
    m.clutch(psi1, psi2, when=0.5 - m.time, until=1.0 - m.time, name="clutch")
    m.simulation(duration=1.5, qd0={"psi1": 10.0, "psi2": 0.0})
    return m


def slipping_clutch() -> ncgen.Model:
    m, (psi1, psi2) = two_discs()
    m.friction(psi1, coulomb=4.0, other=psi2, name="clutch")
    m.simulation(duration=4.0, qd0={"psi1": 10.0, "psi2": 0.0})
    return m


def gripped() -> ncgen.Model:
    m, s = sliding_block("gripped")
    m.torque(s, 1.0)
    m.event("grip", m.time - 1.0, "rising", do=ncgen.lock("s"))
    m.event("let_go", m.time - 2.0, "rising", do=[ncgen.free(s), {"rate(s)": 3.0}])
    m.simulation(duration=3.0)
    return m


def winch(speed: float, **ratchet) -> ncgen.Model:
    """A weight that is thrown up, and which a force of 4 t N lifts."""
    m = ncgen.Model("winch")
    P = m.point("P", (0, 0), fixed="x")
    m.body("weight", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, 4 * m.time))
    m.ratchet(P.y, name="pawl", **ratchet)
    m.simulation(duration=3.0, qd0={"P.y": speed})
    return m


def brake() -> ncgen.Model:
    """Friction 2 t; from 1 m/s; then a force 5 (t − 2)."""
    m, s = sliding_block("braked")
    m.torque(s, 5 * sympy.Max(0, m.time - 2))
    m.friction(s, coulomb=2 * m.time, name="brake")
    m.simulation(duration=4.0, qd0={"s": 1.0})
    return m


def freewheel() -> ncgen.Model:
    m, (psi1, psi2) = two_discs()
    m.torque(psi2, 6.0)
    m.ratchet(psi1, psi2, name="freewheel")
    m.simulation(duration=3.0, qd0={"psi1": 2.0, "psi2": 0.0})
    return m


def hit() -> ncgen.Model:
    """A ratchet at rest is hit backward by a ball."""
    m, x = ncgen.Model("hit"), []
    for k, place in enumerate((1.0, 0.0)):
        x.append(m.point(f"P{k}", (place, 0), fixed="y").x)
        m.body(f"ball{k}", [m.elements[f"P{k}"]], mass=1.0)
    m.ratchet(x[1], name="pawl")
    m.event("hit", x[0] - x[1] - 0.5, do=ncgen.impact(1.0, order="simultaneous"))
    m.simulation(duration=1.0, qd0={"P0.x": -1.0, "P1.x": 0.0})
    return m


def solid() -> ncgen.Model:
    """A pendulum whose angle and point are both locked for a while."""
    m = ncgen.Model("pendulum")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("bob", [P], mass=1.0)
    m.distance(O, P)
    m.angle("psi", x, P - O, z)
    m.gravity((0, -G))
    m.event("grip", m.time - 0.2, "rising", do=[ncgen.lock(name) for name in ("psi", "P.x")])
    m.event("go", m.time - 0.5, "rising", do=[ncgen.free(name) for name in ("psi", "P.x")])
    m.simulation(duration=0.8)
    return m


def teeth() -> ncgen.Model:
    """Thrown up by 0.2 m over teeth of 0.03 m, from −5 m."""
    m = ncgen.Model("winch")
    P = m.point("P", (0, 0), fixed="x")
    m.body("weight", [P], mass=1.0)
    m.gravity((0, -G))
    m.ratchet(P.y, name="pawl", pitch=0.03)
    m.simulation(duration=2.0, qd0={"P.y": math.sqrt(2 * G * 0.2)})
    return m


def hoist() -> ncgen.Model:
    """A winch with a clutch, a ratchet on the wheel of a brake, and inputs that events change (examples/winch.py)."""
    m, speeds = lift()
    m.simulation(duration=5.5, qd0=speeds)
    return m


def guided(push, side, speed: float, duration: float) -> ncgen.Model:
    """A block of 2 kg whose friction follows the load of its guide. push, side: forces (N) along and across it"""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=2.0)
    m.force(A, (push(m.time), side(m.time)))
    m.friction(s, coefficient=0.5, load=m.constrain(A.y, label="guide"))
    m.simulation(duration=duration, qd0={"s": speed})
    return m


def guide() -> ncgen.Model:
    """It stops at 1 s, and the push t N exceeds 0.5 · 4 N at 2 s."""
    return guided(lambda t: sympy.Piecewise((0, t < 1.5), (t, True)), lambda t: 4.0, 1.0, 3.0)


def turning_load() -> ncgen.Model:
    """The load is 4 cos t."""
    return guided(lambda t: 0.0, lambda t: 4 * sympy.cos(t), 10.0, 5.0)


def redundant() -> ncgen.Model:
    """A parallelogram with a third rod, which others imply: it falls onto a floor, with friction at a hinge."""
    m = ncgen.Model("parallel")
    A, B = ([m.point(f"{name}{k}", (k, y), fixed=name == "A") for k in range(3)] for name, y in (("A", 0), ("B", 1)))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("coupler", [B[0], B[2]], mass=2.0, inertia="rod")
    for axis in "xy":
        first, middle, last = (getattr(B[k], axis) for k in range(3))
        m.constrain(middle - (first + last) / 2, label=f"middle {axis}")
    for k in range(3):
        m.distance(A[k], B[k])
    m.gravity((0, -G))
    m.friction(m.angle("psi", x, B[0] - A[0], z), coulomb=3.0, static=4.0, name="hinge")
    m.event("floor", when=B[0].y + 0.2, do=ncgen.impact(0.4))
    m.simulation(duration=2.0, qd0={"psi": 1.0})
    return m


def at_rest() -> ncgen.Model:
    """A ball that comes to rest on the floor."""
    m = ball()
    m.simulation(duration=3.0)
    return m


def linkage() -> ncgen.Model:
    """A four-bar linkage whose crank is pressed against its stop."""
    m = fourbar()
    m.simulation_options["duration"] = 0.6
    return m


def pressed() -> ncgen.Model:
    """A compliant stop that the start presses."""
    m, s = sliding_block("pressed")
    m.stop(s, upper=0.0, stiffness=100.0, name="buffer")
    m.simulation(duration=1.0, q0={"s": 0.1, "A.x": 0.1})
    return m


def shaken() -> ncgen.Model:
    """A block at rest that slips at 20 Hz, in steps that are longer than the periods."""
    m, u = sliding_block("shaken")
    m.torque(u, 3.0 * sympy.sin(40 * math.pi * m.time) * (m.time / 2))
    m.friction(u, coulomb=2.943)
    m.simulation(duration=2.1)
    return m


MODELS = {
    "belt": belt, "oscillator": oscillator, "clutch": clutch, "slipping clutch": slipping_clutch, "gripped": gripped,
    "ratchet": lambda: winch(2.0), "ratchet driven back": lambda: winch(-3.0), "brake": brake, "freewheel": freewheel, "hit ratchet": hit,
    "winch": hoist, "guide": guide, "load that changes its sign": turning_load, "locked solid": solid, "teeth": teeth,
    "pressed at the start": pressed, "redundant": redundant, "shaken": shaken,
}  # fmt: skip


def own_run(model: ncgen.Model) -> tuple[ncgen.Trajectory, float]:
    """Our own run of a model as it is described, and its duration."""
    options = dict(model.simulation_options)
    end = options.pop("duration")
    return ncgen.simulate(ncgen.compile(model), end, rtol=1e-12, atol=1e-13, points=2, **options), end


@pytest.mark.parametrize("name", MODELS)
def test_c_is_our_own_run(tmp_path, name):
    """Times of events, and the state at the end."""
    model = MODELS[name]()
    run, end = own_run(model)
    events, last, _, stopped, said = run_in_c(model, tmp_path, end, 1e-13)
    assert said == "ok" and not stopped
    times = sorted({each.t for each in run.events if 0 < each.t < end})
    assert [row[0] for row in events if row[0] > 0] == pytest.approx(times, rel=1e-9)
    n = run.kernels.n
    assert last[1 : 1 + n] == pytest.approx(run.q[-1], abs=1e-8) and last[1 + n : 1 + 2 * n] == pytest.approx(run.qd[-1], abs=1e-8)
    assert last[-1] == pytest.approx(run.work[-1], abs=1e-7)


@in_node
@pytest.mark.parametrize("name", [*MODELS, "ball", "four-bar linkage"])
def test_webassembly_is_our_own_run(tmp_path, name):
    model = (MODELS | {"ball": at_rest, "four-bar linkage": linkage})[name]()
    run, end = own_run(model)
    answer = moved(model, tmp_path, end)
    times = sorted({each.t for each in run.events if 0 < each.t < end and each.transition not in ("rests", "leaves")})
    assert [row[0] for row in answer["found"][:-1]] == pytest.approx(times, rel=1e-9)
    n = run.kernels.n
    for last in (answer["found"][-1], answer["again"]):
        assert last[0] == end
        assert last[1 : 1 + n] == pytest.approx(run.q[-1], abs=1e-8) and last[1 + n : 1 + 2 * n] == pytest.approx(run.qd[-1], abs=1e-8)
    assert answer["work"] == pytest.approx(run.work[-1], abs=1e-7)


def test_an_oscillator_is_where_the_closed_form_says(tmp_path):
    """T5: it turns seven times, and rests at 1 − (√205 − 14) for ever."""
    events, last, counts, *_ = run_in_c(oscillator(), tmp_path, 100.0, 1e-12)
    assert events[-1][0] == pytest.approx(22.42355635069909, rel=1e-9) and counts == [len(events)] == [8]
    assert last[1] == pytest.approx(1 - (math.sqrt(205) - 14), abs=1e-10)


def test_a_block_on_a_belt_is_where_the_closed_form_says(tmp_path):
    """T4: stick 4/3 s, slip 2π − 2 atan(2/3) s."""
    events, *_ = run_in_c(belt(), tmp_path, 20.0, 1e-12)
    slip = 2 * math.pi - 2 * math.atan(2 / 3)
    assert [row[0] for row in events if row[0] > 0] == pytest.approx(np.cumsum([4 / 3, slip] * 3), rel=1e-10)


def turned_screw(ratio_of_inertia: float, couple, speed: float) -> ncgen.Model:
    """The screw of T16: a couple (N m) of time on its nut, which turns with `speed`."""
    m = copy.deepcopy(screw(0.1, ratio_of_inertia).model)
    m.torque(m.elements["turn"], couple(m.time))
    m.simulation(duration=0.4, qd0={"turn": speed})
    return m


def test_a_screw_locks_itself(tmp_path):
    """The couple t lifts the load where it exceeds W r tan(λ + φ) = 0.301507538 N m."""
    events, last, _, _, said = run_in_c(turned_screw(50.0, lambda t: t, 0.0), tmp_path, 0.4, 1e-11)
    slips = WEIGHT * RADIUS * (TAN + 0.1) / (1 - 0.1 * TAN)
    assert said == "ok" and events[-1][0] == pytest.approx(slips, rel=1e-10) and last[0] == 0.4


def test_a_load_that_is_not_determined_ends_the_motion(tmp_path):
    """As our own run: m r²/J is above 402."""
    *_, said = run_in_c(turned_screw(403.0, lambda t: 0.0, 1.0), tmp_path / "above", 0.01, 1e-11)
    assert said.startswith("the load that friction follows is not determined")
    *_, said = run_in_c(turned_screw(401.0, lambda t: 0.0, 1.0), tmp_path / "below", 0.01, 1e-11)
    assert said == "ok"


PACKAGE = r"""
import numpy, winch
motion = winch.Motion()
for _ in range(4):
    motion.step(0.25)
print(motion.t, *motion.q, motion.happened["pawl"])
motion.p = winch.DEFAULTS  # what is held stays so
motion.step(0.5)
print(motion.t, *motion.q, motion.happened["pawl"])
motion.advance(3.0, 1e-12, 1e-12)
print(motion.t, *motion.q, motion.happened["pawl"])
"""


def test_a_python_package_keeps_what_is_held(tmp_path):
    """Thrown up with 2 m/s against 4 t N, the weight is caught, also where all of p is written to, and lifted from g/4 s on."""
    model = winch(2.0)
    run, _ = own_run(model)
    export(model, "python", tmp_path)
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", tmp_path)
    first, second, last = ([float(x) for x in line.split()] for line in shell(f"{sys.executable} -c '{PACKAGE}'", tmp_path).splitlines())
    caught = run.events[0].q[0]
    assert first[1] == pytest.approx(caught, abs=1e-6) and first[2] == 1 and second[1:] == first[1:]
    assert last[1] - first[1] == pytest.approx(2 * (3.0 - G / 4) ** 3 / 3, rel=1e-8) and last[2] == 2


@shown
def test_the_page_of_a_winch(browser, page_of):
    """It lists what happens, keeps its energy, and has sliders for inputs, not for what is held."""
    browser.open(page_of(hoist()))
    while state_of(browser)[0] < 2.2:
        click(browser, "step")
    settled(browser)
    listed = browser.value("[...document.querySelectorAll('#happened li')].map((each) => each.textContent.split(' ')[2])")
    assert listed == ["clutch", "motor.on", "ratchet", "clutch.free", "motor.off", "ratchet"]
    sliders = browser.value("document.body.innerText")
    assert "brake (N m)" in sliders and "clutch.on" not in sliders and "brake.slip" not in sliders
    assert browser.value("living.drift()") < 1e-8 and nothing_said(browser)
