"""Mechanisms whose point of support changes at every impact, 50 times; energy through ten thousand impacts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sliding import sliding_block

import ncgen
from examples.impacts import ALPHA, SLOPE, G, rolling, wheel


def test_a_rimless_wheel_walks_down():
    """Hub mass, spokes of 1 m, 2 α apart, slope γ: ω⁺ = ω⁻ cos 2α and ω⁻² = ω⁺² + 4 g sin α sin γ."""
    gain, loss = 4 * G * math.sin(ALPHA) * math.sin(SLOPE), math.cos(2 * ALPHA) ** 2
    kernels = ncgen.compile(wheel())
    speed = 1.3
    run = ncgen.simulate(kernels, 53.0, rtol=1e-11, qd0=rolling(speed))
    steps = [(float(np.hypot(*each.before)), float(np.hypot(*each.after))) for each in run.events][:50]
    assert len(steps) == 50
    for before, after in steps:
        assert before**2 == pytest.approx(speed**2 + gain, rel=1e-9)
        assert after == pytest.approx(before * math.sqrt(loss), rel=1e-9)
        speed = math.sqrt(loss * (speed**2 + gain))
    assert steps[-1] == pytest.approx((1.549218404905459, 1.095462839647657), rel=1e-9)
    times = [each.t for each in run.events]
    assert times[-1] - times[-2] == pytest.approx(1.034549811423279, rel=1e-9)
    assert run.energy_drift < 1e-9
    cycle = 1.095462839647657
    found = ncgen.sensitivities(kernels, 1.05, 420, by="rate(P.x)", z="P.x", zd0={"P.x": cycle * math.cos(SLOPE - ALPHA)})
    (step_by,) = found.events
    multiplier = run.events[-1].after @ step_by.after_by[:, 0] / cycle * math.cos(SLOPE - ALPHA)
    assert multiplier == pytest.approx(loss, rel=1e-8)


def test_a_block_rocks():
    """Housner: half sizes 0.2 m and 1 m; every impact takes 1 − 3/2 sin² α of the angular velocity, as the impulse at the corner says."""
    b, h, theta = 0.2, 1.0, 0.1
    alpha = math.atan2(b, h)
    ratio = 1 - 1.5 * math.sin(alpha) ** 2
    m = ncgen.Model("block")
    stands = m.parameter("stands", 1.0)
    A, B = m.point("A", (-b, 0)), m.point("B", (b, 0))
    m.body("block", [A, B], mass=1.0, com=(0, h), inertia=(b**2 + h**2) / 3)
    m.gravity((0, -G))
    for corner in "xy":
        there, beyond = (getattr(point, corner) for point in (A, B))
        own = b if corner == "x" else 0.0
        m.constrain(stands * (there + own) + (1 - stands) * (beyond - own), f"corner.{corner}")
    m.event("B.lands", when=B.y, do={"stands": 0.0, "rate(B.y)": 0.0})
    m.event("A.lands", when=A.y, do={"stands": 1.0, "rate(A.y)": 0.0})
    kernels = ncgen.compile(m)
    start = {"A.x": -b, "A.y": 0.0, "B.x": -b + 2 * b * math.cos(theta), "B.y": 2 * b * math.sin(theta)}
    run = ncgen.simulate(kernels, 12.0, rtol=1e-12, q0=start)
    impacts, A_y, B_y = run.events[:50], kernels.index["A.y"], kernels.index["B.y"]
    assert len(impacts) == 50 and impacts[0].t == pytest.approx(0.4965584599485608, rel=1e-10)
    speed = 0.4602424499628977
    for each in impacts:
        turning, turned = ((rates[B_y] - rates[A_y]) / (2 * b) for rates in (each.before, each.after))
        assert abs(turning) == pytest.approx(speed, rel=1e-8) and turned == pytest.approx(ratio * turning, rel=1e-9)
        speed *= ratio
    second = ncgen.simulate(kernels, 2.0, rtol=1e-12, q0=start, stop={"rate(A.y)": (0.0, "falling")})
    assert math.asin(second["A.y"][-1] / (2 * b)) == pytest.approx(0.08433802361429504, rel=1e-8)
    assert run.energy_drift < 1e-9


@pytest.mark.slow
def test_energy_through_ten_thousand_impacts():
    """Between two stops, with a spring and friction: energy, losses of impacts and the work of friction add up, and each impact takes
    (1 − e²) of the energy of motion."""
    m, s = sliding_block("between")
    e = 0.99995
    m.torque(s, -4 * s)
    m.stop(s, lower=-0.5, upper=0.5, restitution=e)
    m.friction(s, coulomb=0.01)
    run = ncgen.simulate(ncgen.compile(m), 135.0, rtol=1e-12, qd0={"s": 100.0})
    assert len(run.events) >= 10_000
    rate, place = run["rate(s)"], run["s"]
    energy = rate**2 / 2 + 2 * place**2
    lost = sum(each.energy_lost for each in run.events)
    assert lost == pytest.approx(sum((1 - e**2) * each.before[0] ** 2 / 2 for each in run.events), rel=1e-9)
    way = abs(place[-1] - run.events[-1].q[run.kernels.index["s"]]) + len(run.events) - 0.5
    assert energy[-1] + lost + 0.01 * way == pytest.approx(energy[0], rel=1e-9)
    assert (rate[-1] ** 2 - rate[0] ** 2) / 2 == pytest.approx(run.work[-1], rel=1e-9) and run.energy_drift < 1e-9
