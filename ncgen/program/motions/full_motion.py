"""The motion of all coordinates at once, as two programs without a choice of independent ones.

    closing(t, q, p, e)     -> Δq (n), Φ (m): a Newton step towards the constraints
    motion(t, q, qd, p, e)  -> q̇ (n), q̈ (n), λ (m), power: velocities brought onto the constraints, and what follows

Both eliminate the quasidefinite matrix

    H = [ M + e W   Φ_qᵀ ]      W: about the size of the masses
        [ Φ_q      −e V  ]      V: about the size of Φ_q M⁻¹ Φ_qᵀ

in a fixed order, which a small e makes possible wherever the mechanism is: where rows are redundant, where masses are
missing, and in singular positions. With x of H x = b, one step of refinement on the matrix without e leaves an error of
order e². Velocities and positions are projected in the metric of M.

Their derivatives along a direction, seed = [dt; dq; dq̇; dp], are two more programs:

    closing_tangent(t, q, p, e, seed)     -> dΔq (n)
    motion_tangent(t, q, qd, p, e, seed)  -> dq̇ (n), dq̈ (n), dλ (m), dpower, dkinetic, dpotential

A solution x of H x = b changes by H dx = db − dH x, so the factors serve again and elimination is not differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ncgen.program.algebra.elimination import SymmetricFactors, factor_symmetric, solve_symmetric
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along, tangent
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.programs import ENERGIES
from ncgen.symbolic.numbering import Terms

REGULARISATION = 2.0**-35
"""e for doubles: the rounding unit to the power of 2/3, for which refinement leaves less than a rounding error."""


Vector: TypeAlias = dict[int, int]
"""{unknown, or row: node}."""


@dataclass(frozen=True)
class FullMotion:
    """Both programs, or the tangents of both; the shapes of their outputs in this module's text."""

    closing: Program
    motion: Program


@dataclass(frozen=True, eq=False)
class MotionSizes:
    """What H is scaled by: natural sizes of the coordinates (n,), and Φ_q (m, n) and M (n, n) in sample positions."""

    columns: np.ndarray
    jacobians: tuple[np.ndarray, ...]
    mass_matrices: tuple[np.ndarray, ...]

    @cached_property
    def W(self) -> np.ndarray:
        """The size of every coordinate's mass (n,); one without mass takes the largest of all others."""
        diagonals = np.max([np.diag(M) for M in self.mass_matrices], axis=0)
        largest = np.max(diagonals * self.columns**2) / self.columns**2
        return np.where(diagonals > 1e-12 * largest, diagonals, largest)

    @cached_property
    def V(self) -> np.ndarray:
        """The size of every row's diagonal in Φ_q M⁻¹ Φ_qᵀ (m,)."""
        return np.max([np.sum(J**2 / self.W, axis=1) for J in self.jacobians], axis=0)


def assemble_full_motion(equations: Terms, sizes: MotionSizes, holonomic: Iterable[int]) -> FullMotion:
    """Both programs; holonomic: numbers of the rows that are equations of position. The mechanism must have mass."""
    closing, motion = _parts(equations, sizes, holonomic)
    built = FullMotion(closing.program(), motion.program())
    n, m = len(equations.free), len(equations.rows)
    assert (built.closing.size, built.motion.size) == (n + m, 2 * n + m + 1)
    return _verified(built, equations)


def assemble_full_tangents(equations: Terms, sizes: MotionSizes, holonomic: Iterable[int]) -> FullMotion:
    """The tangents of both programs, with the same arguments."""
    closing, motion = _parts(equations, sizes, holonomic)
    return _verified(FullMotion(closing.tangent(), motion.tangent()), equations)


def _parts(equations: Terms, sizes: MotionSizes, holonomic: Iterable[int]) -> tuple[_Closing, _Motion]:
    return _Closing(equations, sizes, list(map(int, holonomic))), _Motion(equations, sizes)


def _verified(built: FullMotion, equations: Terms) -> FullMotion:
    n, parameters = len(equations.free), len(equations.parameters)
    lengths = {"t": 1, "q": n, "qd": n, "p": parameters, "e": 1, "seed": 1 + 2 * n + parameters}
    for program in (built.closing, built.motion):
        verify(program, lengths)
    return built


