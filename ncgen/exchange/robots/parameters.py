"""Numbers of a robot as parameters of its model, where they are asked for, with the values of the file.

Of a link: LINK.mass (kg), LINK.centre.x (m) and so on, LINK.inertia.xx, LINK.inertia.xy (kg m²) and so on: the centre of mass in the
link's frame, the entries of the inertia tensor about the centre of mass along the axes of that frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Mass, Robot
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import AXES
from ncgen.model.names import numbered
from ncgen.model.values import Scalar

INERTIA = "inertia"
"""Asks for the parameters of all links that move and have inertia."""

ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Of a symmetric tensor, in the order of URDF's xx, yy, zz, xy, xz, yz."""

ROUNDING = 1e-15
"""Cosines that are smaller are 0: what is left of turns by right angles."""


@dataclass(frozen=True, eq=False)
class Part:
    """A link, or several that are fixed to each other. mass: in its own frame; frame: in the world, where all coordinates are 0."""

    name: str
    mass: Mass
    frame: Placement


@dataclass(frozen=True, eq=False)
class Parts:
    """The masses of a body. fixed: numbers, in the world; chosen: those that become parameters."""

    fixed: Mass | None
    chosen: tuple[Part, ...]


def names_asked(parameters: object) -> tuple[str, ...]:
    """What `ncgen.load` is asked to make parameters. Raises ModelError unless it is a word, a name or several of them."""
    asked = (parameters,) if isinstance(parameters, str) else parameters
    if not isinstance(asked, Sequence) or not all(isinstance(name, str) for name in asked):
        raise ModelError(f'parameters: {shown(parameters)} given; give "{INERTIA}", or a list of names of links')
    return tuple(asked)


def parts_of(robot: Robot, floating: bool, asked: Sequence[str]) -> dict[str, Parts]:
    """{link that moves by itself: its masses, where some of them become parameters}.

    robot: ordered, with its fixed joints; floating: whether its root moves
    Raises ModelError for a name that is no link, or a link that rests.
    """
    homes = homes_of(robot)
    moving = {name: home for name, home in homes.items() if floating or home != robot.root}
    for name in asked:
        if name != INERTIA and name not in robot.links:
            raise ModelError(f'parameters: there is no link {shown(name)}; give "{INERTIA}" for all links, or names of links')
        if name in robot.links and name not in moving:
            raise ModelError(f"parameters: link {name} rests, so that its inertia has no effect; leave it out")
    chosen = {name for name in moving if name in asked or (INERTIA in asked and robot.links[name].mass)}
    frames = robot.frames(robot.base)
    found: dict[str, Parts] = {}
    for home in {homes[name]: None for name in chosen}:
        fixed: Mass | None = None
        parts = []
        for name in (name for name in moving if homes[name] == home):
            mass, origin = robot.links[name].mass, robot.links[name].origin or Placement()
            if name in chosen:
                own = mass.seen_from(origin.inverse()) if mass else Mass(0.0, np.zeros(3), np.zeros((3, 3)))
                parts.append(Part(name, own, frames[name] @ origin))
            elif mass:
                own = mass.seen_from(frames[name])
                fixed = fixed.plus(own) if fixed else own
        found[home] = Parts(fixed, tuple(parts))
    return found


def homes_of(robot: Robot) -> dict[str, str]:
    """{link: the link that moves by itself to which it is fixed, or itself}. Joints must be ordered."""
    homes = {robot.root: robot.root}
    for joint in robot.joints:
        homes[joint.child] = homes[joint.parent] if joint.kind == "fixed" else joint.child
    return homes


def add_part(model: Model, body: Body, part: Part, word: str, as_given: bool) -> None:
    """A part's ten parameters, and its mass fixed to a body. word: how they begin; as_given: whatever its moments of inertia are"""
    names = ["mass", *(f"centre.{axis}" for axis in AXES), *(f"inertia.{AXES[i]}{AXES[j]}" for i, j in ENTRIES)]
    first = numbered(word, lambda wish: any(model.bearer(f"{wish}.{name}") is not None for name in names))
    values = [part.mass.mass, *part.mass.com, *(part.mass.tensor[i, j] for i, j in ENTRIES)]
    units = ["kg", *["m"] * 3, *["kg m2"] * 6]
    made = [model.parameter(f"{first}.{name}", float(value), unit).symbol for name, value, unit in zip(names, values, units, strict=True)]
    rotation = np.where(np.abs(part.frame.rotation) < ROUNDING, 0.0, part.frame.rotation)
    com = [float(part.frame.position[i]) + combined(rotation[i], made[1:4]) for i in range(3)]
    tensor: list[list[Scalar]] = [[0.0] * 3 for _ in AXES]
    for i, j in ENTRIES:
        shares = [rotation[i, k] * rotation[j, l] + (rotation[i, l] * rotation[j, k] if k != l else 0.0) for k, l in ENTRIES]
        tensor[i][j] = tensor[j][i] = combined(np.where(np.abs(shares) < ROUNDING, 0.0, shares), made[4:])
    model.payload(body, part.name, made[0], com, tensor, **({"as_given": True} if as_given else {}))


def combined(shares: Sequence[float] | np.ndarray, values: Sequence[Scalar]) -> Scalar:
    """Σ share · value, without what has no share."""
    return sum(float(share) * value if share != 1.0 else value for share, value in zip(shares, values, strict=True) if share)
