"""Linear algebra as operations: a matrix of known pattern is eliminated once, at generation.

What is emitted are the operations on nonzeros and nothing else. Pivots are chosen by Markowitz' rule, fewest
multiplications first, among entries that are large enough in sample positions; the order is then fixed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ncgen.program.ir.graph import Graph

THRESHOLD = 0.05
"""A pivot must be at least this share of the largest entry of its column in every sample."""

Matrix: TypeAlias = dict[tuple[int, int], int]
"""{(row, column): node} of the nonzeros."""

Samples: TypeAlias = list[dict[tuple[int, int], float]]
"""The same matrix as numbers, in some typical positions."""


Rows: TypeAlias = list[dict[int, int]]
"""{column: node} per row, while they are eliminated."""

Numbers: TypeAlias = list[list[dict[int, float]]]
"""Per sample the same as numbers: {column: number} per row."""


class EliminationError(ArithmeticError):
    """No admissible pivot is left: the matrix is singular in a sample position."""


@dataclass(frozen=True)
class Factors:
    """L and U of a matrix whose rows and columns are taken in the order of `pivots`.

    pivots: (row, column) pairs; reciprocal: node of 1/pivot per step
    lower: per step {row: node of its multiplier}; upper: per step {column: node}
    """

    pivots: tuple[tuple[int, int], ...]
    reciprocal: tuple[int, ...]
    lower: tuple[dict[int, int], ...]
    upper: tuple[dict[int, int], ...]


def factor(graph: Graph, matrix: Matrix, size: int, samples: Samples) -> Factors:
    """Emit the LU factorisation of a square matrix.

    Raises EliminationError where every candidate pivot is too small in a sample.
    """
    work = _Elimination(matrix, size, samples)
    pivots: list[tuple[int, int]] = []
    reciprocals: list[int] = []
    lower: Rows = []
    upper: Rows = []
    one = graph.const(1.0)
    for _ in range(size):
        i, j = work.pivot()
        reciprocal = graph.div(one, work.rows[i][j])
        below = {k: graph.mul(work.rows[k][j], reciprocal) for k in work.below(i, j)}
        for k, multiplier in below.items():
            work.subtract(graph, i, j, k, multiplier)
        work.finish(i)
        pivots.append((i, j))
        reciprocals.append(reciprocal)
        lower.append(below)
        upper.append({c: node for c, node in work.rows[i].items() if c != j})
    return Factors(tuple(pivots), tuple(reciprocals), tuple(lower), tuple(upper))


class _Elimination:
    """A matrix while it is eliminated: rows of nodes and of sample numbers, and of every column the rows that are left in it.

    What is largest in a column is found again only where a step has changed the column.
    """

    def __init__(self, matrix: Matrix, size: int, samples: Samples) -> None:
        self.rows: Rows = [{} for _ in range(size)]
        self.columns: dict[int, set[int]] = {}
        for (i, j), node in sorted(matrix.items()):
            self.rows[i][j] = node
            self.columns.setdefault(j, set()).add(i)
        self.numbers: Numbers = [[{j: sample.get((i, j), 0.0) for j in self.rows[i]} for i in range(size)] for sample in samples]
        self.left = list(range(size))
        self._least: dict[int, list[float]] = {}

    def pivot(self) -> tuple[int, int]:
        """The admissible entry with the fewest multiplications, first in order among equals."""
        best: tuple[int, int, int] | None = None
        for i in self.left:
            width = len(self.rows[i]) - 1
            for j in sorted(self.rows[i]):
                price = width * (len(self.columns[j]) - 1)
                if (best is None or price < best[0]) and self._is_admissible(i, j):
                    best = (price, i, j)
            if best is not None and best[0] == 0:
                break
        if best is None:
            raise EliminationError("every candidate pivot vanishes in a sample position")
        return best[1], best[2]

    def below(self, i: int, j: int) -> list[int]:
        """The other rows that are left in a column."""
        return sorted(self.columns[j] - {i})

    def subtract(self, graph: Graph, i: int, j: int, k: int, multiplier: int) -> None:
        """row k −= multiplier · row i, on operations and on the sample numbers."""
        rows = self.rows
        shares = [sample[k].pop(j) / sample[i][j] for sample in self.numbers]
        rows[k].pop(j)
        for c, node in rows[i].items():
            if c == j:
                continue
            product = graph.mul(multiplier, node)
            rows[k][c] = graph.sub(rows[k][c], product) if c in rows[k] else graph.neg(product)
            self.columns[c].add(k)
            for sample, factor in zip(self.numbers, shares, strict=True):
                sample[k][c] = sample[k].get(c, 0.0) - factor * sample[i][c]

    def finish(self, i: int) -> None:
        """A pivot's row leaves."""
        self.left.remove(i)
        for c in self.rows[i]:
            self.columns[c].discard(i)
            self._least.pop(c, None)

    def _is_admissible(self, i: int, j: int) -> bool:
        if j not in self._least:
            self._least[j] = [max(THRESHOLD * max(abs(sample[k][j]) for k in self.columns[j]), 1e-12) for sample in self.numbers]
        return all(abs(sample[i][j]) > least for sample, least in zip(self.numbers, self._least[j], strict=True))


