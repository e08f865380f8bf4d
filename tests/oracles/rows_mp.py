"""Φ, Φ_q and γ of a model's rows at 50 digits, from the definitions of the paper.

Rows 1000-1003 are Table 2, the sine rows Table 4, the cosine rows their scalar-product twins, and the smooth
angle row is equation by equation: sin ψ [a·b − (a·n)(b·n)/ln²] − cos ψ (a×b)·n/ln. A scaled row is divided by
2L, 2, L, 1 or la lb. Gradients are derived by hand; γ = −d²Φ(q + s q̇)/ds² comes from exact Taylor arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add


from ncgen.model.elements import Combination
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
    return tuple(factor * x for x in a)


def plus(*vectors) -> tuple[Series, ...]:
    return tuple(reduce(add, components) for components in zip(*vectors, strict=True))


def axis(k: int, size: int) -> tuple[Series, ...]:
    """The unit vector e_k as constant series of `size` coefficients."""
    return tuple(constant(1 if i == k else 0, size) for i in AXES)


def constant(value, size: int) -> Series:
    return series(value, *([0] * (size - 1)))


# -- the rows: value and gradient by argument --------------------------------------------------------
# Every function takes the arguments by name, each a vector of series, `sin` and `cos` of psi as series, and the
# constants as mpf. It returns Φ, and the gradient as {argument: derivative}; nothing is scaled.


def distance(a, L):
    return dot(a, a) - constant(L * L, len(a[0].values)), {"a": times(2, a)}


def unit(u):
    return dot(u, u) - constant(1, len(u[0].values)), {"u": times(2, u)}


def vector_segment(u, a, L, c):
    return dot(u, a) - constant(L * c, len(a[0].values)), {"u": a, "a": u}


def vector_vector(u, v, c):
    return dot(u, v) - constant(c, len(u[0].values)), {"u": v, "v": u}


def cosine_row(a, b, n, sin, cos, la, lb, ln):
    return dot(a, b) - la * lb * cos, {"a": b, "b": a, "psi": la * lb * sin}


def sine_row(k):
    """Component k of Table 4's vector equation a × b = n (la lb/ln) sin ψ."""

    def row(a, b, n, sin, cos, la, lb, ln):
        e, factor = axis(k, len(a[0].values)), la * lb / ln
        gradient = {"a": cross(b, e), "b": cross(e, a), "n": times(-factor * sin, e), "psi": -factor * n[k] * cos}
        return cross(a, b)[k] - factor * n[k] * sin, gradient

    return row


def perpendicular_row(a, b, n, sin, cos, la, lb, ln):
    """The smooth row where both sides stay perpendicular to the axis."""
    triple = dot(cross(a, b), n)
    gradient = {
        "a": plus(times(sin, b), times(-cos * (1 / ln), cross(b, n))),
        "b": plus(times(sin, a), times(-cos * (1 / ln), cross(n, a))),
        "n": times(-cos * (1 / ln), cross(a, b)),
        "psi": cos * dot(a, b) + sin * triple * (1 / ln),
    }
    return sin * dot(a, b) - cos * triple * (1 / ln), gradient


def smooth_row(a, b, n, sin, cos, la, lb, ln):
    """The smooth row in full: what points along the axis does not count."""
    value, gradient = perpendicular_row(a, b, n, sin, cos, la, lb, ln)
    an, bn, factor = dot(a, n), dot(b, n), -1 / ln**2
    gradient["a"] = plus(gradient["a"], times(factor * sin * bn, n))
    gradient["b"] = plus(gradient["b"], times(factor * sin * an, n))
    gradient["n"] = plus(gradient["n"], times(factor * sin * bn, a), times(factor * sin * an, b))
    gradient["psi"] = gradient["psi"] + factor * cos * an * bn
    return value + factor * sin * an * bn, gradient


def paper_row(wc, wx, wy, wz, **arguments):
    """The paper's rule: the weights say which of cosine and sine rows is in force."""
    rows = [(w, row(**arguments)) for w, row in zip((wc, wx, wy, wz), (cosine_row, *map(sine_row, AXES))) if w]
    value = reduce(add, (w * phi for w, (phi, _) in rows))
    gradient = {}
    for w, (_, part) in rows:
        for name, derivative in part.items():
            weighted = w * derivative if name == "psi" else times(w, derivative)
            gradient[name] = weighted if name not in gradient else _sum(name, gradient[name], weighted)
    return value, gradient


