"""A winch that lifts, holds and lowers a weight by events, and four published problems with events.

    python examples/winch.py docs/events.png

A motor that turns takes the drum along by a clutch, and the rope on the drum lifts a weight. Where the weight reaches its height, the
clutch opens. The drum turns on until it would turn back; there the ratchet catches it on the wheel of the brake, which holds the weight. A
brake that is eased lets the weight down, and pulled again it stops it. Without the name of a picture the script prints these events.

The published problems: a mass on a spring with dry friction comes to rest for ever; a block on a belt sticks and slips; a block rocks
from corner to corner; a pendulum on a rope falls and swings again.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import ncgen
from ncgen.model.elements import Relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ncgen.solver.trajectories.trajectory import Trajectory

G = 9.81
MOTOR, DRUM, WHEEL = 0.5, 0.3, 0.1
"""Moments of inertia of the winch (kg m²)."""
WEIGHT, RADIUS = 20.0, 0.1
"""Mass of the weight (kg), radius of the drum (m)."""
SPEED, TORQUE = 20.0, 29.62
"""Angular velocity at which the motor turns before it lifts (rad/s), and its torque while it lifts (N m)."""
HOLDS, EASED = 25.62, 16.62
"""Torques of the brake (N m); the weight pulls with 19.62 N m."""
CLOSES, HEIGHT, LETS_DOWN, LOW = 0.5, 1.5, 2.8, 1.0
"""When the clutch closes (s), where it opens (m), when the brake is eased (s), and where it is pulled (m)."""


def winch() -> tuple[ncgen.Model, dict[str, float]]:
    """The winch, whose motor turns, and its velocities."""
    m = ncgen.Model("winch")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)

    def turning(name: str, inertia: float) -> Relative:
        P = m.point(f"{name}.P", (RADIUS, 0))
        m.body(name, [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        return m.angle(f"{name}.angle", x, P - O, z)

    motor, drum, wheel = turning("motor", MOTOR), turning("drum", DRUM), turning("wheel", WHEEL)
    floor, W = m.point("floor", (RADIUS, -3), fixed=True), m.point("W", (RADIUS, -3), fixed="x")
    m.body("weight", [W], mass=WEIGHT)
    height = m.slide("height", floor, W, m.vector("up", (0, 1, 0), fixed=True))
    m.rack(height, drum, RADIUS)
    m.gravity((0, -G))

    torque, brake = m.input("torque", "N m"), m.input("brake", "N m", default=HOLDS)
    m.torque(motor, torque)
    m.clutch(motor, drum, when=CLOSES - m.time, until=HEIGHT - height, name="clutch")
    m.event("motor.on", CLOSES - m.time, do={"torque": TORQUE})
    m.event("motor.off", HEIGHT - height, do={"torque": 0.0})
    m.ratchet(drum, wheel, name="ratchet")
    m.friction(wheel, coulomb=brake, name="brake")
    m.event("brake.eased", LETS_DOWN - m.time, do={"brake": EASED})
    m.event("brake.pulled", height - LOW, do={"brake": HOLDS})
    return m, {"motor.angle": SPEED, "drum.angle": 0.0, "wheel.angle": 0.0}


def mass_on_x(name: str, start: float) -> tuple[ncgen.Model, Relative]:
    """A mass of 1 kg on a spring of 1 N/m along x, from where it starts (m), and its distance from the middle."""
    m = ncgen.Model(name)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (start, 0), fixed="y")
    s = m.slide("s", O, A, m.vector("axis", (1, 0, 0), fixed=True))
    m.body("block", [A], mass=1.0)
    m.torque(s, -s)
    return m, s


def oscillator() -> tuple[ncgen.Model, dict[str, float]]:
    """Siconos' FrictionOscillator, 1 N of friction, and its velocity."""
    m, s = mass_on_x("oscillator", 12.0)
    m.friction(s, coulomb=1.0)
    return m, {"s": 6.0}


def belt() -> tuple[ncgen.Model, dict[str, float]]:
    """A block on a belt of 3 m/s with friction of 5 N where it sticks and 3 N where it slips (as in cardillo), and its velocity."""
    m, s = mass_on_x("belt", 1.0)
    Z, B = m.point("Z", (0, 0), fixed=True), m.point("B", (0, 0), fixed="y")
    m.body("band", [B], mass=1.0)
    band = m.slide("band.way", Z, B, m.vector("along", (1, 0, 0), fixed=True))
    m.drive(band, 3.0 * m.time)
    m.friction(s, coulomb=3.0, static=5.0, other=band, name="belt")
    return m, {"s": 3.0}


