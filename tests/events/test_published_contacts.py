"""Mechanisms with contacts that others have published: a slider with clearance, a woodpecker toy, a walker."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen
from examples.contacts import woodpecker

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


def test_a_woodpecker_goes_down_its_pole():
    """Events of the first period, and the limit cycle (Glocker and Studer, ASME DETC2001/VIB-21608; digits by event-driven integration)."""
    m, start = woodpecker()
    run = ncgen.simulate(ncgen.compile(m), 20.0, qd0=start, rtol=1e-11, points=2)
    seen = [(each.name, each.what) for each in run.events[1:6]]
    assert seen == [("lower", "sticks"), ("lower", "slips"), ("lower", "leaves"), ("upper", ""), ("beak", "")]
    expected = [0.021636314053, 0.061213931248, 0.067023398145, 0.077877992290, 0.080988805419]
    assert [each.t for each in run.events[1:6]] == pytest.approx(expected, rel=1e-10)
    sticks = [each for each in run.events if (each.name, each.what) == ("lower", "sticks")]
    periods = np.diff([each.t for each in sticks])
    assert periods[-1] == pytest.approx(0.145976065, abs=1e-9)
    assert 1e3 * (sticks[-2].q[0] - sticks[-1].q[0]) == pytest.approx(19.4453, abs=1e-4)
    assert np.diff(periods)[41] / np.diff(periods)[40] == pytest.approx(-0.8392, abs=1e-3)
    assert run.energy_drift < 1e-8


def walker(slope: float) -> ncgen.Model:
    """The simplest walker: a mass on two legs without mass, as the angles of both, one of which stands (Garcia et al., 1998,
    10.1115/1.2798313; g = l = 1). Where the swinging foot is on the ground ahead, the legs change their parts and cos 2θ of the
    velocity stays; in passing it is ignored."""
    import sympy

    m = ncgen.Model("walker")
    points = [m.point(f"A{k}", (x, 0), fixed="y") for k, x in ((1, 0.2), (2, -0.2))]
    for k, point in enumerate(points, 1):
        m.body(f"leg{k}", [point], mass=1.0)
    part = m.parameter("part", 0.0).symbol  # 0 where the first leg stands
    legs = [point.x for point in points]
    for k, point in enumerate(points):
        own, other = legs[k].symbol, legs[1 - k].symbol
        stands = sympy.sin(own - slope)
        swings = (sympy.cos(other - slope) - legs[1 - k].rate ** 2) * sympy.sin(other - own)
        share = part if k else 1 - part
        m.force(point, (share * stands + (1 - share) * swings, 0))

    def strike(state, kernels):
        first = state.p[kernels.parameters.index("part")]
        stance = int(first)
        theta, rate = state.q[stance], state.qd[stance]
        if theta > -0.05:
            return None  # in passing
        kept = math.cos(2 * theta)
        rates = {stance: kept**2 * rate, 1 - stance: kept * rate}
        return {"part": 1.0 - first} | {f"rate(A{k + 1}.x)": value for k, value in rates.items()}

    m.event("foot", when=legs[0] + legs[1], direction="either", do=strike)
    return m


def steps(kernels: ncgen.Kernels, theta: float, rate: float, count: int) -> list[tuple[float, float, float]]:
    """(time, angle and velocity of the leg that begins to stand) of some steps, after the first strike from such a leg."""
    start = {"A1.x": rate, "A2.x": math.cos(2 * theta) * rate}
    run = ncgen.simulate(kernels, 4.0 * (count + 0.1), q0={"A1.x": theta, "A2.x": -theta}, qd0=start, rtol=1e-11, points=2)
    strikes = [each for each in run.events if np.any(each.before != each.after)][:count]
    places = [1 - k % 2 for k in range(len(strikes))]
    return [(each.t, float(each.q[k]), float(each.after[k])) for each, k in zip(strikes, places, strict=True)]


@pytest.mark.parametrize(
    ("slope", "cycle"),
    [(0.009, (0.2003109005443, -0.1998324730050, 3.882463752851)), (0.004, (0.1533895648762, -0.1560801466757, 3.852613461751))],
)
def test_the_simplest_walker_walks(slope, cycle):
    """To its limit cycle from beside it."""
    kernels = ncgen.compile(walker(slope))
    (before, _, _), (t, theta, rate) = steps(kernels, cycle[0] + 1e-3, cycle[1] - 1e-3, 55)[-2:]
    assert [theta, rate, t - before] == pytest.approx(cycle, rel=1e-9)


def test_the_multipliers_of_the_simplest_walker():
    kernels, (theta, rate) = ncgen.compile(walker(0.009)), (0.2003109005443, -0.1998324730050)
    h, columns = 1e-5, []
    for change in ((h, 0.0), (0.0, h)):
        ends = [np.array(steps(kernels, theta + s * change[0], rate + s * change[1], 1)[0][1:]) for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * h))
    found = sorted(np.linalg.eigvals(np.array(columns).T), key=lambda z: z.imag)
    assert found == pytest.approx([-0.19010 - 0.55760j, -0.19010 + 0.55760j], abs=2e-5)
