"""A mechanism with loops over its independent rates: the programs of `ncgen.program.tree.joint_programs` where joints hold each other.

With x = R v + S ν for all rates of the tree (`ncgen.program.tree.recursion`) mass matrix and forces are RᵀHR and Rᵀf. In addition:

    joint_position(t, x, p)  -> q where the joints have displacements x and coordinates of no joint the values x, loops open, and
                                what x changes by in a step of Newton's method that closes them and leaves the independent ones
    joint_spread(t, q, p)    -> R row by row, and S ν
    joint_spread_rate(t, q, v, p) -> how R changes with time at rates v of the independent joints, row by row

joint_screws and joint_momenta are those of the joints' rates, of which R makes those of the independent ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ncgen.program.algebra.elimination import dot
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.inlined import inlined
from ncgen.program.ir.sampling import Sample
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines, line
from ncgen.program.tree.composite import needed_loads
from ncgen.program.tree.joint_programs import ACCELERATED, DIRECTION, MOVING, POSITION, Made, changes, gravity_of, momenta
from ncgen.program.tree.rates import RateRow
from ncgen.program.tree.recursion import Column, Recursion
from ncgen.program.tree.regressor import NAMES, frames_of, regressor
from ncgen.program.tree.tree_position import TreePosition
from ncgen.symbolic.numbering import Terms

WANTED_WEIGHT, MEASURED_WEIGHT = 1e-3, 0.1
"""Weights of the coordinates that the model's author wants independent, and of measured ones, beside other rates where dependent ones are
chosen: a motor turns a joint that has a coordinate."""


class JointLoops(Recursion):
    """The recursion with the independent rates given as v.

    samples: typical positions; sizes: natural size of every coordinate; wanted: coordinates that are to be independent
    Raises NoRecursion where no tree of bodies moves as the rows allow, EliminationError where no pivot is left.
    """

    def __init__(self, equations: Terms, samples: Sequence[Sample], sizes: np.ndarray, wanted: Sequence[int]) -> None:
        self.wanted = wanted
        super().__init__(equations, None, samples, sizes)

    def programs(self, group: Made) -> dict[str, Program]:
        """By name."""
        made = {program.name: program for program in (make(self) for make in MAKERS[group])}
        rates = self.rates
        lengths = {"t": 1, "q": len(rates.equations.free), "x": rates.count, "p": len(rates.equations.parameters)}
        for program in made.values():
            verify(program, lengths | dict.fromkeys(("v", "a", "dx", "dv"), len(self.R)))
        return made

    def _choose(self, rows: list[RateRow]) -> None:
        weights = dict.fromkeys(self.rates.measured, MEASURED_WEIGHT)
        weights |= {self.rates.own[c]: WANTED_WEIGHT for c in self.wanted if c in self.rates.own}
        self.rates.choose(rows, weights)

    def _speeds(self, split: object) -> list[int]:
        return self._loaded("v")

    def _loaded(self, array: str) -> list[int]:
        return [self.graph.load(array, k) for k in range(len(self.R))]

    def _program(self, name: str, inputs: tuple[str, ...], outputs: Sequence[int]) -> Program:
        return self.lines.program(f"joint_{name}", inputs, outputs)

    def position(self) -> Program:
        return _Closing(self).program

    def screws(self) -> Program:
        geometry, outputs = self.rates.geometry, []
        for reference, rates in zip(geometry.reference, geometry.own, strict=True):
            for column in (geometry.columns[k] for k in rates):
                outputs += [*column.axis, *geometry.space.add(column.along, geometry.space.cross(reference, column.axis))]
        return self._program("screws", POSITION, outputs)

    def spread_over_rates(self) -> Program:
        numbers = {i: row.source for i, row in enumerate(self.rows) if isinstance(row.source, int)}
        particular = self.particular({i: self.nu[number] for i, number in numbers.items() if number in self.nu})
        return self._program("spread", POSITION, [*self._entries, *(particular.get(k, self.zero) for k in range(self.rates.count))])

    def spread_rate(self) -> Program:
        graph = self.graph
        direction = {graph.load("q", c): rate for c, rate in enumerate(self.lines.rates)} | {graph.load("t", 0): self.one}
        return self._program("spread_rate", MOVING, changes_along(graph, self._entries, direction))

    @cached_property
    def _entries(self) -> list[int]:
        """R row by row."""
        return [column.get(k, self.zero) for k in range(self.rates.count) for column in self.R]

    def mass(self) -> Program:
        return self._program("mass", POSITION, [dot(self.graph, self.R[i], self._HR[j]) for i in range(len(self.R)) for j in range(i + 1)])

    def momenta(self) -> Program:
        return self._program("momenta", POSITION, momenta(self.rates.geometry))

    def inverse(self) -> Program:
        return self._program("inverse", ACCELERATED, self._needed)

    def inverse_tangent(self) -> Program:
        return self._program("inverse_tangent", (*ACCELERATED, *DIRECTION), self._changes(self._needed))

    def loads_along(self) -> Program:
        return self._program("loads", MOVING, self._given)

    def loads_tangent(self) -> Program:
        return self._program("loads_tangent", (*MOVING, *DIRECTION), self._changes(self._given))

    def regressor(self) -> Program:
        geometry = self.rates.geometry
        rates = self.spread(self._loaded("a"), self.bias)[: self.joints]
        rows = regressor(geometry, self.velocity, gravity_of(self.lines), rates, frames_of(self.model, geometry.tree))
        columns = [{k: row[c] for k, row in rows.items() if c in row} for c in range(len(NAMES) * len(geometry.tree.links))]
        return self._program("regressor", ACCELERATED, [dot(self.graph, row, column) for row in self.R for column in columns])

    @cached_property
    def _needed(self) -> list[int]:
        """Forces of the independent rates against inertia and gravity."""
        geometry, graph = self.rates.geometry, self.graph
        rates = self.spread(self._loaded("a"), self.bias)
        loads = needed_loads(geometry, self.velocity, self.loads.inertias, gravity_of(self.lines), rates[: self.joints])
        needed = geometry.inward({}, loads)
        forces: Column = {k: graph.neg(node) for k, node in needed.items()}
        if self.loads.mass:
            accelerations = self.over_coordinates(rates, self.velocity.accelerations(rates[: self.joints]))
            for (a, b), mass in sorted(self.loads.mass.items()):
                force = graph.mul(mass, accelerations[b])
                for k, node in self._moved(a).items():
                    forces[k] = graph.add(forces.get(k, self.zero), graph.mul(node, force))
        return [dot(graph, column, forces) for column in self.R]

    @cached_property
    def _given(self) -> list[int]:
        """What forces of the model do along the independent rates."""
        loads, along = self._applied()
        along |= self.rates.geometry.inward(loads, {})
        return [dot(self.graph, column, along) for column in self.R]

    def _changes(self, nodes: Sequence[int]) -> list[int]:
        """How nodes change along dx and dv."""
        rates = self.spread(self._loaded("dx"), {})
        return changes(self.graph, nodes, self.over_coordinates(rates, self.rates.geometry.velocities(rates)), len(self.R))

    def correction(self) -> Program:
        """dependent(t, q, r, p) -> what all rates change by where rows are off by r."""
        right = {i: self.graph.neg(self.graph.load("r", i)) for i in range(len(self.rows))}
        changes = self.particular(right)
        return self.lines.program("dependent", ("t", "q", "r", "p"), [changes.get(k, self.zero) for k in range(self.rates.count)])


class _Closing:
    """Positions of the tree, what the rows are off there, and the step that closes them, in a graph of its own."""

    def __init__(self, work: JointLoops) -> None:
        self.work, self.lines = work, Lines(work.rates.equations)
        self.graph: Graph = self.lines.graph
        rates = work.rates
        self.x = [self.graph.load("x", k) for k in range(rates.count)]
        self.moved = TreePosition(self.lines, work.tree, self.x[: work.joints])
        self.q = [self._coordinate(c) for c in range(len(rates.equations.free))]
        inputs = {
            "t": [self.graph.load("t", 0)],
            "q": self.q,
            "p": [self.graph.load("p", k) for k in range(len(rates.equations.parameters))],
        }
        self.phi = inlined(self.graph, self._rows(), inputs)
        off = [self._off(row) for row in work.rows]
        steps = self._over_displacements(inlined(self.graph, work.correction(), inputs | {"r": off}))
        self.program = line(self.graph, "joint_position", ("t", "x", "p"), [*self.q, *steps], rates.equations)

    def _over_displacements(self, steps: list[int]) -> list[int]:
        """Steps of the rates as those of displacements: a rotation vector changes otherwise than by the angular velocity."""
        free = self.work.rates.free
        for link in range(len(self.work.tree.links)):
            numbers = [k for _, k in self.moved.turning(link)]
            if len(numbers) == 3 and not set(numbers) <= set(free):
                x, y, z = (steps[k] for k in numbers)
                changed = dict(zip(numbers, self.moved.changed(link, (x, y, z)), strict=True))
                steps = [changed.get(k, node) if k not in free else node for k, node in enumerate(steps)]
        return steps

    def _coordinate(self, c: int) -> int:
        rates = self.work.rates
        if c in rates.own:
            return self.x[rates.own[c]]
        element, axis = rates.where[c]
        return self.moved.placed(element, self.work.tree.home[element])[axis]

    @cached_property
    def _numbers(self) -> dict[int, int]:
        """{row of Φ: place} of those that are kept."""
        return {number: i for i, number in enumerate(sorted({row.source for row in self.work.rows if isinstance(row.source, int)}))}

    def _rows(self) -> Program:
        lines = Lines(self.work.rates.equations)
        phi = lines.vector(KERNELS["phi"])
        return lines.program("phi", POSITION, [phi.get(number, lines.graph.const(0.0)) for number in self._numbers])

    def _off(self, row: RateRow) -> int:
        """What a row is off."""
        graph = self.graph
        if isinstance(row.source, int):
            return self.phi[self._numbers[row.source]]
        if row.source is None:  # of ratios 1 and −1, which come out to the last bit
            return graph.sum(
                graph.mul(graph.const(self._number(node)), graph.sub(self.x[k], self._start(k))) for k, node in row.entries.items()
            )
        element, link = row.source
        home = self.work.tree.home.get(element)
        rests = home in (None, link)  # a component that is held, where the home is the link itself
        at_home = self.moved.initial(element) if rests else self.moved.placed(element, home)
        return graph.sub(self.moved.placed(element, link)[row.axis], at_home[row.axis])

    def _number(self, node: int) -> float:
        number = self.work.graph.value(node)
        assert number is not None, "a row of ratios whose entries are no numbers"
        return number

    def _start(self, k: int) -> int:
        """A rate's displacement, or a coordinate's value, in the initial position."""
        c = next((c for c, rate in self.work.rates.own.items() if rate == k), None)
        return self.graph.const(0.0) if c is None else self.lines.value(self.work.rates.equations.free[c].value)


MAKERS = {
    "basics": (
        JointLoops.position,
        JointLoops.screws,
        JointLoops.spread_over_rates,
        JointLoops.mass,
        JointLoops.inverse,
        JointLoops.loads_along,
        JointLoops.momenta,
    ),
    "slopes": (JointLoops.inverse_tangent, JointLoops.loads_tangent),
    "regressor": (JointLoops.regressor,),
    "spread": (JointLoops.spread_rate,),
}
