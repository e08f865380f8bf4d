"""Φ, Φ_q and γ of a model's rows at 50 digits, from the definitions of the paper.

Rows 1000-1003 are Table 2, the sine rows Table 4, the cosine rows their scalar-product twins, and the smooth
angle row is equation by equation: sin ψ [a·b − (a·n)(b·n)/ln²] − cos ψ (a×b)·n/ln. A scaled row is divided by
2L, 2, L, 1 or la lb. Gradients are derived by hand; γ = −d²Φ(q + s q̇)/ds² comes from exact Taylor arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from ncgen.model.elements import Combination, Component
from ncgen.model.values import Parameter, is_number
from ncgen.symbolic.equations import build_equations
from oracles.series import Exact, Series, mp, series, sine_and_cosine

AXES = range(3)


# -- vectors of series ----------------------------------------------------------------------------


def dot(a, b) -> Series:
    return reduce(add, (x * y for x, y in zip(a, b, strict=True)))


def cross(a, b) -> tuple[Series, ...]:
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in AXES)


def times(factor, a) -> tuple[Series, ...]:
    return tuple(x * factor for x in a)


def plus(*vectors) -> tuple[Series, ...]:
    return tuple(reduce(add, components) for components in zip(*vectors, strict=True))


def axis(k: int, like: Series) -> tuple[Series, ...]:
    """The unit vector e_k."""
    return tuple(constant(int(i == k), like) for i in AXES)


def constant(value, like: Series) -> Series:
    """A constant with as many coefficients as `like`."""
    return series(value, *([0] * (len(like.values) - 1)))


# -- the rows -----------------------------------------------------------------------------------------
# A value takes the vectors and the sine and cosine of psi as series, by name, and the constants as mpf.
# A gradient takes the same and returns {argument: derivative}, derived by hand. Nothing is scaled here.


def distance(a, L):
    return dot(a, a) - constant(L * L, a[0])


def distance_gradient(a, L):
    return {"a": times(2, a)}


def unit(u):
    return dot(u, u) - constant(1, u[0])


def unit_gradient(u):
    return {"u": times(2, u)}


def vector_segment(u, a, L, c):
    return dot(u, a) - constant(L * c, a[0])


def vector_segment_gradient(u, a, L, c):
    return {"u": a, "a": u}


def vector_vector(u, v, c):
    return dot(u, v) - constant(c, u[0])


def vector_vector_gradient(u, v, c):
    return {"u": v, "v": u}


def cosine_row(a, b, n, sin, cos, la, lb, ln):
    return dot(a, b) - cos * (la * lb)


def cosine_gradient(a, b, n, sin, cos, la, lb, ln):
    return {"a": b, "b": a, "psi": sin * (la * lb)}


def sine_row(k):
    """Component k of Table 4's vector equation a × b = n (la lb/ln) sin ψ."""
    return lambda a, b, n, sin, cos, la, lb, ln: cross(a, b)[k] - n[k] * sin * (la * lb / ln)


def sine_gradient(k):
    """(a × b)·e = a·(b × e) = b·(e × a)."""

    def gradient(a, b, n, sin, cos, la, lb, ln):
        e, factor = axis(k, a[0]), -la * lb / ln
        return {"a": cross(b, e), "b": cross(e, a), "n": times(sin * factor, e), "psi": n[k] * cos * factor}

    return gradient


def perpendicular_row(a, b, n, sin, cos, la, lb, ln):
    """The smooth row where both sides stay perpendicular to the axis."""
    return sin * dot(a, b) - cos * dot(cross(a, b), n) * (1 / ln)


def perpendicular_gradient(a, b, n, sin, cos, la, lb, ln):
    turn = cos * (-1 / ln)
    return {
        "a": plus(times(sin, b), times(turn, cross(b, n))),
        "b": plus(times(sin, a), times(turn, cross(n, a))),
        "n": times(turn, cross(a, b)),
        "psi": cos * dot(a, b) + sin * dot(cross(a, b), n) * (1 / ln),
    }


