"""Locks, clutches, ratchets, brakes and backlash against closed forms: momentum, energy lost, and what holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sliding import sliding_block

import ncgen
from ncgen.exchange.toml_writer import to_toml

G = 9.81


def two_discs(inertias=(2.0, 3.0)) -> tuple[ncgen.Model, list]:
    """Two discs on one axis, free to turn, and their angles."""
    m = ncgen.Model("discs")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for k, inertia in enumerate(inertias, 1):
        P = m.point(f"P{k}", (1, 0))
        m.body(f"disc{k}", [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"psi{k}", x, P - O, z))
    return m, angles


def test_a_clutch_between_two_discs():
    """Common speed (J₁ω₁ + J₂ω₂)/(J₁ + J₂); the clutch takes ½ J₁J₂/(J₁ + J₂) (ω₁ − ω₂)²; opened again, they run apart."""
    m, (psi1, psi2) = two_discs()
    m.torque(psi2, 6.0)
    m.clutch(psi1, psi2, when=0.5 - m.time, until=1.0 - m.time, name="clutch")
    run = ncgen.simulate(ncgen.compile(m), 1.5, rtol=1e-11, qd0={"psi1": 10.0, "psi2": 0.0}, points=4)
    closes, opens = run.events
    common = (2 * 10 + 3 * 1.0) / 5
    events = [(e.name, e.transition, e.search) for e in run.events]
    assert events == [("clutch", "locks", "polynomial"), ("clutch.free", "frees", "polynomial")]
    assert [closes.t, opens.t] == pytest.approx([0.5, 1.0], rel=1e-13)
    assert closes.energy_lost == pytest.approx(0.5 * 6 / 5 * 9.0**2, rel=1e-11)
    places = [run.kernels.index[name] for name in ("psi1", "psi2")]
    assert closes.after[places] == pytest.approx([common, common], rel=1e-12)
    assert opens.after[places] == pytest.approx([common + 6 / 5 * 0.5] * 2, rel=1e-11)
    assert run.qd[-1][places] == pytest.approx([common + 0.6, common + 0.6 + 2 * 0.5], rel=1e-11)
    assert run.energy_drift < 1e-10


def test_a_clutch_with_a_ratio():
    """Speeds ω₁ = −2 ω₂ by an impulse along (1, 2): Φ = ω₁ + 2 ω₂."""
    m, (psi1, psi2) = two_discs()
    m.clutch(psi1, psi2, ratio=-2.0, closed=True, name="clutch")
    run = ncgen.simulate(ncgen.compile(m), 0.1, qd0={"psi1": 10.0, "psi2": 0.0}, points=2)
    impulse = -10.0 / (1 / 2 + 4 / 3)
    (closed,) = run.events
    assert (closed.transition, closed.search, closed.t) == ("locks", "start", 0.0)
    assert [run["rate(psi1)"][-1], run["rate(psi2)"][-1]] == pytest.approx([10 + impulse / 2, 2 * impulse / 3], rel=1e-11)


def test_a_clutch_that_slips_up_to_a_torque():
    """Friction between two discs: the difference of speeds falls by T (1/J₁ + 1/J₂), and then they stick to each other."""
    m, (psi1, psi2) = two_discs()
    m.friction(psi1, coulomb=4.0, other=psi2, name="clutch")
    run = ncgen.simulate(ncgen.compile(m), 4.0, rtol=1e-11, qd0={"psi1": 10.0, "psi2": 0.0}, points=5)
    (sticks,) = [event for event in run.events if event.t > 0]
    assert (sticks.name, sticks.transition) == ("clutch", "sticks") and sticks.t == pytest.approx(10 / (4 * (1 / 2 + 1 / 3)), rel=1e-11)
    assert [run["rate(psi1)"][-1], run["rate(psi2)"][-1]] == pytest.approx([4.0, 4.0], rel=1e-11)


def test_a_lock_by_events_of_others():
    """Held and freed by name; a locked block does not move under its force."""
    m, s = sliding_block("gripped")
    m.torque(s, 1.0)
    m.event("grip", m.time - 1.0, "rising", do=ncgen.lock("s"))
    m.event("let_go", m.time - 2.0, "rising", do=[ncgen.free(s), {"rate(s)": 3.0}])
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 3.0, points=7)
    assert run["s"] == pytest.approx([0, 1 / 8, 1 / 2, 1 / 2, 1 / 2, 1 / 2 + 1.5 + 1 / 8, 1 / 2 + 3 + 1 / 2], abs=1e-12)
    assert [(e.name, e.transition) for e in run.events] == [("grip", "locks"), ("let_go", "frees")]
    assert run.events[0].energy_lost == pytest.approx(0.5, rel=1e-12) and run.energy_drift < 1e-12
    assert np.max(np.abs(run["rate(rate(s))"][3:4])) < 1e-12


def test_steps_and_batches_go_through_locks():
    """As one run does, a state that is gone back to included."""
    m, s = sliding_block("gripped")
    m.torque(s, 1.0)
    m.lock(s, when=1.0 - m.time, until=2.0 - m.time)
    m.ratchet(s)
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 3.0, points=7)
    sim = ncgen.start(kernels)
    sim.step(1.5)
    state = sim.state
    for _ in range(2):
        sim.reset(state)
        sim.step(1.5)
        assert sim.q == pytest.approx(run.q[-1], abs=1e-12) and [e.name for e in sim.events] == [e.name for e in run.events]
    batch = ncgen.simulate(kernels, 3.0, qd0=[[0.0, 0.0], [1.0, 1.0]], points=7)
    assert batch.q[0, -1] == pytest.approx(run.q[-1], abs=1e-12)
    assert [[e.transition for e in events if e.t > 0] for events in batch.events] == [["locks", "frees"]] * 2


def test_files_say_locks(tmp_path):
    m, (psi1, psi2) = two_discs()
    m.clutch(psi1, psi2, closed=True, name="clutch")
    m.ratchet(psi1, direction="falling")
    m.backlash(psi1, psi2, 0.1, stiffness=10.0)
    m.event("open", m.time - 1.0, "rising", do=[ncgen.free("clutch"), ncgen.lock(psi2)])
    text = to_toml(m)
    assert 'do = [{ "free" = "clutch" }, { "lock" = "psi2" }]' in text and "[[ratchet]]" in text and "[[backlash]]" in text
    (tmp_path / "discs.toml").write_text(text)
    again = ncgen.load(tmp_path / "discs.toml")
    assert to_toml(again) == text and list(again.locks) == ["clutch", "psi2.lock"]


@pytest.mark.parametrize("count", [1, 2])
def test_a_mechanism_that_is_locked_solid(count):
    """A pendulum whose angle is locked, once and twice, has no degree of freedom left; freed it goes on from rest."""
    m = ncgen.Model("pendulum")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("bob", [P], mass=1.0)
    m.distance(O, P)
    m.angle("psi", x, P - O, z)
    m.gravity((0, -G))
    names = ["psi", "P.x"][:count]
    m.event("grip", m.time - 0.2, "rising", do=[ncgen.lock(name) for name in names])
    m.event("go", m.time - 0.5, "rising", do=[ncgen.free(name) for name in names])
    run = ncgen.simulate(ncgen.compile(m), 0.8, rtol=1e-10, points=[0.0, 0.2, 0.3, 0.4, 0.5, 0.8])
    assert np.ptp(run["psi"][1:5]) < 1e-13 and np.all(np.abs(run["rate(psi)"][1:5]) < 1e-12)
    again = ncgen.simulate(run.kernels, 0.3, rtol=1e-10, q0=run.q[1], t0=0.5, points=2)
    assert run["psi"][-1] == pytest.approx(again["psi"][-1], rel=1e-8) and run.energy_drift < 1e-8


def test_what_a_driver_moves_cannot_be_locked():
    m, s = sliding_block("driven")
    m.drive(s, m.time)
    m.lock(s, when=0.5 - m.time)
    with pytest.raises(ncgen.ModelError, match="driven: s.lock cannot be locked at t = 0.5 s, since drivers or other locks move it"):
        ncgen.simulate(ncgen.compile(m), 1.0)


# -- ratchets -----------------------------------------------------------------------------------


def winch(**ratchet) -> ncgen.Kernels:
    """A weight of 1 kg that a force lifts in turns: up for a second with 2 g, then nothing."""
    m = ncgen.Model("winch")
    P = m.point("P", (0, 0), fixed="x")
    m.body("weight", [P], mass=1.0)
    m.gravity((0, -G))
    lift = m.input("lift")
    m.force(P, (0, lift))
    m.ratchet(P.y, name="pawl", **ratchet)
    return ncgen.compile(m)


def test_a_ratchet_holds_a_weight():
    """Thrown up with 2 m/s it hangs where it would turn back, for ever."""
    run = ncgen.simulate(winch(), 5.0, rtol=1e-11, qd0={"P.y": 2.0}, points=6)
    (caught,) = [event for event in run.events if event.t > 0]
    assert (caught.name, caught.transition) == ("pawl", "catches") and caught.t == pytest.approx(2.0 / G, rel=1e-13)
    assert run["P.y"][1:] == pytest.approx([2.0**2 / (2 * G)] * 5, rel=1e-12) and np.all(np.abs(run["rate(P.y)"][1:]) < 1e-14)


def test_a_ratchet_releases_what_is_lifted():
    kernels = winch()
    run = ncgen.simulate(kernels, 3.0, rtol=1e-11, inputs={"lift": lambda t: 2 * G * t / 2})
    assert [(event.transition, round(event.t, 10)) for event in run.events] == [("catches", 0.0), ("releases", 1.0)]
    assert run["P.y"][-1] == pytest.approx(G * 2.0**3 / 6, rel=1e-10)


def test_a_ratchet_that_is_driven_back_at_the_start():
    """It is stopped by an impulse, and the energy is lost."""
    run = ncgen.simulate(winch(), 1.0, qd0={"P.y": -3.0}, points=3)
    assert run.events[0].impulse == pytest.approx(3.0, rel=1e-13) and run.events[0].energy_lost == pytest.approx(4.5, rel=1e-13)
    assert np.all(run["P.y"] == 0.0) and run.energy_drift < 1e-13


def test_several_ratchets_that_are_driven_back_at_the_start():
    """Each takes the impulse of its own weight, and one that is thrown up none."""
    m = ncgen.Model("row")
    m.gravity((0, -G))
    for k in range(3):
        P = m.point(f"P{k}", (k, 0), fixed="x")
        m.body(f"weight{k}", [P], mass=1.0 + k)
        m.ratchet(P.y, name=f"pawl{k}")
    run = ncgen.simulate(ncgen.compile(m), 0.1, qd0={"P0.y": 1.0, "P1.y": -3.0, "P2.y": -2.0}, points=2)
    assert {event.name: event.impulse for event in run.events if event.impulse} == pytest.approx({"pawl1": 6.0, "pawl2": 6.0}, rel=1e-13)
    assert run.q[-1] == pytest.approx([0.1 - G * 0.1**2 / 2, 0.0, 0.0], rel=1e-9, abs=1e-15)


def test_a_ratchet_with_teeth():
    """Thrown up by v²/2g = 0.2 m over teeth of 0.03 m, it falls onto the sixth, 0.18 m, with √(2 g 0.02)."""
    kernels = winch(pitch=0.03)
    run = ncgen.simulate(kernels, 2.0, rtol=1e-11, qd0={"P.y": math.sqrt(2 * G * 0.2)}, q0={"P.y": 5.0}, points=3)
    names = [event.name for event in run.events]
    assert names == ["pawl.tooth"] * 6 + ["pawl", "pawl"] and run.events[-1].transition == "rests"
    assert run.events[6].before[0] == pytest.approx(-math.sqrt(2 * G * 0.02), rel=1e-9)
    assert run["P.y"][-1] == pytest.approx(5.18, rel=1e-12)


def test_a_freewheel():
    """An overrunning clutch: disc 1 may run ahead of disc 2; where disc 2 catches up, it carries it along."""
    m, (psi1, psi2) = two_discs()
    m.torque(psi2, 6.0)
    m.ratchet(psi1, psi2, name="freewheel")
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-11, qd0={"psi1": 2.0, "psi2": 0.0}, points=4)
    (caught,) = [event for event in run.events if event.t > 0]
    assert caught.transition == "catches" and caught.t == pytest.approx(1.0, rel=1e-10)
    assert [run["rate(psi1)"][-1], run["rate(psi2)"][-1]] == pytest.approx([2 + 6 / 5 * 2] * 2, rel=1e-11)


def test_a_ball_hits_a_ratchet_backward():
    """A ratchet at rest is hit backward by a ball of its mass: the ball bounces off it as off a wall, and then it has not moved."""
    m = ncgen.Model("hit")
    x = []
    for k, place in enumerate((1.0, 0.0)):
        x.append(m.point(f"P{k}", (place, 0), fixed="y").x)
        m.body(f"ball{k}", [m.elements[f"P{k}"]], mass=1.0)
    m.ratchet(x[1], name="pawl")
    m.event("hit", x[0] - x[1] - 0.5, do=ncgen.impact(1.0, order="simultaneous"))
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"P0.x": -1.0, "P1.x": 0.0}, points=3)
    hit = [event for event in run.events if event.t > 0]
    assert (
        [event.name for event in hit] == ["hit", "pawl"]
        and run["P0.x"][-1] == pytest.approx(1.0, rel=1e-12)
        and hit[0].t == pytest.approx(0.5, rel=1e-12)
    )
    assert run["P1.x"] == pytest.approx(0.0, abs=1e-13) and run.energy_drift < 1e-12


# -- brakes and backlash ------------------------------------------------------------------------


def test_a_brake_that_an_input_pulls():
    """Friction 2 t as an input: from 1 m/s, v = 1 − t², at rest at 1 s; a force 5 (t − 2) breaks away where it exceeds 2 t, at 10/3 s."""
    import sympy

    m, s = sliding_block("braked")
    pull = m.input("pull")
    m.torque(s, 5 * sympy.Max(0, m.time - 2))
    m.friction(s, coulomb=pull, name="brake")
    run = ncgen.simulate(ncgen.compile(m), 4.0, rtol=1e-11, qd0={"s": 1.0}, inputs={"pull": lambda t: 2 * t})
    seen = [(event.transition, event.t) for event in run.events if event.t > 0]
    assert [what for what, _ in seen] == ["sticks", "slips"]
    assert [t for _, t in seen] == pytest.approx([1.0, 10 / 3], rel=1e-9)


def test_a_capstan():
    """A rope around a bollard slips where T₂ = T₁ exp(μβ), T₁ = 2 + 10 s being a spring's; then s = (wτ − sin wτ)/w³, w² = 10 exp(μβ)."""
    m, s = sliding_block("capstan")
    grip = math.exp(0.3 * 3 * math.pi)
    tension = 2 + 10 * s
    m.torque(s, m.time - tension)
    m.friction(s, coulomb=tension * (grip - 1), name="bollard")
    run = ncgen.simulate(ncgen.compile(m), 2 * grip + 0.1, rtol=1e-11, points=2)
    (slips,) = [event for event in run.events if event.t > 0]
    assert (slips.name, slips.transition) == ("bollard", "slips") and slips.t == pytest.approx(2 * grip, rel=1e-11)
    w = math.sqrt(10 * grip)
    assert run["s"][-1] == pytest.approx((0.1 * w - math.sin(0.1 * w)) / w**3, rel=1e-8)


