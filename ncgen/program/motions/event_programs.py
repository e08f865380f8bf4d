"""The conditions of a mechanism's events, and what their actions set, as programs.

conditions(t, q, qd, p)            -> of every condition its value, and the size of its terms, with which rounding is compared
condition_derivatives(t, q, qd, p)      -> of every condition ∂/∂q (n), ∂/∂q̇ (n) and ∂/∂t
condition_rates(t, q, qd, qdd, p)  -> the C rates of change along the motion, then the C second derivatives, those of conditions without q̇
action_values(t, q, qd, p)         -> the numbers that actions set
element_values(t, q, qd, p)        -> restitutions and coefficients of friction that are expressions
contact_velocities(t, q, qd, p)    -> velocities at which contacts slide, and of each ∂/∂q̇ (n)

In a mode the mechanism has more constraints, held ones, and `conditions` those of their loads behind its own: the load of a gap, static
friction less and plus the load of a joint, friction of a contact that sticks less its force (both squared), each positive as long as the
constraint is held; and what is positive as long as the loads of contacts that slide are determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.model.expressions import symbols_in
from ncgen.model.names import TIME
from ncgen.model.values import Scalar
from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along, gradient
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.verify import verify
from ncgen.program.lines import Lines
from ncgen.program.motions.expression_nodes import expression_node
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.program.motions.multipliers import AccelerationNodes
from ncgen.program.motions.sliding import Sliding, SlidingNodes
from ncgen.symbolic.numbering import Terms

if TYPE_CHECKING:
    import sympy

INPUTS = {
    "conditions": ("t", "q", "qd", "p"),
    "condition_derivatives": ("t", "q", "qd", "p"),
    "condition_rates": ("t", "q", "qd", "qdd", "p"),
    "action_values": ("t", "q", "qd", "p"),
    "element_values": ("t", "q", "qd", "p"),
    "contact_velocities": ("t", "q", "qd", "p"),
}

MAX_POLYNOMIAL_OPERATIONS = 300
"""Operations of an expression beyond which it is not written as a polynomial, which could have any number of terms."""

Named: TypeAlias = tuple[str, Scalar]
"""What messages call an expression, and the expression."""


def assemble_conditions(
    equations: Terms, conditions: Sequence[Named], values: Sequence[Named], elements: Sequence[Named], velocities: Sequence[Named]
) -> dict[str, Program]:
    """The programs of conditions, values of actions and elements, and velocities of contacts, each with the words of messages.

    Raises ModelError where one mentions what the model does not have.
    """
    lines = Lines(equations)
    graph, n = lines.graph, len(equations.free)
    gaps = [expression_node(lines, *each) for each in conditions]
    sizes = [expression_node(lines, where, terms_of(expression)) for where, expression in conditions]
    variables = [*(graph.load("q", i) for i in range(n)), *(graph.load("qd", i) for i in range(n)), graph.load("t", 0)]
    derivatives, zero = [gradient(graph, gap, variables) for gap in gaps], graph.const(0.0)
    along = {variables[i]: variables[n + i] for i in range(n)} | {variables[n + i]: graph.load("qdd", i) for i in range(n)}
    along[variables[-1]] = graph.const(1.0)
    rates = changes_along(graph, gaps, along)
    second = changes_along(graph, rates, along)
    slides = [expression_node(lines, *each) for each in velocities]
    outputs = {
        "conditions": [node for pair in zip(gaps, sizes, strict=True) for node in pair],
        "condition_derivatives": [derivative.get(v, zero) for derivative in derivatives for v in variables],
        "condition_rates": [*rates, *second],
        "action_values": [expression_node(lines, *each) for each in values],
        "element_values": [expression_node(lines, *each) for each in elements],
        "contact_velocities": [*slides, *(gradient(graph, w, variables).get(v, zero) for w in slides for v in variables[n : 2 * n])],
    }
    programs = {name: lines.program(name, INPUTS[name], nodes) for name, nodes in outputs.items() if nodes}
    for program in programs.values():
        verify(program, input_lengths(equations))
    return programs


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldLoad:
    """What holds a constraint of a mode. row: number of its first constraint; words, as messages call it

    static: friction that holds a joint, times the load of the constraints `pressed` where there are some
    grip: (number of its gap's constraint, coefficient) of a contact that sticks, which has as many constraints as `directions`
    A gap has neither
    shows_force: whether the multipliers of these constraints stand behind the condition, each with the size 1
    """

    words: str
    row: int
    static: Scalar | None = None
    grip: tuple[int, Scalar] | None = None
    directions: int = 1
    pressed: tuple[int, ...] = ()
    shows_force: bool = False


def assemble_mode_conditions(
    equations: Terms,
    conditions: Sequence[Named],
    held: Sequence[HeldLoad],
    sliding: Sequence[Sliding],
    sizes: MotionSizes,
    rows: np.ndarray,
) -> dict[str, Program]:
    """The program `conditions` of a mode.

    held: its constraints; sliding: contacts that slide in it; rows (m,): natural sizes of constraints, with which multipliers are compared
    """
    lines = Lines(equations)
    graph = lines.graph
    nodes = [expression_node(lines, where, each) for where, when in conditions for each in (when, terms_of(when))]
    motion = SlidingNodes(lines, sizes, sliding) if sliding else AccelerationNodes(lines, sizes)
    accelerations = motion.motion if isinstance(motion, SlidingNodes) else motion
    nodes += load_conditions(lines, motion.lam, held, rows, accelerations.energy(sizes, rows))
    if isinstance(motion, SlidingNodes):
        nodes += [motion.margin, graph.const(1.0)]
    program = lines.program("conditions", INPUTS["conditions"], nodes)
    verify(program, input_lengths(equations))
    return {"conditions": program}


def assemble_load_margins(equations: Terms, held: Sequence[HeldLoad], rows: np.ndarray) -> Program:
    """The program of values and sizes of the conditions of loads, given the multipliers lam (m,); arguments as of
    `assemble_mode_conditions`"""
    lines = Lines(equations)
    graph = lines.graph
    lam = [graph.load("lam", row) for row in range(len(equations.rows))]
    all_loads = graph.sum([graph.mul(graph.const(float(size)), graph.call("abs", node)) for node, size in zip(lam, rows, strict=True)])
    return lines.program("load_margins", ("t", "q", "qd", "p", "lam"), load_conditions(lines, lam, held, rows, all_loads))


def load_conditions(lines: Lines, lam: Sequence[int], held: Sequence[HeldLoad], rows: np.ndarray, energy: int) -> list[int]:
    """Return nodes of values and sizes of the conditions of loads. lam (m,): nodes of all multipliers; energy: node of what loads along
    natural sizes are compared with; others as of `assemble_mode_conditions`"""
    graph, nodes = lines.graph, list[int]()
    for each in held:
        load, size = graph.neg(lam[each.row]), graph.mul(graph.const(1 / float(rows[each.row])), energy)
        if each.grip is not None:
            gap, friction = each.grip
            most = graph.mul(expression_node(lines, each.words, friction), lam[gap])
            most = graph.mul(most, most)
            force = graph.sum([graph.mul(x, x) for x in lam[each.row : each.row + each.directions]])
            nodes += [graph.sub(most, force), graph.sum([most, graph.mul(size, size)])]
        elif each.static is not None:
            most = expression_node(lines, each.words, each.static)
            if each.pressed:
                most = graph.mul(most, _together(graph, [lam[row] for row in each.pressed]))
            size = graph.add(most, size)
            nodes += [graph.sub(most, load), size, graph.add(most, load), size]
        else:
            nodes += [load, size]
        if each.shows_force:
            nodes += [node for x in lam[each.row : each.row + each.directions] for node in (x, graph.const(1.0))]
    return nodes


def _together(graph: Graph, loads: Sequence[int]) -> int:
    """The size of a load, or of two at a right angle."""
    if len(loads) == 1:
        return graph.call("abs", loads[0])
    return graph.call("sqrt", graph.sum([graph.mul(x, x) for x in loads]))


def terms_of(expression: Scalar) -> sympy.Expr:
    """The sum of the sizes of the terms of an expression; of one that is not long, those into which its products could be multiplied out:
    of a (b − c) it is |a| (|b| + |c|)."""
    import sympy

    formula = sympy.sympify(expression)
    if formula.count_ops() <= MAX_POLYNOMIAL_OPERATIONS:
        return _size(formula)
    return sympy.Add(*(sympy.Abs(term) for term in sympy.Add.make_args(formula)))


def _size(formula: sympy.Basic) -> sympy.Expr:
    """An expression with the sizes of its terms for these, so that none takes another away."""
    import sympy

    if isinstance(formula, (sympy.Add, sympy.Mul)):
        return formula.func(*map(_size, formula.args))
    if isinstance(formula, sympy.Pow) and formula.exp.is_Integer and formula.exp.is_positive:
        return _size(formula.base) ** formula.exp
    return sympy.Abs(formula)


def degree_of(expression: Scalar, moving: set[str]) -> int | None:
    """The degree of an expression as a polynomial of time, coordinates and velocities of these names; None for others and long ones."""
    import sympy

    formula = sympy.sympify(expression)
    if formula.count_ops() > MAX_POLYNOMIAL_OPERATIONS:
        return None
    symbols = [s for s in sorted(symbols_in(formula), key=str) if s.name == TIME or s.name in moving]
    if not symbols:
        return 0
    poly = formula.as_poly(*symbols)
    return None if poly is None else poly.total_degree()
