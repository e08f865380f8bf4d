"""How much worse than in the samples the order of an elimination is, which was chosen in these."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ncgen.program.ir.graph import Graph
from ncgen.program.ir.sampling import Sampling, roughly

PIVOT_WEIGHT = 0.2
"""What the square of a reciprocal pivot counts: a third of a pivot is nothing unusual."""


def relative(graph: Graph, sampling: Sampling, node: int, weight: float = 1.0) -> int:
    """A node over the largest that it is in the samples, times a weight."""
    usual = roughly(np.max(sampling[node]))
    return graph.mul(graph.const(weight / usual), node) if usual > 0 else graph.const(0.0)


def pivot_growth(graph: Graph, sampling: Sampling, reciprocals: Iterable[int]) -> list[int]:
    """What small pivots count, from their reciprocals.

    Pivots become small at singular positions, and where rows that represent redundant ones degenerate, though R does not grow. What is
    constant cannot: it stands for joints that are measured, and on an open tree nothing else is eliminated but a positive definite mass
    matrix, for which no order is a bad one. So the result does not depend on how many joints a mechanism has.
    """
    smalls = [
        relative(graph, sampling, graph.mul(reciprocal, reciprocal), PIVOT_WEIGHT)
        for reciprocal in reciprocals
        if graph.value(reciprocal) is None
    ]
    return [graph.mul(small, small) for small in smalls]


def with_pivots(graph: Graph, sampling: Sampling, amplification: int, reciprocals: Iterable[int]) -> int:
    """‖R‖², and as many times what it usually is as small pivots count."""
    parts = pivot_growth(graph, sampling, reciprocals)
    usual = graph.const(roughly(np.max(sampling[amplification])))
    return graph.add(amplification, graph.mul(usual, graph.sum(parts))) if parts else amplification
