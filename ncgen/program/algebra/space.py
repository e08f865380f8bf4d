"""Vectors in space as nodes of a graph, and symmetric tensors; components that are 0 cost nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from ncgen.program.ir.graph import Graph

Vector: TypeAlias = tuple[int, int, int]
"""Nodes of three components along the global axes."""

Tensor: TypeAlias = tuple[int, int, int, int, int, int]
"""Nodes xx, yy, zz, xy, xz, yz of a symmetric tensor."""

TENSOR_INDICES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Where the six nodes of a tensor stand."""


class Space:
    """Products and sums of vectors in one graph."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        none = graph.const(0.0)
        self.zero: Vector = (none, none, none)
        self.empty: Tensor = (none, none, none, none, none, none)

    def constant(self, values: Sequence[float]) -> Vector:
        x, y, z = map(self.graph.const, map(float, values))
        return x, y, z

    def sum(self, vectors: Iterable[Vector]) -> Vector:
        total = self.zero
        for v in vectors:
            total = self.add(total, v)
        return total

    def add(self, a: Vector, b: Vector) -> Vector:
        x, y, z = (self.graph.add(i, j) for i, j in zip(a, b, strict=True))
        return x, y, z

    def sub(self, a: Vector, b: Vector) -> Vector:
        x, y, z = (self.graph.sub(i, j) for i, j in zip(a, b, strict=True))
        return x, y, z

    def times(self, factor: int, a: Vector) -> Vector:
        x, y, z = (self.graph.mul(factor, i) for i in a)
        return x, y, z

    def dot(self, a: Vector, b: Vector) -> int:
        return self.graph.sum(self.graph.mul(i, j) for i, j in zip(a, b, strict=True))

    def cross(self, a: Vector, b: Vector) -> Vector:
        g = self.graph
        x, y, z = (g.sub(g.mul(a[i], b[j]), g.mul(a[j], b[i])) for i, j in ((1, 2), (2, 0), (0, 1)))
        return x, y, z

    def plus(self, a: Tensor, b: Tensor) -> Tensor:
        xx, yy, zz, xy, xz, yz = (self.graph.add(i, j) for i, j in zip(a, b, strict=True))
        return xx, yy, zz, xy, xz, yz

    def turning(self, spread: Sequence[int]) -> Tensor:
        """tr(P) 1 − P, the inertia of what lies as P = Σ m r rᵀ says: nodes xx, yy, zz, xy, xz, yz of it."""
        add, neg = self.graph.add, self.graph.neg
        xx, yy, zz, xy, xz, yz = spread
        return add(yy, zz), add(xx, zz), add(xx, yy), neg(xy), neg(xz), neg(yz)

    def less(self, tensor: Tensor, a: Vector, b: Vector) -> Tensor:
        """The tensor without a bᵀ, of which one is a multiple of the other."""
        xx, yy, zz, xy, xz, yz = (
            self.graph.sub(node, self.graph.mul(a[i], b[j])) for node, (i, j) in zip(tensor, TENSOR_INDICES, strict=True)
        )
        return xx, yy, zz, xy, xz, yz

    def turned(self, tensor: Tensor, a: Vector) -> Vector:
        """The tensor times a vector."""
        xx, yy, zz, xy, xz, yz = tensor
        return self.dot((xx, xy, xz), a), self.dot((xy, yy, yz), a), self.dot((xz, yz, zz), a)
