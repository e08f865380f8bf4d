"""A term of the equations of a mechanism: a template bound to its places in q, with its owner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ncgen.model.elements import Component
from ncgen.model.rows import Owner
from ncgen.model.values import Scalar, Value
from ncgen.symbolic.templates import Template

LinearForm: TypeAlias = tuple[tuple[Scalar, Component], ...]
"""Pairs (weight, coordinate); a weight is a value."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Term:
    """A template at its place.

    scalars: a linear form of coordinates per scalar of the template
    data: a value per constant of the template
    row: the number of the constraint row, or None; equation: that of a row or of a load, for people
    """

    template: Template
    scalars: tuple[LinearForm, ...]
    data: tuple[Value, ...]
    owner: Owner
    label: str
    row: int | None = None
    equation: str = ""