def _sum(name, first, second):
    return first + second if name == "psi" else plus(first, second)


ROWS = {
    "distance": (distance, lambda d: 1 / (2 * d["L"])),
    "unit": (unit, lambda d: mp.mpf(1) / 2),
    "vector-segment": (vector_segment, lambda d: 1 / d["L"]),
    "vector-vector": (vector_vector, lambda d: mp.mpf(1)),
    "angle-cosine": (cosine_row, lambda d: 1 / (d["la"] * d["lb"])),
    **{f"angle-sine-{name}": (sine_row(k), lambda d: 1 / (d["la"] * d["lb"])) for k, name in enumerate("xyz")},
    "angle-smooth": (smooth_row, lambda d: 1 / (d["la"] * d["lb"])),
    "angle-smooth-perpendicular": (perpendicular_row, lambda d: 1 / (d["la"] * d["lb"])),
    "angle-paper": (paper_row, lambda d: 1 / (d["la"] * d["lb"])),
}
"""{row type: (Φ and gradient, what a scaled row is multiplied by)}."""


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
        self.keys = [term.template.key for term in build_equations(model).rows]

    def over(self, q, qd) -> Values:
        """Values at several positions, q and qd of shape (k, n)."""
        values = [self.at(*state) for state in zip(q, qd, strict=True)]
        return Values(*(Exact.stack([getattr(v, name) for v in values]) for name in ("phi", "phi_q", "gamma")))

    def at(self, q, qd) -> Values:
        """Values at q, along the straight motion with velocity qd."""
        place = {c: (mp.mpf(x), mp.mpf(v)) for c, x, v in zip(self.free, q.tolist(), qd.tolist(), strict=True)}
        place |= {c: (self.number(c.value), mp.mpf(0)) for c in self.model.components if c.fixed}
        phi, gradients = zip(*(self._row(*item, place) for item in zip(self.model.rows, self.keys, strict=True)))
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

    def _row(self, row, key, place):
        formula, factor = ROWS[key]
        vectors = {k: self._vector(v, place) for k, v in row.arguments.items() if isinstance(v, Combination)}
        data = {name: self.number(value) for name, value in row.data.items()}
        scale = factor(data) if row.scaled else mp.mpf(1)
        sines = sine_and_cosine(*place[row.arguments["psi"]]) if "psi" in row.arguments else ()
        phi, _ = formula(**vectors, **dict(zip(("sin", "cos"), sines)), **data)
        still = {name: tuple(x.start for x in vector) for name, vector in vectors.items()}
        _, gradient = formula(**still, **dict(zip(("sin", "cos"), (s.start for s in sines))), **data)
        return scale * phi, self._chain(row, gradient, scale)

    def _vector(self, combination: Combination, place):
        return tuple(self._component(combination, k, place) for k in AXES)

    def _component(self, combination: Combination, k: int, place) -> Series:
        """One component of Σ weight·element. A difference of two is rounded once, so it counts as one term."""
        terms = [(self.number(weight), *place[element.components[k]]) for weight, element in combination.terms]
        total = reduce(add, (series(w * x, w * v, 0) for w, x, v in terms))
        single = len(terms) <= 2 and all(abs(w) == 1 for w, _, _ in terms)
        return series(*total.values) if single else total

    def _chain(self, row, gradient, scale) -> dict:
        """{coordinate: ∂Φ/∂coordinate}, each argument being a weighted sum of coordinates."""
        entries = {}
        for name, derivative in gradient.items():
            for component, piece in self._pieces(row.arguments[name], derivative):
                entries[component] = entries[component] + scale * piece if component in entries else scale * piece
        return entries

    def _pieces(self, argument, derivative):
        if not isinstance(argument, Combination):
            yield argument, derivative
            return
        for weight, element in argument.terms:
            for component, piece in zip(element.components, derivative, strict=True):
                yield component, self.number(weight) * piece

    def _jacobian(self, gradients) -> Exact:
        nothing = series(0)
        entries = [[row.get(c, nothing) for c in self.free] for row in gradients]
        exact = Exact.of([e.values[0] for row in entries for e in row], [e.scales[0] for row in entries for e in row])
        return Exact(*(array.reshape(len(gradients), len(self.free)) for array in (exact.high, exact.low, exact.scale)))
