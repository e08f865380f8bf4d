"""The plan by which the runtime factors [A Φ_qᵀ; Φ_q −E]: order of elimination, pattern of L, where the values go.

The order is of minimum degree with one rule. A row is eliminated after all of its coordinates with mass: its pivot then holds
−(E + Φ_q M⁻¹ Φ_qᵀ) over these, which is never near zero unless the row is redundant, or moves nothing else, and E may be zero where
all coordinates have mass. Those without are eliminated after all of their rows: their pivots then are those of Φ_qᵀ (E + …)⁻¹ Φ_q.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

from ncgen.program.ir.blocks import Pattern


@dataclass(frozen=True, kw_only=True)
class Elimination:
    """Index arrays in the words of ncgen_runtime.h (`ncgen_elimination`)."""

    size: int
    nonzeros: int
    order: tuple[int, ...]
    row_start: tuple[int, ...]
    row_columns: tuple[int, ...]
    row_positions: tuple[int, ...]
    column_start: tuple[int, ...]
    column_rows: tuple[int, ...]
    entry_start: tuple[int, ...]
    entry_columns: tuple[int, ...]
    entry_values: tuple[int, ...]

    ARRAYS = ("order", "row_start", "row_columns", "row_positions", "column_start", "column_rows", "entry_start", "entry_columns",
              "entry_values")  # fmt: skip


def plan(mass: Pattern, phi_q: Pattern) -> Elimination:
    """The plan for A with the pattern of M."""
    n, m = phi_q.shape[1], phi_q.shape[0]
    entries = _entries(n, mass, phi_q)
    neighbours: list[set[int]] = [set() for _ in range(n + m)]
    for i, j, _ in entries:
        if i != j:
            neighbours[i].add(j)
            neighbours[j].add(i)
    massive = {i for i, j in mass.positions() if i == j}
    waits: list[set[int]] = [set() for _ in range(n + m)]
    for i, j in phi_q.positions():
        first, then = (j, n + i) if j in massive else (n + i, j)
        waits[then].add(first)
    order, columns = _minimum_degree(neighbours, waits)
    return _index(order, columns, entries)


def _entries(n: int, mass: Pattern, phi_q: Pattern) -> list[tuple[int, int, int]]:
    """(i, j, number of its value) of the lower half of the matrix."""
    entries = [(i, j, k) for (i, j), k in mass.positions().items() if i >= j]
    return entries + [(n + i, j, mass.nonzeros + k) for (i, j), k in phi_q.positions().items()]


def _minimum_degree(neighbours: list[set[int]], waits: list[set[int]]) -> tuple[list[int], list[set[int]]]:
    """The order, and for every step the unknowns still there that its column of L reaches. neighbours are used up."""
    waiting: list[list[int]] = [[] for _ in neighbours]
    left = [len(w) for w in waits]
    for row, coordinates in enumerate(waits):
        for c in coordinates:
            waiting[c].append(row)
    heap = [(len(near), u) for u, near in enumerate(neighbours) if not left[u]]
    heapq.heapify(heap)
    done = [False] * len(neighbours)
    order, columns = [], []
    while heap:
        degree, u = heapq.heappop(heap)
        if done[u] or degree != len(neighbours[u]):
            continue
        done[u] = True
        order.append(u)
        near = neighbours[u]
        columns.append(near)
        for v in near:
            neighbours[v] = (neighbours[v] | near) - {u, v}
        for v in waiting[u]:
            left[v] -= 1
        for v in near | set(waiting[u]):
            if not left[v]:
                heapq.heappush(heap, (len(neighbours[v]), v))
    return order, columns


def _index(order: list[int], columns: list[set[int]], entries: list[tuple[int, int, int]]) -> Elimination:
    """The plan as arrays."""
    size = len(order)
    position = {u: k for k, u in enumerate(order)}
    column_start, column_rows = [0], []
    rows: list[list[tuple[int, int]]] = [[] for _ in range(size)]
    for k, reached in enumerate(columns):
        for row in sorted(position[v] for v in reached):
            rows[row].append((k, len(column_rows)))
            column_rows.append(row)
        column_start.append(len(column_rows))
    into: list[list[tuple[int, int]]] = [[] for _ in range(size)]
    for i, j, value in entries:
        low, high = sorted((position[i], position[j]))
        into[high].append((low, value))
    row_start, entry_start = [0], [0]
    for k in range(size):
        row_start.append(row_start[-1] + len(rows[k]))
        entry_start.append(entry_start[-1] + len(into[k]))
    row_pairs = [pair for row in rows for pair in row]
    entry_pairs = [pair for row in into for pair in sorted(row)]
    return Elimination(
        size=size, nonzeros=len(column_rows), order=tuple(order),
        row_start=tuple(row_start), row_columns=tuple(c for c, _ in row_pairs), row_positions=tuple(p for _, p in row_pairs),
        column_start=tuple(column_start), column_rows=tuple(column_rows),
        entry_start=tuple(entry_start), entry_columns=tuple(c for c, _ in entry_pairs), entry_values=tuple(v for _, v in entry_pairs),
    )  # fmt: skip
