"""Where a term reads from: its places in q and p, numbered locally so that equal terms look equal.

Two terms with the same `structure` (template, pattern of fixed and free components, shared
coordinates) are computed by the same operations on other places: they share one loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

from ncgen.errors import ModelError
from ncgen.model.elements import Component, rate_name
from ncgen.model.names import TIME
from ncgen.model.traced_numbers import Traced, folded
from ncgen.model.values import Parameter, Value, is_number
from ncgen.program.ir.graph import FOLDED, ArrayElement, Graph
from ncgen.program.ir.lower import LoweredTemplate, lowered
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.templates import Template
from ncgen.symbolic.term import Term

if TYPE_CHECKING:
    import sympy


class Folded(NamedTuple):
    """A number that is folded into the operations of a term."""

    number: float


class Reference(NamedTuple):
    """Something that a term reads: the k-th of its coordinates ("q", with rates "qd" and "qdd"), constants or parameters.

    ("lam", 0) is the multiplier of a term that is a row.
    """

    kind: Literal["q", "qd", "qdd", "const", "p", "lam"]
    k: int


Source: TypeAlias = Folded | Reference

Pairs: TypeAlias = list[tuple[Source, Source]]
"""The linear form of a scalar: where its weights and its coordinates come from."""

Structure: TypeAlias = tuple[Template, tuple[tuple[tuple[Source, Source], ...], ...], tuple[tuple[str, Source], ...], tuple[str, ...]]
"""What terms of one loop have in common: template, scalars, data, and arrays of the parameters."""


@dataclass(eq=False, kw_only=True)
class BoundTerm:
    """A term with its sources.

    scalars: pairs per scalar; data: {name of a constant: its source}
    coordinates, constants, parameters: what references count; a parameter is read from "p" or is an expression in "d"
    names: what a reader calls what a reference stands for
    """

    term: Term
    template: LoweredTemplate
    scalars: list[Pairs] = field(default_factory=list)
    data: dict[str, Source] = field(default_factory=dict)
    coordinates: list[Component] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    parameters: list[ArrayElement] = field(default_factory=list)
    names: dict[Reference, str] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        sources = tuple(array for array, _ in self.parameters)
        return (self.term.template, tuple(map(tuple, self.scalars)), tuple(self.data.items()), sources)

    @property
    def row(self) -> int:
        """The number of the row that the term is."""
        assert self.term.row is not None, f"{self.term.label} is no row"
        return self.term.row


class Derived:
    """Expressions of parameters, computed once at the start of a kernel into the temporary `d`."""

    def __init__(self) -> None:
        self.expressions: list[sympy.Expr] = []
        self._places: dict[sympy.Expr, int] = {}

    def index(self, expression: sympy.Expr) -> int:
        if expression not in self._places:
            self._places[expression] = len(self.expressions)
            self.expressions.append(expression)
        return self._places[expression]


def bind(term: Term, equations: Terms, derived: Derived) -> BoundTerm:
    """Find the sources of every scalar and constant of a term."""
    bound = BoundTerm(term=term, template=lowered(term.template))
    positions = equations.parameter_index

    def value(v: Value, name: str) -> Source:
        if is_number(v):
            if not math.isfinite(v):
                raise ModelError(f"its {name} becomes {float(v)}; check the units of lengths and masses")
            number = folded(v)
            if number in FOLDED and not isinstance(number, Traced):
                return Folded(number + 0.0)
            bound.constants.append(number)
            reference = Reference("const", len(bound.constants) - 1)
        else:
            source = ArrayElement("p", positions[v.name]) if isinstance(v, Parameter) else ArrayElement("d", derived.index(v))
            bound.parameters.append(source)
            reference = Reference("p", len(bound.parameters) - 1)
        bound.names[reference] = name
        return reference

    def coordinate(component: Component, name: str) -> Source:
        if not equations.moves(component):
            return value(component.value, name)
        if component not in bound.coordinates:
            bound.coordinates.append(component)
        reference = Reference("q", bound.coordinates.index(component))
        bound.names.setdefault(reference, name)
        return reference

    for name, form in zip(term.template.scalars, term.scalars, strict=True):
        pairs: Pairs = []
        for k, (weight, component) in enumerate(form):
            head, _, axis = name.rpartition("_") if len(form) > 1 else ("", "", "")
            suffix = f"{head}{k}_{axis}" if head else name
            pairs.append((value(weight, f"weight_{suffix}"), coordinate(component, suffix)))
        bound.scalars.append(pairs)
    bound.data = {n: value(v, n) for n, v in zip(term.template.data, term.data, strict=True)}
    return bound


class TermOperands:
    """Turns a term's references into operations of a graph.

    read(reference) gives the node of what a reference stands for.
    """

    def __init__(self, graph: Graph, bound: BoundTerm, read: Callable[[Reference], int]) -> None:
        self.graph = graph
        self.bound = bound
        self.read = read
        self.scalars = dict(zip(bound.term.template.scalars, bound.scalars, strict=True))
        self.rates = {rate_name(name): pairs for name, pairs in self.scalars.items()}

    def node(self, source: Source) -> int:
        return self.graph.const(source.number) if isinstance(source, Folded) else self.read(source)

    def symbol(self, name: str) -> int:
        """The node of a template's symbol: a scalar, its rate, a constant, or time."""
        if name in self.scalars:
            return self.graph.sum(self.graph.mul(self.node(w), self.node(c)) for w, c in self.scalars[name])
        if name in self.rates:
            moving = [(w, c.k) for w, c in self.rates[name] if isinstance(c, Reference) and c.kind == "q"]
            return self.graph.sum(self.graph.mul(self.node(w), self.read(Reference("qd", k))) for w, k in moving)
        if name == TIME:
            return self.graph.load("t", 0)
        return self.node(self.bound.data[name])

    def weights(self, coordinate: int) -> list[tuple[int, int]]:
        """(scalar number, node of its weight) for every scalar the coordinate enters."""
        wanted = Reference("q", coordinate)
        return [(k, self.node(w)) for k, pairs in enumerate(self.bound.scalars) for w, c in pairs if c == wanted]
