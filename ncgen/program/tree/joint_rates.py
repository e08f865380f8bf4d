"""How fast the joints of a tree turn and slide, from the velocities of all coordinates.

An element e of a link moves with its parent, and relative to it with t_k ẋ_k of every screw k of the joint. What it moves relative to the
parent
gives the rates: of one screw by the element that it moves most, of several by least squares over the link's elements, each with its mass.
An element that rests says so as well: where a loop closes on the ground, it may be all that tells how a link turns about a line.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ncgen.model.elements import Point, Spatial
from ncgen.program.algebra.elimination import Matrix, solve_positive
from ncgen.program.algebra.space import Vector
from ncgen.program.ir.sampling import roughly
from ncgen.program.tree.rates import Rates

CONSTANT = 1e-12
"""What differs less than this between samples, over its size, is the same in all; and what is smaller is 0."""

MASSLESS_FRACTION = 1e-2
"""An element without mass counts as one with this share of the heaviest one's."""


MIN_SQUARED_MOTION = 1e-12
"""The square of what a screw moves an element by, over the element's size, below which the element says nothing of the screw's rate."""


def measured_rates(rates: Rates, masses: Matrix) -> list[int]:
    """Nodes of the free rates; masses: M of all coordinates, as nodes."""
    measured = {k: rates.graph.load("qd", c) for c, k in rates.own.items()}
    joints = _Joints(rates, masses)
    return [measured[k] if k in measured else joints.rate(k) for k in rates.free]


class _Joints:
    """Links whose twists are measured, each when it is first asked for."""

    def __init__(self, rates: Rates, masses: Matrix) -> None:
        self.rates, self.geometry, self.space, self.graph = rates, rates.geometry, rates.geometry.space, rates.graph
        self.link = {k: number for number, numbers in enumerate(self.geometry.own) for k in numbers}
        self.masses = masses
        self.known: dict[int, list[int]] = {}
        self.twists: dict[int | None, tuple[Vector, Vector]] = {None: (self.space.zero, self.space.zero)}

    def rate(self, k: int) -> int:
        number = self.link[k]
        return self._of(number)[k - self.geometry.own[number].start]

    def _of(self, number: int) -> list[int]:
        """The rates of a link's joint."""
        if number not in self.known:
            self.known[number] = self._measured(number)
        return self.known[number]

    def _twist(self, number: int | None) -> tuple[Vector, Vector]:
        """Of a link, None for the ground."""
        if number is not None and number not in self.twists:
            before = self._twist(self.geometry.tree.links[number].parent)
            before = self.geometry.arriving(number, before)
            self.twists[number] = self.geometry.turned(before, zip(self._of(number), self.geometry.own[number], strict=True))
        return self.twists[number]

    def _measured(self, number: int) -> list[int]:
        indices, link = self.geometry.own[number], self.geometry.tree.links[number]
        moved = {e: self.geometry.moved(e, number) for e in link.body.elements}
        moved = {
            e: v
            for e, v in moved.items()
            if not e.fixed or any(self._reach(v[k]) > MIN_SQUARED_MOTION * self._size(e) ** 2 for k in indices)
        }
        weights = self._weights(moved)
        if len(indices) == 1:
            (k,) = indices
            best = max(moved, key=lambda e: weights[e] * self._reach(moved[e][k]))
            moved = {best: moved[best]}
        matrix = {(i, j): self._product(moved, weights, a, b) for i, a in enumerate(indices) for j, b in enumerate(indices[: i + 1])}
        sizes = np.array([np.min(np.abs(self._values(matrix[i, i]))) for i in range(len(indices))])
        for (i, j), node in matrix.items():
            matrix[i, j] = self._plain(node, float(np.sqrt(sizes[i] * sizes[j])))
        offsets = {e: self._relative_velocity(e, number) for e in moved}
        right = [self._sum(weights, {e: self.space.dot(moved[e][k], v) for e, v in offsets.items()}) for k in indices]
        return solve_positive(self.graph, matrix, len(indices), right)

    def _size(self, element: Spatial) -> float:
        """The natural size of an element's coordinates, of one that rests that of its kind."""
        sizes = [float(self.rates.natural[c]) for c, (e, _) in self.rates.where.items() if e is element]
        return max(sizes, default=self.rates.length if isinstance(element, Point) else 1.0)

    def _reach(self, moved: Vector) -> float:
        """How far a screw moves an element at least, squared."""
        return float(np.min(sum(self._values(node) ** 2 for node in moved)))

    def _product(self, moved: dict[Spatial, dict[int, Vector]], weights: dict[Spatial, float], a: int, b: int) -> int:
        return self._sum(weights, {e: self.space.dot(v[a], v[b]) for e, v in moved.items()})

    def _sum(self, weights: dict[Spatial, float], nodes: dict[Spatial, int]) -> int:
        return self.graph.sum(self.graph.mul(self.graph.const(weights[e]), node) for e, node in nodes.items())

    def _plain(self, node: int, size: float) -> int:
        """What numbers and parameters make of a node where they alone do: what it is in the position that is described, if it is that in
        all samples."""
        values = self._values(node)
        described = self.rates.described(node)
        if np.max(np.abs(self._values(described) - values)) > CONSTANT * size:
            return node
        number = self.graph.value(described)
        return self.graph.const(0.0) if number is not None and abs(number) < CONSTANT * size else described

    def _relative_velocity(self, element: Spatial, number: int) -> Vector:
        """An element's velocity without that of the link's parent."""
        twist = self.geometry.arriving(number, self._twist(self.geometry.tree.links[number].parent))
        return self.space.sub(self._velocity(element), self.geometry.carried(element, number, twist))

    def _velocity(self, element: Spatial) -> Vector:
        equations = self.rates.equations
        x, y, z = (self.graph.load("qd", equations.index[c]) if equations.moves(c) else self.graph.const(0.0) for c in element.components)
        return x, y, z

    def _weights(self, elements: Iterable[Spatial]) -> dict[Spatial, float]:
        """Masses of elements in the samples, relative to the heaviest in natural sizes."""
        sizes, masses = {}, {}
        for e in elements:
            indices = [c for c, (element, _) in self.rates.where.items() if element is e]
            sizes[e] = self._size(e) ** 2
            candidates = (float(np.max(self._values(self.masses[c, c]))) for c in indices if (c, c) in self.masses)
            masses[e] = max(candidates, default=0.0) * sizes[e]
        heaviest = max(masses.values()) or 1.0
        return {e: roughly(max(masses[e] / heaviest, MASSLESS_FRACTION) / sizes[e]) for e in sizes}

    def _values(self, node: int) -> np.ndarray:
        return self.rates.sampling[node]
