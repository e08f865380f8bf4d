"""Ranges of operations over intervals: what the function itself is at many places in them, no less and no more."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ncgen.program.ir.graph import Graph
from ncgen.program.ir.ranges import ranges

ONE = {
    "neg": (lambda g, x: g.neg(x), np.negative, -9, 9),
    "square": (lambda g, x: g.mul(x, x), np.square, -9, 9),
    "reciprocal": (lambda g, x: g.div(g.const(2.0), x), lambda x: 2.0 / x, -9, 9),
    **{
        name: (lambda g, x, name=name: g.call(name, x), function, low, high)
        for name, function, low, high in (
            ("sin", np.sin, -20, 20), ("cos", np.cos, -20, 20), ("tan", np.tan, -20, 20), ("asin", np.arcsin, -1.2, 1.2),
            ("acos", np.arccos, -1.2, 1.2), ("atan", np.arctan, -9, 9), ("sinh", np.sinh, -3, 3), ("cosh", np.cosh, -3, 3),
            ("tanh", np.tanh, -3, 3), ("exp", np.exp, -3, 3), ("log", np.log, 0.1, 9), ("sqrt", np.sqrt, 0, 9), ("abs", np.abs, -9, 9),
        )
    },
}  # fmt: skip

TWO = {
    "add": (lambda g, x, y: g.add(x, y), np.add, -9),
    "sub": (lambda g, x, y: g.sub(x, y), np.subtract, -9),
    "mul": (lambda g, x, y: g.mul(x, y), np.multiply, -9),
    "div": (lambda g, x, y: g.div(x, y), np.divide, -9),
    "pow": (lambda g, x, y: g.call("pow", x, y), np.power, -1),
    "atan2": (lambda g, x, y: g.call("atan2", x, y), np.arctan2, -9),
}

COUNT, STEPS = 300, 400


def intervals(low: float, high: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(COUNT,) lower and upper ends, of every width that there is room for."""
    generator = np.random.default_rng(seed)
    width = (high - low) * 10 ** generator.uniform(-3, 0, COUNT)
    a = low + generator.uniform(0, 1, COUNT) * (high - low - width)
    return a, a + width


def places(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, None] + (b - a)[:, None] * np.linspace(0, 1, STEPS + 1)


@pytest.mark.parametrize("name", ONE)
def test_of_one_number(name):
    """It may be beyond the places that are looked at by as much as it changes from one to the next. 2/x and the tangent have poles."""
    make, function, least, most = ONE[name]
    graph = Graph()
    node = make(graph, graph.load("x", 0))
    a, b = intervals(least, most, 1)
    with np.errstate(invalid="ignore"):
        defined = ~np.all(np.isnan(function(places(a, b))), axis=1)
        a, b = a[defined], b[defined]
        true = function(places(a, b))
    ((low, high),) = ranges(graph.ops, [node], {graph.ops[graph.load("x", 0)].input: (a, b)})
    has_pole = np.zeros(len(a), dtype=bool)
    if name == "reciprocal":
        has_pole = (a <= 0) & (b >= 0)
    if name == "tan":
        has_pole = np.floor(b / math.pi - 0.5) > np.floor(a / math.pi - 0.5)
    assert np.all((low[has_pole] == -np.inf) & (high[has_pole] == np.inf)) and np.any(has_pole) == (name in ("tan", "reciprocal"))
    rounding = 1e-13 * np.nanmax(np.abs(true), axis=1)
    lowest, highest = np.nanmin(true, axis=1), np.nanmax(true, axis=1)
    assert np.all((low <= lowest + rounding) & (high >= highest - rounding))
    sound = ~(has_pole | np.any(np.isnan(true), axis=1))
    slack = np.nanmax(np.abs(np.diff(true, axis=1)), axis=1) + rounding
    assert np.all((low >= lowest - slack)[sound] & (high <= highest + slack)[sound])


@pytest.mark.parametrize("name", TWO)
def test_of_two_numbers(name):
    """Extremes lie at the corners: all rise or fall in each of their numbers; of the others nothing is known."""
    make, function, least = TWO[name]
    graph = Graph()
    x, y = graph.load("x", 0), graph.load("x", 1)
    node = make(graph, x, y)
    (a, b), (c, d) = intervals(least, 3, 2), intervals(-3, 3, 3)
    ((low, high),) = ranges(graph.ops, [node], {graph.ops[x].input: (a, b), graph.ops[y].input: (c, d)})
    with np.errstate(invalid="ignore"):
        corners = np.array([function(one, other) for one in (a, b) for other in (c, d)])
    unbounded = {"div": (c <= 0) & (d >= 0), "pow": a < 0, "atan2": a > -np.inf}
    sound = ~unbounded.get(name, a > np.inf)
    np.testing.assert_allclose(low[sound], np.min(corners, axis=0)[sound], rtol=1e-14)
    np.testing.assert_allclose(high[sound], np.max(corners, axis=0)[sound], rtol=1e-14)
    assert np.all(low[~sound] == -np.inf) and np.all(high[~sound] == np.inf)
