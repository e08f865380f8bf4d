"""A tree of bodies over the rates of its joints: the programs that robotics calls the basics.

    joint_position(t, x, p)       -> q: the natural coordinates where the joints have values x, turned or slid from the initial position
    joint_screws(t, q, p)         -> for every rate its axis and its velocity at the origin (6 numbers a rate)
    joint_mass(t, q, p)           -> the mass matrix H over the rates, its lower triangle row by row
    joint_inverse(t, q, v, a, p)  -> the forces that rates v and accelerations a need against inertia and gravity
    joint_loads(t, q, v, p)       -> the forces along the rates of springs, dampers and applied forces

All are those of the tree before loops are closed (`ncgen.symbolic.tree`), by composite inertias and the recursive Newton-Euler
algorithm in global axes (`ncgen.program.composite`). Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 5 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import TypeAlias

from ncgen.model.elements import Point, Spatial
from ncgen.program.assemble import KERNELS
from ncgen.program.blocks import Program
from ncgen.program.composite import inertias_of, mass_matrix, needed_loads
from ncgen.program.elimination import Matrix
from ncgen.program.lines import Lines
from ncgen.program.space import Vector
from ncgen.program.tree_motion import Loads, TreePlace, TreeVelocity, add_force
from ncgen.program.verify import verify
from ncgen.symbolic.equations import build_equations
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import Screw, moving, spanning_tree

POSITION = ("t", "q", "p")

UNIT = 1e-14
"""By which the length of an axis may miss 1."""

Frame: TypeAlias = tuple[Vector, Vector, Vector]
"""Nodes of a rotation's columns."""

Followed = Mapping[int, tuple[int, float]]
"""{coordinate: (rate, share)} of relative coordinates that follow a joint: the coordinate's rate is `share` times that of the screw, and
it is the coordinate's that the programs take and give."""


def assemble_joint_space(equations: Terms, followed: Followed) -> dict[str, Program]:
    """The programs by name; every coordinate must be that of an element of the tree, or followed."""
    tree = spanning_tree(equations.model)
    programs = {f"joint_{make.__name__}": make(_Basics(equations, followed)) for make in MADE}
    n, count = len(equations.free), tree.freedoms
    for program in programs.values():
        verify(program, {"t": 1, "q": n, "x": count, "v": count, "a": count, "p": len(equations.parameters)})
    return programs


