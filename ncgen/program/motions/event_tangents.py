"""Derivatives of what happens at events along a direction, as programs; seed: the changes of t, q, q̇ and p.

condition_tangent(t, q, qd, p, seed)                  -> of the conditions, and in a mode of those of loads behind them
value_tangent(t, q, qd, p, seed)                      -> of what actions set, and of the values of elements
impact_tangent(t, q, qd, p, after, mu, push, seed)    -> of M (q̇⁺ − q̇) + Φ_qᵀ μ − Wᵀ Λ (n), of Φ_q q̇⁺ − ν (m), and of every row of W its
    velocities before and after; q̇⁺, μ and Λ are held

W has the gradients of gaps, whose velocities are W q̇ + ∂g/∂t, and then the gradients by q̇ of the velocities at which contacts slide and
ratchets run.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along, gradient
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.motions.event_programs import HeldLoad, Named, load_conditions
from ncgen.program.motions.expression_nodes import expression_node
from ncgen.program.motions.full_motion import MotionSizes, directions
from ncgen.program.motions.multipliers import AccelerationNodes
from ncgen.program.motions.sliding import Sliding, SlidingNodes
from ncgen.program.motions.sliding_derivatives import SlidingDerivatives
from ncgen.symbolic.numbering import Terms

STATE = ("t", "q", "qd", "p")
INPUTS = {
    "condition_tangent": (*STATE, "seed"),
    "value_tangent": (*STATE, "seed"),
    "impact_tangent": (*STATE, "after", "mu", "push", "seed"),
}


def assemble_condition_tangent(
    equations: Terms, conditions: Sequence[Named], held: Sequence[HeldLoad], sliding: Sequence[Sliding], sizes: MotionSizes,
    rows: np.ndarray,
) -> dict[str, Program]:  # fmt: skip
    """Of a mode, or of the mechanism itself where nothing is held; arguments as of `assemble_mode_conditions`."""
    lines = Lines(equations)
    nodes = [expression_node(lines, *each) for each in conditions]
    along = directions(lines)
    if held:
        lam, changes = _multipliers(lines, sizes, sliding, along)
        nodes += load_conditions(lines, lam, held, rows, lines.graph.const(1.0))[::2]
        along |= {node: change for node, change in zip(lam, changes, strict=True) if lines.graph.value(node) is None}
    return {"condition_tangent": _program(lines, "condition_tangent", nodes, along)}


def _multipliers(lines: Lines, sizes: MotionSizes, sliding: Sequence[Sliding], along: dict[int, int]) -> tuple[list[int], list[int]]:
    """Nodes of all multipliers (m) in a mode, and how they change."""
    if not sliding:
        motion = AccelerationNodes(lines, sizes)
        return motion.lam, motion.along(dict(along))[1]
    friction, n = SlidingNodes(lines, sizes, sliding), len(lines.equations.free)
    changes, _ = SlidingDerivatives(lines, friction).along(along)
    return friction.lam, [changes.get(n + r, lines.graph.const(0.0)) for r in range(len(friction.lam))]


def assemble_value_tangents(equations: Terms, values: Sequence[Named]) -> dict[str, Program]:
    """Of actions and elements."""
    lines = Lines(equations)
    nodes = [expression_node(lines, *each) for each in values]
    return {"value_tangent": _program(lines, "value_tangent", nodes, directions(lines))}


def assemble_impact_tangent(equations: Terms, gaps: Sequence[Named], rates: Sequence[Named]) -> dict[str, Program]:
    """Of the equations of an impact, as in this module's text."""
    lines = Lines(equations)
    return {"impact_tangent": _program(lines, "impact_tangent", _impact(lines, gaps, rates), directions(lines))}


def _impact(lines: Lines, gaps: Sequence[Named], rates: Sequence[Named]) -> list[int]:
    graph, n, m = lines.graph, len(lines.equations.free), len(lines.equations.rows)
    q = [graph.load("q", i) for i in range(n)]
    before, after = ([graph.load(name, i) for i in range(n)] for name in ("qd", "after"))
    change = [graph.sub(b, a) for a, b in zip(before, after, strict=True)]
    balance: list[list[int]] = [[] for _ in range(n)]
    rows: list[list[int]] = [[] for _ in range(m)]
    for (i, j), node in sorted(lines.matrix(KERNELS["mass"]).items()):
        balance[i].append(graph.mul(node, change[j]))
    for (r, i), node in sorted(lines.matrix(KERNELS["phi_q"]).items()):
        balance[i].append(graph.mul(node, graph.load("mu", r)))
        rows[r].append(graph.mul(node, after[i]))
    for r, node in sorted(lines.vector(KERNELS["nu"]).items()):
        rows[r].append(graph.neg(node))
    velocities, time = [], graph.load("t", 0)
    pairs = [(gradient(graph, expression_node(lines, *gap), [*q, time]), q) for gap in gaps]
    pairs += [(gradient(graph, expression_node(lines, *rate), before), before) for rate in rates]
    for k, (derivatives, variables) in enumerate(pairs):
        for i, variable in enumerate(variables):
            if variable in derivatives:
                balance[i].append(graph.neg(graph.mul(derivatives[variable], graph.load("push", k))))
        drift = [derivatives[time]] if time in derivatives else []
        for velocity in (before, after):
            parts = (graph.mul(derivatives[x], v) for x, v in zip(variables, velocity, strict=True) if x in derivatives)
            velocities.append(graph.sum([*parts, *drift]))
    return [*(graph.sum(nodes) for nodes in (*balance, *rows)), *velocities]


def _program(lines: Lines, name: str, nodes: Sequence[int], along: dict[int, int]) -> Program:
    """How nodes change along a direction."""
    equations, graph = lines.equations, lines.graph
    n = len(equations.free)
    program = lines.program(name, INPUTS[name], changes_along(graph, nodes, along))
    more = {"after": n, "mu": len(equations.rows), "push": len(nodes), "seed": 1 + 2 * n + len(equations.parameters)}
    verify(program, input_lengths(equations) | more)
    return program
