"""Joints between two bodies: what they share, and rows between them, say how one moves relative to the other.

What two bodies share tells their degrees of freedom: a point 3, a point and a direction 1, a direction 4, two directions 3, nothing 6; in
the
plane a point 1, a direction 2, nothing 3. On a direction that they share a slider has 1 of these, a cylindrical joint 2. Relative to the
ground
held components of a body's points and vectors count, too: a point with a held y goes along x and z.
Source: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody Systems (1994), chapter 2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.model.arithmetic import cross
from ncgen.model.bodies import Body
from ncgen.model.contents import Contents
from ncgen.model.elements import Combination, Constant, Point, Spatial, Vector, as_combination
from ncgen.model.rigid import NORMAL

PARALLEL = 1e-6
"""Sine of the angle below which two directions are one."""

AXES = tuple(as_combination(Constant.of(name, tuple(row))) for name, row in zip("xyz", np.eye(3).tolist(), strict=True))
"""Directions that do not turn."""


SLIDING = {"prismatic": False, "cylindrical": True}
"""Joints along a shared direction, and whether they turn about it."""


@dataclass(frozen=True, eq=False)
class Screw:
    """One freedom of a joint: turning about `axis` through `point`, or moving along `axis` where there is no point."""

    axis: Combination
    point: Point | None = None

    @property
    def is_constant(self) -> bool:
        """True if the axis turns with no body."""
        return all(isinstance(element, Constant) for element in self.axis.elements)


@dataclass(frozen=True, eq=False)
class Slide:
    """What rows say of two bodies that share a direction: one slides along it, on a line through both points; and may turn about it."""

    points: tuple[Point, ...]
    turns: bool
    across: tuple[Combination, ...] = ()
    """Directions that the line is perpendicular to."""


def sliding_of(model: Contents) -> dict[frozenset[Body], Slide]:
    """{two bodies: how one slides along the other}, of the model's sliders and cylindrical joints."""
    bodies = {**model.bodies, model.ground.name: model.ground}
    slides: dict[frozenset[Body], Slide] = {}
    for row in model.rows:
        kind = row.owner.joint
        if kind in SLIDING and isinstance(along := row.arguments.get("a"), Combination):
            pair = frozenset(bodies[name] for name in row.owner.bodies)
            known = slides.setdefault(pair, Slide(tuple(e for e in along.elements if isinstance(e, Point)), True))
            other = row.arguments.get("b")
            across = (*known.across, other) if isinstance(other, Combination) else known.across
            slides[pair] = Slide(known.points, known.turns and SLIDING[kind], across)
    return slides


def joint_between(body: Body, shared: Sequence[Spatial], slide: Slide | None) -> tuple[Screw, ...]:
    """How a body can move where these elements of it are held; slide: what rows say besides."""
    held = next((e for e in shared if isinstance(e, Point)), None)
    point = held or body.points[0]
    directions = own_directions(body, shared)
    if body.frame.planar:
        turns, axes = ([] if directions else [as_combination(NORMAL)]), AXES[:2]
    else:
        turns, axes = ([] if len(directions) > 1 else directions or list(AXES)), AXES
    if slide and held is None and (along := _line(slide, directions)):
        point = next((e for e in slide.points if e in body.elements), point)
        turns, axes = (turns if slide.turns else []), (along,)
    moves = [] if held else [Screw(axis) for axis in axes]
    return (*moves, *(Screw(axis, point) for axis in turns))


def joint_to_ground(body: Body, slide: Slide | None) -> tuple[Screw, ...]:
    """How a body can move relative to the ground, with which it shares what is fixed, and held components of what moves."""
    shared = [e for e in body.elements if e.fixed]
    screws = joint_between(body, shared, slide)
    moves = [screw for screw in screws if screw.point is None]
    if len(moves) != (2 if body.frame.planar else 3):
        return screws
    turns = [screw for screw in screws if screw.point] if not (body.frame.planar and _is_level(body)) else []
    point = max(body.points, key=lambda p: sum(c.fixed for c in p.components))
    components = [screw for screw, component in zip(moves, point.components, strict=False) if not component.fixed]
    return (*components, *(Screw(screw.axis, point) for screw in turns))


def _is_level(body: Body) -> bool:
    """True if a direction of a planar body has a held component, so that the body does not turn."""
    first, *others = body.points
    pairs = [tuple(zip(first.components[:2], other.components[:2], strict=True)) for other in others]
    segments = any(a.fixed and b.fixed for pair in pairs for a, b in pair)
    return segments or any(c.fixed for v in body.vectors if not _is_normal(as_combination(v)) for c in v.components[:2])


def _line(slide: Slide, directions: Sequence[Combination]) -> Combination | None:
    """The direction, of those that are shared, along which a slider goes."""
    if len(directions) == 1:
        return directions[0]
    normals = [a.initial / float(np.linalg.norm(a.initial)) for a in slide.across]
    if len(_independent(normals)) < 2:
        return None
    return next(
        (d for d in directions if all(abs(float(d.initial @ n)) < PARALLEL * float(np.linalg.norm(d.initial)) for n in normals)), None
    )


def _independent(directions: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Up to two of them that are not parallel."""
    independent: list[np.ndarray] = []
    for direction in directions:
        if len(independent) < 2 and all(float(np.linalg.norm(cross(direction, other))) > PARALLEL for other in independent):
            independent.append(direction)
    return independent


def _directions(elements: Iterable[Spatial]) -> list[Combination]:
    """Up to two independent directions among elements: vectors, and segments between points."""
    elements = list(elements)
    points = [e for e in elements if isinstance(e, Point)]
    independent: list[Combination] = []
    vectors = [as_combination(e) for e in elements if isinstance(e, Vector)]
    for direction in (*vectors, *(p - points[0] for p in points[1:])):
        if len(independent) < 2 and _is_new(direction, independent):
            independent.append(direction)
    return independent


def own_directions(body: Body, elements: Iterable[Spatial]) -> list[Combination]:
    """Directions among a body's elements, of a planar one those in its plane."""
    return [d for d in _directions(elements) if not (body.frame.planar and _is_normal(d))]


def _is_new(direction: Combination, directions: Collection[Combination]) -> bool:
    length = float(np.linalg.norm(direction.initial))
    return length > 0 and all(
        float(np.linalg.norm(cross(direction.initial, o.initial))) > PARALLEL * length * float(np.linalg.norm(o.initial))
        for o in directions
    )


def _is_normal(direction: Combination) -> bool:
    return not np.any(direction.initial[:2])
