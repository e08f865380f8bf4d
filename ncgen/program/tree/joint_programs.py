"""A tree of bodies over the rates of its joints: the programs that robotics calls the basics.

    joint_position(t, x, p)       -> q: the natural coordinates where the joints have values x, turned or slid from the initial position
    joint_screws(t, q, p)         -> for every rate its axis and its velocity at the origin (6 numbers a rate)
    joint_mass(t, q, p)           -> the mass matrix H over the rates, its lower triangle row by row
    joint_inverse(t, q, v, a, p)  -> the forces that rates v and accelerations a need against inertia and gravity
    joint_loads(t, q, v, p)       -> the forces along the rates of springs, dampers and applied forces
    joint_momenta(t, q, p)        -> mass and first moment about the origin of all bodies (4), and for every rate the linear momentum and
                                     the angular one about the origin (6 numbers a rate)
    joint_inverse_tangent(t, q, v, a, p, dx, dv), joint_loads_tangent(t, q, v, p, dx, dv)
                                  -> how these two change where the joints move by dx and the rates by dv
    joint_regressor(t, q, v, a, p) -> what joint_inverse is linear in, row by row (`ncgen.program.tree.regressor`)

All are those of the tree before loops are closed (`ncgen.symbolic.tree`), by composite inertias and the recursive Newton-Euler
algorithm in global axes (`ncgen.program.tree.composite`). Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Literal, TypeAlias

from ncgen.program.algebra.elimination import Matrix
from ncgen.program.algebra.space import Vector
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.tree.composite import inertias_of, mass_matrix, needed_loads, nothing
from ncgen.program.tree.regressor import NAMES, frames_of, regressor
from ncgen.program.tree.tree_motion import Loads, TreeGeometry, TreeVelocity, add_force
from ncgen.program.tree.tree_position import TreePosition
from ncgen.symbolic.equations import build_equations
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import moving, spanning_tree

POSITION = ("t", "q", "p")
MOVING = ("t", "q", "v", "p")
ACCELERATED = ("t", "q", "v", "a", "p")
DIRECTION = ("dx", "dv")
"""What programs take: a position, rates and accelerations, and directions of joints and rates."""

Made: TypeAlias = Literal["basics", "slopes", "regressor", "spread"]
"""Which programs are made: tangents, the regressor, how the spread over rates changes (of loops alone), or all others."""

Followed = Mapping[int, tuple[int, float]]
"""{coordinate: (rate, share)} of relative coordinates that follow a joint: the coordinate's rate is `share` times that of the screw, and
it is the coordinate's that the programs take and give."""


def assemble_joint_space(equations: Terms, followed: Followed, group: Made) -> dict[str, Program]:
    """The programs by name; every coordinate must be that of an element of the tree, or followed."""
    tree = spanning_tree(equations.model)
    programs = {f"joint_{make.__name__}": make(_Basics(equations, followed)) for make in MAKERS[group]}
    n, count = len(equations.free), tree.dof
    for program in programs.values():
        verify(program, {"t": 1, "q": n, "p": len(equations.parameters)} | dict.fromkeys(("x", "v", "a", "dx", "dv"), count))
    return programs


def changes(graph: Graph, nodes: Sequence[int], moved: Sequence[int], count: int) -> list[int]:
    """How nodes change where the coordinates q change by `moved` and the rates v by dv, of which there are so many."""
    direction = {graph.load("q", c): node for c, node in enumerate(moved)} | {graph.load("v", k): graph.load("dv", k) for k in range(count)}
    return changes_along(graph, nodes, direction)


def gravity_of(lines: Lines) -> Vector:
    """The field (m/s²)."""
    x, y, z = map(lines.value, lines.equations.model.gravity_field)
    return x, y, z


def momenta(geometry: TreeGeometry) -> list[int]:
    """Mass, first moment about the origin, and the momenta about the origin of every screw at rate 1."""
    space, graph, links = geometry.space, geometry.space.graph, geometry.tree.links
    composite = [each or nothing(space) for each in inertias_of(geometry)]
    total, first, momentum = graph.const(0.0), space.zero, [graph.const(0.0)] * (6 * len(geometry.columns))
    for number in reversed(range(len(links))):
        inertia, reference = composite[number], geometry.reference[number]
        for k in geometry.own[number]:
            linear, angular = inertia.momentum(space, geometry.columns[k].axis, geometry.columns[k].along)
            momentum[6 * k : 6 * k + 6] = [*linear, *space.add(angular, space.cross(reference, linear))]
        parent = links[number].parent
        if parent is not None:
            composite[parent] = composite[parent].plus(space, inertia.shifted(space, geometry.shift[number]))
        else:
            total = graph.add(total, inertia.mass)
            first = space.sum((first, inertia.first, space.times(inertia.mass, reference)))
    return [total, *first, *momentum]


