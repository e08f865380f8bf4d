"""Emitted linear algebra against NumPy's on random sparse matrices."""

from __future__ import annotations

import numpy as np
import pytest

from ncgen.program.algebra.elimination import THRESHOLD, EliminationError, factor, solve, solve_positive, solve_transposed
from ncgen.program.ir.blocks import Program, Store, Straight
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.graph import Graph


def sparse(size, generator):
    """A well-conditioned matrix with about three entries a row, in mixed-up order."""
    matrix = np.where(generator.random((size, size)) < 2 / size, generator.standard_normal((size, size)), 0.0)
    return (matrix + np.diag(3 + generator.random(size)))[generator.permutation(size)]


def loaded(graph, matrix):
    places = list(zip(*np.nonzero(matrix), strict=True))
    return {(int(i), int(j)): graph.load("q", k) for k, (i, j) in enumerate(places)}, [matrix[i, j] for i, j in places]


def run(graph, nodes, q, p=()):
    stores = tuple(Store(array="x", index=k, node=node) for k, node in enumerate(nodes))
    program = Program(name="x", inputs=("q", "p"), output="x", size=len(nodes), blocks=(Straight(tuple(graph.ops), stores),))
    return np.array(evaluate(program, {"q": list(q), "p": list(p)}))


@pytest.mark.parametrize("size", [1, 2, 7, 30])
@pytest.mark.parametrize("transposed", [False, True])
def test_solutions(size, transposed):
    """A x = b and Aᵀ x = b for a full and for a sparse right-hand side, also for other numbers of the same pattern."""
    generator = np.random.default_rng(size)
    matrix = sparse(size, generator)
    graph = Graph()
    nodes, numbers = loaded(graph, matrix)
    factors = factor(graph, nodes, size, [{place: float(matrix[place]) for place in nodes}])
    for known in (range(size), range(0, size, 3)):
        right = {i: graph.load("p", i) for i in known}
        solution = (solve_transposed if transposed else solve)(graph, factors, right)
        zero = graph.const(0.0)
        for scale in (1.0, 0.7):
            changed = np.array(numbers) * (1 + scale * 0.01 * generator.standard_normal(len(numbers)))
            full = np.zeros((size, size))
            full[tuple(np.array(list(nodes)).T)] = changed
            b = np.where(np.isin(np.arange(size), list(known)), generator.standard_normal(size), 0.0)
            mine = run(graph, [solution.get(k, zero) for k in range(size)], changed, b)
            expected = np.linalg.solve(full.T if transposed else full, b)
            assert np.allclose(mine, expected, rtol=1e-11, atol=1e-12)


def test_markowitz_keeps_an_arrow_sparse():
    """An arrow matrix fills in completely if its tip is eliminated first; the rule takes it last: 3 operations a column."""
    size = 20
    matrix = np.diag(np.full(size, 4.0))
    matrix[0, :] = matrix[:, 0] = 1.0
    matrix[0, 0] = 8.0
    graph = Graph()
    nodes, _ = loaded(graph, matrix)
    before = len(graph.ops)
    factor(graph, nodes, size, [{place: float(matrix[place]) for place in nodes}])
    assert len(graph.ops) - before <= 4 * size + 1


@pytest.mark.parametrize("seed", range(6))
def test_every_pivot_is_the_cheapest_that_is_large_enough(seed):
    """Markowitz' price (r − 1)(c − 1) of r entries in the row and c in the column, found again on the whole matrix in every step."""
    size, generator = 14, np.random.default_rng(seed)
    pattern = generator.random((size, size)) < 0.2
    pattern |= np.eye(size, dtype=bool)[generator.permutation(size)]
    samples = [np.where(pattern, 10 ** generator.uniform(-2, 1, (size, size)), 0.0) for _ in range(2)]
    graph = Graph()
    nodes, _ = loaded(graph, pattern)
    factors = factor(graph, nodes, size, [{place: float(sample[place]) for place in nodes} for sample in samples])
    rows, columns, prices = list(range(size)), list(range(size)), []
    for i, j in factors.pivots:
        left = np.ix_(rows, columns)
        price = np.outer(pattern[left].sum(axis=1) - 1, pattern[left].sum(axis=0) - 1)
        large = [np.abs(sample[left]) > THRESHOLD * np.max(np.abs(sample[left]), axis=0) for sample in samples]
        assert all(sample[rows.index(i), columns.index(j)] for sample in large)
        prices.append(price[rows.index(i), columns.index(j)])
        assert prices[-1] == np.min(price[pattern[left] & np.all(large, axis=0)])
        pattern |= np.outer(pattern[:, j] & np.isin(range(size), rows), pattern[i] & np.isin(range(size), columns))
        rows.remove(i), columns.remove(j)
        for sample in samples:
            sample[np.ix_(rows, columns)] -= np.outer(sample[rows, j], sample[i, columns]) / sample[i, j]
    assert max(prices) > 2


def test_small_pivots_are_avoided():
    """A tiny diagonal entry is not taken as a pivot although it would be free."""
    matrix = np.array([[1e-9, 1.0], [1.0, 1.0]])
    graph = Graph()
    nodes, numbers = loaded(graph, matrix)
    factors = factor(graph, nodes, 2, [{place: float(matrix[place]) for place in nodes}])
    assert factors.pivots[0] != (0, 0)
    solution = solve(graph, factors, {0: graph.const(1.0), 1: graph.const(2.0)})
    assert np.allclose(run(graph, [solution[0], solution[1]], numbers), np.linalg.solve(matrix, [1.0, 2.0]), rtol=1e-14)


def test_singular_samples_are_refused():
    graph = Graph()
    nodes, _ = loaded(graph, np.array([[1.0, 2.0], [2.0, 4.0]]))
    with pytest.raises(EliminationError):
        factor(graph, nodes, 2, [{(0, 0): 1.0, (0, 1): 2.0, (1, 0): 2.0, (1, 1): 4.0}])


def test_positive_definite_solution():
    """LDLᵀ on a dense matrix."""
    generator = np.random.default_rng(4)
    half = generator.standard_normal((6, 6))
    matrix = half @ half.T + np.eye(6)
    graph = Graph()
    lower = {(i, j): graph.load("q", i * 6 + j) for i in range(6) for j in range(i + 1)}
    b = generator.standard_normal(6)
    solution = solve_positive(graph, lower, 6, [graph.load("p", i) for i in range(6)])
    assert np.allclose(run(graph, solution, matrix.ravel(), b), np.linalg.solve(matrix, b), rtol=1e-12)
