"""The outputs of a mechanism as a program and its tangent, one number an output, in the model's order.

outputs(t, q, qd, qdd, lam, p)                -> the outputs
outputs_tangent(t, q, qd, qdd, lam, p, seed)  -> how they change with seed = [dq; dq̇; dq̈; dλ; dp]

λ is read where outputs mention loads: those of joints are `full_loads`, and a driver, whose row is coordinate − law(t), does −λ.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TypeAlias

from ncgen.errors import ModelError, shortened
from ncgen.model.bodies import load_names
from ncgen.model.elements import Component, driver_name, rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.names import TIME
from ncgen.model.outputs import Output
from ncgen.model.values import as_sympy, is_number
from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.verify import verify
from ncgen.program.labels import labelled_errors
from ncgen.program.lines import Lines
from ncgen.program.motions.full_loads import load_nodes, loaded_elements
from ncgen.symbolic.numbering import Terms

INPUTS = ("t", "q", "qd", "qdd", "lam", "p")

LOAD_INPUTS = ("t", "q", "qd", "qdd", "lam", "felt", "p", "seed")

Known: TypeAlias = dict[str, Callable[[], int]]
"""{name: what makes its node}."""


def assemble_outputs(equations: Terms) -> tuple[Program, Program]:
    """Both programs. Raises ModelError where an output mentions what the model does not have."""
    lines = Lines(equations)
    known = _known(lines)
    nodes = [_node(lines, output, known) for output in equations.model.outputs.values()]
    program = lines.program("outputs", INPUTS, nodes)
    sizes = input_lengths(equations)
    moved = [(array, k) for array in INPUTS[1:] for k in range(sizes[array])]
    along = {lines.graph.load(*leaf): lines.graph.load("seed", k) for k, leaf in enumerate(moved)}
    derivative = lines.program("outputs_tangent", (*INPUTS, "seed"), changes_along(lines.graph, nodes, along))
    for each in (program, derivative):
        verify(each, sizes | {"seed": len(moved)})
    return program, derivative


def assemble_load_slopes(equations: Terms) -> Program:
    """load_slopes(t, q, qd, qdd, lam, felt, p, seed) -> how outputs change where joint loads, `felt`, change by `seed` and nothing else.

    Three numbers a load, in the order of `loaded_elements`.
    """
    lines, names = Lines(equations), _load_words(equations)
    graph = lines.graph
    known = _known(lines) | {name: partial(graph.load, "felt", k) for k, name in enumerate(names)}
    nodes = [_node(lines, output, known) for output in equations.model.outputs.values()]
    along = {graph.load("felt", k): graph.load("seed", k) for k in range(len(names))}
    program = lines.program("load_slopes", LOAD_INPUTS, changes_along(graph, nodes, along))
    verify(program, input_lengths(equations) | {"felt": len(names), "seed": len(names)})
    return program


def _load_words(equations: Terms) -> list[str]:
    return [name for pair in loaded_elements(equations) for name in load_names(*pair)]


def _node(lines: Lines, output: Output, known: Known) -> int:
    import sympy

    expression = sympy.sympify(output.expression)
    mentioned = sorted(s.name for s in symbols_in(expression))
    for name in mentioned:
        if name not in known:
            raise ModelError(f"output {output.label}: {_refused(lines, name)}")
    with labelled_errors(f"output {output.label}"):
        return lower_value(lines.graph, expression, {name: known[name]() for name in mentioned})


def _refused(lines: Lines, name: str) -> str:
    """Why an output cannot mention a name."""
    if name in {driver_name(c.name) for c in lines.equations.model.components}:
        return f"{name}: nothing drives that coordinate; m.drive does, or leave it out"
    return (
        f"{shortened(name, 60)} is neither a coordinate, a rate, an acceleration, a load, a parameter, an input nor m.time; "
        "correct the expression"
    )


def _known(lines: Lines) -> Known:
    """All that an output can mention."""
    readers: Known = {TIME: partial(lines.graph.load, "t", 0)}
    readers |= {p.name: partial(lines.graph.load, "p", i) for i, p in enumerate(lines.equations.parameters)}
    for component in lines.equations.model.components:
        rate = rate_name(component.name)
        for name, array in ((component.name, "q"), (rate, "qd"), (rate_name(rate), "qdd")):
            readers[name] = partial(read_component, lines, array, component)
    return readers | _loads(lines)


def _loads(lines: Lines) -> Known:
    """Joint loads, which are put into the graph once the first of them is mentioned, and driver forces."""
    graph, equations = lines.graph, lines.equations
    nodes = cache(lambda: load_nodes(lines))
    readers: Known = {name: partial(lambda k: nodes()[k], k) for k, name in enumerate(_load_words(equations))}
    for r, row in enumerate(equations.model.rows):
        if row.owner.kind == "driver":
            readers[driver_name(row.owner.name)] = lambda r=r: graph.neg(graph.load("lam", r))
    return readers


def read_component(lines: Lines, array: str, component: Component) -> int:
    """A node: what is fixed has a value and does not move."""
    if component in lines.equations.index:
        return lines.graph.load(array, lines.equations.index[component])
    value = component.value if array == "q" else 0.0
    return lines.value(value if is_number(value) else as_sympy(value))
