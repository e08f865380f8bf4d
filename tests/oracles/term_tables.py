"""The table of any mechanism that ncgen.program.term_tables describes, for tests of the generic kernels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import sympy

from ncgen.errors import ModelError
from ncgen.model.elements import Component
from ncgen.model.values import Parameter, Value, is_number
from ncgen.model.values import evaluate as evaluated
from ncgen.program.term_tables import types
from ncgen.symbolic import templates
from ncgen.symbolic.equations import Equations
from ncgen.symbolic.term import LinearForm, Term

PRODUCTS = 3
"""How many products of two scalars one term of the type `slide`, a.n - s, holds."""


class Placed(NamedTuple):
    """A term as numbers: key of its type, its constraint equation or -1, (constant, pairs (weight, coordinate)) per scalar, constants."""

    key: str
    row: int
    forms: Sequence[tuple[float, Sequence[tuple[float, int]]]]
    data: Sequence[float]

    def numbers(self, number: int) -> list[float]:
        """What the table holds of it; number: that of its type."""
        entries = [number, self.row]
        for constant, pairs in self.forms:
            entries += [constant, len(pairs), *(x for pair in pairs for x in pair)]
        return [*entries, *self.data]


def term_table(equations: Equations) -> np.ndarray:
    """The table of a mechanism, parameters at their defaults. Raises ModelError for what no type describes, such as a user's formula that
    is neither a polynomial of degree 2 nor a constant speed."""
    entries_of = partial(_placed, equations)
    rows = [placed for term in equations.rows for placed in entries_of(term)]
    others = [placed for term in (*equations.masses, *equations.forces) for placed in entries_of(term)]
    return laid_out(len(equations.free), len(equations.rows), rows, others)


def laid_out(n: int, m: int, rows: Sequence[Placed], others: Sequence[Placed]) -> np.ndarray:
    """The table of n coordinates and m constraint equations, whose terms are `rows`, and other terms."""
    numbers = {template.key: k for k, template in enumerate(types())}
    table: list[float] = [n, m, len(rows) + len(others), len(rows)]
    for placed in (*rows, *others):
        table += placed.numbers(numbers[placed.key])
    return np.array(table, dtype=float)


def _placed(equations: Equations, term: Term) -> Iterable[Placed]:
    """A term of the equations as terms of the table."""
    row = -1 if term.row is None else term.row

    def number(value: Value) -> float:
        return float(value if is_number(value) else evaluated(value, equations.model.parameters, term.label))

    def form(linear: LinearForm) -> tuple[float, list[tuple[float, int]]]:
        constant, pairs = 0.0, []
        for weight, component in linear:
            if equations.moves(component):
                pairs.append((number(weight), equations.index[component]))
            else:
                constant += number(weight) * number(component.value)
        return constant, pairs

    if term.template in types():
        return [Placed(term.template.key, row, [form(linear) for linear in term.scalars], [number(value) for value in term.data])]
    if row >= 0:
        return _polynomial(equations, term)
    return _pushes(equations, term)


def _pushes(equations: Equations, term: Term) -> list[Placed]:
    """A user's constant force."""
    placed_terms: list[Placed] = []
    for output, expression in term.template.outputs.items():
        if output.name == "force":
            ((_, component),) = term.scalars[output.scalars[0]]
            if expression.free_symbols:
                raise ModelError(f"{term.label}: {expression} is not constant; the tables hold constant forces alone")
            placed_terms.append(Placed("push", -1, [(0.0, [(1.0, equations.index[component])])], [float(expression)]))
        elif output.name == "potential":
            raise ModelError(f"{term.label}: the tables hold no potential of a user; use springs")
    return placed_terms


def _polynomial(equations: Equations, term: Term) -> list[Placed]:
    """A user's constraint as terms: products of two coordinates, what is linear, and a constant speed."""
    names = {c.name: c for ((_, c),) in term.scalars}
    numbers = {parameter.name: parameter.default for parameter in term.data if isinstance(parameter, Parameter)}
    values = {name: c.initial for name, c in names.items() if not equations.moves(c)} | numbers
    written = term.template.outputs[templates.TemplateOutput("phi")].subs({sympy.Symbol(k, real=True): v for k, v in values.items()})
    free = [sympy.Symbol(name, real=True) for name in names if name not in values]
    try:
        polynomial = sympy.Poly(written, *free, templates.time())
    except sympy.PolynomialError:
        polynomial = None
    if polynomial is None or term.template.outputs[templates.TemplateOutput("nu")].has(*free):
        raise ModelError(f"{term.label}: {written} is no constraint that tables hold; write a polynomial of degree 2 in the coordinates")
    return _products(equations, term, polynomial, [names[s.name] for s in free])


def _products(equations: Equations, term: Term, written: sympy.Poly, components: Sequence[Component]) -> list[Placed]:
    """Terms of the type `slide` that add up to a polynomial, and one of `drive` for what depends on time."""
    products: list[tuple[float, int, int]] = []
    linear, constant, speed = [], 0.0, 0.0
    for (*powers, in_time), coefficient in written.terms():
        mentioned = [equations.index[c] for c, power in zip(components, powers, strict=True) for _ in range(power)]
        value = float(coefficient)
        if len(mentioned) + in_time > 2 or in_time and (mentioned or in_time > 1):
            raise ModelError(f"{term.label}: {written.as_expr()} has products of three; write a polynomial of degree 2")
        if in_time:
            speed += value
        elif len(mentioned) == 2:
            products.append((value, mentioned[0], mentioned[1]))
        elif mentioned:
            linear.append((-value, mentioned[0]))
        else:
            constant -= value
    row = term.row if term.row is not None else -1
    placed_terms: list[Placed] = []
    for k in range(0, max(len(products), 1), PRODUCTS):
        chunk = products[k : k + PRODUCTS]
        empty = [(0.0, [])] * (PRODUCTS - len(chunk))
        a = [(0.0, [(value, i)]) for value, i, _ in chunk] + empty
        b = [(0.0, [(1.0, j)]) for _, _, j in chunk] + empty
        s = (constant, linear) if k == 0 else (0.0, [])
        placed_terms.append(Placed("slide", row, [*a, *b, s], [1.0]))
    if speed:
        placed_terms.append(Placed("drive", row, [(0.0, [])], [0.0, -speed, 0.0, 0.0, 0.0, 1.0]))
    return placed_terms
