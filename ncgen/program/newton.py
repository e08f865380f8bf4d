"""A step of Newton's method over some coordinates, by some rows: Φ_q^d Δq^d = −Φ, eliminated in an order that is chosen in samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ncgen.program.algebra.elimination import Factors, Matrix, factor, solve
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.lines import Lines
from ncgen.program.programs import Split


def newton_step(lines: Lines, phi: Mapping[int, int], jacobian: Matrix, split: Split, samples: Sequence[Sample]) -> dict[int, int]:
    """{dependent coordinate: node of its Δq}, without what is structurally zero, from Φ and Φ_q.

    Raises EliminationError where no order serves all samples.
    """
    _, factors = dependent_factors(lines, jacobian, split, samples)
    right = {i: lines.graph.neg(phi[r]) for i, r in enumerate(split.rows) if r in phi}
    return {split.dependent[j]: node for j, node in solve(lines.graph, factors, right).items()}


def newton_program(
    lines: Lines, split: Split, moved: Sequence[int] | None, steps: Mapping[int, int], phi: Mapping[int, int] | None
) -> Program:
    """The program newton(t, q, p) -> Δq of the coordinates `moved`, None for the dependent ones, then Φ if there is one; 0 for what is in
    neither."""
    zero = lines.graph.const(0.0)
    changes = [steps.get(c, zero) for c in (split.dependent if moved is None else moved)]
    residuals = [] if phi is None else [phi.get(r, zero) for r in range(len(lines.equations.rows))]
    made = lines.program if moved is None else lines.draft
    return made("newton", ("t", "q", "p"), [*changes, *residuals])


def dependent_factors(lines: Lines, jacobian: Matrix, split: Split, samples: Sequence[Sample]) -> tuple[Matrix, Factors]:
    """Φ_q^d over kept rows and dependent coordinates, renumbered, and its factors."""
    row = {r: i for i, r in enumerate(split.rows)}
    column = {c: j for j, c in enumerate(split.dependent)}
    matrix = {(row[r], column[c]): node for (r, c), node in jacobian.items() if r in row and c in column}
    return matrix, factor(lines.graph, matrix, len(split.rows), Sampling(lines.graph, samples).of(matrix))
