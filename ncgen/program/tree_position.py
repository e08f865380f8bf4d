"""Where the elements of a tree of bodies are when its joints are turned or slid from the initial position, as nodes.

By exponentials of the screws of the initial position, one after the other from the ground outward.
Source: Lynch & Park, Modern Robotics (2017), section 4.1 (product of exponentials, space form).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from ncgen.model.elements import Point, Spatial
from ncgen.program.lines import Lines
from ncgen.program.space import Space, Vector
from ncgen.symbolic.tree import Screw, Tree

UNIT = 1e-14
"""By which the length of an axis may miss 1."""

Frame: TypeAlias = tuple[Vector, Vector, Vector]
"""Nodes of a rotation's columns."""


class TreePosition:
    """A tree displaced from its initial position; displacements: nodes, one for every screw of the tree."""

    def __init__(self, lines: Lines, tree: Tree, displacements: Sequence[int]) -> None:
        self.lines, self.graph, self.space, self.tree = lines, lines.graph, Space(lines.graph), tree
        space = self.space
        self.unturned: Frame = space.constant((1, 0, 0)), space.constant((0, 1, 0)), space.constant((0, 0, 1))
        self._moved: list[tuple[Frame, Vector]] = []
        for link, own in zip(tree.links, tree.rates, strict=True):
            turn, shift = self._moved[link.parent] if link.parent is not None else (self.unturned, space.zero)
            for screw, k in zip(link.screws, own, strict=True):
                more, along = self._exponential(screw, displacements[k])
                shift = space.add(shift, self._turned(turn, along))
                first, second, third = (self._turned(turn, column) for column in more)
                turn = (first, second, third)
            self._moved.append((turn, shift))

    def placed(self, element: Spatial, link: int) -> Vector:
        """An element where it moves with a link."""
        turn, shift = self._moved[link]
        place = self._turned(turn, self.initial(element))
        return self.space.add(place, shift) if isinstance(element, Point) else place

    def initial(self, element: Spatial) -> Vector:
        x, y, z = (self.lines.value(component.value) for component in element.components)
        return x, y, z

    def _exponential(self, screw: Screw, value: int) -> tuple[Frame, Vector]:
        """Rotation, as columns, and translation: 1 + sin φ û× + (1 − cos φ) û× û×, about the screw's point."""
        space, graph = self.space, self.graph
        axis = space.sum(space.times(self.lines.value(w), self.initial(e)) for w, e in screw.axis.terms)
        if screw.point is None:
            return self.unturned, space.times(value, axis)
        size = self._length(axis)
        unit, angle = space.times(graph.div(graph.const(1.0), size), axis), graph.mul(size, value)
        s, c = graph.call("sin", angle), graph.call("cos", angle)
        rest = graph.sub(graph.const(1.0), c)

        def turned(v: Vector) -> Vector:
            across = space.cross(unit, v)
            return space.sum((v, space.times(s, across), space.times(rest, space.cross(unit, across))))

        x, y, z = map(turned, self.unturned)
        point = self.initial(screw.point)
        return (x, y, z), space.sub(point, turned(point))

    def _length(self, axis: Vector) -> int:
        """Of an axis; one that is 1 to rounding is."""
        squared = self.space.dot(axis, axis)
        number = self.graph.value(squared)
        if number is None:
            return self.graph.call("sqrt", squared)
        return self.graph.const(1.0 if abs(math.sqrt(number) - 1.0) < UNIT else math.sqrt(number))

    def _turned(self, turn: Frame, v: Vector) -> Vector:
        return self.space.sum(self.space.times(x, column) for x, column in zip(v, turn, strict=True))