class _Basics:
    """Screws and inertias in a graph of their own; one program is made of each."""

    def __init__(self, equations: Terms, followed: Followed) -> None:
        self.model, self.followed = equations.model, followed
        self.tree = spanning_tree(self.model)
        self.lines = Lines(build_equations(self.model, massless=[link.body for link in self.tree.links]))
        self.graph, self.geometry = self.lines.graph, TreeGeometry(self.lines, self.tree)
        self.space, self.count = self.geometry.space, self.tree.dof
        shares = {k: factor for k, factor in followed.values()}
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
        where = moving(self.lines.equations, self.tree)
        moved = TreePosition(self.lines, self.tree, [self._displacement(k) for k in range(self.count)])
        outputs = [self.graph.load("x", self.followed[c][0]) if c in self.followed else -1 for c in range(len(self.lines.equations.free))]
        for c, (element, axis) in where.items():
            outputs[c] = moved.placed(element, self.tree.home[element])[axis]
        return self.program("position", ("t", "x", "p"), outputs)

    def _displacement(self, k: int) -> int:
        """How far a screw has gone since the initial position."""
        coordinate = next((c for c, (rate, _) in self.followed.items() if rate == k), None)
        start = self.graph.const(0.0) if coordinate is None else self.lines.value(self.lines.equations.free[coordinate].value)
        return self.graph.mul(self.scale[k], self.graph.sub(self.graph.load("x", k), start))

    def screws(self) -> Program:
        outputs: list[int] = []
        for number, rates in enumerate(self.geometry.own):
            for k in rates:
                axis, along = self.geometry.columns[k].axis, self.geometry.columns[k].along
                outputs += [self.scaled(k, node) for node in (*axis, *self._at_origin(axis, along, number))]
        return self.program("screws", POSITION, outputs)

    def _at_origin(self, axis: Vector, along: Vector, link: int) -> Vector:
        """The velocity of a screw at the origin, from that at the reference point."""
        return self.space.add(along, self.space.cross(self.geometry.reference[link], axis))

    def mass(self) -> Program:
        H, zero = mass_matrix(self.geometry, inertias_of(self.geometry)), self.graph.const(0.0)
        for (a, b), node in self.rotors.items():
            H[a, b] = self.graph.add(H[a, b], node) if (a, b) in H else node
        lower = ((i, j) for i in range(self.count) for j in range(i + 1))
        return self.program("mass", POSITION, [self.scaled(i, self.scaled(j, H.get((i, j), zero))) for i, j in lower])

    def inverse(self) -> Program:
        return self.program("inverse", ACCELERATED, self._inverse())

    def inverse_tangent(self) -> Program:
        return self.program("inverse_tangent", (*ACCELERATED, *DIRECTION), self._changes(self._inverse()))

    def loads(self) -> Program:
        return self.program("loads", MOVING, self._loads())

    def loads_tangent(self) -> Program:
        return self.program("loads_tangent", (*MOVING, *DIRECTION), self._changes(self._loads()))

    def momenta(self) -> Program:
        total, angular = momenta(self.geometry)[:4], momenta(self.geometry)[4:]
        return self.program("momenta", POSITION, [*total, *(self.scaled(k // 6, node) for k, node in enumerate(angular))])

    def regressor(self) -> Program:
        gravity, velocity = gravity_of(self.lines), TreeVelocity(self.geometry, self.rates())
        rows = regressor(self.geometry, velocity, gravity, self.rates("a"), frames_of(self.model, self.tree))
        count, none = len(NAMES) * len(self.tree.links), self.graph.const(0.0)
        nodes = [self.scaled(k, rows[k].get(c, none)) for k in range(self.count) for c in range(count)]
        return self.program("regressor", ACCELERATED, nodes)

    def _changes(self, nodes: Sequence[int]) -> list[int]:
        """How nodes change along dx and dv."""
        where, vectors = moving(self.lines.equations, self.tree), self.geometry.velocities(self.rates("dx"))
        moved = [
            vectors[where[c][0]][where[c][1]] if c in where else self.graph.load("dx", self.followed[c][0])
            for c in range(len(self.lines.equations.free))
        ]
        return changes(self.graph, nodes, moved, self.count)

    def _inverse(self) -> list[int]:
        velocity = TreeVelocity(self.geometry, self.rates())
        needed = needed_loads(self.geometry, velocity, inertias_of(self.geometry), gravity_of(self.lines), self.rates("a"))
        forces = {k: self.graph.neg(node) for k, node in self.geometry.inward({}, needed).items()}
        for (a, b), node in self.rotors.items():
            forces[a] = self.graph.add(forces.get(a, self.graph.const(0.0)), self.graph.mul(node, self.rates("a")[b]))
        return [self.scaled(k, forces[k]) if k in forces else self.graph.const(0.0) for k in range(self.count)]

    def _loads(self) -> list[int]:
        where, velocity = moving(self.lines.equations, self.tree), TreeVelocity(self.geometry, self.rates())
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
                add_force(self.geometry, loads, *where[c], node)
            else:
                along.setdefault(self.followed[c][0], []).append(node)
        forces = {k: self.scaled(k, node) for k, node in self.geometry.inward(loads, {}).items()}
        return [self.graph.sum([*along.get(k, []), *([forces[k]] if k in forces else [])]) for k in range(self.count)]

    @cached_property
    def rotors(self) -> Matrix:
        """Inertia of relative coordinates over the screws' rates."""
        shares = {c: (k, self.graph.const(factor)) for c, (k, factor) in self.followed.items()}
        inertias: Matrix = {}
        for (a, b), node in self.lines.matrix(KERNELS["mass"]).items():
            (i, first), (j, second) = shares[a], shares[b]
            inertias[i, j] = self.graph.mul(node, self.graph.mul(first, second))
        return inertias


MAKERS = {
    "basics": (_Basics.position, _Basics.screws, _Basics.mass, _Basics.inverse, _Basics.loads, _Basics.momenta),
    "slopes": (_Basics.inverse_tangent, _Basics.loads_tangent),
    "regressor": (_Basics.regressor,),
    "spread": (),
}
