"""Model only what the scene needs: parts of equations that a mechanism's own rows make superfluous."""

from __future__ import annotations

from typing import TypeAlias

from ncgen.model import Model, measures
from ncgen.model.catalogue import ROW_TYPES, RowType
from ncgen.model.elements import Combination
from ncgen.model.rows import Row
from ncgen.model.values import Scalar, is_number

Line: TypeAlias = frozenset[tuple[str, Scalar]]
"""Pairs (name of an element, its weight)."""

Pairs: TypeAlias = frozenset[frozenset[Line]]
"""Of lines."""


def angle_row_type(row: Row, kind: RowType, pairs: Pairs, omitted: list[str]) -> RowType:
    """The smooth angle row without its projection terms, where both sides stay perpendicular to the axis.

    (a·n)(b·n) and its gradient vanish where a·n = 0 and b·n = 0; rows with cosine zero, or fixed
    elements, must say so. Anything less keeps the full row.

    kind: the type of the row; others than smooth ones stay; pairs: what rows keep perpendicular
    """
    if kind.key != "angle-smooth":
        return kind
    axis = row.direction("n")
    if not all(_perpendicular(row.direction(side), axis, pairs) for side in "ab"):
        return kind
    omitted.append(f"{row.label}: projection terms, both sides are perpendicular to the axis by other constraints")
    return ROW_TYPES["angle-smooth-perpendicular"]


def _perpendicular(a: Combination, b: Combination, pairs: Pairs) -> bool:
    if all(c.fixed and is_number(c.value) for e in a.elements + b.elements for c in e.components):
        return measures.cosine_of(a.initial, b.initial) == 0.0
    return frozenset((_line(a), _line(b))) in pairs


def perpendicular_pairs(model: Model) -> Pairs:
    """Directions that rows with cosine zero keep perpendicular."""
    return frozenset(
        frozenset(_line(row.direction(name)) for name in row.type.vectors)
        for row in model.rows
        if row.type and row.type.key in ("vector-segment", "vector-vector") and row.data["c"] == 0.0
    )


def _line(direction: Combination) -> Line:
    """The same key for every multiple of a direction: weights relative to the first element by name."""
    terms = sorted((element.name, weight) for weight, element in direction.terms)
    leading = terms[0][1]
    return frozenset((name, weight / leading) for name, weight in terms)
