"""Inertia of the bodies of a tree about one point, and what follows by recursion: mass matrix and forces over the joints' rates.

About the reference point a body has mass m, first moment h and inertia I (h, I of its natural coordinates by constants). With the
twist (ω, v) of the body, v at the reference point, its acceleration (ω̇, a) there without the joints' own accelerations, force and
moment of inertia are

    m a + ω̇ × h + ω × (ω × h),    I ω̇ + ω × I ω + h × a

Bodies beyond a joint add up, and a joint's screw (u, s) needs u · moment + s · force. Its momentum at rate 1, m s + u × h and
I u + h × s of all of them, gives the mass matrix: no transformation between bodies is ever needed.
Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.2; in global axes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ncgen.errors import SingularError
from ncgen.model.elements import Component
from ncgen.program.algebra.elimination import Matrix
from ncgen.program.algebra.space import TENSOR_INDICES, Space, Tensor, Vector
from ncgen.program.tree.tree_motion import Loads, TreeGeometry, TreeVelocity
from ncgen.symbolic.inertia import Exact, StandardInertia, standard_inertia


@dataclass(frozen=True)
class SpatialInertia:
    """Mass, first moment and inertia tensor about the reference point, of one body or of several together."""

    mass: int
    first: Vector
    tensor: Tensor

    def plus(self, space: Space, other: SpatialInertia) -> SpatialInertia:
        return SpatialInertia(
            space.graph.add(self.mass, other.mass), space.add(self.first, other.first), space.plus(self.tensor, other.tensor)
        )

    def shifted(self, space: Space, shift: Vector | None) -> SpatialInertia:
        """The same about a point that is `shift` back from the reference point (Steiner)."""
        if shift is None:
            return self
        graph, moved = space.graph, space.times(self.mass, shift)
        twice = space.sum((self.first, self.first, moved))  # h dᵀ + d hᵀ + m d dᵀ, symmetric, from (2 h + m d) and d
        spread = [
            graph.mul(graph.const(0.5), graph.add(graph.mul(twice[i], shift[j]), graph.mul(twice[j], shift[i]))) for i, j in TENSOR_INDICES
        ]
        return SpatialInertia(self.mass, space.add(self.first, moved), space.plus(self.tensor, space.turning(spread)))

    def momentum(self, space: Space, axis: Vector, lever: Vector) -> tuple[Vector, Vector]:
        """Linear and angular momentum for the screw (axis, lever) at rate 1."""
        linear = space.add(space.times(self.mass, lever), space.cross(axis, self.first))
        return linear, space.add(space.turned(self.tensor, axis), space.cross(self.first, lever))

    def load(self, space: Space, turning: Vector, along: Vector, change: Vector) -> tuple[Vector, Vector]:
        """Force and moment that a body needs. turning: ω; along: a at the reference point; change: ω̇."""
        cross, h = space.cross, self.first
        force = space.sum((space.times(self.mass, along), cross(change, h), cross(turning, cross(turning, h))))
        spin = cross(turning, space.turned(self.tensor, turning))
        return force, space.sum((space.turned(self.tensor, change), spin, cross(h, along)))


def massless(name: str) -> SingularError:
    """The refusal of a mechanism of which nothing resists a motion."""
    return SingularError(f"{name}: a motion of the mechanism has no inertia; give the bodies that move mass")


def nothing(space: Space) -> SpatialInertia:
    return SpatialInertia(space.graph.const(0.0), space.zero, space.empty)


def inertia_of(
    standard: StandardInertia, space: Space, node: Callable[[Component], int], value: Callable[[Exact], int], reference: Vector
) -> SpatialInertia:
    """A body's inertia about the reference point, from its coordinates y and the constants S of natural coordinates:
    h = Σ S₀ₐ yₐ, P = Σ Sₐᵦ yₐ yᵦᵀ and I = tr(P) 1 − P.

    node: of a coordinate; value: of an entry of S
    """
    graph = space.graph
    base, *directions = [_form(space, form, node) for form in standard.directions]
    base = space.sub(base, reference)
    if standard.crossed:
        directions.append(space.cross(directions[0], directions[1]))
    S = [[value(entry) for entry in row] for row in standard.matrix]
    offset = space.sum(space.times(S[0][a], y) for a, y in enumerate(directions, 1))
    first = space.add(offset, space.times(S[0][0], base))
    halves = [space.sum(space.times(S[a][b], y) for b, y in enumerate(directions, 1)) for a in range(1, len(S))]

    def second(i: int, j: int) -> int:
        spread = [graph.mul(y[i], half[j]) for y, half in zip(directions, halves, strict=True)]
        return graph.sum((*spread, graph.mul(offset[i], base[j]), graph.mul(base[i], first[j])))

    xx, yy, zz, xy, xz, yz = (second(i, j) for i, j in TENSOR_INDICES)
    return SpatialInertia(S[0][0], first, space.turning((xx, yy, zz, xy, xz, yz)))


def _form(space: Space, form: tuple[tuple[float, tuple[Component, ...]], ...], node: Callable[[Component], int]) -> Vector:
    """The vector of a linear form of elements."""
    vectors = []
    for weight, components in form:
        x, y, z = map(node, components)
        vectors.append(space.times(space.graph.const(weight), (x, y, z)))
    return space.sum(vectors)


def inertias_of(geometry: TreeGeometry) -> list[SpatialInertia | None]:
    """Of every link about its reference point, None of links without mass."""
    links, lines = geometry.tree.links, geometry.lines
    parameters = lines.equations.model.parameters
    return [
        inertia_of(standard_inertia(link.body, parameters), geometry.space, geometry.node, lines.value, geometry.reference[number])
        if link.body.inertia
        else None
        for number, link in enumerate(links)
    ]


def mass_matrix(geometry: TreeGeometry, inertias: Sequence[SpatialInertia | None]) -> Matrix:
    """Both triangles of the mass matrix over the joints' rates: the momentum of all that a joint carries, against the screws of those that
    carry it."""
    space, links = geometry.space, geometry.tree.links
    composite = [inertia or nothing(space) for inertia in inertias]
    H: Matrix = {}
    for number in reversed(range(len(links))):
        for k in geometry.own[number]:
            at = {number: composite[number].momentum(space, geometry.columns[k].axis, geometry.columns[k].along)}
            chain = geometry.tree.chain(number)
            for inner, outer in zip(chain[-2::-1], chain[:0:-1], strict=True):
                at[inner] = geometry.leaving(outer, at[outer])
            for home, j in ((link, j) for link in chain for j in geometry.own[link] if j <= k):
                (linear, angular), other = at[home], geometry.columns[j]
                H[k, j] = H[j, k] = space.graph.add(space.dot(other.axis, angular), space.dot(other.along, linear))
        if (parent := links[number].parent) is not None:
            composite[parent] = composite[parent].plus(space, composite[number].shifted(space, geometry.shift[number]))
    return H


def needed_loads(
    geometry: TreeGeometry,
    velocity: TreeVelocity,
    inertias: Sequence[SpatialInertia | None],
    gravity: Vector,
    accelerations: Sequence[int] | None = None,
) -> Loads:
    """Force and moment that every link with mass needs against inertia and gravity.

    accelerations: of the joints' rates; None for what is needed without them
    """
    space = geometry.space
    more = geometry.twists(accelerations) if accelerations is not None else [(space.zero, space.zero)] * len(inertias)
    loads: Loads = {}
    for number, (body, (turned, moved)) in enumerate(zip(inertias, more, strict=True)):
        if body is not None:
            (turning, along), (change, lift) = velocity.twists[number], velocity.changes[number]
            lift = space.add(space.sub(lift, gravity), space.cross(turning, along))
            loads[number] = body.load(space, turning, space.add(lift, moved), space.add(change, turned))
    return loads