def test_backlash_is_a_chain_of_impacts():
    """Masses 1 and 2 with play 0.2: the first one hits at the end of the play, and momentum and (1 − e²) of the relative energy follow."""
    m = ncgen.Model("play")
    x = []
    for k, mass in enumerate((1.0, 2.0)):
        P = m.point(f"P{k}", (float(k), 0), fixed="y")
        m.body(f"mass{k}", [P], mass=mass)
        x.append(P.x)
    m.backlash(x[0], x[1], 0.2, restitution=0.5)
    run = ncgen.simulate(ncgen.compile(m), 1.0, rtol=1e-11, qd0={"P0.x": 3.0, "P1.x": 0.0})
    relative, t = 3.0, 0.1 / 3
    for number, event in enumerate(run.events[:3]):
        assert event.name == f"P0.x.P1.x.backlash.{'upper' if number % 2 == 0 else 'lower'}"
        assert event.t == pytest.approx(t, rel=1e-11)
        relative *= -0.5
        assert event.after[0] - event.after[1] == pytest.approx(relative, rel=1e-11)
        assert event.after[0] + 2 * event.after[1] == pytest.approx(3.0, rel=1e-12)
        assert event.energy_lost == pytest.approx(0.5 * 2 / 3 * 3 * relative**2, rel=1e-10)
        t += 0.2 / abs(relative)


