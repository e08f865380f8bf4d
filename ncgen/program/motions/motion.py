"""The motion of all coordinates by recursion over the tree of bodies, without a choice of independent ones.

    derivative(t, q, qd, p)  -> q̇ (n), q̈ (n), power, growth; with forces along the coordinates derivative(t, q, qd, forces, p)
    projected(t, q, qd, p)   -> q̈ (n), q̇ (n), power, growth: the nearest velocities that the joints allow, in the sense of kinetic energy,
                                and the accelerations there; in the order of the states that runs integrate
    velocities(t, q, qd, p)  -> q̇ (n), growth: these alone

The velocities given say how the joints turn and slide (`ncgen.program.tree.joint_rates`), and x = R ż + S ν is what loops allow of that.
What is left of the velocities, r, has the momentum Tᵀ M r over the rates, which changes the free ones by (RᵀHR)⁻¹ Rᵀ Tᵀ M r: a
projection for the price of one more right-hand side, less what both have in common.

growth is how much larger ‖R‖² and the reciprocals of the pivots are than in the samples; far from 1 the fixed order of elimination is a
bad one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ncgen.program.algebra.elimination import times
from ncgen.program.algebra.growth import pivot_growth, relative
from ncgen.program.ir.blocks import Phases, Program
from ncgen.program.ir.cut import RATES
from ncgen.program.ir.sampling import Sample
from ncgen.program.tree.recursion import Column, Recursion
from ncgen.program.tree.tree_motion import Loads
from ncgen.symbolic.numbering import Terms

STATE, FORCED = ("t", "q", "qd", "p"), ("t", "q", "qd", "forces", "p")


class RecursiveMotions:
    """The programs by every recursion that applies. Arguments and errors as for `assemble_recursions`; forced: with `forces`, along all
    coordinates, as one more input of the derivative."""

    def __init__(self, equations: Terms, samples: Sequence[Sample], sizes: np.ndarray, forced: bool = False) -> None:
        self.work = Recursion(equations, None, samples, sizes, forced)

    def derivatives(self) -> dict[str, Program]:
        """`derivative` by the name of its recursion."""
        return {name: self._derivative(zdd) for name, zdd in self.work.ways()}

    def velocities(self, way: str) -> Program:
        """`velocities` by one of these."""
        work = self.work
        moved = work.at_speeds(self._corrected(way))
        return work.lines.draft("velocities", STATE, [*moved.lines.rates, _growth(work)])

    def projected(self, way: str) -> Program:
        """`projected` by one of these, with phases: joint velocities are measured, corrected, and all else follows from them.

        Both have inertias and their factors in common, and joint velocities are not measured again.
        """
        work, count = self.work, len(self.work.speeds)
        moved = work.at_speeds([work.graph.load(RATES, k) for k in range(count)])
        zdd = moved.solve(way)
        outputs = [*_accelerations(moved, zdd), *moved.lines.rates, moved.power(zdd), _growth(work)]
        phases = Phases(count, _places_of_velocities(len(outputs)))
        return work.lines.draft("projected", ("t", "q", "qd", RATES, "p"), [*work.speeds, *self._corrected(way), *outputs], phases)

    def _corrected(self, way: str) -> list[int]:
        changes = self.work.solve(way, _momentum(self.work))
        return [self.work.graph.add(speed, change) for speed, change in zip(self.work.speeds, changes, strict=True)]

    def _derivative(self, zdd: Sequence[int]) -> Program:
        work = self.work
        outputs = [*work.lines.rates, *_accelerations(work, zdd), work.power(zdd), _growth(work)]
        return work.lines.draft("derivative", FORCED if work.forces else STATE, outputs)


def derivative_of(projected: Program) -> Program:
    """`derivative`, which consists of phases of `projected`."""
    return replace(in_order_of_runs(projected.uncorrected), name="derivative")


def in_order_of_runs(derivative: Program) -> Program:
    """`derivative` with q̈ before q̇, as `projected` has them; and what has that order in the other one."""
    n = derivative.size // 2 - 1
    return derivative.reordered([*range(n, 2 * n), *range(n), 2 * n, 2 * n + 1])


def among_projected(velocities: Program) -> Program:
    """`velocities` that writes where `projected` has them."""
    size = 2 * velocities.size
    return replace(velocities.reordered(_places_of_velocities(size)), size=size)


def _places_of_velocities(size: int) -> tuple[int, ...]:
    """Where q̇ and growth are among so many outputs of `projected`."""
    n = size // 2 - 1
    return (*range(n, 2 * n), size - 1)


def _accelerations(work: Recursion, zdd: Sequence[int]) -> list[int]:
    """q̈ of all coordinates."""
    changes = work.spread(zdd, work.bias)
    return work.over_coordinates(changes, work.velocity.accelerations(changes))


def _momentum(work: Recursion) -> Column:
    """{rate: node} of Tᵀ M (q̇ given − q̇)."""
    graph, rates = work.graph, work.rates
    rest = {c: graph.sub(graph.load("qd", c), rate) for c, rate in enumerate(work.lines.rates)}
    loads: Loads = {}
    momentum: Column = {}
    for c, node in sorted(times(graph, work.masses, rest).items()):
        if c in rates.where:
            rates.load(loads, c, node)
        else:
            momentum[rates.own[c]] = node
    return momentum | rates.geometry.inward(loads, {})


def _growth(work: Recursion) -> int:
    """Return how much worse than in the samples the order of elimination is: ‖R‖², and pivots that become small."""
    graph, sampling, amplification = work.graph, work.rates.sampling, work.amplification()
    parts = [relative(graph, sampling, amplification)] if graph.value(amplification) is None else []
    return graph.sum([*parts, *pivot_growth(graph, sampling, work.factors.reciprocal)])
