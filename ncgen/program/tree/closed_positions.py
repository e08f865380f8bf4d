"""Positions of an open tree of hinges from their angles, body by body outward, in place of a Newton step: exact, and much cheaper.

A hinge of axis n turns the direction a, which its angle is measured from, to b = cos ψ a + sin ψ n × a. With n and n × b it is a frame of
the next body, whose elements are constant combinations of it (natural coordinates of rigid bodies are affine in any of its frames).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ncgen.model.elements import Angle, Combination, Component, Point, Spatial
from ncgen.model.values import is_number
from ncgen.program.algebra.space import Space, Vector
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.lines import Lines
from ncgen.program.programs import Split
from ncgen.program.tree.rates import NoRecursion, check_samples
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import Tree, TreeLink, moving, spanning_tree

POSITION_TOLERANCE = 1e-9
"""Natural sizes by which positions may differ from those of samples, and cosines from 0."""

DESCRIBED = 1e-13
"""By which a coordinate of the described position may differ from one that is consistent (m, or a share of it)."""

ROUNDING = 1e-14
"""Shares of a body's frame below this are 0, and 1 or −1 where they differ from that by less."""


@dataclass(frozen=True)
class Hinge:
    """A link's independent angle: from a direction of its parent to one of its own about the axis; sign: of the turn from the one to the
    other."""

    angle: Angle
    start: Combination
    sign: float


def assemble_closed_positions(
    equations: Terms, split: Split, samples: Sequence[Sample], sizes: np.ndarray, moved: Sequence[int] | None = None
) -> Program:
    """The program newton(t, q, p) -> the dependent coordinates; with `moved` Δq of these, which closes exactly, then Φ, which is 0.

    With `moved` the angles of all hinges stay as they are, whichever coordinates are independent.

    Raises NoRecursion where the dependent coordinates are not those of an open tree of hinges whose angles are independent.
    """
    check_samples(equations, samples)
    tree = spanning_tree(equations.model)
    if moved is not None:
        split = _angles_of_hinges(equations, tree, split)
    hinges = hinges_of(equations, tree, split)
    lines = Lines(equations)
    placed = _Placing(lines, samples[0], tree, hinges).placed
    graph = lines.graph
    where, corrections = moving(equations, tree), {}
    for c in split.dependent:
        if c not in where:
            raise NoRecursion(f"{equations.free[c].name} belongs to no body of the tree")
        element, axis = where[c]
        corrections[c] = graph.sub(placed[element][axis], graph.load("q", c))
    sampling = Sampling(graph, samples)
    if any(np.max(np.abs(sampling[node])) > POSITION_TOLERANCE * sizes[c] for c, node in corrections.items()):
        raise NoRecursion("the bodies' shapes depend on parameters")
    zero = graph.const(0.0)
    if moved is None:
        outputs = [placed[element][axis] for element, axis in map(where.__getitem__, split.dependent)]
        return lines.program("newton", ("t", "q", "p"), outputs)
    return lines.draft("newton", ("t", "q", "p"), [*(corrections.get(c, zero) for c in moved), *[zero] * len(equations.rows)])


def _angles_of_hinges(equations: Terms, tree: Tree, split: Split) -> Split:
    """The angles of an open tree's hinges as independent coordinates, in place of others that determine as much."""
    angles = {e.components[0] for e in equations.model.elements.values() if isinstance(e, Angle)}
    candidates = Split(rows=(), dependent=(), independent=tuple(c for c, component in enumerate(equations.free) if component in angles))
    hinges = {equations.index[_hinge(equations, tree, link, candidates).angle.components[0]] for link in tree.links}
    if len(hinges) != len(split.independent):
        raise NoRecursion("not every independent coordinate is a hinge's angle")
    others = tuple(c for c in range(len(equations.free)) if c not in hinges)
    return Split(rows=(), dependent=others, independent=tuple(sorted(hinges)))


def hinges_of(equations: Terms, tree: Tree, split: Split) -> list[Hinge]:
    """One a link. Raises NoRecursion where links are on something else, or where other coordinates are independent, too."""
    hinges = [_hinge(equations, tree, link, split) for link in tree.links]
    if len(hinges) != len(split.independent):
        raise NoRecursion("not every independent coordinate is a hinge's angle")
    return hinges


def _hinge(equations: Terms, tree: Tree, link: TreeLink, split: Split) -> Hinge:
    """The independent angle of a link's joint. Raises NoRecursion where there is none."""
    if len(link.screws) != 1 or link.screws[0].point is None:
        raise NoRecursion(f"{link.body.name} is on no hinge")
    elements = set(link.body.elements)
    carrier = set(tree.links[link.parent].body.elements) if link.parent is not None else set()
    is_still = link.parent is None or link.screws[0].is_constant  # in the plane an angle may be measured from what rests

    def carried(direction: Combination) -> bool:
        return all(e in carrier or (is_still and e.fixed) for e in direction.elements)

    for c in split.independent:
        angle = next((e for e in equations.model.elements.values() if e.components[0] is equations.free[c]), None)
        if not isinstance(angle, Angle) or not carried(angle.axis):
            continue
        if not (link.screws[0].is_constant or set(angle.axis.elements) <= elements):
            continue
        if carried(angle.start) and set(angle.end.elements) <= elements:
            return Hinge(angle, angle.start, 1.0)
        if carried(angle.end) and set(angle.start.elements) <= elements:
            return Hinge(angle, angle.end, -1.0)
    raise NoRecursion(f"{link.body.name}: no independent angle is that of its hinge")