REFUSED = [
    (lambda m, a, b: m.clutch(a, a), "psi1.psi1.clutch: psi1 is given twice; name two coordinates"),
    (lambda m, a, b: [m.clutch(a, b) for _ in range(2)], "psi1.psi2.clutch: there is one of that name already; give another name"),
    (lambda m, a, b: m.lock(m.elements["O"].x), "O.x.lock: O.x is fixed; name a coordinate that moves"),
    (lambda m, a, b: m.event("e", a, do=ncgen.lock("phi")), "event e, do: there is no coordinate phi; define it first"),
    (lambda m, a, b: ncgen.lock(3), "lock, free: 3 is neither a coordinate nor the name of a lock; give one of them"),
    (lambda m, a, b: m.ratchet(a, direction="up"), "ratchet: direction 'up' is unknown; choose one of rising, falling"),
    (lambda m, a, b: m.ratchet(a, pitch=0.0), "psi1.ratchet: pitch is 0; give a number above 0"),
    (lambda m, a, b: m.backlash(a, b, -1.0), "psi1.psi2.backlash: width is -1; give a number above 0"),
    (lambda m, a, b: m.stop(a, 1.0, order="both"), "psi1.stop: order 'both' is unknown; choose one of simultaneous, in turn"),
]


@pytest.mark.parametrize(("declare", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refused(declare, message):
    m, (psi1, psi2) = two_discs()
    with pytest.raises(ncgen.ModelError) as refused:
        declare(m, psi1, psi2)
    assert str(refused.value) == message


def test_a_four_bar_whose_crank_is_locked():
    """Nothing moves: what the impulse leaves of velocities is rounding, which the constraints do not allow either."""
    m = ncgen.load("fourbar")
    psi = m.elements["psi"]
    m.lock(psi, when=psi + 0.6)
    run = ncgen.simulate(ncgen.compile(m), 0.3, zd0={"psi": -3.0})
    (locks,) = run.events
    assert locks.transition == "locks" and run["psi"][-1] == pytest.approx(-0.6, rel=1e-12) and np.max(np.abs(run.qd[-1])) < 1e-13


@pytest.mark.parametrize("start", [-0.5, -0.03, 0.0, 0.07])
def test_teeth_begin_where_the_ratchet_does(start):
    """From anywhere: at 1 m/s against 1 m/s² it goes 0.5 m up, falls to the tooth before its highest place, and is held there."""
    m, s = sliding_block("teeth")
    m.torque(s, -1.0)
    m.ratchet(s, direction="rising", pitch=0.3)
    run = ncgen.simulate(ncgen.compile(m), 3.0, q0={"s": start, "A.x": start}, qd0={"s": 1.0}, rtol=1e-10)
    hit = next(each for each in run.events if each.name == "s.ratchet")
    assert hit.t == pytest.approx(1 + math.sqrt(2 * 0.2), rel=1e-10) and run["s"][-1] == pytest.approx(start + 0.3, abs=1e-10)
