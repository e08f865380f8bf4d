"""Models with contacts that have friction, each with the motion that it describes, for tests of exports."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import sympy

import ncgen

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "events"))
sys.path.insert(0, str(ROOT))

from test_contact_impacts import block as plate  # noqa: E402
from test_contacts import RADIUS, G, disc, rod, velocity  # noqa: E402

from examples.contacts import tube, turntable, woodpecker  # noqa: E402
from examples.impacts import clearance, turning_crank  # noqa: E402
from examples.winch import rocking  # noqa: E402

__all__ = ["G", "MODELS", "RADIUS", "SCENES", "described", "disc", "rod", "velocity"]

SPOKE, SLOPE, INERTIA = math.pi / 8, 0.08, 0.1
"""Half the angle between spokes, the slope under the wheel (rad), and its inertia (kg m²); mass and spokes are 1."""


def described(model: ncgen.Model, seconds: float, velocities: dict[str, float] | None = None) -> ncgen.Model:
    """The model with a motion of its own."""
    model.simulation(duration=seconds, **({"qd0": velocities} if velocities else {}))
    return model


def of_example(example: tuple[ncgen.Model, dict[str, float]], seconds: float) -> ncgen.Model:
    """A model with its velocities as an example has them."""
    return described(example[0], seconds, example[1])


def _point_on_ground(name: str, flat: bool = True) -> tuple[ncgen.Model, ncgen.Point, ncgen.Body]:
    m = ncgen.Model(name)
    zero = (0,) * (2 if flat else 3)
    P = m.point("P", zero)
    return m, P, m.body("block", [P], mass=1.0)


def _ground(m: ncgen.Model, flat: bool = True) -> dict[str, object]:
    up = (0, 1) if flat else (0, 0, 1)
    return {"on": m.ground, "at": m.point("O", (0,) * len(up), fixed=True), "normal": m.vector("up", up, fixed=True)}


def incline(tangent: float = 0.6) -> ncgen.Model:
    """A block that slides up an incline of atan(3/4) and stops: for ever where the friction is above 3/4, else it comes down again."""
    m, P, body = _point_on_ground("incline")
    m.gravity((-0.6 * G, -0.8 * G))
    m.contact("slope", body, P, friction=tangent, **_ground(m))
    return described(m, 1.0, {"P.x": 3.0, "P.y": 0.0})


def pushed() -> ncgen.Model:
    """It begins to slide where a push of t N exceeds μ m g."""
    m, P, body = _point_on_ground("pushed")
    m.gravity((0, -G))
    m.force(P, (m.time, 0))
    m.contact("floor", body, P, friction=0.2, **_ground(m))
    return described(m, 3.0)


def across() -> ncgen.Model:
    """A block that is thrown across a slope in space: friction is against a velocity that turns downhill, until it stops."""
    m, P, body = _point_on_ground("across", flat=False)
    m.gravity((G * math.sin(0.3), 0, -G * math.cos(0.3)))
    m.contact("slope", body, P, friction=m.parameter("mu", 1.5 * math.tan(0.3)), **_ground(m, flat=False))
    return described(m, 1.1 * 1.5 * 2.0 / (G * math.sin(0.3) * (1.5**2 - 1)), {"P.x": 0.0, "P.y": 2.0, "P.z": 0.0})


def stirred() -> ncgen.Model:
    """A block in space that a turning force begins to move, in the direction of the force, and moves around."""
    m, P, body = _point_on_ground("stirred", flat=False)
    m.gravity((0, 0, -G))
    m.force(P, (1.5 * m.time * sympy.cos(m.time), 1.5 * m.time * sympy.sin(m.time), 0))
    m.contact("floor", body, P, friction=0.2, **_ground(m, flat=False))
    return described(m, 4.0)


def in_space() -> ncgen.Model:
    """A sphere that slides along a direction between the axes, and rolls."""
    return described(disc(RADIUS, flat=False), 2.0, {"C.x": 5 * math.cos(0.7), "C.y": 5 * math.sin(0.7), "C.z": 0.0})


def bouncing_in_space() -> ncgen.Model:
    """It falls onto the floor with a spin and a velocity, and bounces."""
    m = disc(0.6, flat=False, restitution=0.6)
    return described(m, 1.5, {"C.x": 1.0, "C.y": 0.5, "v.z": 30.0})


def plank() -> ncgen.Model:
    """A cylinder on a plank that is pulled takes a third of its acceleration."""
    m = ncgen.Model("plank")
    up, x = m.vector("up", (0, 1), fixed=True), m.vector("x", (1, 0), fixed=True)
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, 0), fixed="y")
    board = m.body("plank", [P], [up])
    m.drive(m.slide("s", O, P, x), m.time**2)
    C = m.point("C", (0, RADIUS))
    body = m.body("roller", [C, m.point("D", (RADIUS, RADIUS))], mass=1.0, com=(0, RADIUS), inertia=0.5 * RADIUS**2)
    m.gravity((0, -G))
    m.contact("plank", body, C, board, P, radius=RADIUS, normal=up, friction=0.5)
    return described(m, 2.0)


def rim() -> ncgen.Model:
    """A disc that rolls on its rim."""
    from examples.disc.model import MASS, build
    from examples.disc.model import RADIUS as radius

    rolling = build(spokes=0)
    kernels = ncgen.compile(rolling)
    start = dict(zip(kernels.coordinates, ncgen.simulate(kernels, 1e-3, zd0=rolling.simulation_options["zd0"]).qd[0].tolist(), strict=True))
    m = ncgen.Model("rim")
    C = m.point("C", rolling.elements["C"].initial)
    u, v = (m.vector(name, rolling.elements[name].initial) for name in "uv")
    inertia = MASS * radius**2 / 4 * (np.eye(3) + np.outer(u.initial, u.initial))
    body = m.body("disc", [C], [u, v], mass=MASS, inertia=inertia, constant_mass=True)
    m.gravity((0, 0, -G))
    m.contact("rim", body, C, radius=radius, edge=u, friction=100.0, **_ground(m, flat=False))
    return described(m, 0.5, {name: start[name] for name in start if name[0] in "Cuv"})


def wheel() -> ncgen.Model:
    """T7: a rimless wheel of mass 1 and inertia 0.1 on five spokes that stick where they come down, in the frame of the slope."""
    m = ncgen.Model("wheel")
    C = m.point("C", (-math.sin(SPOKE), math.cos(SPOKE)))
    angles = [(2 * k - 1) * SPOKE for k in range(5)]
    tips = [m.point(f"P{k}", (C.initial[0] + math.sin(a), C.initial[1] - math.cos(a))) for k, a in enumerate(angles)]
    body = m.body("wheel", [C, *tips], mass=1.0, com=C.initial[:2], inertia=INERTIA)
    m.gravity((G * math.sin(SLOPE), -G * math.cos(SLOPE)))
    ground, rate = _ground(m), 1.2
    for k, P in enumerate(tips):
        m.contact(f"spoke{k}", body, P, friction=3.0, order="simultaneous", **ground)
    turning = {f"{P.name}.{axis}": rate * side for P in (C, *tips) for axis, side in zip("xy", (P.initial[1], -P.initial[0]), strict=True)}
    return described(m, 2.0, turning)


def toy() -> ncgen.Model:
    """T9: the first twelve events of a woodpecker."""
    return of_example(woodpecker(), 0.125)


def braked() -> ncgen.Model:
    """A cart on a rail with dry friction, on which a block slides, sticks and is taken along."""
    m = ncgen.Model("braked")
    up, x = m.vector("up", (0, 1), fixed=True), m.vector("x", (1, 0), fixed=True)
    O, P, Q = m.point("O", (0, 0), fixed=True), m.point("P", (0, 0), fixed="y"), m.point("Q", (0, 0))
    cart = m.body("cart", [P], [up], mass=2.0)
    s = m.slide("s", O, P, x)
    m.friction(s, coulomb=1.0, static=1.5)
    block = m.body("block", [Q], mass=1.0)
    m.gravity((0, -G))
    m.torque(s, 6.0 * sympy.sin(3 * m.time))
    m.contact("bed", block, Q, cart, P, normal=up, friction=0.1)
    return described(m, 4.0, {"Q.x": 1.0, "Q.y": 0.0, "s": 0.0})


def pressed() -> ncgen.Model:
    """A block on the ground whose slider has friction of the load of its guide."""
    m = ncgen.Model("pressed")
    x, O, A = m.vector("x", (1, 0), fixed=True), m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    P = m.point("P", (1, 1), fixed="")
    s = m.slide("s", O, A, x)
    m.body("slider", [A], mass=2.0)
    m.force(A, (m.time, -3.0))
    m.friction(s, coefficient=0.3, load=m.constrain(A.y, label="guide"), name="guide.friction")
    block = m.body("block", [P], mass=1.0)
    m.gravity((0, -G))
    ground = m.point("F", (0, 1), fixed=True)
    m.contact("floor", block, P, m.ground, ground, normal=m.vector("up", (0, 1), fixed=True), friction=0.1)
    m.spring(A, P, 20.0, free_length=1.0)
    return described(m, 5.0, {"s": 1.0, "A.x": 1.0, "A.y": 0.0, "P.x": 1.0, "P.y": 0.0})


SCENES = {
    "slides and rolls": lambda: described(disc(RADIUS), 2.0, velocity(5.0, 0.0)),
    "spins and drops": lambda: described(disc(1.0), 1.0, velocity(0.0, 50.0)),
    "rolls at once": lambda: described(disc(1.0), 1.0, velocity(0.0, 10.0)),
    "up an incline and down": incline,
    "up an incline and stops": lambda: incline(0.8),
    "pushed": pushed,
    "turntable": lambda: of_example(turntable((0.5, 0.0), (0.3, 0.1)), 3.0),
    "rim": rim,
    "rocking": lambda: of_example(rocking(), 2.0),
    "rimless wheel": wheel,
    "woodpecker": toy,
}
"""Those of every export."""

MODELS = SCENES | {
    "in space": in_space,
    "bounces in space": bouncing_in_space,
    "across a slope": across,
    "stirred": stirred,
    "plank": plank,
    "tube": lambda: of_example(tube(), 1.0),
    "two tips": lambda: described(plate(order="simultaneous"), 1.0, {"A.x": 1.0, "B.x": 1.0, "A.y": 0.0, "B.y": 0.0}),
    "superball": lambda: described(disc(1.0, friction=2.0, restitution=0.9, tangential=0.8), 2.0, velocity(0.3, 50.0)),
    "clearance": lambda: described(clearance(), 0.006, turning_crank()),
    "braked": braked,
    "friction of a load": pressed,
}
