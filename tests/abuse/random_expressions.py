"""Random expressions of everything that a user may write: all functions, powers, rationals, constants, parameters.

What a function is given is brought into its domain, except in a small share of `raw` calls, which may be no numbers
somewhere: then ncgen has to say so.
"""

from __future__ import annotations

import sympy

R = sympy.Rational
CONSTANTS = (
    sympy.pi,
    sympy.E,
    R(1, 3),
    R(-22, 7),
    R(5, 2),
    sympy.Integer(2),
    sympy.Integer(-3),
    sympy.Float(0.1),
    sympy.Float(1.7e-3),
    sympy.sqrt(2),
)

SAFE = {
    "sqrt": lambda u, v: sympy.sqrt(1 + u**2),
    "sin": lambda u, v: sympy.sin(u),
    "cos": lambda u, v: sympy.cos(u),
    "tan": lambda u, v: sympy.tan(sympy.sin(u)),
    "asin": lambda u, v: sympy.asin(u / (1 + u**2)),
    "acos": lambda u, v: sympy.acos(sympy.sin(u) * R(9, 10)),
    "atan": lambda u, v: sympy.atan(u),
    "atan2": lambda u, v: sympy.atan2(u, 1 + v**2),
    "sinh": lambda u, v: sympy.sinh(sympy.sin(u)),
    "cosh": lambda u, v: sympy.cosh(sympy.cos(u)),
    "tanh": lambda u, v: sympy.tanh(u),
    "exp": lambda u, v: sympy.exp(-(u**2)),
    "log": lambda u, v: sympy.log(2 + sympy.cos(u)),
    "abs": lambda u, v: sympy.Abs(u),
    "sign": lambda u, v: sympy.sign(u) * v,
    "pow": lambda u, v: (1 + u**2) ** sympy.sin(v),
}
"""{function of ncgen.program.ir.functions: a call of it that is a number for all real u and v}; a test holds the two lists equal."""

SHAPES = (
    lambda u, v: u + v,
    lambda u, v: u - v,
    lambda u, v: u * v,
    lambda u, v: u / (1 + v**2),
    lambda u, v: u**2,
    lambda u, v: u**3 - v,
    lambda u, v: (1 + u**2) ** R(3, 2),
    lambda u, v: 1 / sympy.sqrt(1 + u**2),
    lambda u, v: (2 + sympy.sin(u)) ** -3,
    lambda u, v: -u,
)

RAW = (
    lambda u, v: sympy.sqrt(u),
    lambda u, v: sympy.log(u),
    lambda u, v: 1 / u,
    lambda u, v: sympy.asin(2 * u),
    lambda u, v: sympy.atan2(u, v),
    lambda u, v: u ** R(2, 3),
    lambda u, v: sympy.exp(30 * u),
    lambda u, v: u**v,
    lambda u, v: sympy.tan(5 * u),
    lambda u, v: sympy.Abs(u) ** R(1, 2),
)

RAW_SHARE = 0.01


def expression(rng, leaves, depth: int = 3):
    """A random expression of `leaves` (sympy symbols or numbers of the order of 1), nested at most so deep."""
    if depth == 0 or not leaves or rng.random() < 0.15:
        return _leaf(rng, leaves)
    u, v = (expression(rng, leaves, depth - 1 - int(rng.integers(2)) if depth > 1 else 0) for _ in "uv")
    drawn = rng.random()
    if drawn < RAW_SHARE:
        made = _pick(rng, RAW)(u, v)
    elif drawn < 0.55:
        made = SAFE[_pick(rng, sorted(SAFE))](u, v)
    else:
        made = _pick(rng, SHAPES)(u, v)
    return made if made.is_finite is not False and made.is_real is not False else u


def _leaf(rng, leaves):
    if not leaves or rng.random() < 0.25:
        return _pick(rng, CONSTANTS)
    return _pick(rng, leaves)


def _pick(rng, things):
    return things[int(rng.integers(len(things)))]
