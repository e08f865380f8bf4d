"""Where a term reads from: its places in q and p, numbered locally so that equal terms look equal.

Two terms with the same `structure` (template, pattern of fixed and free components, shared
coordinates) are computed by the same operations on other places: they share one loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ncgen.errors import ModelError
from ncgen.model.elements import Component, rate_name
from ncgen.model.values import Parameter, is_number
from ncgen.program.graph import Graph
from ncgen.program.lower import LoweredTemplate, lowered
from ncgen.symbolic.equations import Equations, Term
from ncgen.symbolic.templates import TIME

FOLDED = (0.0, 1.0, -1.0)
"""Numbers that simplify what they meet; they belong to the structure of a term, all others to its data."""


@dataclass(eq=False)
class Bound:
    """A term with its sources.

    scalars: per scalar the pairs (weight reference, coordinate reference)
    data: a reference per constant
    A reference is ("number", value) for folded numbers, or ("q", k), ("const", k), ("p", k): the k-th
    coordinate, constant or parameter of this term.
    """

    term: Term
    template: LoweredTemplate
    scalars: list[list[tuple]] = field(default_factory=list)
    data: dict[str, tuple] = field(default_factory=dict)
    coordinates: list[Component] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    parameters: list[tuple[str, int]] = field(default_factory=list)
    names: dict[tuple, str] = field(default_factory=dict)

    @property
    def structure(self) -> tuple:
        sources = tuple(array for array, _ in self.parameters)
        return (self.term.template, tuple(map(tuple, self.scalars)), tuple(self.data.items()), sources)


class Derived:
    """Expressions of parameters, computed once at the start of a kernel into the temporary `d`."""

    def __init__(self):
        self.expressions: list[object] = []

    def index(self, expression) -> int:
        if expression not in self.expressions:
            self.expressions.append(expression)
        return self.expressions.index(expression)


def bind(term: Term, equations: Equations, derived: Derived) -> Bound:
    """Find the sources of every scalar and constant of a term."""
    bound = Bound(term, lowered(term.template))
    positions = {p.name: i for i, p in enumerate(equations.parameters)} if equations.parameters else {}

    def value(v, name: str) -> tuple:
        if is_number(v):
            if not math.isfinite(v):
                raise ModelError(f"its {name} becomes {float(v)}; check the units of lengths and masses")
            if float(v) in FOLDED:
                return ("number", float(v) + 0.0)
            bound.constants.append(float(v))
            reference = ("const", len(bound.constants) - 1)
        else:
            source = ("p", positions[v.name]) if isinstance(v, Parameter) else ("d", derived.index(v))
            bound.parameters.append(source)
            reference = ("p", len(bound.parameters) - 1)
        bound.names[reference] = name
        return reference

    def coordinate(component: Component, name: str) -> tuple:
        if not equations.moves(component):
            return value(component.value, name)
        if component not in bound.coordinates:
            bound.coordinates.append(component)
        reference = ("q", bound.coordinates.index(component))
        bound.names.setdefault(reference, name)
        return reference

    for name, form in zip(term.template.scalars, term.scalars, strict=True):
        pairs = []
        for k, (weight, component) in enumerate(form):
            head, _, axis = name.rpartition("_") if len(form) > 1 else ("", "", "")
            place = f"{head}{k}_{axis}" if head else name
            pairs.append((value(weight, f"weight_{place}"), coordinate(component, place)))
        bound.scalars.append(pairs)
    bound.data = {n: value(v, n) for n, v in zip(term.template.data, term.data, strict=True)}
    return bound


class Places:
    """Turns a term's references into operations of a graph.

    read(reference) gives the node of ("q", k), ("qd", k), ("const", k) or ("p", k).
    """

    def __init__(self, graph: Graph, bound: Bound, read):
        self.graph = graph
        self.bound = bound
        self.read = read
        self.scalars = dict(zip(bound.term.template.scalars, bound.scalars, strict=True))
        self.rates = {rate_name(name): pairs for name, pairs in self.scalars.items()}

    def node(self, reference) -> int:
        kind, value = reference
        return self.graph.const(value) if kind == "number" else self.read(reference)

    def symbol(self, name: str) -> int:
        """The node of a template's symbol: a scalar, its rate, a constant, or time."""
        if name in self.scalars:
            return self.graph.sum(self.graph.mul(self.node(w), self.node(c)) for w, c in self.scalars[name])
        if name in self.rates:
            moving = [(w, c[1]) for w, c in self.rates[name] if c[0] == "q"]
            return self.graph.sum(self.graph.mul(self.node(w), self.read(("qd", k))) for w, k in moving)
        if name == TIME.name:
            return self.graph.load("t", 0)
        return self.node(self.bound.data[name])

    def weights(self, coordinate: int) -> list[tuple[int, int]]:
        """(scalar number, node of its weight) for every scalar the coordinate enters."""
        return [(k, self.node(w)) for k, pairs in enumerate(self.bound.scalars) for w, c in pairs if c == ("q", coordinate)]
