"""Constraint rows: a row type of the catalogue applied to elements of a mechanism, with its owner.

The functions here check a row against the initial position, because that is where a mistake can be
shown on the line that the user wrote.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ncgen.model import measures
from ncgen.model.catalogue import BRANCH_WEIGHTS, PAPER_ANGLE_CODES, PAPER_CODES, ROW_TYPES, RowType
from ncgen.model.elements import AXES, Angle, Combination, Component, Point, Relative, Spatial, as_combination
from ncgen.model.expressions import is_symbolic
from ncgen.model.value_conditions import Bound, Condition, Cosine
from ncgen.model.values import Parameter, Scalar, Value, is_number, text_of

SIX_DIGITS = 1e-5
"""How far from 1 the length of a unit vector may be that was typed with six digits."""


@dataclass(frozen=True)
class Owner:
    """Who is responsible for a row or a mass: a body, a coordinate, a joint, a driver or the user.

    bodies: names of those that a joint is between, as far as it says them; joint: its kind, such as "prismatic"
    """

    kind: str
    name: str
    bodies: tuple[str, ...] = field(default=(), compare=False, repr=False)
    joint: str = field(default="", compare=False, repr=False)

    def __str__(self) -> str:
        return self.name if self.name.startswith(self.kind) else f"{self.kind} {self.name}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """One constraint equation.

    type: catalogue entry, or None where `expression` (a sympy expression of coordinates, t and parameters) is given
    measured: True if its lengths and angles were taken from the initial position
    level: "position", or "velocity" for a rolling condition, whose expression is linear in rates
    arguments: combination per vector argument, component per scalar argument
    data: value per constant
    along: the segment whose natural length is the size of the raw row; None where the type says its size
    """

    owner: Owner
    label: str
    code: int | None = None
    type: RowType | None = None
    arguments: Mapping[str, Combination | Component] = field(default_factory=dict)
    data: Mapping[str, Value] = field(default_factory=dict)
    expression: Scalar | None = None
    scaled: bool = True
    level: str = "position"
    measured: bool = False
    along: Combination | None = None

    def __repr__(self) -> str:
        return f"<Row {self.code or self.level}: {self.label}, {self.owner}>"

    def as_measured(self) -> Row:
        """The same row, its lengths and angles being those of the initial position."""
        members: dict[str, Any] = {**vars(self), "measured": True}
        return Row(**members)

    @property
    def equation(self) -> str:
        """The equation in words of the row's own elements, for comments and listings."""
        if self.type is None:
            return f"{self.expression} = 0"
        return describe(f"{self.type.equation} = 0", {**self.arguments, **self.data})

    @property
    def written(self) -> Scalar:
        """The expression of a row that is not of the catalogue."""
        assert self.expression is not None, f"{self.label}: a row has a type or an expression"
        return self.expression

    def direction(self, name: str) -> Combination:
        """What a vector argument of the row's type stands for."""
        argument = self.arguments[name]
        assert isinstance(argument, Combination), f"{self.label}: {name} is no vector"
        return argument


def natural_size(row: Row, number: Callable[[Value], float], extent: float) -> float | None:
    """The size of a row's value where it is grossly violated: what a residual is compared with.

    `number` turns a value into a float; extent: of the whole model (m), which nobody knows before all of it is there. For a scaled distance
    row this is L/2 (m); None where only the row's gradient can tell, as of one given as an expression.
    """
    if row.type is None or row.type.size is None:
        return None
    by_data = math.prod(number(row.data[name]) for name in row.type.size)
    size = by_data if row.along is None else measures.natural_length(row.along, extent)
    scale = row.type.scale_factor / math.prod(number(row.data[name]) for name in row.type.scale_data) if row.scaled else 1.0
    return size * scale


def describe(equation: str, values: Mapping[str, Combination | Value | Component]) -> str:
    """The equation of a row or a load with what its letters stand for."""
    substitutions = ", ".join(f"{name} = {_short(value)}" for name, value in values.items() if re.search(rf"\b{name}\b", equation))
    return f"{equation} with {substitutions}" if substitutions else equation


