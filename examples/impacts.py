"""Seven mechanisms that hit something or let go, most of them published: a ball, a rimless wheel, the simplest walker, a slider with
clearance, a cam, a buffer and a screw.

    python examples/impacts.py docs/impacts.png

A ball bounces infinitely often in a finite time. A wheel without a rim and a walker without motors go down a slope in a limit cycle: what
falls gain, impacts take. A slider with clearance rattles between its guides. A follower leaves a cam that turns too fast for its weight. A
compliant buffer takes energy by its damping. A screw holds its load without a couple.
"""

from __future__ import annotations

import math
import sys

import numpy as np

import ncgen
from ncgen.model.elements import Relative

G = 9.81
ALPHA, SLOPE = math.pi / 8, 0.08
"""Half of the angle between the spokes of the wheel, and the slope that it goes down (rad)."""
LIFT, SPEED = 0.005, 1.2 * math.sqrt(G / 0.005)
"""Lift of the cam (m), and its angular velocity: 1.2 times that at which the follower begins to leave it (rad/s)."""
LEAD, RADIUS, LOAD = math.atan(0.05), 0.02, 100.0
"""Lead angle of the screw (rad), radius of its thread (m), what it lifts (N)."""


def ball() -> ncgen.Model:
    """A ball that falls from 1 m and keeps half of its velocity at every impact."""
    m = ncgen.Model("ball")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=0.5))
    return m


def wheel() -> ncgen.Model:
    """A rimless wheel: the mass of its hub on a spoke of 1 m. Where the next spoke hits the slope, it takes over."""
    m = ncgen.Model("wheel")
    x, y = m.parameter("x", 0.0), m.parameter("y", 0.0)
    P = m.point("P", (math.sin(SLOPE - ALPHA), math.cos(SLOPE - ALPHA)))
    m.body("hub", [P], mass=1.0)
    m.gravity((0, -G))
    m.constrain((P.x - x) ** 2 + (P.y - y) ** 2 - 1, "spoke")
    step = 2 * math.sin(ALPHA) * np.array([math.cos(SLOPE), -math.sin(SLOPE)])
    a, b = P.x - x - float(step[0]), P.y - y - float(step[1])
    along = a * P.x.rate + b * P.y.rate
    change = {"x": x + float(step[0]), "y": y + float(step[1]), "rate(P.x)": P.x.rate - along * a, "rate(P.y)": P.y.rate - along * b}
    m.event("step", when=a**2 + b**2 - 1, do=change)
    return m


def rolling(speed: float) -> dict[str, float]:
    """Velocities of the hub just after a step (m/s)."""
    return {"P.x": speed * math.cos(SLOPE - ALPHA), "P.y": -speed * math.sin(SLOPE - ALPHA)}


def walker(slope: float) -> ncgen.Model:
    """The simplest walker (Garcia et al., 1998, 10.1115/1.2798313): a mass on two legs without mass, as the angles of both; g = l = 1.

    Where the swinging foot comes down ahead, the legs change their parts, and cos 2θ of the velocity stays. In passing it goes up.
    """
    import sympy

    m = ncgen.Model("walker")
    points = [m.point(f"A{k}", (x, 0), fixed="y") for k, x in ((1, 0.2), (2, -0.2))]
    for k, point in enumerate(points, 1):
        m.body(f"leg{k}", [point], mass=1.0)
    swinging = m.parameter("swinging", 0.0).symbol  # 0 where the first leg stands, 1 where it swings
    shares = 1 - swinging, swinging
    legs = [point.x for point in points]
    for own, other, share, point in zip(legs, legs[::-1], shares, points, strict=True):
        stands = sympy.sin(own.symbol - slope)
        swings = (sympy.cos(other.symbol - slope) - other.rate**2) * sympy.sin(other.symbol - own.symbol)
        m.force(point, (share * stands + (1 - share) * swings, 0))
    kept = sympy.cos(legs[0].symbol - legs[1].symbol)  # of the velocity; the angles are θ and −θ
    standing = shares[0] * legs[0].rate + shares[1] * legs[1].rate
    rates = {f"rate({leg})": standing * kept * (share * kept + 1 - share) for leg, share in zip(("A1.x", "A2.x"), shares, strict=True)}
    m.event("foot", when=legs[0] + legs[1], do={"swinging": 1 - swinging} | rates)
    return m


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