def smooth_row(a, b, n, sin, cos, la, lb, ln):
    """The smooth row in full: what points along the axis does not count."""
    return perpendicular_row(a, b, n, sin, cos, la, lb, ln) - sin * dot(a, n) * dot(b, n) * (1 / ln**2)


def smooth_gradient(a, b, n, sin, cos, la, lb, ln):
    part, an, bn = perpendicular_gradient(a, b, n, sin, cos, la, lb, ln), dot(a, n), dot(b, n)
    along_a, along_b = sin * an * (-1 / ln**2), sin * bn * (-1 / ln**2)
    return {
        "a": plus(part["a"], times(along_b, n)),
        "b": plus(part["b"], times(along_a, n)),
        "n": plus(part["n"], times(along_b, a), times(along_a, b)),
        "psi": part["psi"] - cos * an * bn * (1 / ln**2),
    }


def paper_row(wc, wx, wy, wz, **arguments):
    """The paper's rule: weights say whether the cosine row or a component of the sine row is in force."""
    rows = (cosine_row, *map(sine_row, AXES))
    return reduce(add, (row(**arguments) * w for w, row in zip((wc, wx, wy, wz), rows, strict=True) if w))


def paper_gradient(wc, wx, wy, wz, **arguments):
    (gradient,) = (g for w, g in zip((wc, wx, wy, wz), (cosine_gradient, *map(sine_gradient, AXES)), strict=True) if w == 1)
    return gradient(**arguments)


def _by_lengths(data):
    return 1 / (data["la"] * data["lb"])


ROWS = {
    "distance": (distance, distance_gradient, lambda data: 1 / (2 * data["L"])),
    "unit": (unit, unit_gradient, lambda data: mp.mpf(1) / 2),
    "vector-segment": (vector_segment, vector_segment_gradient, lambda data: 1 / data["L"]),
    "vector-vector": (vector_vector, vector_vector_gradient, lambda data: mp.mpf(1)),
    "angle-cosine": (cosine_row, cosine_gradient, _by_lengths),
    **{f"angle-sine-{name}": (sine_row(k), sine_gradient(k), _by_lengths) for k, name in enumerate("xyz")},
    "angle-smooth": (smooth_row, smooth_gradient, _by_lengths),
    "angle-smooth-perpendicular": (perpendicular_row, perpendicular_gradient, _by_lengths),
    "angle-paper": (paper_row, paper_gradient, _by_lengths),
}
"""{row type: (value, gradient, what a scaled row is multiplied by)}."""


# -- a model's rows at a position ----------------------------------------------------------------------


@dataclass(frozen=True)
class Values:
    """Φ (m,), Φ_q (m, n) and γ (m,), with leading axes where several positions are stacked."""

    phi: Exact
    phi_q: Exact
    gamma: Exact


