"""Numbers of a robot as parameters of its model, where they are asked for, with the values of the file.

Of a link: LINK.mass (kg), LINK.centre.x (m) and so on, LINK.inertia.xx, LINK.inertia.xy (kg m²) and so on: the centre of mass in the
link's frame, the entries of the inertia tensor about the centre of mass along the axes of that frame. Of a joint that moves: JOINT.origin.x
(m) and so on, where its frame is in that of its parent, as URDF says it; which way it is turned stays a number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Mass, Robot
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import AXES, Spatial
from ncgen.model.names import numbered, word
from ncgen.model.values import Scalar

INERTIA, GEOMETRY = "inertia", "geometry"
"""Ask for the parameters of all links that move and have inertia, and of all joints that move."""

ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Of a symmetric tensor, in the order of URDF's xx, yy, zz, xy, xz, yz."""

ROUNDING = 1e-15
"""Cosines that are smaller are 0: what is left of turns by right angles."""


@dataclass(frozen=True, eq=False)
class RigidPart:
    """A link, or several that are fixed to each other. mass: in its own frame; frame: in the world, where all coordinates are 0."""

    name: str
    mass: Mass
    frame: Placement


@dataclass(frozen=True, eq=False)
class Parts:
    """The masses of a body. fixed: numbers, in the world; chosen: those that become parameters."""

    fixed: Mass | None
    chosen: tuple[RigidPart, ...]


def names_of_parameters(parameters: object) -> tuple[str, ...]:
    """What `ncgen.load` is asked to make parameters. Raises ModelError unless it is a word, a name or several of them."""
    names = (parameters,) if isinstance(parameters, str) else parameters
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise ModelError(f'parameters: {shown(parameters)} given; give "{INERTIA}", "{GEOMETRY}", or a list of names of links and joints')
    return tuple(names)


def parts_of(robot: Robot, floating: bool, as_parameters: Sequence[str]) -> dict[str, Parts]:
    """{link that moves by itself: its masses, where some of them become parameters}.

    robot: ordered, with its fixed joints; floating: whether its root moves
    Raises ModelError for a name that is no link and no joint, for a link that rests, and a joint that is fixed.
    """
    homes = homes_of(robot)
    moving = {name: home for name, home in homes.items() if floating or home != robot.root}
    joints = {joint.name: joint for joint in robot.joints}
    for name in as_parameters:
        if name not in (INERTIA, GEOMETRY) and name not in robot.links and name not in joints:
            raise ModelError(
                f'parameters: there is no link or joint {shown(name)}; give "{INERTIA}" (all links), "{GEOMETRY}" (all joints), or names'
            )
        if name in joints and joints[name].kind == "fixed":
            raise ModelError(f"parameters: joint {name} is fixed, so its placement stays a number; leave it out")
        if name in robot.links and name not in moving:
            raise ModelError(f"parameters: link {name} rests, so that its inertia has no effect; leave it out")
    chosen = {name for name in moving if name in as_parameters or (INERTIA in as_parameters and robot.links[name].mass)}
    frames = robot.frames(robot.base)
    parts_by_link: dict[str, Parts] = {}
    for home in {homes[name]: None for name in chosen}:
        fixed: Mass | None = None
        parts = []
        for name in (name for name in moving if homes[name] == home):
            mass, origin = robot.links[name].mass, robot.links[name].origin or Placement()
            if name in chosen:
                part_mass = mass.seen_from(origin.inverse()) if mass else Mass(0.0, np.zeros(3), np.zeros((3, 3)))
                parts.append(RigidPart(name, part_mass, frames[name] @ origin))
            elif mass:
                part_mass = mass.seen_from(frames[name])
                fixed = fixed.plus(part_mass) if fixed else part_mass
        parts_by_link[home] = Parts(fixed, tuple(parts))
    return parts_by_link


def homes_of(robot: Robot) -> dict[str, str]:
    """{link: the link that moves by itself to which it is fixed, or itself}. Joints must be ordered."""
    homes = {robot.root: robot.root}
    for joint in robot.joints:
        homes[joint.child] = homes[joint.parent] if joint.kind == "fixed" else joint.child
    return homes


