"""What bodies look like: boxes, cylinders, wheels, polygons, meshes. They are pictures and nothing else: no equation knows them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError, counted, shown
from ncgen.model.arithmetic import dot, norm, product, unit

if TYPE_CHECKING:
    from ncgen.model.bodies import Body
    from ncgen.model.elements import Point
    from ncgen.model.values import Numbers

COLOUR = re.compile("#[0-9a-fA-F]{6}")

QUARTER = 3e-10
"""rad; an angle nearer to quarters of a turn is one, written with ten digits (1.570796327). Axes that are parallel but for the last digits
of a file would be bound by rows that contradict each other by as much."""

PLANE_TOLERANCE = 1e-6
"""How far, over its size, a corner of a polygon may be from its plane."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Solid:
    """A shape that moves with a body.

    kind: box, cylinder, capsule, ellipsoid, wheel, polygon or mesh
    sizes: of a box along its axes; radius and length along its z axis of a cylinder, a capsule (between the middles of its ends) and a
        wheel; radii of an ellipsoid; thickness of a polygon; factors along the axes of a mesh (m)
    position (3,), rotation (3, 3): of its frame in the global one, in the body's initial position; rotation's columns are its axes
    colour: #rrggbb; None for the body's
    corners (N, 3): of a polygon, in the global frame (m); file: of a mesh
    """

    body: Body
    kind: str
    sizes: tuple[float, ...]
    position: np.ndarray
    rotation: np.ndarray
    colour: str | None = None
    corners: np.ndarray | None = None
    file: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Strut:
    """A round bar from a point to another one, however far they are apart.

    length: of its barrel (m), out of which a thinner rod comes; None for a bar of one radius
    """

    start: Point
    end: Point
    radius: float
    length: float | None = None
    colour: str | None = None


def rotation_of(rpy: tuple[float, ...]) -> np.ndarray:
    """The rotation (3, 3) by roll, pitch and yaw (rad) about the fixed axes x, y, z."""
    roll, pitch, yaw = rpy
    return product(product(_about(2, yaw), _about(1, pitch)), _about(0, roll))


def rotation_to(axis: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) that takes z to a direction."""
    x, y, z = unit(axis)
    if z < 0:  # the formula below divides by 1 + z
        upside = np.diag([1.0, -1.0, -1.0])
        return product(upside, rotation_to(np.array([x, -y, -z])))
    return np.array([[1 - x * x / (1 + z), -x * y / (1 + z), x], [-x * y / (1 + z), 1 - y * y / (1 + z), y], [-x, -y, z]])


def normal_of(corners: np.ndarray, where: str) -> np.ndarray:
    """The unit normal (3,) of a polygon (N, 3). Raises ModelError where it has no area or is not flat."""
    around = np.roll(corners, -1, axis=0)
    area = np.cross(corners - corners[0], around - corners[0]).sum(axis=0)
    size = float(np.ptp(corners, axis=0).max())
    if not norm(area) > PLANE_TOLERANCE * size**2:
        raise ModelError(f"{where}: the corners enclose no area; give them in the order in which they stand around it")
    normal = unit(area)
    off = max(abs(dot(corner - corners[0], normal)) for corner in corners)
    if off > PLANE_TOLERANCE * size:
        raise ModelError(f"{where}: a corner is {off:.3g} m off the plane of the others; a polygon is flat")
    return normal


def check_colour(colour: str | None, where: str) -> str | None:
    """A colour as #rrggbb. Raises ModelError for any other text."""
    if colour is not None and not COLOUR.fullmatch(colour):
        raise ModelError(f"{where}, colour: {shown(colour)} given; write it as #rrggbb, such as #d08030")
    return colour


def check_sizes(sizes: Numbers, count: int, where: str, quantity: str) -> tuple[float, ...]:
    """So many positive numbers. Raises ModelError otherwise."""
    if len(sizes) != count:
        raise ModelError(f"{where}: {counted(len(sizes), 'number')} given for the {quantity}; give {count}")
    for size in sizes:
        if not size > 0:
            raise ModelError(f"{where}: the {quantity} is {float(size):g}; give a positive number")
    return tuple(map(float, sizes))


def _about(axis: int, angle: float) -> np.ndarray:
    """A rotation about a coordinate axis; quarters of a turn are exact where the angle is one with the digits that files have."""
    c, s = (0.0 if abs(x) < QUARTER else x for x in (math.cos(angle), math.sin(angle)))
    after, last = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[after, after] = rotation[last, last] = c
    rotation[last, after], rotation[after, last] = s, -s
    return rotation