def turning_crank(crank: float = 150.0, rod: float = -75.0, slider: float = -0.01) -> dict[str, float]:
    """Velocities of that mechanism at the angular velocities (rad/s) of its bodies."""
    rates = {"A.x": 0.0, "A.y": 0.153 * crank, "B.x": 0.0, "B.y": 0.153 * crank + 0.306 * rod}
    for k, (sx, sy) in enumerate(((-1, 1), (1, 1), (-1, -1), (1, -1)), 1):
        rates[f"P{k}.x"], rates[f"P{k}.y"] = -slider * sy * 0.025, rates["B.y"] + slider * sx * 0.05
    return rates


def follower() -> ncgen.Model:
    """A weight that a cam lifts by 5 mm (1 − cos ω t)."""
    import sympy

    m = ncgen.Model("follower")
    P = m.point("P", (0, 0), fixed="x")
    m.body("follower", [P], mass=1.0)
    m.gravity((0, -G))
    m.event("cam", when=P.y - LIFT * (1 - sympy.cos(SPEED * m.time)), do=ncgen.impact())
    return m


def buffered(damping: float = 0.5) -> tuple[ncgen.Model, Relative]:
    """1 kg that a compliant stop at 0.5 m catches (Hunt and Crossley), and how far it is."""
    m = ncgen.Model("buffered")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    s = m.slide("s", O, A, m.vector("axis", (1, 0, 0), fixed=True))
    m.body("block", [A], mass=1.0)
    m.independent(s)
    m.stop(s, upper=0.5, stiffness=1e4, damping=damping, exponent=1.5, name="stop")
    return m, s


def screw(friction: float = 0.1) -> ncgen.Model:
    """A nut that lifts a load along a thread with friction, by a couple."""
    m = ncgen.Model("screw")
    x, axis = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, P, A = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0)), m.point("A", (1, 0), fixed="y")
    turn, lift = m.angle("turn", x, P - O, axis), m.slide("lift", O, A, x)
    m.body("nut", [O, P], mass=1.0, com=(0, 0), inertia=1e-4)
    m.body("load", [A], mass=LOAD / 10)
    thread = m.constrain(math.cos(LEAD) * ((lift - 1) - math.tan(LEAD) * RADIUS * turn), label="thread")
    m.torque(lift, -LOAD)
    m.torque(turn, m.input("couple"))
    ratio, coefficient = -math.tan(LEAD) / RADIUS, friction * RADIUS * math.cos(LEAD)
    m.friction(turn, other=lift, ratio=ratio, coefficient=coefficient, load=thread, name="thread.friction")
    return m


def draw(path: str) -> None:
    """Draw what the seven do."""
    import matplotlib.pyplot as plt

    figure, places = plt.subplots(2, 4, figsize=(15, 7), layout="constrained")
    for place, of in zip(
        places.flat, (draw_ball, draw_wheel, draw_walker, draw_clearance, draw_cam, draw_buffer, draw_screw), strict=False
    ):
        of(place)
    places[1, 3].set_axis_off()
    figure.savefig(path, dpi=80)


def draw_ball(place) -> None:
    """Its height, and where infinitely many bounces end."""
    run = ncgen.simulate(ncgen.compile(ball()), 1.6, points=801)
    place.plot(run.t, run["P.y"])
    place.axvline(run.events[-1].limit, color="grey", linewidth=0.7)
    place.set(title=f"A ball bounces until {run.events[-1].limit:.4f} s", xlabel="t (s)", ylabel="height (m)")


