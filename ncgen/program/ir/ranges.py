"""Values of operations at many numbers at once, and the ranges that they have over many intervals (interval arithmetic)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import TypeAlias

import numpy as np

from ncgen.model.pieces import Pieces
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES, ArrayElement, Op

Interval: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Lower and upper bounds, of one shape; infinite where nothing is known."""

SIMPLE: dict[str, Callable[..., np.ndarray]] = {"add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "neg": np.negative}

MONOTONE: dict[str, tuple[float, float]] = {
    "sqrt": (0.0, np.inf),
    "asin": (-1.0, 1.0),
    "atan": (-np.inf, np.inf),
    "sinh": (-np.inf, np.inf),
    "tanh": (-np.inf, np.inf),
    "exp": (-np.inf, np.inf),
    "log": (0.0, np.inf),
    "sign": (-np.inf, np.inf),
}
"""{functions that never fall: where they are defined}."""


def values(ops: Sequence[Op], node: int, inputs: Mapping[ArrayElement, np.ndarray | float]) -> np.ndarray:
    """The values of a node; inputs: {input: its numbers, of one shape, or one number}. NaN outside of a function's domain."""
    known: list[np.ndarray | float] = []
    with np.errstate(all="ignore"):
        for op in ops[: node + 1]:
            arguments = [known[a] for a in op.args]
            if op.code == "const":
                known.append(op.value)
            elif op.code == "load":
                known.append(inputs[op.input])
            elif op.code == PIECES:
                known.append(_polynomials(op.pieces, np.asarray(arguments[0])))
            else:
                function = SIMPLE.get(op.code) or getattr(np, FUNCTIONS[op.code].numpy)
                known.append(function(*arguments))
    return np.asarray(known[node])


def ranges(ops: Sequence[Op], nodes: Sequence[int], inputs: Mapping[ArrayElement, Interval]) -> list[Interval]:
    """Bounds of the values of nodes where every input is in its interval, but for rounding."""
    known: list[Interval] = []
    with np.errstate(all="ignore"):
        for op in ops[: max(nodes) + 1]:
            if op.code == "const":
                low = high = np.asarray(op.value)
            elif op.code == "load":
                low, high = inputs[op.input]
            else:
                low, high = _bounds(op, [known[a] for a in op.args])
            known.append((np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)))
    return [known[node] for node in nodes]


def levels_below(pieces: Pieces, x: np.ndarray, side: str) -> np.ndarray:
    """How many knots lie before x, knots of later periods counted on; side "right": those at x as well."""
    knots = np.array(pieces.knots)
    if not pieces.period:
        return np.searchsorted(knots, x, side).astype(float)  # type: ignore[call-overload]
    turns = np.floor((x - knots[0]) / pieces.period)
    return turns * (len(knots) - 1) + np.searchsorted(knots[:-1], x - turns * pieces.period, side)  # type: ignore[call-overload]


def level(pieces: Pieces, number: np.ndarray) -> np.ndarray:
    """The knot of a number, as `levels_below` counts them from 0 on."""
    knots = np.array(pieces.knots)
    if not pieces.period:
        return knots[number.astype(int)]
    turns, rest = np.divmod(number, len(knots) - 1)
    return knots[rest.astype(int)] + turns * pieces.period


def _polynomials(pieces: Pieces, x: np.ndarray) -> np.ndarray:
    rows = np.array(pieces.rows)
    if pieces.period:
        x = x - pieces.period * np.floor((x - pieces.knots[0]) / pieces.period)
    row = rows[np.searchsorted(pieces.knots, x, "right")]
    s = x - row[..., 0]
    value = row[..., -1]
    for k in range(rows.shape[1] - 2, 0, -1):
        value = value * s + row[..., k]
    return value