def solve(graph: Graph, factors: Factors, right: dict[int, int]) -> dict[int, int]:
    """{column: node} of the solution of A x = right; what is structurally zero stays out."""
    work = dict(right)
    for (i, _), below in zip(factors.pivots, factors.lower, strict=True):
        if i in work:
            for k, multiplier in below.items():
                _subtract(graph, work, k, graph.mul(multiplier, work[i]))
    solution: dict[int, int] = {}
    for (i, j), reciprocal, row_beyond in zip(*map(reversed, (factors.pivots, factors.reciprocal, factors.upper)), strict=True):
        for c, node in row_beyond.items():
            if c in solution:
                _subtract(graph, work, i, graph.mul(node, solution[c]))
        if i in work:
            solution[j] = graph.mul(work[i], reciprocal)
    return solution


def solve_refined(graph: Graph, matrix: Matrix, factors: Factors, right: dict[int, int]) -> dict[int, int]:
    """The solution of A x = right with one step of iterative refinement: what is left of the right side is eliminated, too.

    Where the fixed order of pivots was unlucky it gives back the digits that row exchanges would have kept (Skeel 1980).
    """
    solution, left = solve(graph, factors, right), dict(right)
    for (i, j), node in sorted(matrix.items()):
        if j in solution:
            _subtract(graph, left, i, graph.mul(node, solution[j]))
    correction = solve(graph, factors, left)
    return {j: graph.add(node, correction[j]) if j in correction else node for j, node in solution.items()}


def solve_transposed(graph: Graph, factors: Factors, right: dict[int, int]) -> dict[int, int]:
    """{row: node} of the solution of Aᵀ x = right."""
    work = dict(right)
    middle: dict[int, int] = {}
    for (i, j), reciprocal, row_beyond in zip(factors.pivots, factors.reciprocal, factors.upper, strict=True):
        if j in work:
            middle[i] = graph.mul(work[j], reciprocal)
            for c, node in row_beyond.items():
                _subtract(graph, work, c, graph.mul(node, middle[i]))
    for (i, _), below in zip(reversed(factors.pivots), reversed(factors.lower), strict=True):
        for k, multiplier in below.items():
            if k in middle:
                _subtract(graph, middle, i, graph.mul(multiplier, middle[k]))
    return middle


def _subtract(graph: Graph, work: dict[int, int], column: int, product: int) -> None:
    work[column] = graph.sub(work[column], product) if column in work else graph.neg(product)


def times(graph: Graph, matrix: Matrix, vector: dict[int, int]) -> dict[int, int]:
    """{row: node} of A x, added up in the order of the matrix; what is structurally zero stays out."""
    sums: dict[int, list[int]] = {}
    for (i, j), node in matrix.items():
        if j in vector:
            sums.setdefault(i, []).append(graph.mul(node, vector[j]))
    return {i: graph.sum(nodes) for i, nodes in sums.items()}


def dot(graph: Graph, a: dict[int, int], b: dict[int, int]) -> int:
    """The sum of the products of what both have."""
    return graph.sum(graph.mul(a[k], b[k]) for k in sorted(a.keys() & b.keys()))


def solve_in_order(graph: Graph, matrix: list[list[int]], right: list[int]) -> tuple[list[int], int]:
    """The solution of a small system by elimination in the given order, and the product of the pivots."""
    matrix, right = [list(row) for row in matrix], list(right)
    size, product = len(right), graph.const(1.0)
    for k in range(size):
        product = graph.mul(product, matrix[k][k])
        for i in range(k + 1, size):
            factor = graph.div(matrix[i][k], matrix[k][k])
            matrix[i] = [graph.sub(a, graph.mul(factor, b)) for a, b in zip(matrix[i], matrix[k], strict=True)]
            right[i] = graph.sub(right[i], graph.mul(factor, right[k]))
    for k in reversed(range(size)):
        rest = [graph.neg(graph.mul(matrix[k][j], right[j])) for j in range(k + 1, size)]
        right[k] = graph.div(graph.sum([right[k], *rest]), matrix[k][k])
    return right, product