class Saddle:
    """H in a graph, rows numbered after coordinates; A is H without e, which is an input of the program or a number."""

    def __init__(self, lines: Lines, sizes: MotionSizes, rows: Iterable[int], e: float | None = None) -> None:
        self.lines, self.graph, self.n = lines, lines.graph, len(lines.equations.free)
        self.index_of = {r: self.n + k for k, r in enumerate(rows)}
        self.jacobian = {(r, c): node for (r, c), node in lines.matrix(KERNELS["phi_q"]).items() if r in self.index_of}
        self.A = lines.matrix(KERNELS["mass"])
        for (r, c), node in self.jacobian.items():
            self.A[self.index_of[r], c] = self.A[c, self.index_of[r]] = node
        self.factors = self._factors(sizes, self.graph.load("e", 0) if e is None else self.graph.const(e))

    def _factors(self, sizes: MotionSizes, e: int) -> SymmetricFactors:
        graph = self.graph
        H = dict(self.A)
        for c in range(self.n):
            extra = graph.mul(graph.const(float(sizes.W[c])), e)
            H[c, c] = graph.add(H[c, c], extra) if (c, c) in H else extra
        for r, index in self.index_of.items():
            H[index, index] = graph.neg(graph.mul(graph.const(float(sizes.V[r])), e))
        samples = [self._numbers(H, sizes, mass, J) for mass, J in zip(sizes.mass_matrices, sizes.jacobians, strict=True)]
        return factor_symmetric(graph, H, self.n + len(self.index_of), samples)

    def _numbers(
        self, pattern: Iterable[tuple[int, int]], sizes: MotionSizes, mass: np.ndarray, jacobian: np.ndarray
    ) -> dict[tuple[int, int], float]:
        """H as numbers without units: masses and rows of size 1."""
        rows = list(self.index_of)
        J = jacobian[rows]
        scale = 1 / np.sqrt(np.concatenate([sizes.W, sizes.V[rows]]))
        H = np.block([[mass + REGULARISATION * np.diag(sizes.W), J.T], [J, -REGULARISATION * np.diag(sizes.V[rows])]])
        scaled = scale[:, None] * H * scale
        return {entry: float(scaled[entry]) for entry in pattern}

    def solve(self, right: Vector) -> Vector:
        return solve_symmetric(self.graph, self.factors, right)

    def refined(self, right: Vector) -> Vector:
        """The solution with one step of refinement on A."""
        graph, first = self.graph, self.solve(right)
        sums: dict[int, list[int]] = {i: [node] for i, node in right.items()}
        for (i, j), node in sorted(self.A.items()):
            if j in first:
                sums.setdefault(i, []).append(graph.neg(graph.mul(node, first[j])))
        correction = self.solve({i: graph.sum(nodes) for i, nodes in sums.items()})
        return {i: _total(graph, first.get(i), correction.get(i)) for i in first.keys() | correction.keys()}

    def motion(self) -> tuple[Vector, Vector]:
        """Forces and right-hand sides of accelerations, and q̈ and λ that follow from them; where all constraints are rows of H."""
        right = self.lines.vector(KERNELS["force"])
        right |= {self.index_of[r]: node for r, node in self.lines.vector(KERNELS["gamma"]).items()}
        return right, self.refined(right)

    def change(self, x: Vector, right: Vector, along: dict[int, int], solve: Callable[[Vector], Vector]) -> Vector:
        """How the solution x of H x = right changes along a direction: H dx = dright − dH x, solved as x was.

        along: {node: its change}
        """
        graph = self.graph
        changes_of = tangent(graph, [*right.values(), *self.A.values()], along)
        sums = {i: [changes_of[node]] for i, node in right.items() if node in changes_of}
        for (i, j), node in sorted(self.A.items()):
            if node in changes_of and j in x:
                sums.setdefault(i, []).append(graph.neg(graph.mul(changes_of[node], x[j])))
        return solve({i: graph.sum(nodes) for i, nodes in sums.items()})

    def times_jacobian(self, x: Sequence[int]) -> Vector:
        """{row: node} of Φ_q x."""
        sums: dict[int, list[int]] = {}
        for (r, c), node in sorted(self.jacobian.items()):
            sums.setdefault(r, []).append(self.graph.mul(node, x[c]))
        return {r: self.graph.sum(nodes) for r, nodes in sums.items()}


def _total(graph: Graph, a: int | None, b: int | None) -> int:
    """a + b, of which one may not be there."""
    if a is None:
        assert b is not None, "a sum of nothing"
        return b
    return a if b is None else graph.add(a, b)