class _Basics:
    """Screws and inertias in a graph of their own; one program is made of each."""

    def __init__(self, equations: Terms, followed: Followed) -> None:
        self.model, self.followed = equations.model, followed
        self.tree = spanning_tree(self.model)
        self.lines = Lines(build_equations(self.model, massless=[link.body for link in self.tree.links]))
        self.graph, self.place = self.lines.graph, TreePlace(self.lines, self.tree)
        self.space, self.count = self.place.space, self.tree.freedoms
        shares = {k: share for k, share in followed.values()}
        self.scale = [self.graph.const(1.0 / shares.get(k, 1.0)) for k in range(self.count)]

    def program(self, name: str, inputs: tuple[str, ...], outputs: list[int]) -> Program:
        return self.lines.program(f"joint_{name}", inputs, outputs)

    def rates(self, array: str = "v") -> list[int]:
        """Of the screws, or how they change."""
        return [self.graph.mul(scale, self.graph.load(array, k)) for k, scale in enumerate(self.scale)]

    def scaled(self, k: int, node: int) -> int:
        """What goes with the rate of screw k, for the rate that is given in its place."""
        return self.graph.mul(self.scale[k], node)

    def position(self) -> Program:
        """By exponentials of the screws of the initial position, one after the other from the ground outward."""
        where = moving(self.lines.equations, self.tree)
        moved: list[tuple[Frame, Vector]] = []
        for number, link in enumerate(self.tree.links):
            turn, shift = moved[link.parent] if link.parent is not None else (self.unturned, self.space.zero)
            for screw, k in zip(link.screws, self.place.own[number], strict=True):
                more, along = self._exponential(screw, self._displacement(k))
                shift = self.space.add(shift, self._turned(turn, along))
                first, second, third = (self._turned(turn, column) for column in more)
                turn = (first, second, third)
            moved.append((turn, shift))
        outputs = [self.graph.load("x", self.followed[c][0]) if c in self.followed else -1 for c in range(len(self.lines.equations.free))]
        for c, (element, axis) in where.items():
            turn, shift = moved[self.tree.home[element]]
            place = self._turned(turn, self._initial(element))
            outputs[c] = (self.space.add(place, shift) if isinstance(element, Point) else place)[axis]
        return self.program("position", ("t", "x", "p"), outputs)

    @cached_property
    def unturned(self) -> Frame:
        return self.space.constant((1, 0, 0)), self.space.constant((0, 1, 0)), self.space.constant((0, 0, 1))

    def _displacement(self, k: int) -> int:
        """How far a screw has gone since the initial position."""
        own = next((c for c, (rate, _) in self.followed.items() if rate == k), None)
        start = self.graph.const(0.0) if own is None else self.lines.value(self.lines.equations.free[own].value)
        return self.graph.mul(self.scale[k], self.graph.sub(self.graph.load("x", k), start))

    def _exponential(self, screw: Screw, value: int) -> tuple[Frame, Vector]:
        """Rotation, as columns, and translation: 1 + sin φ û× + (1 − cos φ) û× û×, about the screw's point."""
        space, graph = self.space, self.graph
        axis = space.sum(space.times(self.lines.value(w), self._initial(e)) for w, e in screw.axis.terms)
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
        point = self._initial(screw.point)
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

    def _initial(self, element: Spatial) -> Vector:
        x, y, z = (self.lines.value(component.value) for component in element.components)
        return x, y, z

    def screws(self) -> Program:
        outputs: list[int] = []
        for number, own in enumerate(self.place.own):
            for k in own:
                axis, along = self.place.columns[k].axis, self.place.columns[k].along
                outputs += [self.scaled(k, node) for node in (*axis, *self._at_origin(axis, along, number))]
        return self.program("screws", POSITION, outputs)

    def _at_origin(self, axis: Vector, along: Vector, link: int) -> Vector:
        """The velocity of a screw at the origin, from that at the reference point."""
        return self.space.add(along, self.space.cross(self.place.reference[link], axis))

    def mass(self) -> Program:
        H, zero = mass_matrix(self.place, inertias_of(self.place)), self.graph.const(0.0)
        for (a, b), node in self.rotors.items():
            H[a, b] = self.graph.add(H[a, b], node) if (a, b) in H else node
        lower = ((i, j) for i in range(self.count) for j in range(i + 1))
        return self.program("mass", POSITION, [self.scaled(i, self.scaled(j, H.get((i, j), zero))) for i, j in lower])

    def inverse(self) -> Program:
        x, y, z = map(self.lines.value, self.model.gravity_field)
        velocity = TreeVelocity(self.place, self.rates())
        needed = needed_loads(self.place, velocity, inertias_of(self.place), (x, y, z), self.rates("a"))
        found = {k: self.graph.neg(node) for k, node in self.place.inward({}, needed).items()}
        for (a, b), node in self.rotors.items():
            found[a] = self.graph.add(found.get(a, self.graph.const(0.0)), self.graph.mul(node, self.rates("a")[b]))
        outputs = [self.scaled(k, found[k]) if k in found else self.graph.const(0.0) for k in range(self.count)]
        return self.program("inverse", ("t", "q", "v", "a", "p"), outputs)

    def loads(self) -> Program:
        where, rates = moving(self.lines.equations, self.tree), self.rates()
        velocity = TreeVelocity(self.place, rates)
        for c in range(len(self.lines.rates)):
            if c in where:
                element, axis = where[c]
                self.lines.rates[c] = velocity.velocity[element][axis]
            else:
                self.lines.rates[c] = self.graph.load("v", self.followed[c][0])
        loads: Loads = {}
        along: dict[int, list[int]] = {}
        for c, node in sorted(self.lines.vector(KERNELS["force"]).items()):
            if c in where:
                add_force(self.place, loads, *where[c], node)
            else:
                along.setdefault(self.followed[c][0], []).append(node)
        found = {k: self.scaled(k, node) for k, node in self.place.inward(loads, {}).items()}
        outputs = [self.graph.sum([*along.get(k, []), *([found[k]] if k in found else [])]) for k in range(self.count)]
        return self.program("loads", ("t", "q", "v", "p"), outputs)

    @cached_property
    def rotors(self) -> Matrix:
        """Inertia of relative coordinates over the screws' rates."""
        shares = {c: (k, self.graph.const(share)) for c, (k, share) in self.followed.items()}
        found: Matrix = {}
        for (a, b), node in self.lines.matrix(KERNELS["mass"]).items():
            (i, first), (j, second) = shares[a], shares[b]
            found[i, j] = self.graph.mul(node, self.graph.mul(first, second))
        return found


MADE = (_Basics.position, _Basics.screws, _Basics.mass, _Basics.inverse, _Basics.loads)
