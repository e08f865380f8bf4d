"""Four mechanisms that touch, with what their contacts do: a spinning ball that falls, balls on a turntable, a ball in a tube, and a
woodpecker toy.

    python examples/contacts.py docs/contacts.png

A ball that falls while it spins slides until it rolls, which is 2 v/(7 μ g) after the fall for its sliding velocity v. On a turntable it
rolls along a circle with 2/7 of the table's angular velocity, wherever it starts. In a vertical tube it does not fall out, but goes up
again with √(2/7) of the frequency of its revolutions. The woodpecker's sleeve sticks to its pole and slips down a little at every peck,
in a limit cycle.
"""

from __future__ import annotations

import math
import sys

import numpy as np

import ncgen
from ncgen.model.bodies import Body
from ncgen.model.elements import Point

G, RADIUS = 9.81, 0.1
OMEGA, TUBE = 3.0, 0.4
"""Angular velocity of the turntable (rad/s), radius of the tube (m)."""


def sphere(m: ncgen.Model, place: tuple[float, float, float]) -> tuple[Body, Point]:
    """A homogeneous ball of 1 kg and 0.1 m, with the vectors u along x and v along y."""
    C = m.point("C", place)
    return m.body("ball", [C], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=[0.4 * RADIUS**2] * 3), C


def turning(velocity: tuple[float, float, float], spin: tuple[float, float, float]) -> dict[str, float]:
    """Velocities of that ball, its centre's and of u and v at the angular velocity `spin` (rad/s)."""
    rates = {"C": velocity, "u": np.cross(spin, (1, 0, 0)), "v": np.cross(spin, (0, 1, 0))}
    return {f"{name}.{axis}": float(x) for name, vector in rates.items() for axis, x in zip("xyz", vector, strict=True)}


def falling() -> tuple[ncgen.Model, dict[str, float]]:
    """A ball that falls from 1 m while it spins with 50 rad/s, in the plane, and its velocities."""
    m = ncgen.Model("falling")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    C, D = m.point("C", (0, 1)), m.point("D", (RADIUS, 1))
    ball = m.body("ball", [C, D], mass=1.0, com=(0, 1), inertia=0.4 * RADIUS**2)
    m.gravity((0, -G))
    m.contact("floor", ball, C, m.ground, O, radius=RADIUS, normal=up, friction=0.2)
    return m, {"C.x": 0.0, "C.y": 0.0, "D.x": 0.0, "D.y": 50 * RADIUS}


