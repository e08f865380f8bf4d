"""Rows of an open tree of bodies that others imply, link by link, so that the tree can be large.

The rows that close a link say of its own coordinates what those before leave open, and all rows allow what the joints do. So a row is
implied by others where its part over the link's own coordinates is a combination of such parts: what is left of it over the coordinates of
links before is zero for all their motions, and rows that close these links imply it.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ncgen.model.singular_values import least_squares, singular_values
from ncgen.program.tree.tree_rows import SampledPosition
from ncgen.program.tree.tree_tables import OpenTree
from ncgen.solver.positions.row_choice import best_rows, first_independent, represents_badly

RELATIVE_ZERO = 1e-9
"""What is left of a row below this fraction of it is rounding."""

MIN_COEFFICIENT = 1e-7
"""A row whose part in a combination is below this is no part of it."""

Implications: TypeAlias = dict[int, dict[int, float]]
"""{row: {other row: its coefficient}}, rows in natural sizes."""


def implied_rows(tree: OpenTree, here: SampledPosition) -> Implications | None:
    """The rows of a tree that others imply, those that come last in the user's order if the others are far from dependent.

    None where the rows of a link let more move at a position than its joint, or too few stay independent.

    here: the position
    """
    ranks = list(tree.ranks(here))
    if any(rank != needed for rank, _, needed in ranks):
        return None
    try:
        return _Implied(tree, here, [needed for _, _, needed in ranks]).implications()
    except _OpenQuestion:
        return None


class _OpenQuestion(Exception):
    """Rows at the edge of independence, which all of them together decide."""


class _Implied:
    """The rows that each link keeps; ranks: of the rows that close each."""

    def __init__(self, tree: OpenTree, here: SampledPosition, ranks: list[int]) -> None:
        self.tree = tree
        self.values, self.values_here = tree.in_natural_sizes(tree.aside), tree.in_natural_sizes(here)
        self.is_ordered = True
        self.kept = [self._independent(link, rank) for link, rank in enumerate(ranks)]

    def _independent(self, link: int, rank: int) -> list[int]:
        """Of the rows that close a link, by their numbers among these, the first that are independent; if they are nearly dependent at the
        position, those that are farthest from it."""
        block, block_here = self.tree.block(link, self.values), self.tree.block(link, self.values_here)
        if len(block) == rank:
            return list(range(rank))
        values = singular_values(block_here)
        kept = first_independent([block])
        if len(kept) != rank or represents_badly(block_here, kept, values):
            self.is_ordered, kept = False, best_rows(block_here, rank).tolist()
            if represents_badly(block, kept, singular_values(block)):
                raise _OpenQuestion
        return kept

    def implications(self) -> Implications:
        implied: Implications = {row: {} for row in range(len(self.tree.rows))}
        for link, kept in enumerate(self.kept):
            rows = self.tree.rows_of(link)
            for k, row in enumerate(rows):
                if k in kept:
                    del implied[row]
                else:
                    implied[row] = self._combination(link, row)
        return _last_ones(implied) if self.is_ordered else implied

    def _row(self, row: int) -> np.ndarray:
        """A row over all coordinates, in natural sizes."""
        entries = slice(self.tree.pattern.indptr[row], self.tree.pattern.indptr[row + 1])
        columns = list(self.tree.rows[row])
        dense = np.zeros(self.tree.n)
        dense[columns] = self.values[entries] * self.tree.sizes[columns]
        return dense

    def _combination(self, link: int, row: int) -> dict[int, float]:
        """The kept rows that a row is a sum of, from the link that it closes to the ground."""
        left, parts = self._row(row), {}
        least = RELATIVE_ZERO * np.max(np.abs(left))
        group = np.array(self.tree.group)
        before = link + 1
        while np.any(far := np.abs(left) > least):
            link = int(np.max(group[far]))
            if link >= before:
                raise _OpenQuestion
            before, numbers = link, [self.tree.rows_of(link)[k] for k in self.kept[link]]
            block = self.tree.block(link, self.values)[self.kept[link]]
            coefficients = least_squares(block.T, left[self.tree.unknowns[link]])
            for number, coefficient in zip(numbers, coefficients.tolist(), strict=True):
                if abs(coefficient) > MIN_COEFFICIENT:
                    parts[number] = coefficient
                left = left - coefficient * self._row(number)
        return parts


def _last_ones(implied: Implications) -> Implications:
    """The same with the rows that come last implied by those before, as a choice in the order of the rows has it."""
    while wrong := next((row for row, parts in implied.items() if parts and max(parts) > row), None):
        parts = implied.pop(wrong)
        last = max(parts)
        coefficient_of_last = parts.pop(last)
        turned = {wrong: 1 / coefficient_of_last} | {row: -coefficient / coefficient_of_last for row, coefficient in parts.items()}
        for others in implied.values():
            if factor := others.pop(last, 0.0):
                for row, coefficient in turned.items():
                    others[row] = others.get(row, 0.0) + factor * coefficient
        implied[last] = turned
    return {row: {k: c for k, c in parts.items() if abs(c) > MIN_COEFFICIENT} for row, parts in sorted(implied.items())}
