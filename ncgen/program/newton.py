"""A step of Newton's method over some coordinates, by some rows: Φ_q^d Δq^d = −Φ, eliminated in an order that is chosen in samples."""

from __future__ import annotations

from collections.abc import Sequence

from ncgen.program.algebra.elimination import Factors, Matrix, factor, solve
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.programs import Split


def newton_step(lines: Lines, split: Split, samples: Sequence[Sample]) -> tuple[dict[int, int], dict[int, int]]:
    """{dependent coordinate: node of its Δq}, and {row: node} of all of Φ; both without what is structurally zero.

    Raises EliminationError where no order serves all samples.
    """
    graph, phi = lines.graph, lines.vector(KERNELS["phi"])
    _, factors = dependent_factors(lines, lines.matrix(KERNELS["phi_q"]), split, samples)
    right = {i: graph.neg(phi[r]) for i, r in enumerate(split.rows) if r in phi}
    return {split.dependent[j]: node for j, node in solve(graph, factors, right).items()}, phi


def dependent_factors(lines: Lines, jacobian: Matrix, split: Split, samples: Sequence[Sample]) -> tuple[Matrix, Factors]:
    """Φ_q^d over kept rows and dependent coordinates, renumbered, and its factors."""
    row = {r: i for i, r in enumerate(split.rows)}
    column = {c: j for j, c in enumerate(split.dependent)}
    matrix = {(row[r], column[c]): node for (r, c), node in jacobian.items() if r in row and c in column}
    return matrix, factor(lines.graph, matrix, len(split.rows), Sampling(lines.graph, samples).of(matrix))