def turntable(place: tuple[float, float], speed: tuple[float, float]) -> tuple[ncgen.Model, dict[str, float]]:
    """A ball that rolls on a table that turns, and its velocities."""
    m = ncgen.Model("turntable")
    n, x = m.vector("n", (0, 0, 1), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
    O, e = m.point("O", (0, 0, 0), fixed=True), m.vector("e", (1, 0, 0), fixed="z")
    table = m.body("table", [O], [n, e])
    m.drive(m.angle("psi", x, e, n), OMEGA * m.time)
    ball, C = sphere(m, (*place, RADIUS))
    m.gravity((0, 0, -G))
    m.contact("table", ball, C, table, O, radius=RADIUS, normal=n, friction=0.5)
    slip = (np.array([-OMEGA * place[1], OMEGA * place[0]]) - speed) / RADIUS  # ω × (−R n) = (−R ω_y, R ω_x)
    return m, turning((*speed, 0.0), (slip[1], -slip[0], 0.0))


def tube(speed: float = 3.0) -> tuple[ncgen.Model, dict[str, float]]:
    """A ball that rolls inside a vertical tube, thrown in horizontally without spin about the radius, and its velocities."""
    m = ncgen.Model("tube")
    axis, O = m.vector("axis", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True)
    ball, C = sphere(m, (TUBE - RADIUS, 0.0, 0.0))
    m.gravity((0, 0, -G))
    m.contact("tube", ball, C, m.ground, O, radius=RADIUS, axis=axis, around=TUBE, inside=True, friction=1.0)
    return m, turning((0.0, speed, 0.0), (0.0, 0.0, -speed / RADIUS))


def woodpecker() -> tuple[ncgen.Model, dict[str, float]]:
    """A toy of Glocker and Studer (ASME DETC2001/VIB-21608), for small angles, and its velocities.

    y of the sleeve, angles a of the sleeve and b of the woodpecker, whose mass is at y + l_M a + l_G b
    """
    sleeve, bird, J_M, J_S = 3e-4, 4.5e-3, 5e-9, 7e-7
    l_M, l_G, h_S, l_S, h_M, r_M, r_O, c = 0.01, 0.015, 0.02, 0.0201, 0.0058, 0.0031, 0.0025, 0.0056
    m = ncgen.Model("woodpecker")
    start = {"y": 0.0, "a": -(r_M - r_O) / h_M, "b": -0.2788}
    start["s"] = l_M * start["a"] + l_G * start["b"]
    points = {name: m.point(name, (x, 0), fixed="y") for name, x in start.items()}
    y, a, b, s = (point.x for point in points.values())
    for (name, point), mass in zip(points.items(), (sleeve, J_M, J_S, bird), strict=True):
        m.body(f"mass_{name}", [point], mass=mass)
    m.constrain(s - y - l_M * a - l_G * b)
    m.force(points["y"], (-sleeve * G, 0))
    m.force(points["s"], (-bird * G, 0))
    m.force(points["a"], (-c * (a - b), 0))
    m.force(points["b"], (-c * (b - a), 0))
    along = y.rate + r_M * a.rate
    m.gap_contact("beak", (l_M + l_G - l_S - r_O) - h_S * b, y.rate + l_M * a.rate + (l_G - l_S) * b.rate, 0.3, 0.5)
    m.gap_contact("lower", (r_M - r_O) + h_M * a, along, 0.3)
    m.gap_contact("upper", (r_M - r_O) - h_M * a, along, 0.3)
    return m, {"y.x": -0.3411, "a.x": 0.0, "b.x": -7.4583, "s.x": -0.3411 - l_G * 7.4583}


def draw(path: str) -> None:
    """Draw what the four do."""
    import matplotlib.pyplot as plt

    figure, places = plt.subplots(1, 4, figsize=(15, 3.8), layout="constrained")
    m, start = falling()
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0=start, points=801)
    arm, rate = run.q[:, 2:] - run.q[:, :2], run.qd[:, 2:] - run.qd[:, :2]
    spin = (arm[:, 0] * rate[:, 1] - arm[:, 1] * rate[:, 0]) / RADIUS
    places[0].plot(run.t, run["rate(C.x)"], label="velocity of the centre")
    places[0].plot(run.t, -spin, label="that of rolling, −ω r")
    for each in run.events:
        places[0].axvline(each.t, color="grey", linewidth=0.7)
    places[0].set(title="A spinning ball falls, slides and rolls", xlabel="t (s)", ylabel="m/s")
    places[0].legend(frameon=False, loc="lower right")
    for place, speed in (((0.5, 0.0), (0.3, 0.1)), ((-0.2, 0.4), (0.0, -0.5)), ((0.0, -0.5), (-0.2, 0.0))):
        m, start = turntable(place, speed)
        run = ncgen.simulate(ncgen.compile(m), 2 * math.pi / (2 * OMEGA / 7), qd0=start, points=301)
        places[1].plot(run["C.x"], run["C.y"])
        places[1].plot(*place, "ko", markersize=4)
    places[1].set(title="On a turntable: 7.33 s a turn", xlabel="x (m)", ylabel="y (m)")
    places[1].set_aspect("equal", adjustable="datalim")
    m, start = tube()
    run = ncgen.simulate(ncgen.compile(m), 3.0, qd0=start, points=601)
    places[2].plot(run.t, run["C.z"], label="height (m)")
    places[2].plot(run.t, run["C.x"], linewidth=0.7, label="x (m)")
    places[2].set(title="In a tube a ball comes up again", xlabel="t (s)", ylim=(-0.55, 0.55))
    places[2].legend(frameon=False)
    m, start = woodpecker()
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0=start, points=4001)
    places[3].plot(run.t, 1e3 * run["y.x"])
    sticks = [each for each in run.events if each.transition == "sticks"]
    places[3].plot([each.t for each in sticks], [1e3 * each.q[0] for each in sticks], "ko", markersize=4, label="sticks")
    places[3].set(title="A woodpecker sticks and slips", xlabel="t (s)", ylabel="height (mm)")
    places[3].legend(frameon=False)
    figure.savefig(path, dpi=80)


if __name__ == "__main__":
    draw(sys.argv[1])
