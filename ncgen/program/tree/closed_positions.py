"""Positions of hinges from their angles, body by body outward, in place of a Newton step: exact, and much cheaper.

A hinge of axis n turns the direction a, which its angle is measured from, to b = cos ψ a + sin ψ n × a. With n and n × b it is a frame of
the next body, whose elements are constant combinations of it (natural coordinates of rigid bodies are affine in any of its frames).
Links of loops, whose hinges have no independent angles, take a step of Newton's method over their own coordinates alone, once what they
hang on is placed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ncgen.model.elements import Angle, Combination, Component, Point, Spatial
from ncgen.model.values import is_number
from ncgen.program.algebra.space import Space, Vector
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.newton import newton_program, newton_step
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


class ClosedPositions(NamedTuple):
    """The program; follow_from_angles: whether it leaves nothing but the angles of hinges, from which all positions follow."""

    program: Program
    follow_from_angles: bool


def assemble_closed_positions(
    equations: Terms, split: Split, samples: Sequence[Sample], sizes: np.ndarray, moved: Sequence[int] | None = None
) -> ClosedPositions:
    """The program newton(t, q, p) -> the dependent coordinates; with `moved`, or where not all follow from angles, Δq, then Φ.

    Where every link is on a hinge with an independent angle positions close exactly, and there is no Φ. With `moved` the angles of all
    hinges, if these are enough, stay as they are, whichever coordinates are independent.

    Raises NoRecursion where no link is on such a hinge, and where a part of the others has not as many constraints as coordinates.
    """
    check_samples(equations, samples)
    tree = spanning_tree(equations.model)
    if moved is not None:
        split = _angles_of_hinges(equations, tree, split)
    hinges = hinges_of(equations, tree, split)
    if not hinges:
        raise NoRecursion("no independent coordinate is a hinge's angle")
    lines = Lines(equations)
    placing = Placing(lines, samples, tree, hinges)
    steps = placing.steps(split)
    sampling = Sampling(lines.graph, samples)
    if any(np.max(np.abs(sampling[node])) > POSITION_TOLERANCE * sizes[c] for c, node in steps.items()):
        raise NoRecursion("the bodies' shapes depend on parameters")
    if moved is None and placing.is_exact:
        return ClosedPositions(lines.program("newton", ("t", "q", "p"), [lines.coordinates[c] for c in split.dependent]), True)
    residuals = None if placing.is_exact else Lines(equations, lines.graph).vector(KERNELS["phi"])
    program = newton_program(lines, split, moved, steps, residuals)
    return ClosedPositions(program, len(hinges) == len(split.independent))


def _angles_of_hinges(equations: Terms, tree: Tree, split: Split) -> Split:
    """The angles of all hinges as independent coordinates, in place of others that determine as much; else the split as it is."""
    angles = {e.components[0] for e in equations.model.elements.values() if isinstance(e, Angle)}
    candidates = tuple(c for c, component in enumerate(equations.free) if component in angles)
    hinges = hinges_of(equations, tree, Split(rows=(), dependent=(), independent=candidates)).values()
    independent = sorted({equations.index[hinge.angle.components[0]] for hinge in hinges})
    if len(independent) != len(split.independent):
        return split
    others = tuple(c for c in range(len(equations.free)) if c not in independent)
    return Split(rows=split.rows, dependent=others, independent=tuple(independent))


def hinges_of(equations: Terms, tree: Tree, split: Split) -> dict[int, Hinge]:
    """{link: its hinge} of the links whose joint is one with an independent angle."""
    joints = ((number, _hinge(equations, tree, link, split)) for number, link in enumerate(tree.links))
    return {number: hinge for number, hinge in joints if hinge}


def _hinge(equations: Terms, tree: Tree, link: TreeLink, split: Split) -> Hinge | None:
    """The independent angle of a link's joint, if it has one."""
    if len(link.screws) != 1 or link.screws[0].point is None:
        return None
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
    return None


