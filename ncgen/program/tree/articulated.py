"""H ẍ = f for the rates of a tree without forming H: its cost grows with the number of joints and not with its square.

Inward, each joint takes from the inertia beyond it what it does not pass on, A − U Uᵀ/d with U = A s and d = sᵀ U for the screw s; outward,
accelerations follow. A joint of several rates is several joints with nothing between them.
Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 7.2; about one point in global axes, so nothing is transformed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ncgen.program.algebra.space import TENSOR_INDICES, Space, Tensor, Vector
from ncgen.program.tree.composite import SpatialInertia, massless
from ncgen.program.tree.tree_motion import TreeGeometry

Rows: TypeAlias = tuple[Vector, Vector, Vector]


@dataclass(frozen=True)
class Articulated:
    """Inertia of bodies that move relative to each other: angular momentum I ω + B v, linear momentum Bᵀ ω + M v."""

    turning: Tensor
    mixed: Rows
    along: Tensor

    @classmethod
    def of(cls, space: Space, body: SpatialInertia) -> Articulated:
        """That of one body: B is h ×, M its mass."""
        none, (x, y, z), neg, m = space.graph.const(0.0), body.first, space.graph.neg, body.mass
        return cls(body.tensor, ((none, neg(z), y), (z, none, neg(x)), (neg(y), x, none)), (m, m, m, none, none, none))

    def plus(self, space: Space, other: Articulated) -> Articulated:
        x, y, z = (space.add(a, b) for a, b in zip(self.mixed, other.mixed, strict=True))
        return Articulated(space.plus(self.turning, other.turning), (x, y, z), space.plus(self.along, other.along))

    def shifted(self, space: Space, shift: Vector | None) -> Articulated:
        """The same about a point that is `shift` d back from the reference point: B + d × M and I + d × (B + d × M)ᵀ − B d ×."""
        if shift is None:
            return self
        xx, yy, zz, xy, xz, yz = self.along
        along = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        mixed = _transposed([space.add(b, space.cross(shift, m)) for b, m in zip(_transposed(self.mixed), along, strict=True)])
        outer = _transposed([space.cross(shift, row) for row in mixed])
        inner = [space.cross(row, shift) for row in self.mixed]
        more = [space.graph.sub(outer[i][j], inner[i][j]) for i, j in TENSOR_INDICES]
        return Articulated(space.plus(self.turning, (more[0], more[1], more[2], more[3], more[4], more[5])), mixed, self.along)

    def times(self, space: Space, axis: Vector, lever: Vector) -> tuple[Vector, Vector]:
        """Angular and linear momentum for a screw."""
        angular = space.add(space.turned(self.turning, axis), _times(space, self.mixed, lever))
        return angular, space.add(_times(space, _transposed(self.mixed), axis), space.turned(self.along, lever))

    def less(self, space: Space, angular: Vector, linear: Vector, reciprocal: int) -> Articulated:
        """Without what a joint with this momentum does not pass on."""
        turned, moved = space.times(reciprocal, angular), space.times(reciprocal, linear)
        x, y, z = (space.sub(row, space.times(turned[i], linear)) for i, row in enumerate(self.mixed))
        return Articulated(space.less(self.turning, turned, angular), (x, y, z), space.less(self.along, moved, linear))


def _transposed(rows: Sequence[Vector]) -> Rows:
    x, y, z = zip(*rows, strict=True)
    return x, y, z


def _times(space: Space, rows: Rows, vector: Vector) -> Vector:
    x, y, z = (space.dot(row, vector) for row in rows)
    return x, y, z


def accelerations(geometry: TreeGeometry, bodies: Sequence[SpatialInertia | None], right: dict[int, int]) -> dict[int, int]:
    """{rate: ẍ} of H ẍ = right; bodies: the own inertia of every link.

    Raises SingularError where a joint moves nothing.
    """
    space, graph, links = geometry.space, geometry.space.graph, geometry.tree.links
    nothing = (space.zero, space.zero)
    beyond: list[Articulated | None] = [Articulated.of(space, body) if body else None for body in bodies]
    pull = [nothing] * len(links)
    steps: dict[int, tuple[Vector, Vector, int, int]] = {}
    for number in reversed(range(len(links))):
        beyond_joint, (moment, force) = beyond[number], pull[number]
        for k in reversed(geometry.own[number]):
            if beyond_joint is None:
                raise massless(geometry.lines.equations.model.name)
            axis, along = geometry.columns[k].axis, geometry.columns[k].along
            angular, linear = beyond_joint.times(space, axis, along)
            reciprocal = graph.div(graph.const(1.0), graph.add(space.dot(axis, angular), space.dot(along, linear)))
            rest = graph.sub(right[k], graph.add(space.dot(axis, moment), space.dot(along, force)))
            steps[k] = angular, linear, reciprocal, rest
            beyond_joint = beyond_joint.less(space, angular, linear, reciprocal)
            quotient = graph.mul(reciprocal, rest)
            moment, force = space.add(moment, space.times(quotient, angular)), space.add(force, space.times(quotient, linear))
        parent = links[number].parent
        if parent is not None and beyond_joint is not None:
            before, beyond_joint = beyond[parent], beyond_joint.shifted(space, geometry.shift[number])
            beyond[parent] = beyond_joint.plus(space, before) if before else beyond_joint
            force, moment = geometry.leaving(number, (force, moment))
            pull[parent] = space.add(pull[parent][0], moment), space.add(pull[parent][1], force)
    rates_changes: dict[int, int] = {}
    moving = [nothing] * len(links)
    for number, link in enumerate(links):
        turning, lift = geometry.arriving(number, moving[link.parent] if link.parent is not None else nothing)
        for k in geometry.own[number]:
            angular, linear, reciprocal, rest = steps[k]
            known = graph.add(space.dot(angular, turning), space.dot(linear, lift))
            rates_changes[k] = graph.mul(reciprocal, graph.sub(rest, known))
            turning = space.add(turning, space.times(rates_changes[k], geometry.columns[k].axis))
            lift = space.add(lift, space.times(rates_changes[k], geometry.columns[k].along))
        moving[number] = turning, lift
    return rates_changes