def solve_positive(graph: Graph, matrix: Matrix, size: int, right: list[int]) -> list[int]:
    """x of A x = right for a symmetric positive definite A (lower triangle given), by LDLᵀ in the given order.

    Meant for the small dense mass matrix of the independent coordinates.
    """
    zero = graph.const(0.0)
    a = {(i, j): matrix.get((i, j), zero) for i in range(size) for j in range(i + 1)}
    x = list(right)
    reciprocal: list[int] = []
    for k in range(size):
        reciprocal.append(graph.div(graph.const(1.0), a[k, k]))
        for i in range(k + 1, size):
            multiplier = graph.mul(a[i, k], reciprocal[k])
            for j in range(k + 1, i + 1):
                a[i, j] = graph.sub(a[i, j], graph.mul(multiplier, a[j, k]))
            x[i] = graph.sub(x[i], graph.mul(multiplier, x[k]))
    for k in reversed(range(size)):
        for i in range(k + 1, size):
            x[k] = graph.sub(x[k], graph.mul(a[i, k], x[i]))
        x[k] = graph.mul(x[k], reciprocal[k])
    return x


@dataclass(frozen=True)
class SymmetricFactors:
    """L and D of a symmetric matrix: order of elimination, node of 1/pivot per step, {row: node of its multiplier} per step."""

    order: tuple[int, ...]
    reciprocal: tuple[int, ...]
    lower: tuple[dict[int, int], ...]


LEAST_PIVOT = 1e-3
"""A diagonal pivot is admissible where it is this share of the largest entry of its row, in every sample."""


def factor_symmetric(graph: Graph, matrix: Matrix, size: int, samples: Samples) -> SymmetricFactors:
    """Emit LDLᵀ of a symmetric quasidefinite matrix, both triangles given.

    Such a matrix can be eliminated in any order (Vanderbei 1995); taken is the row with the fewest nonzeros among those
    with an admissible pivot, else the one with the best pivot.
    """
    rows: Rows = [{} for _ in range(size)]
    for (i, j), node in sorted(matrix.items()):
        rows[i][j] = node
    numbers: Numbers = [[{j: sample.get((i, j), 0.0) for j in rows[i]} for i in range(size)] for sample in samples]
    left = set(range(size))
    order: list[int] = []
    reciprocals: list[int] = []
    lower: Rows = []
    one = graph.const(1.0)
    while left:
        k = min(sorted(left), key=lambda i: _diagonal_price(i, rows, numbers))
        left.remove(k)
        reciprocal = graph.div(one, rows[k].pop(k))
        pivots = [sample[k].pop(k) for sample in numbers]
        later = sorted(rows[k])
        multipliers = {i: graph.mul(rows[k][i], reciprocal) for i in later}
        for i in later:
            for j in (j for j in later if j <= i):
                product = graph.mul(multipliers[i], rows[k][j])
                rows[i][j] = rows[j][i] = graph.sub(rows[i][j], product) if j in rows[i] else graph.neg(product)
                for sample, pivot in zip(numbers, pivots, strict=True):
                    sample[i][j] = sample[j][i] = sample[i].get(j, 0.0) - sample[k][i] * sample[k][j] / pivot
        for i in later:
            del rows[i][k]
            for sample in numbers:
                del sample[i][k]
        order.append(k)
        reciprocals.append(reciprocal)
        lower.append(multipliers)
    return SymmetricFactors(tuple(order), tuple(reciprocals), tuple(lower))


def _diagonal_price(i: int, rows: Rows, numbers: Numbers) -> tuple[float, int]:
    """(0, nonzeros) of a row with an admissible pivot; rows without one come after all others, the best of them first."""
    ratio = min(abs(s[i][i]) / max((abs(x) for x in s[i].values()), default=1.0) for s in numbers)
    return (0.0, len(rows[i])) if ratio >= LEAST_PIVOT else (1.0 - ratio, 0)


def solve_symmetric(graph: Graph, factors: SymmetricFactors, right: dict[int, int]) -> dict[int, int]:
    """{row: node} of the solution of A x = right; what is structurally zero stays out."""
    work = dict(right)
    for k, below in zip(factors.order, factors.lower, strict=True):
        if k in work:
            for i, multiplier in below.items():
                _subtract(graph, work, i, graph.mul(multiplier, work[k]))
    for k, reciprocal, below in zip(*map(reversed, (factors.order, factors.reciprocal, factors.lower)), strict=True):
        if k in work:
            work[k] = graph.mul(work[k], reciprocal)
        for i, multiplier in below.items():
            if i in work:
                _subtract(graph, work, k, graph.mul(multiplier, work[i]))
    return work
