"""Splines, tables and smooth steps in expressions: against SciPy's splines, in every language, and through all that differentiates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicSpline

import ncgen
from ncgen.mechanism.batch import CompiledBatch
from ncgen.model.pieces import ENDS

DRAW = np.random.default_rng(8)
KNOTS = np.cumsum(DRAW.uniform(0.1, 0.6, 25)) - 4.0
VALUES = np.append(DRAW.standard_normal(24), 0.0)
VALUES[-1] = VALUES[0]
COUNT = 10_000
EPS = 2.0**-52


def pushed(end: str) -> ncgen.Model:
    """Two points under forces that are all orders of a spline, a table and a smooth step, at P.x, and two of them at Q.x, too."""
    m = ncgen.Model("pushed")
    P, Q = m.point("P", (0, 0, 0)), m.point("Q", (0, 0, 0))
    m.body("p", [P], mass=1.0)
    m.body("q", [Q], mass=1.0)
    curve = m.spline("profile", KNOTS, VALUES, end)
    table = m.table("law", KNOTS, VALUES, periodic=end == "periodic")
    m.force(P, (curve(P.x), curve(P.x, 1), curve(P.x, 2)))
    m.force(Q, (curve(P.x, 3), table(P.x), ncgen.smooth_step(P.x, -2, 3)))
    return m


def expected(end: str, x: np.ndarray) -> np.ndarray:
    """SciPy's: a spline goes on straight beyond its ends unless it begins again."""
    spline, periodic = CubicSpline(KNOTS, VALUES, bc_type=end), end == "periodic"
    first, last = KNOTS[0], KNOTS[-1]
    inside = first + (x - first) % (last - first) if periodic else np.clip(x, first, last)
    beyond = x - inside if not periodic else 0.0
    orders = [spline(inside, order) for order in range(4)]
    orders[0] += beyond * orders[1]
    for order in (2, 3):
        orders[order] = np.where(beyond == 0.0, orders[order], 0.0)
    chords = np.diff(VALUES) / np.diff(KNOTS)
    table = np.interp(inside, KNOTS, VALUES) + beyond * np.where(x < first, chords[0], chords[-1])
    step = BPoly.from_derivatives([-2.0, 3.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])(np.clip(x, -2.0, 3.0))
    return np.stack([*orders, table, step], axis=-1)


def places() -> np.ndarray:
    """10,000 of them, some beyond the knots, none so near one that a rounding would choose the piece."""
    x = DRAW.uniform(KNOTS[0] - 1.0, KNOTS[-1] + 1.0, COUNT)
    turned = KNOTS[0] + (x - KNOTS[0]) % (KNOTS[-1] - KNOTS[0])
    return x[np.min(np.abs(np.concatenate([x[:, None] - KNOTS, turned[:, None] - KNOTS], axis=1)), axis=1) > 1e-9]


@pytest.mark.parametrize("end", ENDS)
def test_values_and_derivatives_are_scipys(end):
    """C, lanes and NumPy, to rounding of the largest value."""
    x = places()
    model = pushed(end)
    compiled = ncgen.compile(model)
    q = np.zeros((len(x), compiled.n))
    q[:, compiled.index["P.x"]] = x
    zero = np.zeros_like(q)
    want = expected(end, x)
    bound = 60 * EPS * np.max(np.abs(want), axis=0)
    lanes = CompiledBatch(compiled, least=0.0)
    for found in (
        compiled.batch.values("force", 0.0, q, zero, None),
        lanes.values("force", 0.0, q, zero, None),
        ncgen.compile(model, "numpy").values("force", 0.0, q, zero, compiled.p0),
    ):
        assert np.all(np.abs(found - want) < bound)
    alone = np.array([compiled.values("force", 0.0, row, row, None) for row in q[:300]])
    assert np.all(np.abs(alone - want[:300]) < bound)
