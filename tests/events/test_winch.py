"""The winch of examples/winch.py and its published problems, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen
from examples import winch as example
from examples.winch import CLOSES, DRUM, EASED, HEIGHT, HOLDS, LETS_DOWN, LOW, MOTOR, RADIUS, SPEED, TORQUE, WEIGHT, WHEEL, G
from ncgen.solver.trajectories.trajectory import Trajectory

PULL, LOAD = WEIGHT * G * RADIUS, DRUM + WEIGHT * RADIUS**2
"""What the weight pulls with (N m), and the inertia of drum and weight (kg m²)."""


def events(run: Trajectory) -> dict[tuple[str, str], list]:
    """{(name, what): events after the start}."""
    found: dict[tuple[str, str], list] = {}
    for each in run.events:
        if each.t > 0:
            found.setdefault((each.name, each.transition), []).append(each)
    return found


@pytest.fixture(scope="module")
def run() -> Trajectory:
    m, start = example.winch()
    return ncgen.simulate(ncgen.compile(m), 7.0, qd0=start, rtol=1e-11, points=701)


def test_the_clutch_keeps_momentum(run):
    """Common speed J ω/(J + J_L), and ½ J J_L/(J + J_L) ω² are lost."""
    (closes,) = events(run)["clutch", "locks"]
    common = MOTOR * SPEED / (MOTOR + LOAD)
    index = run.kernels.index
    assert closes.t == pytest.approx(CLOSES, rel=1e-12)
    assert [closes.after[index[name]] for name in ("motor.angle", "drum.angle")] == pytest.approx([common, common], rel=1e-12)
    assert closes.after[index["height"]] == pytest.approx(RADIUS * common, rel=1e-12)
    assert closes.energy_lost == pytest.approx(MOTOR * LOAD / (MOTOR + LOAD) * SPEED**2 / 2, rel=1e-11)
    assert run.energy_drift < 1e-10


def lifted() -> tuple[float, float, float]:
    """The velocity (m/s) with which the clutch opens, and when and where the weight turns (s, m)."""
    start, speeding = RADIUS * MOTOR * SPEED / (MOTOR + LOAD), RADIUS * (TORQUE - PULL) / (MOTOR + LOAD)
    speed, falling = math.sqrt(start**2 + 2 * speeding * HEIGHT), RADIUS * PULL / LOAD
    return speed, CLOSES + (speed - start) / speeding + speed / falling, HEIGHT + speed**2 / (2 * falling)


def test_the_ratchet_holds_the_weight(run):
    """It turns where its velocity is used up, and hangs there at rest while the motor runs on."""
    seen, (speed, time, top) = events(run), lifted()
    (opens,), (catches,) = seen["clutch.free", "frees"], seen["ratchet", "catches"]
    index = run.kernels.index
    assert opens.after[index["height"]] == pytest.approx(speed, rel=1e-11)
    assert (catches.t, catches.q[index["height"]]) == pytest.approx((time, top), rel=1e-11)
    hangs = (run.t > time) & (run.t < LETS_DOWN)
    assert np.count_nonzero(hangs) > 50
    assert np.ptp(run["height"][hangs]) < 1e-12 and np.max(np.abs(run["rate(height)"][hangs])) < 1e-12
    assert run["rate(motor.angle)"][-1] == pytest.approx(speed / RADIUS, rel=1e-11)


def test_the_brake_stops_the_weight(run):
    """Eased it lets it fall with R (M − B)/J; pulled again it stops it within (M − B)/(B' − M) of that way, for ever."""
    seen, (_, _, top) = events(run), lifted()
    (pulled,), (sticks,) = seen["brake.pulled", ""], seen["brake", "sticks"]
    inertia = LOAD + WHEEL
    down, up = RADIUS * (PULL - EASED) / inertia, RADIUS * (HOLDS - PULL) / inertia
    speed = math.sqrt(2 * down * (top - LOW))
    assert pulled.t == pytest.approx(LETS_DOWN + speed / down, rel=1e-11)
    assert pulled.before[run.kernels.index["height"]] == pytest.approx(-speed, rel=1e-10)
    assert sticks.t == pytest.approx(pulled.t + speed / up, rel=1e-11)
    distance = (top - LOW) * (PULL - EASED) / (HOLDS - PULL)
    after = run.t > sticks.t
    assert run["height"][after] == pytest.approx(np.full(np.count_nonzero(after), LOW - distance), abs=1e-11)
    assert np.max(np.abs(run["rate(height)"][after])) < 1e-12 and np.ptp(run["height"][after]) < 1e-12


def of(problem, duration: float) -> tuple[Trajectory, dict[tuple[str, str], list]]:
    m, start = problem()
    run = ncgen.simulate(ncgen.compile(m), duration, qd0=start, rtol=1e-11, points=2)
    return run, events(run)


def test_dry_friction_ends_a_motion():
    """Siconos' FrictionOscillator; closed form."""
    run, seen = of(example.oscillator, 30.0)
    assert seen["s.friction", "sticks"][0].t == pytest.approx(22.42355635069909, rel=1e-11)
    assert run["s"][-1] == pytest.approx(1 - (math.sqrt(205) - 14), rel=1e-11)


def test_a_block_on_a_belt():
    """Sticks for 2 (F_s − F_c)/v = 4/3 s from 1 m to 5 m and slips for 2π − 2 atan(2/3) s."""
    run, seen = of(example.belt, 15.0)
    slips, sticks = seen["belt", "slips"], seen["belt", "sticks"]
    place = run.kernels.index["s"]
    assert slips[0].t == pytest.approx(4 / 3, rel=1e-11) and slips[1].t - slips[0].t == pytest.approx(6.440513433417785, rel=1e-11)
    assert [slips[0].q[place], sticks[0].q[place]] == pytest.approx([5.0, 1.0], rel=1e-11)


def test_a_block_rocks_on_its_corners():
    """Housner: ω after an impact is 1 − 3/2 sin² α of that before."""
    run, seen = of(example.rocking, 1.0)
    (hits,), index = seen["A", ""], run.kernels.index
    assert hits.t == pytest.approx(0.4965584599485608, rel=1e-10)

    def turning(q: np.ndarray, qd: np.ndarray) -> float:
        x, y, dx, dy = (v[index[f"B.{c}"]] - v[index[f"A.{c}"]] for v in (q, qd) for c in "xy")
        return (x * dy - y * dx) / 0.4**2

    assert [turning(hits.q, hits.before), turning(hits.q, hits.after)] == pytest.approx([0.4602424499628977, 0.4336900009265767], rel=1e-9)


def test_a_rope_becomes_slack_and_taut():
    """Slack 30° above the middle, and taut again at the bottom, where the radial velocity is lost."""
    run, seen = of(example.rope, 1.4)
    (leaves,), (taut,) = seen["rope", "leaves"], seen["rope", ""]
    assert (leaves.t, leaves.q[1]) == pytest.approx((0.4819942834614219, 0.5), rel=1e-10)
    assert taut.t == pytest.approx(0.4819942834614219 + 0.782061887005775, rel=1e-10)
    assert taut.q == pytest.approx([0.0, -1.0], abs=1e-9) and taut.before[1] == pytest.approx(-5.75402033364499, rel=1e-9)
    assert taut.after == pytest.approx([-1.107361729517505, 0.0], abs=1e-9)


def test_the_script_prints_and_draws(tmp_path, capsys):
    example.main([])
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "0.500000 s  clutch locks" and lines[-1] == "5.814491 s  brake sticks"
    example.main([str(tmp_path / "events.png")])
    data = (tmp_path / "events.png").read_bytes()
    assert data.startswith(b"\x89PNG") and 10_000 < len(data) < 90_000
