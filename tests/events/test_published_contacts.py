"""Mechanisms with contacts that others have published: a slider with clearance, a woodpecker toy, a walker."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen

G = 9.81


def clearance() -> ncgen.Model:
    """Slider-crank whose slider, 0.1 by 0.05 m, has 1 mm to either guide (Flores, Leine and Glocker, 2010, 10.1007/s11044-009-9178-y)."""
    m = ncgen.Model("clearance")
    crank, rod, a, b = 0.153, 0.306, 0.05, 0.025
    up, down = m.vector("up", (0, 1), fixed=True), m.vector("down", (0, -1), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (crank, 0)), m.point("B", (crank + rod, 0))
    x = crank + rod
    corners = {k: m.point(f"P{k}", (x + sx * a, sy * b)) for k, (sx, sy) in enumerate(((-1, 1), (1, 1), (-1, -1), (1, -1)), 1)}
    top, bottom = m.point("top", (0, b + 0.001), fixed=True), m.point("bottom", (0, -b - 0.001), fixed=True)
    m.body("crank", [O, A], mass=0.038, inertia=7.4e-5)
    m.body("rod", [A, B], mass=0.038, inertia=5.9e-4)
    slider = m.body("slider", [B, *corners.values()], mass=0.076, com=(x, 0), inertia=2.7e-6)
    m.gravity((0, -G))
    for k, P in corners.items():
        at, normal = (top, down) if k < 3 else (bottom, up)
        m.contact(f"corner{k}", slider, P, m.ground, at, normal=normal, friction=0.01, restitution=0.4, order="simultaneous")
    return m


def angles(q: np.ndarray, kernels: ncgen.Kernels) -> np.ndarray:
    """Of crank, rod and slider (rad)."""
    place = {name: q[kernels.index[f"{name}.x"] : kernels.index[f"{name}.x"] + 2] for name in ("A", "B", "P1", "P2")}
    return np.array([math.atan2(*v[::-1]) for v in (place["A"], place["B"] - place["A"], place["P2"] - place["P1"])])


def test_the_first_contact_of_a_slider_with_clearance():
    kernels = ncgen.compile(clearance())
    rates = {"A.x": 0.0, "A.y": 0.153 * 150.0, "B.x": 0.0, "B.y": 0.153 * 150.0 - 0.306 * 75.0}
    start = rates | {f"P{k}.{axis}": 0.0 for k in range(1, 5) for axis in "xy"}
    for k, (sx, sy) in enumerate(((-1, 1), (1, 1), (-1, -1), (1, -1)), 1):
        start[f"P{k}.x"], start[f"P{k}.y"] = 0.01 * sy * 0.025 + rates["B.x"], -0.01 * sx * 0.05 + rates["B.y"]
    run = ncgen.simulate(kernels, 0.05, qd0=start, rtol=1e-11)
    first = run.events[0]
    assert first.name == "corner1" and first.t == pytest.approx(0.00269090364841, rel=1e-10)
    assert angles(first.q, kernels) == pytest.approx([0.355129243, -0.171430644, -2.69090365e-5], rel=1e-8)
    turned = [angles(first.q + h * first.before, kernels) for h in (-1e-7, 1e-7)]
    assert (turned[1] - turned[0]) / 2e-7 == pytest.approx([109.580168, -49.3457894, -0.01], rel=1e-6)
    assert len(run.events) > 10 and run.energy_drift < 1e-8
