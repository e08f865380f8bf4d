"""What models have in common that differ in their numbers only: a digest of the structure, and the numbers, in an order of their own.

0, 1 and −1 belong to the structure, since they simplify what they meet. A model whose numbers are traced (ncgen.model.traced_numbers) gives
equations and programs that know what each constant was computed from.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from ncgen.model import Model
from ncgen.model.catalogue import RowType
from ncgen.model.digest import NOT_IN_EQUATIONS, names_of_fields
from ncgen.model.elements import Component
from ncgen.model.expressions import is_symbolic
from ncgen.model.traced_numbers import Trace, unit_near
from ncgen.symbolic.inertia import StandardInertia, standard_inertia, take_standard
from ncgen.symbolic.inertia_terms import Amount, Amounts, amounts_of, take_amounts
from ncgen.symbolic.omissions import angle_row_type, perpendicular_pairs
from ncgen.symbolic.tree import spanning_tree

FIELDS = "__dataclass_fields__"
"""What classes of data have."""


@dataclass(frozen=True, eq=False)
class TracedModel:
    """A copy of a model, for its equations only, whose numbers are traced.

    digest: of its structure, 64 hexadecimal digits; numbers: of the model, by the positions in the trace
    """

    model: Model
    trace: Trace
    digest: str
    numbers: list[float]


def has_structure(model: Model) -> bool:
    """Whether the numbers of a model may be told from its structure: not with parameters or curves, whose expressions contain numbers."""
    return not (model.parameters or model.curves)


def described(model: Model) -> Description | None:
    """What a model was given; None where it holds something that has no name and no value."""
    description = Description(model, None)
    try:
        description.describe()
    except TypeError:
        return None
    return description


def traced(model: Model) -> TracedModel | None:
    """The copy of a model, and what its description says of it."""
    trace = Trace()
    description = Description(model, trace)
    try:
        copy = description.copy()
    except (TypeError, OverflowError):
        return None
    return TracedModel(copy, trace, description.digest(), description.numbers)


class Description:
    """What a model consists of, in words; with a trace a copy of it, too.

    words: of the structure; values: all numbers; numbers: those that are no part of the structure; rates: of the tree of bodies
    """

    def __init__(self, model: Model, trace: Trace | None) -> None:
        self.words: list[str] = []
        self.values: list[float] = []
        self.numbers: list[float] = []
        self.rates = 0
        self._model, self._trace = model, trace
        self._positions: dict[float, int] = {}
        self._copies: dict[object, tuple[int, Any, Any]] = {}

    def digest(self) -> str:
        """Of the words so far, 64 hexadecimal digits."""
        return hashlib.sha256("\n".join(self.words).encode()).hexdigest()

    def identity(self) -> str:
        """What tells the model from all others, when it has been described."""
        return f"{self.digest()}\n{' '.join(map(float.hex, self.values))}"

    def told_apart(self) -> tuple[str, list[float], int] | None:
        """The digest of the structure and the numbers of the model, as of `TracedModel`, and the degrees of freedom of its tree of bodies,
        when it has been described; None for numbers whose products are no doubles."""
        try:
            self._derive()
        except (TypeError, OverflowError):
            return None
        return self.digest(), self.numbers, self.rates

    def copy(self) -> Model:
        """A copy of what equations depend on; all else is shared."""
        members = self.describe()
        inertias, amounts = self._derive()
        copy = object.__new__(type(self._model))
        vars(copy).update(vars(self._model) | members)
        for name, inertia in inertias.items():
            take_standard(copy.bodies[name], inertia)
        take_amounts(copy, amounts)
        return copy

    def describe(self) -> dict[str, Any]:
        """What equations depend on by its names, copied where numbers are traced. Raises TypeError for what has no name and no value."""
        return {key: self._copy(value) for key, value in vars(self._model).items() if key not in NOT_IN_EQUATIONS}

    def _derive(self) -> tuple[dict[str, StandardInertia], Amounts]:
        """Inertias and amounts, whose sums are numbers, too, and what is decided by looking at numbers."""
        model = self._model
        bodies = [body for body in model.bodies.values() if body.inertia]
        inertias = {body.name: self._inertia(standard_inertia(body, model.parameters)) for body in bodies}
        amounts = self._amounts(amounts_of(model, bodies, (), model.rotors), inertias)
        self._decisions(model)
        return inertias, amounts

    def _decisions(self, model: Model) -> None:
        """Add what is decided by looking at numbers: which rows are simpler than others, and how bodies hang on each other."""
        pairs = perpendicular_pairs(model)
        self.words += [angle_row_type(row, row.type, pairs, []).key for row in model.rows if row.type]
        tree = spanning_tree(model)
        self.rates = tree.dof
        for link in tree.links:
            axes = [(screw.axis, screw.point and screw.point.name, screw.is_constant) for screw in link.screws]
            self.words.append(f"{link.body.name} on {link.parent}: {axes}")

    def _copy(self, value: Any) -> Any:
        kind = value.__class__
        if kind is float:
            return self._float(value)
        if kind is str or kind is int or kind is bool or value is None:
            self.words.append(repr(value))
            return value
        if kind in (tuple, list, dict):
            return self._collection(value)
        if hasattr(kind, FIELDS) and kind is not RowType:
            return self._object(value)
        return self._rare(value)

    def _rare(self, value: Any) -> Any:
        """A copy of what is of another type than most values. Raises TypeError for what has no name and no value."""
        if isinstance(value, (bool, str, int, np.integer)):
            self.words.append(repr(value))
            return value
        if isinstance(value, (list, tuple, dict)):
            return self._collection(value)
        if isinstance(value, (float, np.floating)):
            return self._float(float(value))
        if isinstance(value, RowType):
            self.words.append(value.key)
            return value
        if isinstance(value, np.ndarray):
            self.words.append(str(value.shape))
            self._copy(value.ravel().tolist() if value.dtype != object else list(value.flat))
            return value
        if is_symbolic(value):
            import sympy

            self.words.append(sympy.srepr(value))
            return value
        raise TypeError(f"{value!r} has no value that could be told")

    def _float(self, value: float) -> float:
        self.values.append(value)
        unit = unit_near(value)
        if unit is not None:
            self.words.append(unit.hex())
            return unit
        position = len(self.numbers) if self._model.has_separate_numbers else self._positions.setdefault(value, len(self.numbers))
        self.words.append(f"number {position}")
        if position == len(self.numbers):
            self.numbers.append(value)
        return value if self._trace is None else self._trace.given(value, position)

    def _collection(self, value: Any) -> Any:
        self.words.append(f"{len(value)} parts")
        if self._trace is None:
            for member in chain.from_iterable(value.items()) if isinstance(value, dict) else value:
                self._copy(member)
            return value
        if isinstance(value, dict):
            return {self._copy(key): self._copy(member) for key, member in value.items()}
        members = [self._copy(member) for member in value]
        if isinstance(value, list):
            return members
        return type(value)(*members) if hasattr(value, "_fields") else tuple(members)

    def _object(self, value: Any) -> Any:
        """A copy of an object, one for all places where it stands; components are what they say, since the normal of planes is one for
        all models of a process, but not for those from elsewhere."""
        key = value if isinstance(value, Component) else id(value)
        known = self._copies.get(key)
        if known is not None:
            self.words.append(f"again {known[0]}")
            return known[1]
        copy = value if self._trace is None else object.__new__(type(value))
        self._copies[key] = len(self._copies), copy, value
        self.words.append(type(value).__name__)
        for name in names_of_fields(type(value)):
            member = self._copy(getattr(value, name))
            if copy is not value:
                object.__setattr__(copy, name, member)
        return copy

    def _inertia(self, standard: StandardInertia) -> StandardInertia:
        forms = tuple(self._copy(form) for form in standard.directions)
        return replace(standard, directions=forms, matrix=tuple(tuple(self._float(float(x)) for x in row) for row in standard.matrix))

    def _amounts(self, exact: Amounts, inertias: dict[str, StandardInertia]) -> Amounts:
        """Sums are numbers of their own, since they are rounded once. inertias: of the bodies, as they are copied"""
        mass: dict[tuple[Component, Component], Amount] = {}
        for pair, value in exact.mass.items():
            name, row, column = exact.alone.get(pair, ("", 0, 0))
            alone = inertias[name].matrix[row][column] if name else 0.0
            mass[self._copy(pair)] = self._float(float(value)) if unit_near(float(alone)) is not None else alone
            self.words.append(f"{name} {row} {column}")
        weight: dict[Component, Amount] = {self._copy(each): self._float(float(value)) for each, value in exact.weight.items()}
        return Amounts(mass, weight, self._float(float(exact.offset)))
