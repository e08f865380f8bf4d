"""The outputs of a mechanism as a program and its tangent, one number an output, in the model's order.

outputs(t, q, qd, qdd, p)                -> the outputs
outputs_tangent(t, q, qd, qdd, p, seed)  -> how they change with seed = [dq; dq̇; dq̈; dp]
"""

from __future__ import annotations

import sympy

from ncgen.errors import ModelError, shortened
from ncgen.model.elements import Component, rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.names import TIME
from ncgen.model.outputs import Output
from ncgen.model.values import as_sympy, is_number
from ncgen.program.assemble import told_of
from ncgen.program.blocks import Program
from ncgen.program.derivatives import tangent
from ncgen.program.lines import Lines
from ncgen.program.lower import lower_value
from ncgen.program.verify import verify
from ncgen.symbolic.numbering import Terms

INPUTS = ("t", "q", "qd", "qdd", "p")


def assemble_outputs(equations: Terms) -> tuple[Program, Program]:
    """Both programs. Raises ModelError where an output mentions what the model does not have."""
    lines = Lines(equations)
    nodes = [_node(lines, output) for output in equations.model.outputs.values()]
    program = lines.program("outputs", INPUTS, nodes)
    sizes = {"t": 1, **dict.fromkeys(("q", "qd", "qdd"), len(equations.free)), "p": len(equations.parameters)}
    moved = [(array, k) for array in INPUTS[1:] for k in range(sizes[array])]
    along = {lines.graph.load(*leaf): lines.graph.load("seed", k) for k, leaf in enumerate(moved)}
    found = tangent(lines.graph, nodes, along)
    slope = lines.program("outputs_tangent", (*INPUTS, "seed"), [found.get(node, lines.graph.const(0.0)) for node in nodes])
    for each in (program, slope):
        verify(each, sizes | {"seed": len(moved)})
    return program, slope


def _node(lines: Lines, output: Output) -> int:
    expression = sympy.sympify(output.expression)
    known = _known(lines)
    mentioned = {s.name for s in symbols_in(expression)}
    if unknown := sorted(mentioned - known.keys()):
        raise ModelError(
            f"output {output.label}: {shortened(unknown[0], 60)} is neither a coordinate, a rate, an acceleration, a parameter, an input "
            "nor m.time; correct the expression"
        )
    with told_of(f"output {output.label}"):
        return lower_value(lines.graph, expression, {name: _read(lines, *known[name]) for name in mentioned})


def _known(lines: Lines) -> dict[str, tuple[str, Component | int]]:
    """{name: (array, component or position in it)} of all that an output can mention."""
    found: dict[str, tuple[str, Component | int]] = {TIME: ("t", 0)}
    found |= {p.name: ("p", i) for i, p in enumerate(lines.equations.parameters)}
    for component in lines.equations.model.components:
        rate = rate_name(component.name)
        found |= {component.name: ("q", component), rate: ("qd", component), rate_name(rate): ("qdd", component)}
    return found


def _read(lines: Lines, array: str, place: Component | int) -> int:
    """A node: what is fixed has a value and does not move."""
    if not isinstance(place, Component):
        return lines.graph.load(array, place)
    if place in lines.equations.index:
        return lines.graph.load(array, lines.equations.index[place])
    value = place.value if array == "q" else 0.0
    return lines.value(value if is_number(value) else as_sympy(value))
