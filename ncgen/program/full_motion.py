"""The motion of all coordinates at once, as two programs without a choice of independent ones.

    closing(t, q, p, e)     -> Δq (n), Φ (m): a Newton step towards the constraints
    motion(t, q, qd, p, e)  -> q̇ (n), q̈ (n), λ (m), power: velocities brought onto the constraints, and what follows

Both eliminate the quasidefinite matrix

    H = [ M + e W   Φ_qᵀ ]      W: about the size of the masses
        [ Φ_q      −e V  ]      V: about the size of Φ_q M⁻¹ Φ_qᵀ

in a fixed order, which a small e makes possible wherever the mechanism is: where rows are redundant, where masses are
missing, and in singular positions. With x of H x = b, one step of refinement on the matrix without e leaves an error of
order e². Velocities and positions are projected in the metric of M.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.program.assemble import ENERGIES, KERNELS
from ncgen.program.blocks import Program
from ncgen.program.elimination import SymmetricFactors, factor_symmetric, solve_symmetric
from ncgen.program.graph import Graph
from ncgen.program.lines import Lines
from ncgen.program.verify import verify
from ncgen.symbolic.equations import Equations

SMALL = 2.0**-35
"""e for doubles: the rounding unit to the power of 2/3, for which refinement leaves less than a rounding error."""


@dataclass(frozen=True)
class FullMotion:
    """Both programs, and the shapes of their outputs in this module's text."""

    closing: Program
    motion: Program


@dataclass(frozen=True)
class Sizes:
    """What H is scaled by: natural sizes of the coordinates (n,), and Φ_q (m, n) and M (n, n) in sample positions."""

    columns: np.ndarray
    jacobians: tuple[np.ndarray, ...]
    mass_matrices: tuple[np.ndarray, ...]

    @cached_property
    def W(self) -> np.ndarray:
        """The size of every coordinate's mass (n,); one without mass takes the largest of all others."""
        own = np.max([np.diag(M) for M in self.mass_matrices], axis=0)
        largest = np.max(own * self.columns**2) / self.columns**2
        return np.where(own > 1e-12 * largest, own, largest)

    @cached_property
    def V(self) -> np.ndarray:
        """The size of every row's diagonal in Φ_q M⁻¹ Φ_qᵀ (m,)."""
        return np.max([np.sum(J**2 / self.W, axis=1) for J in self.jacobians], axis=0)


def assemble_full_motion(equations: Equations, sizes: Sizes, holonomic) -> FullMotion:
    """Both programs; holonomic: numbers of the rows that are equations of position. The mechanism must have mass."""
    built = FullMotion(_closing(equations, sizes, list(map(int, holonomic))), _motion(equations, sizes))
    n, m = len(equations.free), len(equations.rows)
    lengths = {"t": 1, "q": n, "qd": n, "p": len(equations.parameters), "e": 1}
    assert (built.closing.size, built.motion.size) == (n + m, 2 * n + m + 1)
    for program in (built.closing, built.motion):
        verify(program, lengths)
    return built