def _short(value: Combination | Value | Component) -> str:
    if isinstance(value, (Parameter, Component)):
        return value.name
    return f"{value:.6g}" if is_number(value) else text_of(value) if is_symbolic(value) else str(value)


def _typed(
    key: str,
    owner: Owner,
    label: str,
    arguments: Mapping[str, Combination | Component],
    data: Mapping[str, Value],
    scaled: bool,
    along: Combination | None = None,
) -> Row:
    """A row of a type of the catalogue, with the paper's code where it has one."""
    kind, code = ROW_TYPES[key], PAPER_CODES.get(key)
    return Row(owner=owner, label=label, code=code, type=kind, arguments=arguments, data=data, scaled=scaled, along=along)


def distance(start: Point, end: Point, length: Value, owner: Owner, numeric: float, scaled: bool) -> Row:
    """Row 1000: |end − start| = length (m). `numeric` is the length's number."""
    new = _typed("distance", owner, f"distance {start.name}-{end.name}", {"a": start - end}, {"L": length}, scaled)
    _length_condition(new).check([numeric])
    return new


def unit(vector: Spatial, owner: Owner, scaled: bool) -> Row:
    """Row 1001: |u| = 1."""
    return _typed("unit", owner, f"unit {vector.name}", {"u": as_combination(vector)}, {}, scaled)


def vector_segment(vector: Spatial, segment: Combination, length: Value, cosine: Value, owner: Owner, numeric: float, scaled: bool) -> Row:
    """Row 1002: u·segment = length·cosine; refused where the two are parallel. `numeric` is the cosine's number."""
    arguments = {"u": as_combination(vector), "a": segment}
    new = _typed("vector-segment", owner, f"angle {vector.name}, {segment}", arguments, {"L": length, "c": cosine}, scaled)
    _cosine_condition(new).check([numeric])
    return new


def vector_vector(u: Spatial, v: Spatial, cosine: Value, owner: Owner, numeric: float, scaled: bool) -> Row:
    """Row 1003: u·v = cosine; refused where the two are parallel. `numeric` is the cosine's number."""
    arguments = {"u": as_combination(u), "v": as_combination(v)}
    new = _typed("vector-vector", owner, f"angle {u.name}, {v.name}", arguments, {"c": cosine}, scaled)
    _cosine_condition(new).check([numeric])
    return new


def conditions(row: Row) -> list[Condition]:
    """What the data of a row must satisfy. A cosine that was measured is no data of the user's: it says where elements are."""
    key = row.type.key if row.type else ""
    on_data: list[Condition] = [_length_condition(row)] if key in ("distance", "vector-segment") else []
    return [*on_data, _cosine_condition(row)] if key in ("vector-segment", "vector-vector") and not row.measured else on_data


def _length_condition(row: Row) -> Bound:
    return Bound(
        wording=f"{row.owner}, {row.label}: the length is",
        value=row.data["L"],
        relation=">",
        unit="m",
        remedy="give points that are apart, or a positive length",
    )


def _cosine_condition(row: Row) -> Cosine:
    return Cosine(f"{row.owner}, {row.label}", row.data["c"])


def dot(a: Combination, b: Combination, value: Value, size: float, owner: Owner, label: str, scaled: bool) -> Row:
    """a·b = value, divided by `size`, the natural size of the product."""
    return _typed("dot", owner, label, {"a": a, "b": b}, {"c": value, "L": size}, scaled)


def in_plane(segment: Combination, normal: Combination, value: Value, extent: float, owner: Owner, label: str, scaled: bool) -> Row:
    """segment·normal = value, divided by a length; extent: of the model as far as there is one (m)."""
    arguments, data = {"a": segment, "b": normal}, {"c": value, "L": measures.natural_length(segment, extent)}
    return _typed("dot", owner, label, arguments, data, scaled, segment)


