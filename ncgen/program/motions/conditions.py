"""The conditions of a mechanism's events, and what their actions set, as programs.

conditions(t, q, qd, p)            -> of every condition its value, and the size of its terms, with which rounding is compared
condition_slopes(t, q, qd, p)      -> of every condition ∂/∂q (n), ∂/∂q̇ (n) and ∂/∂t
condition_rates(t, q, qd, qdd, p)  -> the C rates of change along the motion, then the C second derivatives, those of conditions without q̇
action_values(t, q, qd, p)         -> the numbers that actions set
element_values(t, q, qd, p)        -> restitutions and static frictions that are expressions

In a mode the mechanism has more constraints, held ones, and `conditions` those of their loads behind its own: the load of a gap, static
friction less and plus the load of a joint, each positive as long as the constraint is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.errors import ModelError, shortened
from ncgen.model.elements import rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.names import TIME
from ncgen.model.values import Scalar
from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import gradient, tangent
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.verify import verify
from ncgen.program.labels import labelled_errors
from ncgen.program.lines import Lines
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.program.motions.multipliers import AccelerationNodes
from ncgen.program.motions.outputs import read_component
from ncgen.symbolic.numbering import Terms

if TYPE_CHECKING:
    import sympy

INPUTS = {
    "conditions": ("t", "q", "qd", "p"),
    "condition_slopes": ("t", "q", "qd", "p"),
    "condition_rates": ("t", "q", "qd", "qdd", "p"),
    "action_values": ("t", "q", "qd", "p"),
    "element_values": ("t", "q", "qd", "p"),
}

Named: TypeAlias = tuple[str, Scalar]
"""What messages call an expression, and the expression."""


def assemble_conditions(
    equations: Terms, conditions: Sequence[Named], values: Sequence[Named], elements: Sequence[Named]
) -> dict[str, Program]:
    """The programs of conditions and values of actions and elements, each with the words that messages call it by.

    Raises ModelError where one mentions what the model does not have.
    """
    lines = Lines(equations)
    graph, n = lines.graph, len(equations.free)
    gaps = [_node(lines, *each) for each in conditions]
    sizes = [_node(lines, where, terms_of(expression)) for where, expression in conditions]
    variables = [*(graph.load("q", i) for i in range(n)), *(graph.load("qd", i) for i in range(n)), graph.load("t", 0)]
    slopes, zero = [gradient(graph, gap, variables) for gap in gaps], graph.const(0.0)
    along = {variables[i]: variables[n + i] for i in range(n)} | {variables[n + i]: graph.load("qdd", i) for i in range(n)}
    along[variables[-1]] = graph.const(1.0)
    rates = [tangent(graph, [gap], along).get(gap, zero) for gap in gaps]
    second = [tangent(graph, [rate], along).get(rate, zero) for rate in rates]
    outputs = {
        "conditions": [node for pair in zip(gaps, sizes, strict=True) for node in pair],
        "condition_slopes": [found.get(v, zero) for found in slopes for v in variables],
        "condition_rates": [*rates, *second],
        "action_values": [_node(lines, *each) for each in values],
        "element_values": [_node(lines, *each) for each in elements],
    }
    programs = {name: lines.program(name, INPUTS[name], nodes) for name, nodes in outputs.items() if nodes}
    for program in programs.values():
        verify(program, input_lengths(equations))
    return programs


def assemble_mode_conditions(
    equations: Terms, conditions: Sequence[Named], held: Sequence[tuple[str, Scalar | None]], sizes: MotionSizes, rows: np.ndarray
) -> dict[str, Program]:
    """The program `conditions` of a mode, whose last constraints are held.

    held: its words, and static friction or None for a gap; rows (m,): natural sizes of the constraints, with which multipliers are compared
    """
    lines = Lines(equations)
    graph = lines.graph
    found = [_node(lines, where, each) for where, when in conditions for each in (when, terms_of(when))]
    lam = AccelerationNodes(lines, sizes).lam
    all_loads = graph.sum([graph.mul(graph.const(float(size)), graph.call("abs", node)) for node, size in zip(lam, rows, strict=True)])
    for k, (where, static) in enumerate(held, len(lam) - len(held)):
        load, size = graph.neg(lam[k]), graph.mul(graph.const(1 / float(rows[k])), all_loads)
        if static is None:
            found += [load, size]
            continue
        most = _node(lines, where, static)
        size = graph.add(most, size)
        found += [graph.sub(most, load), size, graph.add(most, load), size]
    program = lines.program("conditions", INPUTS["conditions"], found)
    verify(program, input_lengths(equations))
    return {"conditions": program}


def terms_of(expression: Scalar) -> sympy.Expr:
    """The sum of the sizes of the terms of an expression; those of a polynomial are its monomials."""
    import sympy

    terms = sympy.Add.make_args(sympy.expand(sympy.sympify(expression)))
    return sympy.Add(*(sympy.Abs(term) for term in terms))


def degree_of(expression: Scalar, moving: set[str]) -> int | None:
    """The degree of an expression as a polynomial of the time and of coordinates and velocities of these names; None where it is none."""
    import sympy

    formula = sympy.sympify(expression)
    symbols = [s for s in sorted(symbols_in(formula), key=str) if s.name == TIME or s.name in moving]
    if not symbols:
        return 0
    poly = formula.as_poly(*symbols)
    return None if poly is None else poly.total_degree()


def _node(lines: Lines, where: str, given: Scalar) -> int:
    import sympy

    expression = sympy.sympify(given)
    known = {TIME: partial(lines.graph.load, "t", 0)}
    known |= {p.name: partial(lines.graph.load, "p", i) for i, p in enumerate(lines.equations.parameters)}
    for component in lines.equations.model.components:
        for name, array in ((component.name, "q"), (rate_name(component.name), "qd")):
            known[name] = partial(read_component, lines, array, component)
    mentioned = sorted(s.name for s in symbols_in(expression))
    for name in mentioned:
        if name not in known:
            raise ModelError(
                f"{where}: {shortened(name, 60)} is neither a coordinate, a velocity, a parameter, an input nor m.time; "
                "correct the expression"
            )
    with labelled_errors(where):
        return lower_value(lines.graph, expression, {name: known[name]() for name in mentioned})