class RowsOracle:
    """The rows of a model, read from `model.rows`; only which form a smooth angle took is asked of the equations.

    p: {parameter name: number}, where it differs from the defaults
    """

    def __init__(self, model, p=None):
        self.model = model
        self.p = {name: mp.mpf(parameter.default) for name, parameter in model.parameters.items()}
        self.p |= {name: mp.mpf(value) for name, value in (p or {}).items()}
        self.free = [c for c in model.components if not c.fixed]
        self.held = {c: (self.number(c.value), mp.mpf(0)) for c in model.components if c.fixed}
        self.keys = [term.template.key for term in build_equations(model).rows]
        self.rows = [self._prepared(row, key) for row, key in zip(model.rows, self.keys, strict=True)]

    def over(self, q, qd) -> Values:
        """Values at several positions, q and qd of shape (k, n)."""
        values = [self.at(*state) for state in zip(q, qd, strict=True)]
        return Values(*(Exact.stack([getattr(v, name) for v in values]) for name in ("phi", "phi_q", "gamma")))

    def at(self, q, qd) -> Values:
        """Values at q, along the straight motion with velocity qd."""
        place = {c: (mp.mpf(x), mp.mpf(v)) for c, x, v in zip(self.free, q.tolist(), qd.tolist(), strict=True)} | self.held
        phi, gradients = zip(*(row.evaluate(place) for row in self.rows))
        return Values(
            Exact.of([f.values[0] for f in phi], [f.scales[0] for f in phi]),
            self._jacobian(gradients),
            Exact.of([-2 * f.values[2] for f in phi], [2 * f.scales[2] for f in phi]),
        )

    def number(self, value):
        """The exact number of a value: a float, a parameter, or an expression of parameters."""
        if isinstance(value, Parameter):
            return self.p[value.name]
        if is_number(value):
            return mp.mpf(float(value))
        return mp.mpf(value.subs({s: self.p[s.name] for s in value.free_symbols}).evalf(50))

    def _prepared(self, row, key) -> NumberedRow:
        value, gradient, factor = ROWS[key]
        data = {name: self.number(value) for name, value in row.data.items()}
        vectors = {
            name: tuple((self.number(weight), element.components) for weight, element in argument.terms)
            for name, argument in row.arguments.items()
            if isinstance(argument, Combination)
        }
        return NumberedRow(value, gradient, vectors, row.arguments.get("psi"), data, factor(data) if row.scaled else mp.mpf(1))

    def _jacobian(self, gradients) -> Exact:
        numbers = {c: i for i, c in enumerate(self.free)}
        entries = [(i, numbers[c], e) for i, row in enumerate(gradients) for c, e in row.items() if c in numbers]
        exact = Exact.of([e.values[0] for *_, e in entries], [e.scales[0] for *_, e in entries])
        rows, columns = [i for i, *_ in entries], [j for _, j, _ in entries]
        dense = [np.zeros((len(gradients), len(self.free))) for _ in range(3)]
        for matrix, numbers in zip(dense, (exact.high, exact.low, exact.scale), strict=True):
            matrix[rows, columns] = numbers
        return Exact(*dense)


@dataclass(frozen=True)
class NumberedRow:
    """A row whose constants are mpf numbers.

    vectors: {argument: pairs (weight, components)}
    psi: the angle's coordinate, or None
    scale: what the row is multiplied by
    """

    value: Callable
    gradient: Callable
    vectors: dict[str, tuple]
    psi: Component | None
    data: dict[str, object]
    scale: object

    def evaluate(self, place) -> tuple[Series, dict[Component, Series]]:
        """Φ as a series along the motion, and {coordinate: ∂Φ/∂coordinate}; place: {coordinate: (position, rate)}."""
        vectors = {name: tuple(_component(terms, k, place) for k in AXES) for name, terms in self.vectors.items()}
        sines = dict(zip(("sin", "cos"), sine_and_cosine(*place[self.psi]))) if self.psi else {}
        phi = self.value(**vectors, **sines, **self.data)
        still = {name: tuple(x.start for x in vector) for name, vector in vectors.items()}
        gradient = self.gradient(**still, **{name: s.start for name, s in sines.items()}, **self.data)
        return phi * self.scale, self._chain(gradient)

    def _chain(self, gradient) -> dict[Component, Series]:
        """The chain rule: each argument is a weighted sum of coordinates."""
        entries = {self.psi: gradient.pop("psi") * self.scale} if self.psi else {}
        for name, derivative in gradient.items():
            for weight, components in self.vectors[name]:
                for component, piece in zip(components, derivative, strict=True):
                    piece = piece * (weight * self.scale)
                    entries[component] = entries[component] + piece if component in entries else piece
        return entries


def _component(terms, k: int, place) -> Series:
    """One component of Σ weight·element. A difference of two is rounded once, so it counts as one term."""
    parts = [(weight, *place[components[k]]) for weight, components in terms]
    total = reduce(add, (series(w * x, w * v, 0) for w, x, v in parts))
    return series(*total.values) if len(parts) <= 2 and all(abs(w) == 1 for w, _, _ in parts) else total
