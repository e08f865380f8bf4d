"""Accelerations and multipliers of a state as nodes of a graph, and how they change with inputs.

They solve M q̈ + Φ_qᵀ λ = Q, Φ_q q̈ = γ at the state as it is, by the quasidefinite matrix H of `full_motion`. λ is affine in what stands
in forces alone, such as inputs, so changes are solutions with the same factors.
"""

from __future__ import annotations

import numpy as np

from ncgen.program.lines import Lines
from ncgen.program.motions.full_motion import REGULARISATION, MotionSizes, Saddle

STATE = ("t", "q", "qd", "p")


class AccelerationNodes:
    """q̈ and λ of a state in a graph; qdd (n), lam (m): nodes."""

    def __init__(self, lines: Lines, sizes: MotionSizes) -> None:
        n, m = len(lines.equations.free), len(lines.equations.rows)
        self.lines, self.n, zero = lines, n, lines.graph.const(0.0)
        self.saddle = Saddle(lines, sizes, range(m), REGULARISATION)
        self.right, self.x = self.saddle.motion()
        self.qdd = [self.x.get(c, zero) for c in range(n)]
        self.lam = [self.x.get(n + r, zero) for r in range(m)]

    def energy(self, sizes: MotionSizes, rows: np.ndarray) -> int:
        """A node of the energy of what brings loads about, of which they are fractions: forces along natural sizes of coordinates, and
        what accelerates constraints times inertia. rows (m,): natural sizes of constraints"""
        graph, inertia = self.lines.graph, float(np.max(sizes.W * sizes.columns**2, initial=0.0))
        scales = [*sizes.columns.tolist(), *(inertia / rows).tolist()]
        return graph.sum([graph.mul(graph.const(scales[k]), graph.call("abs", node)) for k, node in sorted(self.right.items())])

    def along(self, changes: dict[int, int]) -> tuple[list[int], list[int]]:
        """How q̈ (n) and λ (m) change where inputs of the graph do. changes: {input: its change}"""
        changes_of = self.saddle.change(self.x, self.right, changes, self.saddle.refined)
        zero = self.lines.graph.const(0.0)
        return [changes_of.get(c, zero) for c in range(self.n)], [changes_of.get(self.n + r, zero) for r in range(len(self.lam))]
