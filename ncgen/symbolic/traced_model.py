"""What models have in common that differ in their numbers only: a digest of the structure, and the numbers, in an order of their own.

0, 1 and −1 belong to the structure, since they simplify what they meet. A model whose numbers are traced (ncgen.model.traced_numbers) gives
equations and programs that know what each constant was computed from.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, is_dataclass, replace
from typing import Any

import numpy as np

from ncgen.model import Model
from ncgen.model.catalogue import RowType
from ncgen.model.digest import NOT_IN_EQUATIONS, names_of_fields
from ncgen.model.expressions import is_symbolic
from ncgen.model.traced_numbers import Trace, Traced, unit_near
from ncgen.symbolic.inertia import StandardInertia, standard_inertia, take_standard
from ncgen.symbolic.inertia_terms import Amount, Amounts, amounts_of, take_amounts
from ncgen.symbolic.omissions import angle_row_type, perpendicular_pairs
from ncgen.symbolic.tree import spanning_tree


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


def traced(model: Model) -> TracedModel | None:
    """The structure and the numbers of a model that has one; None where it holds something that has no name and no value, or numbers whose
    products are no doubles."""
    walk = _Walk(model.has_separate_numbers)
    try:
        copy = walk.model(model)
    except (TypeError, OverflowError):
        return None
    digest = hashlib.sha256("\n".join(walk.words).encode()).hexdigest()
    return TracedModel(copy, walk.trace, digest, walk.numbers)


class _Walk:
    """A copy under way. words: of the structure; are_separate: whether numbers that are equal are different ones."""

    def __init__(self, are_separate: bool) -> None:
        self.words: list[str] = []
        self.numbers: list[float] = []
        self.trace = Trace()
        self._are_separate = are_separate
        self._positions: dict[float, int] = {}
        self._copies: dict[int, tuple[int, Any, Any]] = {}

    def model(self, model: Model) -> Model:
        """A copy of what equations depend on; all else is shared."""
        copy = object.__new__(type(model))
        members = {key: value if key in NOT_IN_EQUATIONS else self._copy(value) for key, value in vars(model).items()}
        vars(copy).update(members)
        bodies = [body for body in model.bodies.values() if body.inertia]
        for body in bodies:
            take_standard(copy.bodies[body.name], self._inertia(standard_inertia(body, model.parameters)))
        copies = [body for body in copy.bodies.values() if body.inertia]
        exact, rounded = amounts_of(model, bodies, (), model.rotors), amounts_of(copy, copies, (), copy.rotors)
        take_amounts(copy, self._amounts(exact, rounded))
        self._decisions(model)
        return copy

    def _decisions(self, model: Model) -> None:
        """Add what is decided by looking at numbers: which rows are simpler than others, and how bodies hang on each other."""
        pairs = perpendicular_pairs(model)
        self.words += [angle_row_type(row, row.type, pairs, []).key for row in model.rows if row.type]
        for link in spanning_tree(model).links:
            axes = [(screw.axis, screw.point and screw.point.name, screw.is_constant) for screw in link.screws]
            self.words.append(f"{link.body.name} on {link.parent}: {axes}")

    def _copy(self, value: Any) -> Any:
        kind = value.__class__
        if kind is float:
            return self._float(value)
        if kind is str or value is None or isinstance(value, (bool, str, int, np.integer)):
            self.words.append(repr(value))
            return value
        if kind in (tuple, list, dict) or isinstance(value, (list, tuple, dict)):
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
        if is_dataclass(value):
            return self._object(value)
        if is_symbolic(value):
            import sympy

            self.words.append(sympy.srepr(value))
            return value
        raise TypeError(f"{value!r} has no value that could be told")

    def _float(self, value: float) -> float:
        unit = unit_near(value)
        if unit is not None:
            self.words.append(unit.hex())
            return unit
        position = len(self.numbers) if self._are_separate else self._positions.setdefault(value, len(self.numbers))
        self.words.append(f"number {position}")
        if position == len(self.numbers):
            self.numbers.append(value)
        return self.trace.given(value, position)

    def _collection(self, value: Any) -> Any:
        self.words.append(f"{len(value)} parts")
        if isinstance(value, dict):
            return {self._copy(key): self._copy(member) for key, member in value.items()}
        members = [self._copy(member) for member in value]
        if isinstance(value, list):
            return members
        return type(value)(*members) if hasattr(value, "_fields") else tuple(members)

    def _object(self, value: Any) -> Any:
        """A copy of an object, one for all places where it stands."""
        known = self._copies.get(id(value))
        if known is not None:
            self.words.append(f"again {known[0]}")
            return known[1]
        copy = object.__new__(type(value))
        self._copies[id(value)] = len(self._copies), copy, value
        self.words.append(type(value).__name__)
        for name in names_of_fields(type(value)):
            object.__setattr__(copy, name, self._copy(getattr(value, name)))
        return copy

    def _inertia(self, standard: StandardInertia) -> StandardInertia:
        forms = tuple(self._copy(form) for form in standard.directions)
        return replace(standard, directions=forms, matrix=tuple(tuple(self._float(float(x)) for x in row) for row in standard.matrix))

    def _amounts(self, exact: Amounts, rounded: Amounts) -> Amounts:
        """Sums are numbers of their own, since they are rounded once."""
        mass = {self._copy(pair): value for pair, value in exact.mass.items()}
        mass = {pair: self._amount(value, rounded.mass.get(pair)) for pair, value in mass.items()}
        weight = {self._copy(component): value for component, value in exact.weight.items()}
        weight = {component: self._amount(value, rounded.weight.get(component)) for component, value in weight.items()}
        return Amounts(mass, weight, self._amount(exact.offset, rounded.offset))

    def _amount(self, exact: Amount, rounded: Amount | None) -> Amount:
        """An exact sum, or the number of the model that is all of it."""
        if not isinstance(rounded, Traced) or not self.trace.is_given(rounded):
            return self._float(float(exact))
        self.words.append(f"operation {rounded.operation}")
        return rounded
