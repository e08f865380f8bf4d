"""Expressions of a state, time and parameters as nodes of a mechanism's graph."""

from __future__ import annotations

from functools import partial

from ncgen.errors import ModelError, shortened
from ncgen.model.elements import rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.names import TIME
from ncgen.model.values import Scalar
from ncgen.program.ir.lower import lower_value
from ncgen.program.labels import labelled_errors
from ncgen.program.lines import Lines
from ncgen.program.motions.output_programs import read_component


def expression_node(lines: Lines, where: str, scalar: Scalar) -> int:
    """The node of an expression. Raises ModelError, which begins with `where`, where it mentions what the model does not have."""
    import sympy

    expression = sympy.sympify(scalar)
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