def _bounds(op: Op, arguments: list[Interval]) -> Interval:
    """The bounds of one operation."""
    (a, b), *others = arguments
    if op.code == "add":
        return a + others[0][0], b + others[0][1]
    if op.code == "sub":
        return a - others[0][1], b - others[0][0]
    if op.code == "neg":
        return -b, -a
    if op.code == "mul":
        return _even(a * a, b * b, a, b) if op.args[0] == op.args[1] else _product((a, b), others[0])
    if op.code == "div":
        c, d = others[0]
        low, high = _product((a, b), (1.0 / d, 1.0 / c))
        has_pole = (c <= 0) & (d >= 0)
        return np.where(has_pole, -np.inf, low), np.where(has_pole, np.inf, high)
    if op.code in MONOTONE:
        least, most = MONOTONE[op.code]
        function = getattr(np, FUNCTIONS[op.code].numpy)
        return function(np.clip(a, least, most)), function(np.clip(b, least, most))
    if op.code == "pow":
        c, d = others[0]
        low, high = _hull(a**c, a**d, b**c, b**d)
        return np.where(a >= 0, low, -np.inf), np.where(a >= 0, high, np.inf)
    return _others(op, a, b)


def _others(op: Op, a: np.ndarray, b: np.ndarray) -> Interval:
    """Of functions that rise and fall."""
    if op.code == "abs":
        return _even(np.abs(a), np.abs(b), a, b)
    if op.code == "cosh":
        return _even(np.cosh(a), np.cosh(b), a, b, 1.0)
    if op.code == "acos":
        return np.arccos(np.clip(b, -1, 1)), np.arccos(np.clip(a, -1, 1))
    if op.code in ("sin", "cos"):
        top = np.pi / 2 if op.code == "sin" else 0.0
        low, high = _hull(*(getattr(np, op.code)(x) for x in (a, b)))
        return np.where(_passes(a, b, top + np.pi, 2 * np.pi), -1.0, low), np.where(_passes(a, b, top, 2 * np.pi), 1.0, high)
    if op.code == "tan":
        has_pole = _passes(a, b, np.pi / 2, np.pi)
        return np.where(has_pole, -np.inf, np.tan(a)), np.where(has_pole, np.inf, np.tan(b))
    if op.code == PIECES:
        return _of_pieces(op.pieces, a, b)
    return np.full_like(a, -np.inf), np.full_like(b, np.inf)  # atan2


def _passes(a: np.ndarray, b: np.ndarray, first: float, period: float) -> np.ndarray:
    """True where an interval has one of the places first + k period in it, or is not finite."""
    return ~(np.floor((b - first) / period) < np.ceil((a - first) / period))


def _even(at_low: np.ndarray, at_high: np.ndarray, a: np.ndarray, b: np.ndarray, least: float = 0.0) -> Interval:
    """Of a function that falls up to 0, where it is `least`, and rises from there on."""
    return np.where((a < 0) & (b > 0), least, np.minimum(at_low, at_high)), np.maximum(at_low, at_high)


def _hull(*corners: np.ndarray) -> Interval:
    return reduce(np.minimum, corners), reduce(np.maximum, corners)


def _product(one: Interval, other: Interval) -> Interval:
    return _hull(*(x * y for x in one for y in other))


def _of_pieces(pieces: Pieces, a: np.ndarray, b: np.ndarray) -> Interval:
    """Where an interval lies in one piece by Horner's rule on intervals, else nothing is known."""
    level = levels_below(pieces, a, "right")
    same = (level == levels_below(pieces, b, "left")) | (a == b)
    turns = np.floor((a - pieces.knots[0]) / pieces.period) if pieces.period else np.zeros_like(a)
    row = np.array(pieces.rows)[np.searchsorted(pieces.knots, a - turns * pieces.period, "right")]
    s = (a - turns * pieces.period - row[..., 0], b - turns * pieces.period - row[..., 0])
    value = (row[..., -1], row[..., -1])
    for k in range(row.shape[-1] - 2, 0, -1):
        low, high = _product(value, s)
        value = (low + row[..., k], high + row[..., k])
    return np.where(same, value[0], -np.inf), np.where(same, value[1], np.inf)
