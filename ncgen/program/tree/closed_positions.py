"""Positions of an open tree of hinges from their angles, body by body outward, in place of a Newton step: exact, and much cheaper.

A hinge of axis n turns the direction a, which its angle is measured from, to b = cos ψ a + sin ψ n × a. With n and n × b it is a frame of
the next body, whose elements are constant combinations of it (natural coordinates of rigid bodies are affine in any of its frames).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.model.elements import Angle, Combination, Component, Point, Spatial
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

    Raises NoRecursion where the dependent coordinates are not those of an open tree of hinges whose angles are independent.
    """
    check_samples(equations, samples)
    tree = spanning_tree(equations.model)
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
        self.placed: dict[Spatial, Vector] = {}
        for number, (link, hinge) in enumerate(zip(tree.links, hinges, strict=True)):
            self._place(link, hinge, [element for element, home in tree.home.items() if home == number])

    def _place(self, link: TreeLink, hinge: Hinge, elements: list[Spatial]) -> None:
        space, graph = self.space, self.lines.graph
        point = link.screws[0].point
        assert point is not None, "a hinge turns about a point"
        turn = self._number(hinge.angle.components[0])
        axis, start = (self._unit(direction) for direction in (hinge.angle.axis, hinge.start))
        across = space.cross(axis[0], start[0])
        psi = graph.load("q", self.lines.equations.index[hinge.angle.components[0]])
        c, s = graph.call("cos", psi), graph.mul(graph.const(hinge.sign), graph.call("sin", psi))
        ahead = space.add(space.times(c, start[0]), space.times(s, across))
        normal_part = space.sub(space.times(c, across), space.times(s, start[0]))
        sideways = np.cross(axis[1], start[1])
        cosine, sine = np.cos(turn), hinge.sign * np.sin(turn)
        frame = np.array([axis[1], cosine * start[1] + sine * sideways, cosine * sideways - sine * start[1]])
        if abs(axis[1] @ start[1]) > POSITION_TOLERANCE:
            raise NoRecursion(f"{hinge.angle.name} is not measured across its axis")
        origin = self._numbers(point)
        for element in elements:
            if element in self.placed:
                continue
            shares = frame @ (self._numbers(element) - (origin if isinstance(element, Point) else 0.0))
            shares[np.abs(shares) < ROUNDING * np.max(np.abs(shares))] = 0.0
            shares = np.where(np.abs(np.abs(shares) - 1.0) < ROUNDING, np.sign(shares), shares)
            parts = [space.times(graph.const(float(x)), v) for x, v in zip(shares, (axis[0], ahead, normal_part), strict=True)]
            self.placed[element] = space.sum([self._nodes(point), *parts] if isinstance(element, Point) else parts)

    def _unit(self, direction: Combination) -> tuple[Vector, np.ndarray]:
        """A direction of length 1: as nodes, and as numbers in the known position."""
        space = self.space
        numbers = sum((float(w) * self._numbers(e) for w, e in direction.terms), np.zeros(3))
        length = float(np.linalg.norm(numbers))
        nodes = space.sum(space.times(self.lines.value(float(w)), self._nodes(e)) for w, e in direction.terms)
        return space.times(self.lines.graph.const(1.0 if abs(length - 1.0) < ROUNDING else 1.0 / length), nodes), numbers / length

    def _nodes(self, element: Spatial) -> Vector:
        if element in self.placed:
            return self.placed[element]
        if not element.fixed:
            raise NoRecursion(f"{element.name} is placed by no hinge before it is needed")
        x, y, z = (self.lines.value(component.value) for component in element.components)
        return x, y, z

    def _numbers(self, element: Spatial) -> np.ndarray:
        return np.array([self._number(component) for component in element.components])

    def _number(self, component: Component) -> float:
        """A coordinate in the known position."""
        equations = self.lines.equations
        return float(self.known.q[equations.index[component]]) if equations.moves(component) else component.initial