Shift: TypeAlias = tuple[Scalar, Scalar, Scalar]
"""How far a link is from where the file has it, along the global axes where all coordinates are 0 (m): expressions of parameters."""


def shifts_of(model: Model, robot: Robot, as_parameters: Sequence[str]) -> dict[str, Shift]:
    """{link: its shift} where placements of joints become parameters, which the model gets; empty where none do.

    robot: ordered, with its fixed joints. Raises ModelError for what would not follow them.
    """
    chosen = [joint for joint in robot.joints if joint.kind != "fixed" and (GEOMETRY in as_parameters or joint.name in as_parameters)]
    if not chosen:
        return {}
    lifted = any(link.lifted for link in robot.links.values())
    held = {"loops": robot.loops, "states of its own": robot.starts, "compensated weights": lifted}
    if problem := next((problem_words for problem_words, present in held.items() if present), None):
        raise ModelError(f"parameters: {robot.name} has {problem}, so that placements of its joints stay numbers; leave geometry out")
    frames, none = robot.frames(robot.base), (0.0, 0.0, 0.0)
    shifts: dict[str, Shift] = {robot.root: none}
    for joint in robot.joints:
        x, y, z = shifts[joint.parent]
        if joint in chosen:
            position = joint.placement.position
            names = [f"{word(joint.name, 'joint')}.origin.{axis}" for axis in AXES]
            made = [model.parameter(model.free_name(name), float(at), "m").symbol for name, at in zip(names, position, strict=True)]
            rotation = cleaned(frames[joint.parent].rotation)
            along = [combined(rotation[i], made) - float(rotation[i] @ position) for i in range(3)]
            x, y, z = (a + b for a, b in zip((x, y, z), along, strict=True))
        shifts[joint.child] = x, y, z
    return shifts


def cleaned(rotation: np.ndarray) -> np.ndarray:
    """A rotation without cosines that are rounding."""
    return np.where(np.abs(rotation) < ROUNDING, 0.0, rotation)


def shifted(position: np.ndarray, shift: Shift | None) -> list[Scalar]:
    """A place (3,) that goes with a link."""
    return position.tolist() if shift is None else [float(x) + more for x, more in zip(position, shift, strict=True)]


def add_part(
    model: Model,
    body: Body,
    rigid_part: RigidPart,
    begin: str,
    as_given: Mapping[str, Any],
    shift: Shift | None = None,
    basis: Sequence[Spatial] | None = None,
) -> None:
    """A part's ten parameters, and its mass fixed to a body.

    begin: how their names begin; as_given, basis: as of `m.payload`; shift: of the body
    """
    names = ["mass", *(f"centre.{axis}" for axis in AXES), *(f"inertia.{AXES[i]}{AXES[j]}" for i, j in ENTRIES)]
    first = numbered(begin, lambda wish: any(model.bearer(f"{wish}.{name}") is not None for name in names))
    values = [rigid_part.mass.mass, *rigid_part.mass.com, *(rigid_part.mass.tensor[i, j] for i, j in ENTRIES)]
    units = ["kg", *["m"] * 3, *["kg m2"] * 6]
    made = [model.parameter(f"{first}.{name}", float(value), unit).symbol for name, value, unit in zip(names, values, units, strict=True)]
    rotation = cleaned(rigid_part.frame.rotation)
    com = [x + combined(rotation[i], made[1:4]) for i, x in enumerate(shifted(rigid_part.frame.position, shift))]
    tensor: list[list[Scalar]] = [[0.0] * 3 for _ in AXES]
    for i, j in ENTRIES:
        shares = [rotation[i, k] * rotation[j, l] + (rotation[i, l] * rotation[j, k] if k != l else 0.0) for k, l in ENTRIES]
        tensor[i][j] = tensor[j][i] = combined(np.where(np.abs(shares) < ROUNDING, 0.0, shares), made[4:])
    model.payload(body, rigid_part.name, made[0], com, tensor, basis, **as_given)


def combined(shares: Sequence[float] | np.ndarray, values: Sequence[Scalar]) -> Scalar:
    """Σ share · value, without what has no share."""
    return sum(float(factor) * value if factor != 1.0 else value for factor, value in zip(shares, values, strict=True) if factor)
