"""Where the elements of a tree of bodies are when its joints are turned or slid from the initial position, as nodes.

By exponentials of the screws of the initial position, one after the other from the ground outward.
Source: Lynch & Park, Modern Robotics (2017), section 4.1 (product of exponentials, space form).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

from ncgen.model.elements import Point, Spatial
from ncgen.model.pairs import Screw
from ncgen.program.algebra.space import Space, Vector
from ncgen.program.lines import Lines
from ncgen.symbolic.tree import Tree

UNIT = 1e-14
"""By which the length of an axis may miss 1."""

Frame: TypeAlias = tuple[Vector, Vector, Vector]
"""Nodes of a rotation's columns."""


ANGLE_REGULARISATION = 1e-30
"""Added to the square of an angle (rad²), so that quotients by it have their limits where it is 0."""


class TreePosition:
    """A tree displaced from its initial position; displacements: nodes, one for every screw of the tree.

    Where a joint turns about all axes, its three displacements are a rotation vector. Whatever moves along or about axes that do not turn
    does so in global axes.
    """

    def __init__(self, lines: Lines, tree: Tree, displacements: Sequence[int]) -> None:
        self.lines, self.graph, self.space, self.tree = lines, lines.graph, Space(lines.graph), tree
        self.displacements = displacements
        space = self.space
        self.unturned: Frame = space.constant((1, 0, 0)), space.constant((0, 1, 0)), space.constant((0, 0, 1))
        self._moved: list[tuple[Frame, Vector]] = []
        for number, link in enumerate(tree.links):
            turn, shift = self._moved[link.parent] if link.parent is not None else (self.unturned, space.zero)
            for screw, k in zip(link.screws, tree.rates[number], strict=True):
                if screw.point is None:
                    along = space.times(displacements[k], self._axis(screw))
                    shift = space.add(shift, along if screw.is_constant else self._turned(turn, along))
            turning = self.turning(number)
            if len(turning) == 1:
                turn, shift = self._about_axis(turn, shift, *turning[0])
            elif turning:
                turn, shift = self._about_point(turn, shift, turning)
            self._moved.append((turn, shift))

    def turning(self, link: int) -> list[tuple[Screw, int]]:
        """Screws of a link's joint that turn it, with their numbers: none, one or three."""
        both = zip(self.tree.links[link].screws, self.tree.rates[link], strict=True)
        return [(screw, k) for screw, k in both if screw.point is not None]

    def placed(self, element: Spatial, link: int) -> Vector:
        """An element where it moves with a link."""
        turn, shift = self._moved[link]
        position = self._turned(turn, self.initial(element))
        return self.space.add(position, shift) if isinstance(element, Point) else position

    def initial(self, element: Spatial) -> Vector:
        x, y, z = (self.lines.value(component.value) for component in element.components)
        return x, y, z

    def changed(self, link: int, turning: Vector) -> Vector:
        """How the rotation vector of a link's joint changes where the joint turns like this: J⁻¹ ω, with the left Jacobian J of exp.

        J⁻¹ = 1 − θ×/2 + (1 − (θ/2) cot(θ/2))/θ² θ×θ×
        """
        graph, space = self.graph, self.space
        x, y, z = (self.displacements[k] for _, k in self.turning(link))
        vector: Vector = (x, y, z)
        squared, half = self._halved(vector)
        ratio = graph.div(graph.mul(half, graph.call("cos", half)), graph.call("sin", half))
        factor = graph.div(graph.sub(graph.const(1.0), ratio), squared)
        across = space.cross(vector, turning)
        more = space.times(factor, space.cross(vector, across))
        return space.add(space.sub(turning, space.times(graph.const(0.5), across)), more)

    def _halved(self, vector: Vector) -> tuple[int, int]:
        """The square of a rotation's angle, and half of the angle; more than 0."""
        graph = self.graph
        squared = graph.add(self.space.dot(vector, vector), graph.const(ANGLE_REGULARISATION))
        return squared, graph.mul(graph.const(0.5), graph.call("sqrt", squared))

    def _turning(self, about: Vector, first: int, second: int) -> Callable[[Vector], Vector]:
        """v ↦ v + first about × v + second about × (about × v)."""
        space = self.space

        def turned(v: Vector) -> Vector:
            across = space.cross(about, v)
            return space.sum((v, space.times(first, across), space.times(second, space.cross(about, across))))

        return turned

    def _about_point(self, turn: Frame, shift: Vector, turning: Sequence[tuple[Screw, int]]) -> tuple[Frame, Vector]:
        """1 + sin θ/θ θ× + 2 sin²(θ/2)/θ² θ×θ×, in global axes about the joint's point where it is."""
        space, graph = self.space, self.graph
        x, y, z = (self.displacements[k] for _, k in turning)
        vector: Vector = (x, y, z)
        squared, half = self._halved(vector)
        s, c = graph.call("sin", half), graph.call("cos", half)
        double = graph.mul(graph.const(2.0), s)
        first, second = graph.div(graph.mul(s, c), half), graph.div(graph.mul(double, s), squared)
        turned = self._turning(vector, first, second)
        point = turning[0][0].point
        assert point is not None, "a screw that turns about no point"
        position = space.add(self._turned(turn, self.initial(point)), shift)
        a, b, c_ = (turned(column) for column in turn)
        return (a, b, c_), space.add(position, turned(space.sub(shift, position)))

    def _about_axis(self, turn: Frame, shift: Vector, screw: Screw, k: int) -> tuple[Frame, Vector]:
        """1 + sin φ û× + (1 − cos φ) û× û×, about the screw's point."""
        space, graph = self.space, self.graph
        axis = self._axis(screw)
        size = self._length(axis)
        unit, angle = space.times(graph.div(graph.const(1.0), size), axis), graph.mul(size, self.displacements[k])
        s, c = graph.call("sin", angle), graph.call("cos", angle)
        turned = self._turning(unit, s, graph.sub(graph.const(1.0), c))
        assert screw.point is not None, "a screw that turns about no point"
        point = self.initial(screw.point)
        along = space.sub(point, turned(point))
        first, second, third = (self._turned(turn, turned(column)) for column in self.unturned)
        return (first, second, third), space.add(shift, self._turned(turn, along))

    def _axis(self, screw: Screw) -> Vector:
        return self.space.sum(self.space.times(self.lines.value(w), self.initial(e)) for w, e in screw.axis.terms)

    def _length(self, axis: Vector) -> int:
        """Of an axis; one that is 1 to rounding is."""
        squared = self.space.dot(axis, axis)
        number = self.graph.value(squared)
        if number is None:
            return self.graph.call("sqrt", squared)
        return self.graph.const(1.0 if abs(math.sqrt(number) - 1.0) < UNIT else math.sqrt(number))

    def _turned(self, turn: Frame, v: Vector) -> Vector:
        return self.space.sum(self.space.times(x, column) for x, column in zip(v, turn, strict=True))