def affine(
    e: Combination, a: Combination, b: Combination, cross_weight: Value, along: Combination | None, owner: Owner, label: str
) -> list[Row]:
    """The components of e = cross_weight · a × b, where e is a linear combination that a rigid body keeps: of the segment `along`, or of a
    unit vector and others."""
    arguments, data = {"e": e, "a": a, "b": b}, {"c": cross_weight}
    return [_typed(f"affine-{axis}", owner, f"{label}.{axis}", arguments, data, True, along) for axis in AXES]


def length_row(s: Relative, segment: Combination, scaled: bool) -> Row:
    """|segment| = s."""
    arguments = {"a": segment, "s": s.components[0]}
    return _typed("length", _coordinate(s), f"length {s.name}", arguments, {"L": measures.length(segment)}, scaled)


def slide_row(s: Relative, segment: Combination, axis: Combination, scaled: bool) -> Row:
    """segment·axis = s."""
    arguments = {"a": segment, "n": axis, "s": s.components[0]}
    return _typed("slide", _coordinate(s), f"slide {s.name}", arguments, {}, scaled, segment)


def follow(coordinate: Relative, other: Relative, ratio: Value, offset: Value, owner: Owner) -> Row:
    """coordinate = ratio other + offset."""
    arguments = {"s": coordinate.components[0], "z": other.components[0]}
    return _typed("follow", owner, f"{coordinate.name} follows {other.name}", arguments, {"k": ratio, "c": offset}, False)


def _coordinate(s: Relative) -> Owner:
    return Owner("coordinate", s.name)


def is_trivial(row: Row) -> bool:
    """True if the row cannot depend on any free coordinate, as in the plane for what is out of it."""
    if row.type is None:
        return False
    vectors = [row.direction(name) for name in row.type.vectors]
    if row.type.scalars:
        return False
    if row.type.key.startswith("affine-"):
        axis = AXES.index(row.type.key[-1])
        e, a, b = vectors
        turned = row.data["c"] != 0.0 and any(_moves(v, k) and not _zero(w, l) for v, w in ((a, b), (b, a)) for k, l in _others(axis))
        return not _moves(e, axis) and not turned
    first, last = vectors[0], vectors[-1]
    return not any(_moves(v, k) and (v is w or not _zero(w, k)) for v, w in ((first, last), (last, first)) for k in range(3))


def _others(axis: int) -> tuple[tuple[int, int], tuple[int, int]]:
    k, l = (axis + 1) % 3, (axis + 2) % 3
    return (k, l), (l, k)


def _moves(direction: Combination, axis: int) -> bool:
    return any(not e.components[axis].fixed for e in direction.elements)


def _zero(direction: Combination, axis: int) -> bool:
    value = direction.given[axis]
    return not _moves(direction, axis) and is_number(value) and value == 0.0


def angle(psi: Angle, form: str, lengths: Sequence[Value] | None, branch: tuple[Parameter, ...], scaled: bool) -> Row:
    """The row that ties a relative angle to the elements it is measured between.

    form: "smooth" (never degenerate), "cosine", "sine" (largest component of the axis) or "paper"
    (cosine or one sine component, chosen at run time through the parameters `branch`).
    lengths: of start, end and axis (m; 1 for unit vectors), or None to measure them in the initial position.
    """
    key = f"angle-sine-{AXES[largest_component(psi.axis.initial)]}" if form == "sine" else f"angle-{form}"
    la, lb, ln = lengths or map(measures.length, (psi.start, psi.end, psi.axis))
    data = {"la": la, "lb": lb, "ln": ln, **dict(zip(BRANCH_WEIGHTS, branch))}
    arguments = {"a": psi.start, "b": psi.end, "n": psi.axis, "psi": psi.components[0]}
    code = PAPER_ANGLE_CODES[measures.shape(psi.start), measures.shape(psi.end), measures.shape(psi.axis)]
    return Row(
        owner=Owner("coordinate", psi.name),
        label=f"angle {psi.name}",
        code=code,
        type=ROW_TYPES[key],
        arguments=arguments,
        data=data,
        scaled=scaled,
    )


def largest_component(axis: np.ndarray) -> int:
    return int(np.argmax(np.abs(axis)))
