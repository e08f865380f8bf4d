"""Accelerations by a recursion over the tree of bodies: `acceleration` of `ncgen.program.motions.dynamics`, for fewer operations.

With the rows J x = ν of the tree's rates (`ncgen.program.tree.rates`), J ẋ = γ − Φ_q b where b is the acceleration of the elements without
ẋ, the mass matrix H of the rates and their forces f by composite inertias, x = R ż + S ν over the independent rates ż gives

    (RᵀHR) z̈ = Rᵀ(f − H S (γ − Φ_q b))

γ of rows that a rigid motion satisfies is never needed. Where the independent rates are those of the tree, R is a matrix of signs, and
on a long chain the articulated recursion, whose cost grows with its length only, takes the place of H.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.program.algebra.elimination import (
    Factors,
    Matrix,
    SymmetricFactors,
    dot,
    factor,
    factor_symmetric,
    solve,
    solve_symmetric,
    solve_transposed,
    times,
)
from ncgen.program.algebra.growth import with_pivots
from ncgen.program.algebra.inertia_matrix import least_inertia
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.sampling import Sample
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.programs import ENERGIES, Split
from ncgen.program.tree import articulated
from ncgen.program.tree.composite import SpatialInertia, inertias_of, mass_matrix, massless, needed_loads
from ncgen.program.tree.joint_rates import measured_rates
from ncgen.program.tree.rates import NoRecursion, RateRow, Rates, check_samples
from ncgen.program.tree.tree_motion import Loads, TreeVelocity
from ncgen.symbolic.equations import build_equations
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import spanning_tree

MIN_SAMPLES = 4
"""Samples from which something can be concluded."""

MIN_ALIKE = 2
"""Of them with the same parameters: what changes with the position seems constant where all others follow from one."""

MAX_COMPOSITE_JOINTS = 30
"""Joints of an open tree from which the composite recursion, whose cost grows with their square, is not even made."""

ROUNDING = 1e-14
"""Least eigenvalue of a mass matrix with diagonal 1 that is an inertia."""

Column = dict[int, int]
"""{rate: node}."""


def assemble_recursions(equations: Terms, split: Split, samples: Sequence[Sample], sizes: np.ndarray) -> dict[str, Program]:
    """The program acceleration(t, q, zd, p) -> q̇, z̈, power, amplification by every recursion that applies: "composite", and on an open
    tree "articulated". Arguments as for `assemble_dynamics`.

    Raises NoRecursion where the mechanism has no tree that moves as the rows allow, EliminationError where no pivot is left.
    """
    work = Recursion(equations, split, samples, sizes)
    return {name: work.written(zdd) for name, zdd in work.ways()}


@dataclass(frozen=True)
class _Loads:
    """own: inertia of every link; force: of every rate without accelerations of the joints; mass: M of coordinates of no link."""

    inertias: list[SpatialInertia | None]
    force: Column
    mass: Matrix


def _is_positive(matrix: dict[tuple[int, int], float], size: int) -> bool:
    """True if a mass matrix resists every motion by more than rounding."""
    dense = np.zeros((size, size))
    for (i, j), value in matrix.items():
        dense[i, j] = value
    return least_inertia(dense) > ROUNDING


class Recursion:
    """The recursion under way: positions, then velocities, then forces.

    split: the independent coordinates, whose velocities are zd; without them velocities are those of all coordinates
    forced: forces along all coordinates, the array `forces`, are applied, too
    Raises NoRecursion and EliminationError as `assemble_recursions`.
    """

    def __init__(self, equations: Terms, split: Split | None, samples: Sequence[Sample], sizes: np.ndarray, forced: bool = False) -> None:
        alike = [sample for sample in samples if np.array_equal(sample.p, samples[0].p)]
        if len(samples) < MIN_SAMPLES or len(alike) < MIN_ALIKE:
            raise NoRecursion("too few positions to see what vanishes")
        check_samples(equations, samples)
        self.model, self.tree = equations.model, spanning_tree(equations.model)
        self.lines = Lines(build_equations(self.model, massless=[link.body for link in self.tree.links]))
        self.graph = self.lines.graph
        self.zero, self.one = self.graph.const(0.0), self.graph.const(1.0)
        self.forces = [self.graph.load("forces", c) for c in range(len(equations.free))] if forced else []
        self.rates = Rates(equations, self.lines, self.tree, split, samples, sizes)
        rows = self.rates.rows()
        if split is None:
            self._choose(rows)
        self.rows = self.rates.kept(rows)
        self._factor()
        self.R = [self._independent(k) for k in self.rates.free]
        self.speeds = self._speeds(split)
        self.nu = self.lines.vector(KERNELS["nu"])
        self.velocity = self._move()
        self.bias = self.particular(self._right_sides())
        self.loads = self._loads()

    def _choose(self, rows: list[RateRow]) -> None:
        """Say which rates are free, where no coordinates are."""
        self.rates.choose(rows)

    def _speeds(self, split: Split | None) -> list[int]:
        """Of the free rates, as they are given."""
        if split is None:
            return measured_rates(self.rates, self.masses)
        return [self.graph.load("zd", k) for k in range(len(self.R))]

    @cached_property
    def masses(self) -> Matrix:
        """M of all coordinates, those of the tree's bodies included."""
        return Lines(self.rates.equations, self.graph).matrix(KERNELS["mass"])

    @property
    def joints(self) -> int:
        """How many rates the joints of the tree have."""
        return len(self.rates.geometry.columns)

    def written(self, zdd: Sequence[int]) -> Program:
        """The program `acceleration` of these accelerations of the independent coordinates."""
        growth = with_pivots(self.graph, self.rates.sampling, self.amplification(), self.factors.reciprocal)
        outputs = [*self.lines.rates, *zdd, self.power(zdd), growth]
        return self.lines.program("acceleration", ("t", "q", "zd", "p"), outputs)

    def amplification(self) -> int:
        """‖R‖² in natural units."""
        return self.graph.sum(self._grown(k, node, i) for i, column in enumerate(self.R) for k, node in column.items())

    # -- positions -----------------------------------------------------------------------------

    def _factor(self) -> None:
        """Factors of J over the dependent rates."""
        self.column = {k: j for j, k in enumerate(self.rates.dependent)}
        self.matrix: Matrix = {
            (i, self.column[k]): n for i, row in enumerate(self.rows) for k, n in row.entries.items() if k in self.column
        }
        self.factors: Factors = factor(self.graph, self.matrix, len(self.rows), self.rates.sampling.of(self.matrix))

    def particular(self, right: Column) -> Column:
        """S·right."""
        return {self.rates.dependent[j]: node for j, node in solve(self.graph, self.factors, right).items()}

    def _independent(self, rate: int) -> Column:
        """The column of R of an independent rate."""
        right = {i: self.graph.neg(row.entries[rate]) for i, row in enumerate(self.rows) if rate in row.entries}
        return {rate: self.one, **self.rates.nonzero_column(self.particular(right))}

    def _grown(self, rate: int, node: int, independent: int) -> int:
        """How much an error of an independent coordinate grows in a rate, squared, without units."""
        scale = self.rates.sizes[self.rates.free[independent]] / self.rates.sizes[rate]
        grown = self.graph.mul(self.graph.const(float(scale)), node)
        return self.graph.mul(grown, grown)

    # -- velocities ----------------------------------------------------------------------------

    def _move(self) -> TreeVelocity:
        """x = R ż + S ν, and with it all velocities."""
        driven = {i: self.nu[row.source] for i, row in enumerate(self.rows) if isinstance(row.source, int) and row.source in self.nu}
        x = self.spread(self.speeds, self.particular(driven))
        velocity = TreeVelocity(self.rates.geometry, x[: self.joints])
        self.lines.rates[:] = self.over_coordinates(x, velocity.velocity)
        return velocity

    def at_speeds(self, speeds: Sequence[int]) -> Recursion:
        """The recursion in the same position, with other velocities of the free rates."""
        other = copy(self)
        for depends_on_velocities in ("_mass", "_left"):
            vars(other).pop(depends_on_velocities, None)
        other.lines = copy(self.lines)
        other.lines.rates = list(self.lines.rates)
        other.speeds = list(speeds)
        other.velocity = other._move()
        other.bias = other.particular(other._right_sides())
        other.loads = other._loads()
        return other

    def spread(self, free: Sequence[int], particular: Column) -> list[int]:
        """All rates, R free + particular."""
        x = [particular.get(k, self.zero) for k in range(self.rates.count)]
        for node, column in zip(free, self.R, strict=True):
            for k, coefficient in column.items():
                x[k] = self.graph.add(x[k], self.graph.mul(coefficient, node))
        return x

    def over_coordinates(self, rates: Sequence[int], vectors: dict) -> list[int]:
        """What rates and a vector for every element say of each coordinate."""
        rate_of = self.rates.own
        return [rates[rate_of[c]] if c in rate_of else self.along(vectors, c) for c in range(len(self.rates.equations.free))]

    def along(self, vectors: dict, c: int) -> int:
        """What a vector for every element says of a coordinate."""
        element, axis = self.rates.where[c]
        return vectors[element][axis]

    def _right_sides(self) -> Column:
        """{row: γ − Φ_q b}."""
        gamma = self.lines.vector(KERNELS["gamma"])
        return {i: self._right_side(row, gamma) for i, row in enumerate(self.rows) if row.source is not None}

    def _right_side(self, row: RateRow, gamma: dict[int, int]) -> int:
        graph, rates, bias = self.graph, self.rates, self.velocity.bias
        if isinstance(row.source, int):
            moved = {c: node for c, node in rates.jacobian[row.source].items() if c in rates.where}
            parts = [graph.mul(node, self.along(bias, c)) for c, node in moved.items()]
            return graph.sub(gamma.get(row.source, self.zero), graph.sum(parts))
        assert row.source is not None, "a row without right-hand sides"
        element, link = row.source
        home = self.tree.home.get(element)
        home_bias = bias[element][row.axis] if home is not None and home != link else self.zero
        return graph.sub(home_bias, self.velocity.bias_with(element, link)[row.axis])

    # -- forces --------------------------------------------------------------------------------

    def _loads(self) -> _Loads:
        """Inertias, and the forces of the rates: applied ones less what bodies need without accelerations of the joints."""
        geometry = self.rates.geometry
        loads, right = self._applied()
        x, y, z = map(self.lines.value, self.model.gravity_field)
        inertias = inertias_of(geometry)
        right |= geometry.inward(loads, needed_loads(geometry, self.velocity, inertias, (x, y, z)))
        return _Loads(inertias, right, self.lines.matrix(KERNELS["mass"]))

    def _applied(self) -> tuple[Loads, Column]:
        """Force and moment on every link, and forces along coordinates of no link, of all that is not inertia of the tree."""
        loads: Loads = {}
        right: Column = {}
        forces = self.lines.vector(KERNELS["force"])
        for c, node in enumerate(self.forces):
            forces[c] = self.graph.add(forces[c], node) if c in forces else node
        for c, node in sorted(forces.items()):
            if c in self.rates.where:
                self.rates.load(loads, c, node)
            else:
                right[self.rates.own[c]] = node
        return loads, right

    def _mass_matrix(self) -> tuple[Matrix, Column]:
        """H, both triangles, and the forces of the rates with those of masses of no link."""
        H = mass_matrix(self.rates.geometry, self.loads.inertias)
        right = dict(self.loads.force)
        for (a, b), mass in sorted(self.loads.mass.items()):
            self._add_mass(H, right, a, b, mass)
        return dict(sorted(H.items())), right

    def _add_mass(self, H: Matrix, right: Column, a: int, b: int, mass: int) -> None:
        """An entry of M adds TᵀMT to H, and takes TᵀM b from the forces."""
        graph = self.graph
        for i, left in self._moved(a).items():
            weighted = graph.mul(mass, left)
            for j, node in self._moved(b).items():
                product = graph.mul(weighted, node)
                H[i, j] = graph.add(H[i, j], product) if (i, j) in H else product
            if b in self.rates.where:
                right[i] = graph.sub(right.get(i, self.zero), graph.mul(weighted, self.along(self.velocity.bias, b)))

    def _moved(self, c: int) -> Column:
        """The row of T of a coordinate."""
        if c not in self.rates.where:
            return {self.rates.own[c]: self.one}
        element, axis = self.rates.where[c]
        return {k: v[axis] for k, v in self.rates.geometry.moved(element, self.tree.home[element]).items()}

    # -- accelerations -------------------------------------------------------------------------

    def ways(self) -> Iterator[tuple[str, list[int]]]:
        """z̈ by every recursion that applies, with its name."""
        if self.is_open:
            yield "articulated", self.solve("articulated")
        if not self.is_open or self.joints <= MAX_COMPOSITE_JOINTS:
            yield "composite", self.solve("composite")

    def solve(self, way: str, right: Column | None = None) -> list[int]:
        """x of (RᵀHR) x = Rᵀ right over the free rates by the recursion of a name; without a right-hand side z̈."""
        if way == "articulated":
            return self._solve_articulated(self.loads.force if right is None else right)
        return self._solve_composite(self._left if right is None else right)  # (RᵀHR) z̈ = Rᵀ(f − H S …)

    @cached_property
    def _mass(self) -> tuple[Matrix, Column]:
        return self._mass_matrix()

    @cached_property
    def _HR(self) -> list[Column]:
        return [times(self.graph, self._mass[0], column) for column in self.R]

    @cached_property
    def _reduced(self) -> SymmetricFactors:
        """Factors of RᵀHR, in an order without fill on a tree."""
        graph, size = self.graph, len(self.R)
        A: Matrix = {}
        for i in range(size):
            for j in range(i + 1):
                node = dot(graph, self.R[i], self._HR[j])
                if graph.value(node) != 0.0:
                    A[i, j] = A[j, i] = node
        samples = self.rates.sampling.of(A)
        if not all(_is_positive(samples[k], size) for k in self.rates.sampling.alike):  # others are drawn, and may be those of no body
            raise massless(self.model.name)
        return factor_symmetric(graph, A, size, samples)

    @cached_property
    def _left(self) -> Column:
        """Forces of the rates less what inertia needs for the accelerations that closing rows ask for."""
        H, right = self._mass
        left = dict(right)
        for k, node in times(self.graph, H, self.bias).items():
            left[k] = self.graph.sub(left.get(k, self.zero), node)
        return left

    def _solve_composite(self, right: Column) -> list[int]:
        solved = solve_symmetric(self.graph, self._reduced, {i: dot(self.graph, column, right) for i, column in enumerate(self.R)})
        return [solved.get(i, self.zero) for i in range(len(self.R))]

    @cached_property
    def is_open(self) -> bool:
        """True if the independent rates are those of the joints but for signs, and all inertia is that of links."""
        joints = [[k for k in column if k < self.joints] for column in self.R]
        signs = all(self.graph.value(column[k]) in (1.0, -1.0) for column, ks in zip(self.R, joints, strict=True) for k in ks)
        each = sorted(k for ks in joints for k in ks) == list(range(self.joints)) and all(len(ks) == 1 for ks in joints)
        return signs and each and not self.loads.mass and not self.nu and not self.bias

    def _solve_articulated(self, forces: Column) -> list[int]:
        joints = range(self.joints)
        right = {k: forces.get(k, self.zero) for k in joints}
        for column in self.R:  # a force along the independent coordinate itself, such as a motor's, acts on its joint
            (k,) = [j for j in column if j in joints]
            for other in (j for j in column if j not in joints and j in forces):
                right[k] = self.graph.add(right[k], self.graph.mul(column[k], forces[other]))
        solution = articulated.accelerations(self.rates.geometry, self.loads.inertias, right)
        return [self.graph.mul(node, solution[k]) for column in self.R for k, node in column.items() if k in joints]

    def power(self, zdd: Sequence[int]) -> int:
        """Power of forces without a potential and of drivers, P − νᵀλ with Jᵀ λ = f − H ẋ on the dependent rates."""
        graph = self.graph
        applied = self.lines.vector(KERNELS["energy"]).get(ENERGIES.index("power"), self.zero)
        power = graph.sum([applied, *(graph.mul(force, rate) for force, rate in zip(self.forces, self.lines.rates, strict=False))])
        if not self.nu:
            return power
        rest = dict(self._left)
        for column, acceleration in zip(self._HR, zdd, strict=True):
            for k, node in column.items():
                rest[k] = graph.sub(rest.get(k, self.zero), graph.mul(node, acceleration))
        lam = solve_transposed(graph, self.factors, {self.column[k]: node for k, node in rest.items() if k in self.column})
        for i, row in enumerate(self.rows):
            if isinstance(row.source, int) and row.source in self.nu and i in lam:
                power = graph.sub(power, graph.mul(self.nu[row.source], lam[i]))
        return power
