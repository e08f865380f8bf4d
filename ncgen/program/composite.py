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

from collections.abc import Callable
from dataclasses import dataclass

from ncgen.errors import SingularError
from ncgen.model.elements import Component
from ncgen.program.space import PLACES, Space, Tensor, Vector
from ncgen.symbolic.inertia import Exact, StandardInertia


@dataclass(frozen=True)
class Inertia:
    """Mass, first moment and inertia tensor about the reference point, of one body or of several together."""

    mass: int
    first: Vector
    tensor: Tensor

    def plus(self, space: Space, other: Inertia) -> Inertia:
        return Inertia(space.graph.add(self.mass, other.mass), space.add(self.first, other.first), space.plus(self.tensor, other.tensor))

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


def nothing(space: Space) -> Inertia:
    return Inertia(space.graph.const(0.0), space.zero, space.empty)


def inertia_of(
    standard: StandardInertia, space: Space, node: Callable[[Component], int], value: Callable[[Exact], int], reference: Vector
) -> Inertia:
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

    xx, yy, zz, xy, xz, yz = (second(i, j) for i, j in PLACES)
    turning = (graph.add(yy, zz), graph.add(xx, zz), graph.add(xx, yy), graph.neg(xy), graph.neg(xz), graph.neg(yz))
    return Inertia(S[0][0], first, turning)


def _form(space: Space, form: tuple[tuple[float, tuple[Component, ...]], ...], node: Callable[[Component], int]) -> Vector:
    """The vector of a linear form of elements."""
    vectors = []
    for weight, components in form:
        x, y, z = map(node, components)
        vectors.append(space.times(space.graph.const(weight), (x, y, z)))
    return space.sum(vectors)