def rocking() -> tuple[ncgen.Model, dict[str, float]]:
    """A block of 0.4 m by 2 m that stands on one corner, turned by 0.1 rad (Housner), and its velocities."""
    m = ncgen.Model("rocking")
    up, O, turn, b, h = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), -0.1, 0.2, 1.0
    c, s = math.cos(turn), math.sin(turn)
    A, B = m.point("A", (-2 * b * c, -2 * b * s)), m.point("B", (0, 0))
    block = m.body("block", [A, B], mass=1.0, com=(-b * c - h * s, -b * s + h * c), inertia=(b**2 + h**2) / 3)
    m.gravity((0, -G))
    for corner in (A, B):
        m.contact(corner.name, block, corner, m.ground, O, normal=up, friction=1.0, order="in turn")
    return m, {}


def rope() -> tuple[ncgen.Model, dict[str, float]]:
    """A mass on a rope of 1 m that is pushed at the bottom, so that the rope becomes slack 30° above the middle, and its velocity."""
    m = ncgen.Model("rope")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, -1))
    m.body("bob", [P], mass=1.0)
    m.gravity((0, -G))
    m.rope(O, P, 1.0, name="rope")
    return m, {"P.x": math.sqrt(3.5 * G), "P.y": 0.0}


def moved(problem: Callable[[], tuple[ncgen.Model, dict[str, float]]], duration: float) -> Trajectory:
    """Its motion for so many seconds."""
    m, start = problem()
    return ncgen.simulate(ncgen.compile(m), duration, qd0=start, rtol=1e-10, points=1001)


def draw_winch(place: Axes) -> None:
    """The height of the weight and the velocities of the rope, with what happens."""
    run = moved(winch, 7.0)
    place.plot(run.t, RADIUS * run["rate(motor.angle)"], label="motor (m/s)")
    place.plot(run.t, run["rate(height)"], label="weight (m/s)")
    place.plot(run.t, run["height"], "k", label="height (m)")
    named = [each for each in run.events if each.t > 0 and each.name not in ("motor.on", "motor.off")]
    words = {each.t: f"{each.name.partition('.')[0]} {each.transition or each.name.partition('.')[2]}" for each in reversed(named)}
    for t, text in words.items():
        place.axvline(t, color="grey", linewidth=0.7)
        place.text(t, 2.6, text, rotation=90, ha="right", va="bottom", fontsize=8)
    place.set(title="A winch lifts, holds and lowers", xlabel="t (s)", ylim=(-1.9, 4.9))
    place.legend(frameon=False, loc="lower right", fontsize=8, ncols=3)


def draw(path: str) -> None:
    """Draw what the five do."""
    import matplotlib.pyplot as plt

    figure, places = plt.subplots(1, 5, figsize=(15, 4), layout="constrained", width_ratios=(1.8, 1, 1, 1, 1))
    draw_winch(places[0])
    run = moved(oscillator, 30.0)
    places[1].plot(run.t, run["s"])
    places[1].plot(run.events[-1].t, run["s"][-1], "ko", markersize=4, label=f"rests at {run['s'][-1]:.3f} m")
    places[1].set(title="Dry friction ends a motion", xlabel="t (s)", ylabel="x (m)")
    places[1].legend(frameon=False)
    run = moved(belt, 12.0)
    places[2].plot(run["s"], run["rate(s)"])
    places[2].axhline(3.0, color="grey", linewidth=0.7)
    ends = [each for each in run.events if each.t > 0][:2]
    places[2].plot([run["s"][abs(run.t - each.t).argmin()] for each in ends], [3.0, 3.0], "ko", markersize=4)
    places[2].set(title="A block on a belt", xlabel="x (m)", ylabel="velocity (m/s)")
    places[2].text(3.0, 2.7, "sticks", ha="center", va="top")
    places[2].text(3.0, -3.2, "slips", ha="center", va="bottom")
    run = moved(rocking, 6.0)
    places[3].plot(run.t, [math.atan2(y, x) for x, y in zip(run["B.x"] - run["A.x"], run["B.y"] - run["A.y"], strict=True)])
    places[3].set(title="A block rocks", xlabel="t (s)", ylabel="angle (rad)")
    run = moved(rope, 1.8)
    leaves, taut = (each.t for each in run.events if each.transition == "leaves" or each.impulse)
    slack = (run.t > leaves) & (run.t < taut)
    for part, style in ((run.t <= leaves, "-"), (slack, ":"), (run.t >= taut, "-")):
        places[4].plot(run["P.x"][part], run["P.y"][part], "C0" + style)
    places[4].plot(0, 0, "ko", markersize=4)
    places[4].set(title="A rope, taut and slack", xlabel="x (m)", ylabel="y (m)")
    places[4].set_aspect("equal", adjustable="datalim")
    figure.savefig(path, dpi=80)


def main(arguments: list[str]) -> None:
    """Print the events of the winch, or draw all into a picture of this name."""
    if arguments:
        draw(arguments[0])
        return
    for each in moved(winch, 7.0).events:
        print(f"{each.t:.6f} s  {each.name} {each.transition}".rstrip())


if __name__ == "__main__":
    main(sys.argv[1:])