class _Saddle:
    """H in a graph, rows numbered after coordinates; A is H without e."""

    def __init__(self, lines: Lines, sizes: Sizes, rows):
        self.lines, self.graph, self.n = lines, lines.graph, len(lines.equations.free)
        self.place = {r: self.n + k for k, r in enumerate(rows)}
        self.jacobian = {(r, c): node for (r, c), node in lines.gather(KERNELS["phi_q"]).items() if r in self.place}
        self.A: dict[tuple[int, int], int] = dict(lines.gather(KERNELS["mass"]))
        for (r, c), node in self.jacobian.items():
            self.A[self.place[r], c] = self.A[c, self.place[r]] = node
        self.factors = self._factors(sizes)

    def _factors(self, sizes: Sizes) -> SymmetricFactors:
        graph, e = self.graph, self.graph.load("e", 0)
        H = dict(self.A)
        for c in range(self.n):
            extra = graph.mul(graph.const(float(sizes.W[c])), e)
            H[c, c] = graph.add(H[c, c], extra) if (c, c) in H else extra
        for r, place in self.place.items():
            H[place, place] = graph.neg(graph.mul(graph.const(float(sizes.V[r])), e))
        samples = [self._numbers(H, sizes, *pair) for pair in zip(sizes.mass_matrices, sizes.jacobians, strict=True)]
        return factor_symmetric(graph, H, self.n + len(self.place), samples)

    def _numbers(self, pattern, sizes: Sizes, mass, jacobian) -> dict[tuple[int, int], float]:
        """H as numbers without units: masses and rows of size 1."""
        rows = list(self.place)
        J = jacobian[rows]
        scale = 1 / np.sqrt(np.concatenate([sizes.W, sizes.V[rows]]))
        H = np.block([[mass + SMALL * np.diag(sizes.W), J.T], [J, -SMALL * np.diag(sizes.V[rows])]])
        scaled = scale[:, None] * H * scale
        return {place: float(scaled[place]) for place in pattern}

    def solve(self, right: dict[int, int]) -> dict[int, int]:
        return solve_symmetric(self.graph, self.factors, right)

    def refined(self, right: dict[int, int]) -> dict[int, int]:
        """The solution with one step of refinement on A."""
        graph, first = self.graph, self.solve(right)
        sums: dict[int, list[int]] = {i: [node] for i, node in right.items()}
        for (i, j), node in sorted(self.A.items()):
            if j in first:
                sums.setdefault(i, []).append(graph.neg(graph.mul(node, first[j])))
        correction = self.solve({i: graph.sum(nodes) for i, nodes in sums.items()})
        return {i: _total(graph, first.get(i), correction.get(i)) for i in first.keys() | correction.keys()}

    def times_jacobian(self, x: list[int]) -> dict[int, int]:
        """{row: node} of Φ_q x."""
        sums: dict[int, list[int]] = {}
        for (r, c), node in sorted(self.jacobian.items()):
            sums.setdefault(r, []).append(self.graph.mul(node, x[c]))
        return {r: self.graph.sum(nodes) for r, nodes in sums.items()}


def _total(graph: Graph, a: int | None, b: int | None) -> int:
    return b if a is None else a if b is None else graph.add(a, b)


def _closing(equations: Equations, sizes: Sizes, holonomic: list[int]) -> Program:
    lines = Lines(equations)
    graph = lines.graph
    zero = graph.const(0.0)
    saddle = _Saddle(lines, sizes, holonomic)
    phi = {r: node for (r,), node in lines.gather(KERNELS["phi"]).items() if r in saddle.place}
    step = saddle.solve({saddle.place[r]: graph.neg(node) for r, node in phi.items()})
    steps = [step.get(c, zero) for c in range(saddle.n)]
    return lines.program("closing", ("t", "q", "p", "e"), [*steps, *(phi.get(r, zero) for r in range(len(equations.rows)))])


def _motion(equations: Equations, sizes: Sizes) -> Program:
    lines = Lines(equations)
    graph = lines.graph
    zero = graph.const(0.0)
    n, m = len(equations.free), len(equations.rows)
    saddle = _Saddle(lines, sizes, range(m))
    nu = {r: node for (r,), node in lines.gather(KERNELS["nu"]).items()}
    off = saddle.times_jacobian(lines.rates)
    missing = {n + r: graph.sub(nu.get(r, zero), off.get(r, zero)) for r in sorted(nu.keys() | off.keys())}
    onto = saddle.solve(missing)
    lines.rates = [graph.add(rate, onto[c]) if c in onto else rate for c, rate in enumerate(lines.rates)]

    right = {c: node for (c,), node in lines.gather(KERNELS["force"]).items()}
    right |= {n + r: node for (r,), node in lines.gather(KERNELS["gamma"]).items()}
    x = saddle.refined(right)
    solution = [x.get(k, zero) for k in range(n + m)]
    power = lines.gather(KERNELS["energy"]).get((ENERGIES.index("power"),), zero)
    for r, node in nu.items():
        power = graph.sub(power, graph.mul(node, solution[n + r]))
    return lines.program("motion", ("t", "q", "qd", "p", "e"), [*lines.rates, *solution, power])