class Placing:
    """The elements of the tree, link by link. Where they are placed stands for their coordinates, so that rows are those of there.

    is_exact: whether all that was placed follows from angles
    """

    def __init__(self, lines: Lines, samples: Sequence[Sample], tree: Tree, hinges: Mapping[int, Hinge]) -> None:
        self.lines, self.space, self.samples = lines, Space(lines.graph), samples
        self.is_described = is_described(lines.equations, samples[0])
        self.tree, self.hinges, self.left = tree, hinges, set(range(len(tree.links)))
        self.homes = {c: tree.home[element] for c, (element, _) in moving(lines.equations, tree).items()}
        self.known: set[int] = set()
        self.is_exact = True

    def steps(self, split: Split) -> dict[int, int]:
        """{dependent coordinate: node of its Δq}. Links on hinges follow as soon as what carries them is placed, others once none of these
        does, and last what belongs to no link."""
        graph, coordinates = self.lines.graph, self.lines.coordinates
        changes: dict[int, int] = {}
        self.known = set(split.independent)
        while len(changes) < len(split.dependent):
            ready = [k for k in self.left if k in self.hinges and self.tree.links[k].parent not in self.left]
            if ready:
                self.left.remove(min(ready))
                placed = self._turned_by(min(ready))
                steps = {c: graph.sub(node, coordinates[c]) for c, node in placed.items()}
            else:
                steps = self._newton([c for c in split.dependent if c not in changes], split)
                placed = {c: graph.add(coordinates[c], node) for c, node in steps.items()}
            if not self.known.isdisjoint(placed):
                raise NoRecursion("a hinge's angle and a coordinate of its body are independent")
            for c, node in placed.items():
                coordinates[c] = node
            self.known |= placed.keys()
            changes |= steps
        return changes

    def _without_hinges(self) -> set[int]:
        """The links whose joints have no independent angle and hang, one on another, on what is placed."""
        loop: set[int] = set()
        for k in sorted(self.left - self.hinges.keys()):
            parent = self.tree.links[k].parent
            if parent not in self.left or parent in loop:
                loop.add(k)
        return loop

    def _newton(self, unknown: Sequence[int], split: Split) -> dict[int, int]:
        """{coordinate: node of its Δq} of those of links without hinges that have as many rows of nothing else that is not known, or of all
        that are unknown."""
        jacobian = self.lines.matrix(KERNELS["phi_q"])
        columns: dict[int, set[int]] = defaultdict(set)
        for r, c in jacobian:
            columns[r].add(c)

        def rows_of(some: Sequence[int]) -> tuple[int, ...]:
            return tuple(r for r in split.rows if not columns[r].isdisjoint(some) and columns[r] <= self.known.union(some))

        loop = self._without_hinges()
        coordinates = [c for c in unknown if self.homes.get(c) in loop]
        if coordinates and len(rows_of(coordinates)) == len(coordinates):
            unknown, self.left = coordinates, self.left - loop
        if len(rows := rows_of(unknown)) != len(unknown):
            raise NoRecursion(f"{len(unknown)} coordinates of links without independent angles have {len(rows)} constraints")
        self.is_exact = False
        steps = newton_step(self.lines, self.lines.vector(KERNELS["phi"]), jacobian, Split(rows, tuple(unknown), ()), self.samples)
        return dict.fromkeys(unknown, self.lines.graph.const(0.0)) | steps

    def _turned_by(self, number: int) -> dict[int, int]:
        """{coordinate: node} of a link's own elements, which its hinge's angle places."""
        space, graph, index = self.space, self.lines.graph, self.lines.equations.index
        link, hinge = self.tree.links[number], self.hinges[number]
        point = link.screws[0].point
        assert point is not None, "a hinge turns about a point"
        axis, start = self._unit(hinge.angle.axis), self._unit(hinge.start)
        if abs(self._value(space.dot(axis.known, start.known))) > POSITION_TOLERANCE:
            raise NoRecursion(f"{hinge.angle.name} is not measured across its axis")
        sign, component = graph.const(hinge.sign), hinge.angle.components[0]
        psi, turn = graph.load("q", index[component]), self._number(component)
        frame = self._turned(axis.nodes, start.nodes, graph.call("cos", psi), graph.mul(sign, graph.call("sin", psi)))
        known = self._turned(axis.known, start.known, graph.call("cos", turn), graph.mul(sign, graph.call("sin", turn)))
        origin, placed = self._numbers(point), {}
        for element in (e for e, home in self.tree.home.items() if home == number):
            arm = space.sub(self._numbers(element), origin) if isinstance(element, Point) else self._numbers(element)
            parts = [space.times(x, v) for x, v in zip(self._shares(known, arm), frame, strict=True)]
            nodes = space.sum([self._nodes(point), *parts] if isinstance(element, Point) else parts)
            placed |= {index[c]: node for c, node in zip(element.components, nodes, strict=True) if self.lines.equations.moves(c)}
        return placed

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
        x, y, z = map(self._node, element.components)
        return x, y, z

    def _node(self, component: Component) -> int:
        """A coordinate where it is placed, or one that is fixed."""
        equations = self.lines.equations
        if not equations.moves(component):
            return self.lines.value(component.value)
        if equations.index[component] not in self.known:
            raise NoRecursion(f"{component.name} is placed by no hinge before it is needed")
        return self.lines.coordinates[equations.index[component]]

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
            return self.lines.value(float(self.samples[0].q[equations.index[component]]))
        return self.lines.value(component.value if is_number(component.value) else component.initial)


class Unit(NamedTuple):
    """A direction of length 1: now, and in the known position."""

    nodes: Vector
    known: Vector


def is_described(equations: Terms, known: Sample) -> bool:
    """Whether a position is the one that is described, but for rounding."""
    described = np.array([float(component.initial) for component in equations.free])
    return bool(np.all(np.abs(known.q - described) <= DESCRIBED * np.maximum(np.abs(described), 1.0)))
