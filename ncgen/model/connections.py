"""The joints and drivers of a model as objects: what it shares between bodies, and what its constraints connect.

Most joints in natural coordinates are elements that two bodies share, so they are read from the bodies; others are constraints.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from ncgen.model.bodies import Body
from ncgen.model.contents import Contents
from ncgen.model.elements import Point, Spatial
from ncgen.model.pairs import Screw, Slide, joint_between, joint_to_ground, own_directions, sliding_of
from ncgen.model.rows import Row
from ncgen.model.values import as_sympy

if TYPE_CHECKING:
    import sympy

KINDS = {(0, 0): "rigid", (0, 1): "revolute", (0, 3): "spherical", (1, 0): "prismatic", (1, 1): "cylindrical", (2, 1): "planar"}
"""{(translations, rotations) that a joint leaves: its name}."""

WORDS = ("spherical", "revolute", "universal", "cylindrical", "prismatic", "slider", "planar", "screw", "rigid")
"""Methods of a model that join two bodies."""

POINTS = {1: "point_on_line", 2: "point_in_plane"}
"""{translations that a body of one point has: the name of its joint}."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelJoint:
    """A joint of a model.

    kind: "revolute", "spherical" and so on, "joint of 2 degrees of freedom" where it has no name
    bodies: names of the two bodies that it connects, or of one where a constraint names no more
    elements: names of the points and vectors that they share
    constraints: those that belong to the joint itself
    """

    kind: str
    bodies: tuple[str, ...]
    elements: tuple[str, ...] = ()
    constraints: tuple[Row, ...] = ()

    def __repr__(self) -> str:
        at = f" at {', '.join(self.elements)}" if self.elements else ""
        return f"<{self.kind} {'-'.join(self.bodies) or ', '.join(row.label for row in self.constraints)}{at}>"


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelDriver:
    """A driver of a model: coordinate (its name) = law (of time and parameters), which is one constraint."""

    coordinate: str
    law: sympy.Expr
    constraint: Row

    def __repr__(self) -> str:
        return f"<driver {self.coordinate} = {self.law}>"


@dataclass(frozen=True, eq=False)
class _Shared:
    """What two bodies share, how they move relative to each other, and the constraints of joints between them."""

    bodies: tuple[Body, Body]
    elements: tuple[Spatial, ...]
    screws: tuple[Screw, ...]
    rows: tuple[Row, ...]


def joints_of(model: Contents) -> tuple[ModelJoint, ...]:
    """All joints, in the order of the bodies, the ground first.

    Of several bodies on one point there is one joint fewer than bodies, those with the fewest degrees of freedom.
    """
    owned: dict[tuple[str, ...], list[Row]] = {}
    for row in model.rows:
        if row.owner.kind == "joint":
            owned.setdefault(row.owner.bodies or (row.label,), []).append(row)
    slides = sliding_of(model)
    pairs = [*_to_ground(model, owned, slides), *_among_bodies(model, owned, slides)]
    words_by_pair = {
        frozenset(b for b in fact.arguments.values() if isinstance(b, Body)): fact.word for fact in model.facts if fact.word in WORDS
    }
    order = sorted(range(len(pairs)), key=lambda k: (len(pairs[k].screws), frozenset(pairs[k].bodies) not in words_by_pair, k))
    kept: list[int] = []
    holding: dict[Spatial, list[_Shared]] = defaultdict(list)  # by each of their elements
    for k in order:
        elements = pairs[k].elements
        if pairs[k].rows or not _is_implied(pairs[k], holding[elements[0]]):
            kept.append(k)
            for element in elements:
                holding[element].append(pairs[k])
    rest = [ModelJoint(kind=rows[0].owner.joint, bodies=rows[0].owner.bodies, constraints=tuple(rows)) for rows in owned.values()]
    return (*(_joint(pairs[k], words_by_pair.get(frozenset(pairs[k].bodies), "")) for k in sorted(kept)), *rest)


def _to_ground(model: Contents, owned: dict[tuple[str, ...], list[Row]], slides: dict[frozenset[Body], Slide]) -> Iterator[_Shared]:
    for body in model.bodies.values():
        rows = _between(owned, body, model.ground)
        held = tuple(e for e in body.elements if any(c.fixed for c in (e.components[:2] if body.frame.planar else e.components)))
        screws = joint_to_ground(body, slides.get(frozenset({body, model.ground})))
        if rows or any(isinstance(e, Point) for e in held):
            yield _Shared((model.ground, body), held, screws, rows)


def _among_bodies(model: Contents, owned: dict[tuple[str, ...], list[Row]], slides: dict[frozenset[Body], Slide]) -> Iterator[_Shared]:
    rank = {body: k for k, body in enumerate(model.bodies.values())}
    users: dict[Point, list[Body]] = defaultdict(list)  # a direction alone, such as that of parallel axes, is no joint
    for body in rank:
        for point in body.points:
            users[point].append(body)
    moving = [sharing for point, sharing in users.items() if not point.fixed]
    named = [[model.bodies[name] for name in names] for names in owned if len(names) == 2 and set(names) <= set(model.bodies)]
    pairs = {tuple(sorted(pair, key=rank.__getitem__)) for sharing in (*moving, *named) for pair in combinations(sharing, 2)}
    for a, b in sorted(pairs, key=lambda pair: (rank[pair[0]], rank[pair[1]])):
        rows, shared = _between(owned, a, b), tuple(e for e in b.elements if e in a.elements)
        if rows or any(isinstance(e, Point) for e in shared):
            yield _Shared((a, b), shared, joint_between(b, shared, slides.get(frozenset({a, b}))), rows)


def _between(owned: dict[tuple[str, ...], list[Row]], a: Body, b: Body) -> tuple[Row, ...]:
    """The constraints of joints between two bodies, in either order, taken out of `owned`."""
    return tuple(row for key in ((a.name, b.name), (b.name, a.name)) for row in owned.pop(key, ()))


def _is_implied(pair: _Shared, others: list[_Shared]) -> bool:
    """Whether its bodies hang together already, through others that share as much."""
    reached, last = {pair.bodies[0]}, 0
    holding = [other for other in others if set(pair.elements) <= set(other.elements)]
    while len(reached) > last:
        last = len(reached)
        reached |= {body for other in holding if reached & set(other.bodies) for body in other.bodies}
    return pair.bodies[1] in reached


def _joint(pair: _Shared, word: str) -> ModelJoint:
    """word: what the model's user called it, or nothing"""
    body = pair.bodies[1]
    moves = sum(screw.point is None for screw in pair.screws)
    turns = len(pair.screws) - moves
    if word:
        kind = word
    elif pair.rows:
        kind = pair.rows[-1].owner.joint
    elif moves and not own_directions(body, body.elements):  # a single point
        kind = POINTS.get(moves, "free")
    else:
        kind = KINDS.get((moves, turns), f"joint of {len(pair.screws)} degrees of freedom")
        kind = "slider" if body.frame.planar and kind == "cylindrical" else kind
    elements = tuple(dict.fromkeys(element.name for element in pair.elements))
    return ModelJoint(kind=kind, bodies=tuple(each.name for each in pair.bodies), elements=elements, constraints=pair.rows)


def drivers_of(model: Contents) -> tuple[ModelDriver, ...]:
    """All drivers, in the order of their constraints."""
    rows = [row for row in model.rows if row.owner.kind == "driver"]
    coordinates = {component.name: component for component in model.components}
    return tuple(
        ModelDriver(coordinate=row.owner.name, law=as_sympy(coordinates[row.owner.name].symbol) - as_sympy(row.written), constraint=row)
        for row in rows
    )