def draw_wheel(place) -> None:
    """The path of its hub, and its spokes just before every step."""
    run = ncgen.simulate(ncgen.compile(wheel()), 4.5, qd0=rolling(1.0955), points=401)
    place.plot(run["P.x"], run["P.y"])
    for k, each in enumerate(run.events):
        foot = 2 * k * math.sin(ALPHA) * np.array([math.cos(SLOPE), -math.sin(SLOPE)])
        ahead = foot + 2 * math.sin(ALPHA) * np.array([math.cos(SLOPE), -math.sin(SLOPE)])
        for end in (foot, ahead):
            place.plot([each.q[0], end[0]], [each.q[1], end[1]], color="grey", linewidth=0.8)
    place.plot([0, 4], [0, -4 * math.tan(SLOPE)], color="black", linewidth=0.8)
    place.set(title="A rimless wheel walks down a slope", xlabel="x (m)", ylabel="y (m)")
    place.set_aspect("equal", adjustable="datalim")


def draw_walker(place) -> None:
    """The angles of its legs."""
    theta, rate = 0.2003109005443, -0.1998324730050
    start = {"A1.x": rate, "A2.x": math.cos(2 * theta) * rate}
    run = ncgen.simulate(ncgen.compile(walker(0.009)), 16.0, q0={"A1.x": theta - 1e-9, "A2.x": -theta}, qd0=start, points=801)
    for leg in (1, 2):
        place.plot(run.t, run[f"A{leg}.x"], label=f"leg {leg}")
    for each in run.events:
        place.axvline(each.t, color="grey", linewidth=0.7)
    place.set(title="The simplest walker", xlabel="t (in √(l/g))", ylabel="angle (rad)")
    place.legend(frameon=False, loc="lower left")


def draw_clearance(place) -> None:
    """How far the slider's corners are from the guide above."""
    run = ncgen.simulate(ncgen.compile(clearance()), 0.04, qd0=turning_crank(), points=2001)
    for corner in (1, 2):
        place.plot(1e3 * run.t, 1e3 * (run[f"P{corner}.y"] - 0.025), label=f"corner {corner}")
    for guide in (-1, 1):
        place.axhline(guide, color="black", linewidth=0.8)
    place.set(title="A slider rattles in its guide", xlabel="t (ms)", ylabel="mm", ylim=(-1.15, 1.5))
    place.legend(frameon=False, loc="upper center", ncols=2)


def draw_cam(place) -> None:
    """The height of the follower and that of the cam."""
    run = ncgen.simulate(ncgen.compile(follower()), 0.25, points=1001)
    place.plot(1e3 * run.t, 1e3 * LIFT * (1 - np.cos(SPEED * run.t)), color="grey", label="cam")
    place.plot(1e3 * run.t, 1e3 * run["P.y"], label="follower")
    place.set(title="A follower leaves its cam", xlabel="t (ms)", ylabel="height (mm)", ylim=(-0.3, 13))
    place.legend(frameon=False, loc="upper center", ncols=2)


def draw_buffer(place) -> None:
    """Force over depth, for three dampings."""
    for damping in (0.0, 0.5, 1.0):
        run = ncgen.simulate(ncgen.compile(buffered(damping)[0]), 0.65, qd0={"s": 1.0}, points=4001)
        depth = np.maximum(run["s"] - 0.5, 0)
        place.plot(1e3 * depth, 1e4 * depth**1.5 * (1 + damping * run["rate(s)"]), label=f"damping {damping:g} s/m")
    place.set(title="A buffer, from 1 m/s", xlabel="depth (mm)", ylabel="force (N)")
    place.legend(frameon=False, loc="upper left")


def draw_screw(place) -> None:
    """How far the load is when the couple grows slowly in either direction."""
    kernels = ncgen.compile(screw())
    for sign in (1, -1):
        run = ncgen.simulate(kernels, 0.6, inputs={"couple": lambda t, sign=sign: sign * t}, points=601)
        place.plot(sign * run.t, 1e3 * (run["lift"] - 1))
    place.axhline(0, color="grey", linewidth=0.7)
    place.set(title="A screw holds its load", xlabel="couple (N m), growing by 1 N m/s", ylabel="lift (mm)", ylim=(-3, 3))


if __name__ == "__main__":
    draw(sys.argv[1])