class _Closing:
    """A Newton step towards the constraints, as nodes."""

    def __init__(self, equations: Terms, sizes: MotionSizes, holonomic: list[int]) -> None:
        self.lines = Lines(equations)
        self.saddle = Saddle(self.lines, sizes, holonomic)
        index = self.saddle.index_of
        self.phi = {r: node for r, node in self.lines.vector(KERNELS["phi"]).items() if r in index}
        self.right = {index[r]: self.lines.graph.neg(node) for r, node in self.phi.items()}
        self.step = self.saddle.solve(self.right)

    def program(self) -> Program:
        zero, n, m = self.lines.graph.const(0.0), self.saddle.n, len(self.lines.equations.rows)
        outputs = [*(self.step.get(c, zero) for c in range(n)), *(self.phi.get(r, zero) for r in range(m))]
        return self.lines.program("closing", ("t", "q", "p", "e"), outputs)

    def tangent(self) -> Program:
        """How the step changes along a direction."""
        graph = self.lines.graph
        along = directions(self.lines)
        change = self.saddle.change(self.step, self.right, along, self.saddle.solve)
        outputs = [change.get(c, graph.const(0.0)) for c in range(self.saddle.n)]
        return self.lines.program("closing_tangent", ("t", "q", "p", "e", "seed"), outputs)


class _Motion:
    """Velocities brought onto the constraints, accelerations, multipliers and energies, as nodes."""

    def __init__(self, equations: Terms, sizes: MotionSizes) -> None:
        self.lines = lines = Lines(equations)
        graph, zero = lines.graph, lines.graph.const(0.0)
        self.n, self.m = n, m = len(equations.free), len(equations.rows)
        self.saddle = Saddle(lines, sizes, range(m))
        nu = lines.vector(KERNELS["nu"])
        off = self.saddle.times_jacobian(lines.rates)
        self.missing = {n + r: graph.sub(nu.get(r, zero), off.get(r, zero)) for r in sorted(nu.keys() | off.keys())}
        self.onto = self.saddle.solve(self.missing)
        self.given = lines.rates
        lines.rates = [graph.add(rate, self.onto[c]) if c in self.onto else rate for c, rate in enumerate(lines.rates)]

        self.right, self.x = self.saddle.motion()
        energies = lines.vector(KERNELS["energy"])
        self.kinetic, self.potential, power = (energies.get(k, zero) for k in range(len(ENERGIES)))
        for r, node in nu.items():
            power = graph.sub(power, graph.mul(node, self.x.get(n + r, zero)))
        self.power = power

    def program(self) -> Program:
        zero = self.lines.graph.const(0.0)
        solution = [self.x.get(k, zero) for k in range(self.n + self.m)]
        return self.lines.program("motion", ("t", "q", "qd", "p", "e"), [*self.lines.rates, *solution, self.power])

    def tangent(self) -> Program:
        """How all of them change along a direction; solutions by the implicit function theorem, on the same factors."""
        lines, graph, zero = self.lines, self.lines.graph, self.lines.graph.const(0.0)
        along = directions(lines)
        onto = self.saddle.change(self.onto, self.missing, along, self.saddle.solve)
        rates = [_total(graph, along[rate], onto.get(c)) for c, rate in enumerate(self.given)]
        along |= zip(lines.rates, rates, strict=True)
        x = self.saddle.change(self.x, self.right, along, self.saddle.refined)
        along |= {self.x[k]: x.get(k, zero) for k in self.x if graph.value(self.x[k]) is None}
        scalars = [self.power, self.kinetic, self.potential]
        outputs = [*rates, *(x.get(k, zero) for k in range(self.n + self.m)), *changes_along(graph, scalars, along)]
        return lines.program("motion_tangent", ("t", "q", "qd", "p", "e", "seed"), outputs)


def directions(lines: Lines) -> dict[int, int]:
    """{input: its change}: a seed has the changes of t, q, q̇ and p one after the other."""
    n, count = len(lines.equations.free), len(lines.equations.parameters)
    inputs = [("t", 0), *(("q", i) for i in range(n)), *(("qd", i) for i in range(n)), *(("p", i) for i in range(count))]
    return {lines.graph.load(*leaf): lines.graph.load("seed", k) for k, leaf in enumerate(inputs)}
