"""Multipliers of constraints as programs of a state and of inputs, with their exact derivatives by inputs.

multipliers(t, q, qd, p)     -> λ of the chosen constraints
multipliers_by(t, q, qd, p)  -> ∂λ/∂p of the chosen constraints by the chosen parameters, a row for each constraint

Both solve M q̈ + Φ_qᵀ λ = Q, Φ_q q̈ = γ at the state as it is, by the quasidefinite matrix H of `full_motion`. λ is affine in what stands
in forces alone, such as inputs, so ∂λ/∂p is a solution with the same factors.
"""

from __future__ import annotations

from collections.abc import Sequence

from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.motions.full_motion import REGULARISATION, MotionSizes, Saddle
from ncgen.symbolic.numbering import Terms

STATE = ("t", "q", "qd", "p")


class AccelerationNodes:
    """q̈ and λ of a state in a graph; qdd (n), lam (m): nodes."""

    def __init__(self, lines: Lines, sizes: MotionSizes) -> None:
        n, m = len(lines.equations.free), len(lines.equations.rows)
        self.lines, self.n, zero = lines, n, lines.graph.const(0.0)
        self.saddle = Saddle(lines, sizes, range(m), REGULARISATION)
        self.right = lines.vector(KERNELS["force"])
        self.right |= {n + r: node for r, node in lines.vector(KERNELS["gamma"]).items()}
        self.x = self.saddle.refined(self.right)
        self.qdd = [self.x.get(c, zero) for c in range(n)]
        self.lam = [self.x.get(n + r, zero) for r in range(m)]

    def along(self, changes: dict[int, int]) -> tuple[list[int], list[int]]:
        """How q̈ (n) and λ (m) change where inputs of the graph do. changes: {input: its change}"""
        changes_of = self.saddle.change(self.x, self.right, changes, self.saddle.refined)
        zero = self.lines.graph.const(0.0)
        return [changes_of.get(c, zero) for c in range(self.n)], [changes_of.get(self.n + r, zero) for r in range(len(self.lam))]


def assemble_multipliers(equations: Terms, sizes: MotionSizes, rows: Sequence[int], by: Sequence[int] = ()) -> dict[str, Program]:
    """The programs, by their names. rows: numbers of constraints; by: numbers of parameters, inputs being the last of them"""
    lines = Lines(equations)
    graph, motion = lines.graph, AccelerationNodes(lines, sizes)
    programs = {"multipliers": lines.program("multipliers", STATE, [motion.lam[r] for r in rows])}
    if by:
        columns = [motion.along({graph.load("p", k): graph.const(1.0)})[1] for k in by]
        programs["multipliers_by"] = lines.program("multipliers_by", STATE, [column[r] for r in rows for column in columns])
    for program in programs.values():
        verify(program, input_lengths(equations))
    return programs
