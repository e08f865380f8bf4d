"""Where bodies are, from their points and vectors: what carries the shapes of a body through a motion.

A frame is made of a point and two directions of the body, by Gram and Schmidt's method: so it is a rotation, whatever a motion's rounding.
The page does the same with the same choice of directions (templates/html/solids.js.jinja).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Vector

Direction = str | tuple[Point, Point] | tuple[float, float, float]
"""A vector's name, from a point to another one, or a direction that does not move."""

LIMIT = 16
"""Elements of a body among which directions are looked for."""


@dataclass(frozen=True, eq=False)
class Carrier:
    """A body's frame. body: its number, None for the ground; origin: None for the ground, whose frame is the global one."""

    body: int | None
    origin: Point | None
    first: Direction
    second: Direction

    def placed(self, points: Mapping[Point, np.ndarray], vectors: Mapping[str, np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
        """Axes as columns (K, 3, 3) and origins (K, 3) of the frame. points, vectors: histories (K, 3)"""
        if self.origin is None:
            return np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))

        def history(direction: Direction) -> np.ndarray:
            if isinstance(direction, str):
                return vectors[direction]
            start, end, *rest = direction
            if isinstance(start, Point) and isinstance(end, Point):
                return points[end] - points[start]
            return np.broadcast_to(np.array(direction, dtype=float), (count, 3))

        e1 = _unit(history(self.first))
        second = history(self.second)
        e2 = _unit(second - (second * e1).sum(axis=1, keepdims=True) * e1)
        return np.stack([e1, e2, np.cross(e1, e2)], axis=2), points[self.origin]


FIXED_DIRECTIONS: tuple[Direction, Direction] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

GROUND = Carrier(None, None, *FIXED_DIRECTIONS)


def carrier_of(body: Body, number: int | None) -> Carrier:
    """The carrier of a body, by its number, or of the ground, which has none: the two of its directions that are farthest from parallel.

    A body of the plane turns about z. A bar in space does not tell how it spins, so a direction that does not move keeps it from spinning.
    """
    if number is None:
        return GROUND
    origin = body.points[0]
    candidates: dict[Direction, np.ndarray] = {
        (origin, point): point.initial - origin.initial
        for point in body.points[1:LIMIT]
        if not np.array_equal(point.initial, origin.initial)
    }
    candidates |= {vector.name: vector.initial for vector in body.vectors[:LIMIT]}
    normals = {direction: value / np.linalg.norm(value) for direction, value in candidates.items()}
    if not normals:
        return Carrier(number, origin, *FIXED_DIRECTIONS)
    if body.frame.planar:
        first = min(normals, key=lambda direction: abs(normals[direction][2]))
        return (
            Carrier(number, origin, first, (0.0, 0.0, 1.0)) if abs(normals[first][2]) < 0.5 else Carrier(number, origin, *FIXED_DIRECTIONS)
        )
    pairs = {pair: float(np.linalg.norm(np.cross(normals[pair[0]], normals[pair[1]]))) for pair in combinations(normals, 2)}
    best = max(pairs, key=lambda pair: pairs[pair], default=None)
    if best is not None and pairs[best] > 1e-3:
        return Carrier(number, origin, *best)
    (first, value), *_ = normals.items()
    x, y, z = np.eye(3)[int(np.argmin(np.abs(value)))].tolist()
    return Carrier(number, origin, first, (x, y, z))


def vectors_of(carrier: Carrier, body: Body) -> list[Vector]:
    """The vectors that a carrier needs."""
    return [vector for vector in body.vectors if vector.name in (carrier.first, carrier.second)]


def _unit(values: np.ndarray) -> np.ndarray:
    return values / np.linalg.norm(values, axis=1, keepdims=True)
