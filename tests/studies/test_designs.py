"""What varies: every variant follows from its number alone, and designs are those that they are called after."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.stats import kstest, qmc

import ncgen
from ncgen.studies.design import BLOCK, KINDS, Design, table

UNIT = {"low": 0.0, "high": 1.0}
TWO = {"a": {"low": 1.0, "high": 3.0}, "b": {"mean": 5.0, "deviation": 2.0}}


def design(kind: str) -> Design:
    listed = {"a": np.arange(300.0), "b": np.arange(300.0) ** 2}
    count = {"grid": None, "list": None}.get(kind, 256)
    return Design.of(listed if count is None else TWO, kind, count, 7)


@pytest.mark.parametrize("kind", KINDS)
def test_a_variant_is_the_same_in_every_chunk(kind):
    """In any order, from a copy too."""
    whole = design(kind)
    rows = whole.rows(0, 256)
    for first, count in ((250, 6), (3, 1), (100, 57), (0, 256)):
        for one in (whole, design(kind), pickle.loads(pickle.dumps(whole))):
            assert np.array_equal(one.rows(first, count), rows[first : first + count])


def test_random_numbers_go_on_over_blocks():
    found = Design.of({"a": UNIT, "b": UNIT}, "random", 3 * BLOCK, 1)
    rows = found.rows(0, 3 * BLOCK)
    assert np.array_equal(found.rows(BLOCK - 2, 5), rows[BLOCK - 2 : BLOCK + 3])
    assert kstest(rows[:, 0], "uniform").pvalue > 1e-3 and abs(np.corrcoef(rows.T)[0, 1]) < 0.05


def test_a_grid_is_the_product():
    found = Design.of({"a": [1, 2], "b": {"low": 0, "high": 1, "count": 3}}, "grid")
    assert found.rows(0, 6).tolist() == [[1, 0], [1, 0.5], [1, 1], [2, 0], [2, 0.5], [2, 1]]


def test_sequences_are_those_of_scipy():
    """Sobol' and Halton with the same generator; a Latin square has one number in every row and column."""
    for kind, engine in (("sobol", qmc.Sobol), ("halton", qmc.Halton)):
        own = Design.of({"a": UNIT, "b": UNIT}, kind, 64, 5).rows(0, 64)
        assert np.array_equal(own, engine(2, rng=np.random.default_rng(5)).random(64))
    square = Design.of({"a": UNIT, "b": UNIT}, "latin", 50, 5).rows(0, 50)
    assert all(sorted((column * 50).astype(int)) == list(range(50)) for column in square.T)


def test_distributions():
    """Moments of a normal and quantiles of a logarithmic axis; a list's numbers come equally often."""
    rows = Design.of(
        {"n": {"mean": 5.0, "deviation": 2.0}, "l": {"low": 1e-2, "high": 1e2, "scale": "log"}, "k": [1, 2, 4]}, "sobol", 4096, 0
    )
    n, log, k = rows.rows(0, 4096).T
    assert n.mean() == pytest.approx(5.0, abs=0.01) and n.std() == pytest.approx(2.0, abs=0.02)
    assert np.quantile(log, [0.25, 0.5, 0.75]) == pytest.approx([0.1, 1.0, 10.0], rel=0.01)
    assert {x: (k == x).mean() for x in (1, 2, 4)} == pytest.approx(dict.fromkeys((1, 2, 4), 1 / 3), abs=0.01)


@pytest.mark.parametrize(
    "vary, options, said",
    [
        ({}, {}, "vary: {} given"),
        ({"a": "x"}, {}, "vary, a: x given; give a list of numbers"),
        ({"a": [[1], [2]]}, {}, "vary, a: "),
        ({"a": []}, {}, "vary, a: "),
        ({"a": {"low": 1}}, {}, "vary, a: .* low and high, or mean and deviation"),
        ({"a": {"low": 2, "high": 1}}, {}, "low is below high"),
        ({"a": {"low": 0, "high": 1, "scale": "log"}}, {}, "and above 0"),
        ({"a": {"lo": 0, "high": 1}}, {}, "vary, a: lo is unknown; there are low, high"),
        ({"a": {"mean": 0, "deviation": -1}}, {}, "vary, a: deviation is -1; it must be positive"),
        ({"a": UNIT}, {}, "vary, a: in a grid it is a list of numbers, or low, high and count"),
        ({"a": UNIT}, {"kind": "sobol"}, "design 'sobol' needs count"),
        ({"a": UNIT}, {"kind": "sobols", "count": 4}, "design 'sobols' is unknown; choose one of grid, list"),
        ({"a": UNIT, "b": UNIT}, {"kind": "saltelli", "count": 100}, "a power of 2, such as 128"),
        ({"a": UNIT}, {"kind": "saltelli", "count": 64}, "a alone varies"),
        ({"a": UNIT}, {"kind": "random", "count": 4, "seed": -1}, "seed: -1 given"),
        ({"a": [1, 2], "b": [1]}, {"kind": "list"}, "a has 2, b has 1"),
        ({"a": [1, 2]}, {"count": 2}, "a grid has 2 variants by itself"),
    ],
)
def test_mistakes_are_named(vary, options, said):
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        Design.of(vary, **options)
    assert "\n" not in str(caught.value)


def test_tables():
    assert table("t.csv", "a, b\n1,2\n\n3,nan\n")["a"] == [1.0, 3.0]
    for text, said in (
        ("a\n", "at least one line"),
        ("a,a\n1,2\n", "a name of its own"),
        ("a,b\n1\n", "line 2: 1 number, 2 needed"),
        ("a\nx\n", "line 2: a: x"),
    ):
        with pytest.raises(ncgen.ModelError, match=said):
            table("t.csv", text)
