"""How the elements of a tree of bodies move with the rates of its joints, as nodes.

Everything is in global axes about a reference point: the screw of a joint on axis u through r is (u, r × u), a body's twist
(ω, v) the sum of its joints' screws times rates, and an element moves with v + ω × r, or ω × r where it is a vector. The reference
is a point of the tree, taken as if it stood still, so that a mechanism far from the origin loses no digits; nearly always one serves all
links (`ncgen.program.tree.references`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ncgen.model.elements import Combination, Component, Point, Spatial
from ncgen.model.pairs import Screw
from ncgen.program.algebra.space import Space, Vector
from ncgen.program.lines import Lines
from ncgen.program.tree.references import reference_points
from ncgen.symbolic.tree import Tree

Loads: TypeAlias = dict[int, tuple[Vector, Vector]]
"""{link: force, and moment about the reference point}."""


@dataclass(frozen=True)
class TreeColumn:
    """The screw of one rate: axis u (0 of a translation) and s, the velocity at the reference point."""

    axis: Vector
    along: Vector


class TreeGeometry:
    """Screws and levers in a position; rates are numbered as the tree's screws, link by link."""

    def __init__(self, lines: Lines, tree: Tree) -> None:
        self.lines, self.tree, self.space = lines, tree, Space(lines.graph)
        self.reference = [self.vector(point) for point in reference_points(tree, lines.equations.model.parameters)]
        self.shift = [self._shift(number) for number in range(len(tree.links))]
        self.own = tree.rates
        self.columns = [self._column(screw, number) for number, link in enumerate(tree.links) for screw in link.screws]

    def node(self, component: Component) -> int:
        """A coordinate, or the value of a fixed component."""
        lines = self.lines
        if lines.equations.moves(component):
            return lines.graph.load("q", lines.equations.index[component])
        return lines.value(component.value)

    def vector(self, element: Spatial) -> Vector:
        x, y, z = map(self.node, element.components)
        return x, y, z

    def combined(self, combination: Combination, vectors: Mapping[Spatial, Vector] | None = None) -> Vector:
        """A combination of elements, or of vectors that stand for them."""
        space = self.space
        of = self.vector if vectors is None else lambda e: vectors.get(e, space.zero)
        return space.sum(space.times(self.lines.value(weight), of(element)) for weight, element in combination.terms)

    def lever(self, element: Spatial, link: int) -> Vector:
        """From the reference point to a point; of a vector itself."""
        origin = self.vector(element)
        return self.space.sub(origin, self.reference[link]) if isinstance(element, Point) else origin

    def moved(self, element: Spatial, link: int) -> dict[int, Vector]:
        """{rate: velocity of an element that moves with a link, at rate 1}."""
        space = self.space  # every screw is told from the reference point of its own link
        turned = {k: space.cross(self.columns[k].axis, self.lever(element, home)) for home in self.tree.chain(link) for k in self.own[home]}
        return {k: space.add(self.columns[k].along, v) if isinstance(element, Point) else v for k, v in turned.items()}

    def twists(self, rates: Sequence[int]) -> list[tuple[Vector, Vector]]:
        """(ω, v) of every link where the joints have these rates, or (ω̇, v̇) where the rates change like this."""
        space = self.space
        pairs: list[tuple[Vector, Vector]] = []
        for number, link in enumerate(self.tree.links):
            before = pairs[link.parent] if link.parent is not None else (space.zero, space.zero)
            pairs.append(self.turned(self.arriving(number, before), ((rates[k], k) for k in self.own[number])))
        return pairs

    def arriving(self, number: int, twist: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
        """A twist of a link's parent, or its change, as it is at the link's reference point."""
        turning, along = twist
        shift = self.shift[number]
        return twist if shift is None else (turning, self.space.add(along, self.space.cross(turning, shift)))

    def leaving(self, number: int, load: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
        """Force and moment on a link, or momenta, about the reference point of its parent."""
        force, moment = load
        shift = self.shift[number]
        return load if shift is None else (force, self.space.add(moment, self.space.cross(shift, force)))

    def turned(self, twist: tuple[Vector, Vector], rates: Iterable[tuple[int, int]]) -> tuple[Vector, Vector]:
        """A twist with that of some screws added; rates: (rate, number of the screw)."""
        turning, along = twist
        for rate, k in rates:
            turning = self.space.add(turning, self.space.times(rate, self.columns[k].axis))
            along = self.space.add(along, self.space.times(rate, self.columns[k].along))
        return turning, along

    def carried(self, element: Spatial, link: int, twist: tuple[Vector, Vector]) -> Vector:
        """The velocity of an element that moves with a link of this twist."""
        turning, along = twist
        turned = self.space.cross(turning, self.lever(element, link))
        return self.space.add(along, turned) if isinstance(element, Point) else turned

    def velocities(self, rates: Sequence[int]) -> dict[Spatial, Vector]:
        """Of all elements that move with the tree, where the joints have these rates."""
        twists = self.twists(rates)
        return {element: self.carried(element, link, twists[link]) for element, link in self.tree.home.items()}

    def inward(self, loads: Loads, needed: Loads) -> dict[int, int]:
        """{rate: node} of what forces and moments on links do at rate 1, each with all those beyond it.

        loads: on the links, which are added up there; needed: what the links take of them
        """
        space, forces = self.space, {}
        for number in reversed(range(len(self.tree.links))):
            if number not in loads and number not in needed:
                continue
            force, moment = loads.get(number, (space.zero, space.zero))
            if number in needed:
                force, moment = space.sub(force, needed[number][0]), space.sub(moment, needed[number][1])
            for k in self.own[number]:
                column = self.columns[k]
                forces[k] = self.space.graph.add(space.dot(column.axis, moment), space.dot(column.along, force))
            if (parent := self.tree.links[number].parent) is not None:
                before = loads.get(parent, (space.zero, space.zero))
                force, moment = self.leaving(number, (force, moment))
                loads[parent] = (space.add(before[0], force), space.add(before[1], moment))
        return forces

    def _shift(self, number: int) -> Vector | None:
        """From the parent's reference point to that of a link, None where it is the same."""
        parent = self.tree.links[number].parent
        if parent is None or self.reference[number] == self.reference[parent]:
            return None
        return self.space.sub(self.reference[number], self.reference[parent])

    def _column(self, screw: Screw, link: int) -> TreeColumn:
        axis = self.combined(screw.axis)
        if screw.point is None:
            return TreeColumn(self.space.zero, axis)
        return TreeColumn(axis, self.space.cross(self.lever(screw.point, link), axis))


def add_force(geometry: TreeGeometry, loads: Loads, element: Spatial, axis: int, node: int) -> None:
    """Add a force along one coordinate of an element to force and moment on its link."""
    space, link = geometry.space, geometry.tree.home[element]
    zero = space.graph.const(0.0)
    x, y, z = (node if k == axis else zero for k in range(3))
    force, moment = loads.get(link, (space.zero, space.zero))
    if isinstance(element, Point):
        force = space.add(force, (x, y, z))
    loads[link] = (force, space.add(moment, space.cross(geometry.lever(element, link), (x, y, z))))


class TreeVelocity:
    """Twists and velocities for rates of the joints, and accelerations that there are without accelerations of the joints.

    velocity, bias: {element: vector} of whatever moves with the tree
    twists: (ω, v) of every link; changes: (ω̇, v̇) of every link without the joints' own accelerations
    """

    def __init__(self, geometry: TreeGeometry, rates: Sequence[int]) -> None:
        self.geometry, self.rates = geometry, rates
        self.twists: list[tuple[Vector, Vector]] = []
        self.changes: list[tuple[Vector, Vector]] = []
        self.velocity: dict[Spatial, Vector] = {}
        for number in range(len(geometry.tree.links)):
            self._follow(number)
        self.bias = {element: self.bias_with(element, link) for element, link in geometry.tree.home.items()}

    def _follow(self, number: int) -> None:
        """Twist of a link from that of its parent, joint by joint, and the velocities of its own elements."""
        geometry, space = self.geometry, self.geometry.space
        link = geometry.tree.links[number]
        nothing = (space.zero, space.zero)
        turning, along = geometry.arriving(number, self.twists[link.parent] if link.parent is not None else nothing)
        change, lift = geometry.arriving(number, self.changes[link.parent] if link.parent is not None else nothing)
        before, speed = turning, None
        for screw, k in zip(link.screws, geometry.own[number], strict=True):
            rate, column = self.rates[k], geometry.columns[k]
            if screw.point is None:
                lift = space.add(lift, space.times(rate, space.cross(before, column.along))) if not screw.is_constant else lift
            else:
                lever = geometry.lever(screw.point, number)
                if speed is None:
                    speed = self.velocity.get(screw.point) or space.add(along, space.cross(turning, lever))
                    if not screw.point.fixed:
                        self.velocity.setdefault(screw.point, speed)
                turned = space.zero if screw.is_constant else self._axis_rate(screw, before)
                shifted = space.add(space.cross(speed, column.axis), space.cross(lever, turned))
                change = space.add(change, space.times(rate, turned))
                lift = space.add(lift, space.times(rate, shifted))
            turning = space.add(turning, space.times(rate, column.axis))
            along = space.add(along, space.times(rate, column.along))
        self.twists.append((turning, along))
        self.changes.append((change, lift))
        for element, home in geometry.tree.home.items():
            if home == number:
                self.velocity.setdefault(element, geometry.carried(element, number, self.twists[number]))

    def _axis_rate(self, screw: Screw, turning: Vector) -> Vector:
        """u̇ of an axis that turns with the parent: of its elements' velocities where they are known."""
        geometry = self.geometry
        if all(element in self.velocity or element.fixed for element in screw.axis.elements):
            return geometry.combined(screw.axis, self.velocity)
        return geometry.space.cross(turning, geometry.combined(screw.axis))

    def bias_with(self, element: Spatial, link: int) -> Vector:
        """The acceleration that an element has where it moves with a link, without accelerations of the joints."""
        return self._acceleration(element, link, *self.changes[link])

    def accelerations(self, rates: Sequence[int]) -> dict[Spatial, Vector]:
        """{element: acceleration} where the joints' rates change like this."""
        space = self.geometry.space
        whole = [
            (space.add(change, turning), space.add(lift, along))
            for (change, lift), (turning, along) in zip(self.changes, self.geometry.twists(rates), strict=True)
        ]
        return {element: self._acceleration(element, link, *whole[link]) for element, link in self.geometry.tree.home.items()}

    def _acceleration(self, element: Spatial, link: int, change: Vector, lift: Vector) -> Vector:
        """Of an element that moves with a link whose twist changes by (change, lift)."""
        space, (turning, _) = self.geometry.space, self.twists[link]
        velocity = self.velocity.get(element, space.zero)
        turned = space.add(space.cross(change, self.geometry.lever(element, link)), space.cross(turning, velocity))
        return space.add(lift, turned) if isinstance(element, Point) else turned
