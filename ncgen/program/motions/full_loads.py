"""Loads between bodies in a motion of all coordinates, as a program and its tangent.

    loads(t, q, qd, qdd, lam, p)                        -> for every element of every body three numbers
    loads_tangent(t, q, qd, qdd, lam, p, seed, change)  -> their changes

A body's balance over what it owns, f = M_b q̈ − Q_b + Φ_{q,b}ᵀ λ, is the load that its joints put on it: at a point the force
f, through a unit vector u the moment u × f (natural coordinates, 2.10). Springs and potentials pull on the first body that has the
coordinate. seed: [dt; dq; dq̇; dp]; change: [dq̇; dq̈; dλ] of the motion, as `motion_tangent` begins.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from ncgen.model.bodies import Body
from ncgen.model.elements import Component, Spatial, Vector
from ncgen.model.rows import Owner
from ncgen.model.values import Parameter, is_number
from ncgen.program.binding import BoundTerm, Reference
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import changes_along
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.motions.full_motion import directions
from ncgen.symbolic.equations import build_equations, build_springs
from ncgen.symbolic.numbering import Terms


def assemble_loads(equations: Terms) -> tuple[Program, Program]:
    """The program and its tangent, elements in the order of `loaded_elements`."""
    lines = Lines(equations)
    graph, n, m = lines.graph, len(equations.free), len(equations.rows)
    nodes = load_nodes(lines)
    program = lines.program("loads", ("t", "q", "qd", "qdd", "lam", "p"), nodes)
    along = directions(lines)
    moved = [*(("qd", i) for i in range(n)), *(("qdd", i) for i in range(n)), *(("lam", r) for r in range(m))]
    along |= {graph.load(*leaf): graph.load("change", k) for k, leaf in enumerate(moved)}
    inputs = ("t", "q", "qd", "qdd", "lam", "p", "seed", "change")
    derivative = lines.program("loads_tangent", inputs, changes_along(graph, nodes, along))
    parameters = len(equations.parameters)
    lengths = {"t": 1, "q": n, "qd": n, "qdd": n, "lam": m, "p": parameters, "seed": 1 + 2 * n + parameters, "change": 2 * n + m}
    for each in (program, derivative):
        verify(each, lengths)
    return program, derivative


def loaded_elements(equations: Terms) -> list[tuple[Body, Spatial]]:
    """(body, element) of every load."""
    return [(body, element) for body in equations.model.bodies.values() for element in body.elements]


def load_nodes(lines: Lines) -> list[int]:
    """Three nodes for every load, in the order of `loaded_elements`."""
    graph, equations = lines.graph, lines.equations
    springs = _BodyLines(lines, build_springs(equations.model))
    pulls = {equations.free[i]: node for i, node in springs.vector(KERNELS["force"]).items()}
    nodes: list[int] = []
    for body in equations.model.bodies.values():
        body_lines = _BodyLines(lines, build_equations(equations.model, Owner("body", body.name)))
        balance = body_lines.balance()
        for element in body.elements:
            f = [balance.get(c, graph.const(0.0)) for c in element.components]
            f = [graph.sub(node, pulls.pop(c)) if c in pulls else node for c, node in zip(element.components, f, strict=True)]
            nodes += _cross(graph, [body_lines.coordinate(c, "q") for c in element.components], f) if isinstance(element, Vector) else f
    return nodes


def _cross(graph: Graph, u: Sequence[int], f: Sequence[int]) -> list[int]:
    return [graph.sub(graph.mul(u[i - 2], f[i - 1]), graph.mul(u[i - 1], f[i - 2])) for i in range(3)]


class _BodyLines(Lines):
    """What one body owns, in the graph and on the coordinates of the whole; its fixed elements are coordinates without motion."""

    def __init__(self, whole: Lines, terms: Terms) -> None:
        super().__init__(terms)
        self.graph, self.whole = whole.graph, whole.equations

    def balance(self) -> dict[Component, int]:
        """{component: node of M q̈ − Q + Φ_qᵀ λ}"""
        graph, free = self.graph, self.equations.free
        sums: dict[Component, list[int]] = defaultdict(list)
        for (i, j), node in self.matrix(KERNELS["mass"]).items():
            sums[free[i]].append(graph.mul(node, self.coordinate(free[j], "qdd")))
        for i, node in self.vector(KERNELS["force"]).items():
            sums[free[i]].append(graph.neg(node))
        for (r, i), node in self.matrix(KERNELS["phi_q"]).items():
            sums[free[i]].append(graph.mul(node, graph.load("lam", r)))
        return {component: graph.sum(nodes) for component, nodes in sums.items()}

    def coordinate(self, component: Component, kind: str) -> int:
        """Where a component, its velocity or its acceleration is read."""
        if component in self.whole.index:
            return self.graph.load(kind, self.whole.index[component])
        if kind != "q":
            return self.graph.const(0.0)
        value, parameters = component.value, [p.name for p in self.whole.parameters]
        if is_number(value):
            return self.graph.const(float(value))
        if isinstance(value, Parameter):
            return self.graph.load("p", parameters.index(value.name))
        return lower_value(self.graph, value, {name: self.graph.load("p", i) for i, name in enumerate(parameters)})

    def _read(self, bound: BoundTerm, reference: Reference) -> int:
        kind, k = reference
        return self.coordinate(bound.coordinates[k], kind) if kind in ("q", "qd") else super()._read(bound, reference)