class _Placing:
    """All elements of the tree, link by link; placed: {element: nodes of its components}."""

    def __init__(self, lines: Lines, known: Sample, tree: Tree, hinges: Sequence[Hinge]) -> None:
        self.lines, self.space, self.known = lines, Space(lines.graph), known
        self.is_described = is_described(lines.equations, known)
        self.placed: dict[Spatial, Vector] = {}
        for number, (link, hinge) in enumerate(zip(tree.links, hinges, strict=True)):
            self._place(link, hinge, [element for element, home in tree.home.items() if home == number])

    def _place(self, link: TreeLink, hinge: Hinge, elements: list[Spatial]) -> None:
        space, graph = self.space, self.lines.graph
        point = link.screws[0].point
        assert point is not None, "a hinge turns about a point"
        axis, start = self._unit(hinge.angle.axis), self._unit(hinge.start)
        if abs(self._value(space.dot(axis.known, start.known))) > POSITION_TOLERANCE:
            raise NoRecursion(f"{hinge.angle.name} is not measured across its axis")
        sign = graph.const(hinge.sign)
        psi = graph.load("q", self.lines.equations.index[hinge.angle.components[0]])
        frame = self._turned(axis.nodes, start.nodes, graph.call("cos", psi), graph.mul(sign, graph.call("sin", psi)))
        turn = self._number(hinge.angle.components[0])
        known = self._turned(axis.known, start.known, graph.call("cos", turn), graph.mul(sign, graph.call("sin", turn)))
        origin = self._numbers(point)
        for element in elements:
            if element in self.placed:
                continue
            arm = space.sub(self._numbers(element), origin) if isinstance(element, Point) else self._numbers(element)
            parts = [space.times(x, v) for x, v in zip(self._shares(known, arm), frame, strict=True)]
            self.placed[element] = space.sum([self._nodes(point), *parts] if isinstance(element, Point) else parts)

    def _turned(self, axis: Vector, start: Vector, c: int, s: int) -> tuple[Vector, Vector, Vector]:
        """The frame of a hinge's axis n, b = c a + s n × a, and n × b."""
        space = self.space
        across = space.cross(axis, start)
        return axis, space.add(space.times(c, start), space.times(s, across)), space.sub(space.times(c, across), space.times(s, start))

    def _shares(self, frame: tuple[Vector, Vector, Vector], arm: Vector) -> list[int]:
        """An arm in a frame, both known."""
        shares = [self.space.dot(v, arm) for v in frame]
        largest = max(abs(self._value(node)) for node in shares)
        return [self._rounded(node, largest) for node in shares]

    def _rounded(self, node: int, largest: float) -> int:
        """A share, 0, 1 or −1 where it is that but for rounding."""
        graph, x = self.lines.graph, self._value(node)
        if abs(x) < ROUNDING * largest:
            return graph.const(0.0)
        return graph.const(1.0 if x > 0 else -1.0) if abs(abs(x) - 1.0) < ROUNDING else node

    def _unit(self, direction: Combination) -> Unit:
        space, graph = self.space, self.lines.graph
        weights = [self.lines.value(w) for w, _ in direction.terms]
        elements = [e for _, e in direction.terms]
        known = space.sum(space.times(w, self._numbers(e)) for w, e in zip(weights, elements, strict=True))
        nodes = space.sum(space.times(w, self._nodes(e)) for w, e in zip(weights, elements, strict=True))
        length = graph.call("sqrt", space.dot(known, known))
        if abs(self._value(length) - 1.0) < ROUNDING:
            return Unit(nodes, known)
        shorter = graph.div(graph.const(1.0), length)
        return Unit(space.times(shorter, nodes), space.times(shorter, known))

    def _nodes(self, element: Spatial) -> Vector:
        if element in self.placed:
            return self.placed[element]
        if not element.fixed:
            raise NoRecursion(f"{element.name} is placed by no hinge before it is needed")
        x, y, z = (self.lines.value(component.value) for component in element.components)
        return x, y, z

    def _value(self, node: int) -> float:
        """The number of a known node."""
        value = self.lines.graph.value(node)
        assert value is not None, "a number of the known position"
        return value

    def _numbers(self, element: Spatial) -> Vector:
        x, y, z = map(self._number, element.components)
        return x, y, z

    def _number(self, component: Component) -> int:
        """A coordinate in the known position: as it is described, where that is the known position."""
        equations = self.lines.equations
        if equations.moves(component) and not self.is_described:
            return self.lines.value(float(self.known.q[equations.index[component]]))
        return self.lines.value(component.value if is_number(component.value) else component.initial)


class Unit(NamedTuple):
    """A direction of length 1: now, and in the known position."""

    nodes: Vector
    known: Vector


def is_described(equations: Terms, known: Sample) -> bool:
    """Whether a position is the one that is described, but for rounding."""
    described = np.array([float(component.initial) for component in equations.free])
    return bool(np.all(np.abs(known.q - described) <= DESCRIBED * np.maximum(np.abs(described), 1.0)))
