"""The paper's Tables 1-7 as input: matrices P, U and CONSTR with 1-based numbers, as printed.

One extension: a negative number of an axis vector in an angle row measures about the reversed vector,
so that every sense of section 3.3 of the paper can be written.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, TypeVar

from ncgen.errors import ModelError, counted, shown
from ncgen.model.argument_readers import coordinate
from ncgen.model.bodies import Body
from ncgen.model.elements import Angle, Combination, Direction, Point, Spatial, Vector
from ncgen.model.values import Value, is_number

if TYPE_CHECKING:
    import numpy as np

    from ncgen.model.model import Model

S = TypeVar("S", Point, Vector)

COLUMNS = 12

Table: TypeAlias = "Sequence[Sequence[Any]] | np.ndarray"
"""In signatures: the rows of a table, in which values stand beside codes and numbers of elements."""

Inertias: TypeAlias = Mapping[int, Mapping[str, Any]]
"""In signatures: {body number: {m, cog, IT, r, u, points, vectors}}: a value, values, a tensor, and numbers of elements."""

Pairs: TypeAlias = Iterable[tuple[int, int]]
"""In signatures: pairs of numbers of elements."""


class TableOptions(TypedDict, total=False):
    """What else `from_tables` takes."""

    inertia: Inertias | None
    lines: Pairs
    uvect: Pairs
    fixed: Iterable[int]
    independent: Iterable[int]
    name: str
    scale: bool
    form: str


def from_tables(
    cls: type[Model],
    P: Table,
    U: Table,
    CONSTR: Table,
    *,
    inertia: Inertias | None = None,
    lines: Pairs = (),
    uvect: Pairs = (),
    fixed: Iterable[int] = (),
    independent: Iterable[int] = (),
    name: str = "model",
    scale: bool = True,
    form: str = "smooth",
) -> Model:
    """Build a model from the paper's tables.

    P, U: rows of x, y, z and the 1-based position in q (Table 1); points are named r1, r2 …, vectors u1, u2 …
    CONSTR: rows of 12 entries with the codes 1000-1003 and 1010-1015 (Tables 2-5); angles are named psi1, psi2 …
    inertia: {body number: {m, cog, IT, r, u}} (Table 6); optional `points` and `vectors` name all elements of a
        body, where they are more than the basis r, u
    lines, uvect: pairs of points, and pairs (point, vector), as the columns of Table 7 stand printed
    fixed: 1-based positions in q that do not move (section 5 of the paper)
    independent: numbers of the angles that are independent coordinates

    Raises ModelError naming the table, its row and the number that is wrong.
    """
    model = cls(name, scale=scale, form=form)
    tables = _Tables(model, inertia or {})
    held = {_counted(i, "fixed", "number of a position in q") for i in fixed}
    tables.place(P, U, held)
    unknown = sorted(held - set(range(1, 3 * len(model.elements) + 1)))
    if unknown:
        raise ModelError(f"fixed: position {unknown[0]:g} in q does not exist, there are {3 * len(model.elements)}; correct the number")
    tables.add_bodies()
    for number, entries in enumerate(CONSTR, start=1):
        tables.add_row(number, list(entries))
    for start, end in lines:
        model.line(tables.point(start, "LINES"), tables.point(end, "LINES"))
    for point, vector in uvect:
        model.arrow(tables.point(point, "UVECT"), tables.vector(vector, "UVECT"))
    model.independent(*(coordinate(model, f"psi{i}", "independent, coordinates") for i in independent))
    return model


def _counted(number: object, where: str, quantity: str) -> float:
    """A number that counts something, such as an element. Raises ModelError where it is no plain number."""
    if not is_number(number):
        raise ModelError(f"{where}: {shown(number)} is not a plain number; give the {quantity}")
    return float(number)


class _Tables:
    """The translation in progress: knows the model and which body owns which elements."""

    def __init__(self, model: Model, inertia: Inertias) -> None:
        self.model = model
        self.inertia = inertia

    def place(self, P: Table, U: Table, fixed: set[float]) -> None:
        """Points and vectors in the order of their positions in q."""
        entries = [(f"r{i}", self.model.point, row) for i, row in enumerate(P, 1)]
        entries += [(f"u{i}", self.model.vector, row) for i, row in enumerate(U, 1)]
        for name, _, row in entries:
            if len(row) != 4:
                raise ModelError(f"table of {name}: {counted(len(row), 'number')} given; give x, y, z and the position in q")
            _counted(row[3], name, "position in q")
        entries.sort(key=lambda entry: entry[2][3])
        expected = 1
        for name, add, (x, y, z, position) in entries:
            if position != expected:
                raise ModelError(f"{name}: its position in q is {position:g} where {expected} is the next free one; correct column 4")
            held = "".join(axis for k, axis in enumerate("xyz") if position + k in fixed)
            add(name, (x, y, z), fixed=held)
            expected += 3

    def add_bodies(self) -> None:
        for number, entry in self.inertia.items():
            where = f"inertia of body {number}"
            missing = [key for key in ("m", "cog", "IT", "r") if key not in entry]
            if missing:
                raise ModelError(f"{where}: {missing[0]} is missing; give m, cog, IT and r")
            basis = [self.point(i, where) for i in entry["r"]] + [self.vector(i, where) for i in entry.get("u", ())]
            self.model.body(
                f"body{number}",
                points=[self.point(i, where) for i in entry.get("points", entry["r"])],
                vectors=[self.vector(i, where) for i in entry.get("vectors", entry.get("u", ()))],
                mass=entry["m"],
                com=entry["cog"],
                inertia=entry["IT"],
                basis=basis,
                rigid=False,
            )

    def point(self, number: float, where: str) -> Point:
        return self._element(Point, "r", number, where)

    def vector(self, number: float, where: str) -> Vector:
        return self._element(Vector, "u", number, where)

    def axis(self, number: float, where: str) -> Direction:
        number = _counted(number, where, "number of a vector")
        vector = self.vector(abs(number), where)
        return -vector if number < 0 else vector

    def segment(self, start: float, end: float, where: str) -> Combination:
        return self.point(end, where) - self.point(start, where)

    def _element(self, kind: type[S], letter: str, number: float, where: str) -> S:
        number = _counted(number, where, f"number of a {kind.word}")
        name = f"{letter}{number:g}"
        if name not in self.model.elements:
            count = sum(e.name.startswith(letter) and not isinstance(e, Angle) for e in self.model.elements.values())
            raise ModelError(f"{where}: {kind.word} {number:g} does not exist, the table has {count}; correct the number")
        element = self.model.elements[name]
        assert isinstance(element, kind), f"{name} is no {kind.word}"
        return element

    def owner(self, elements: Iterable[Spatial]) -> Body | None:
        """The first body that has all these elements: the paper says it only in comments."""
        for body in self.model.bodies.values():
            if set(elements) <= set(body.elements):
                return body
        return None

    def add_row(self, number: int, entries: list[Any]) -> None:
        where = f"CONSTR row {number}"
        if len(entries) != COLUMNS:
            raise ModelError(f"{where}: {counted(len(entries), 'entry')}; a row has {COLUMNS}, fill with zeros")
        for column, entry in enumerate(entries, 1):
            if is_number(entry) and not math.isfinite(entry):
                raise ModelError(f"{where}, column {column}: {entry} is not a finite number; correct it")
            if isinstance(entry, str):
                raise ModelError(f"{where}, column {column}: {entry!r} is not a number; correct it")
        add = ROW_READERS.get(_counted(entries[0], where, "code of a row"))
        if add is None:
            known = ", ".join(map(str, ROW_READERS))
            raise ModelError(f"{where}: code {entries[0]} is unknown; the codes are {known}")
        try:
            add(self, where, *entries[1:])
        except ModelError as error:
            raise error if str(error).startswith(where) else ModelError(f"{where}: {error}") from None

    def distance(self, where: str, i: float, j: float, *rest: Value) -> None:
        start, end = self.point(i, where), self.point(j, where)
        self.model.distance(start, end, rest[-1], owner=self.owner([start, end]))

    def unit(self, where: str, i: float, *rest: Value) -> None:
        vector = self.vector(i, where)
        self.model.unit(vector, owner=self.owner([vector]))

    def vector_segment(self, where: str, k: float, i: float, j: float, *rest: Value) -> None:
        vector, start, end = self.vector(k, where), self.point(i, where), self.point(j, where)
        self.model.vector_segment(vector, start - end, rest[-2], rest[-1], owner=self.owner([vector, start, end]))

    def vector_vector(self, where: str, i: float, j: float, *rest: Value) -> None:
        u, v = self.vector(i, where), self.vector(j, where)
        self.model.vector_vector(u, v, rest[-1], owner=self.owner([u, v]))

    def angle(self, ipos: Value, start: Direction, end: Direction, axis: Direction, lengths: Sequence[Value] | None = None) -> None:
        self.model.angle(f"psi{_counted(ipos, 'angle', 'number of an angle'):g}", start, end, axis, lengths=lengths)

    def segments_on_vector(self, where: str, i: float, j: float, k: float, l: float, m: float, *rest: Value) -> None:
        self.angle(rest[-1], self.segment(i, j, where), self.segment(k, l, where), self.axis(m, where), (*rest[-3:-1], 1.0))

    def segments_on_segment(self, where: str, i: float, j: float, k: float, l: float, m: float, n: float, *rest: Value) -> None:
        self.angle(rest[-1], self.segment(i, j, where), self.segment(k, l, where), self.segment(n, m, where), rest[-4:-1])

    def vectors_on_vector(self, where: str, i: float, j: float, k: float, *rest: Value) -> None:
        self.angle(rest[-1], self.vector(i, where), self.vector(j, where), self.axis(k, where))

    def vectors_on_segment(self, where: str, i: float, j: float, k: float, l: float, *rest: Value) -> None:
        self.angle(rest[-1], self.vector(i, where), self.vector(j, where), self.segment(l, k, where), (1.0, 1.0, rest[-2]))

    def vector_segment_on_vector(self, where: str, k: float, i: float, j: float, l: float, *rest: Value) -> None:
        self.angle(rest[-1], self.vector(k, where), self.segment(j, i, where), self.axis(l, where), (1.0, rest[-2], 1.0))

    def vector_segment_on_segment(self, where: str, k: float, i: float, j: float, l: float, m: float, *rest: Value) -> None:
        axis = self.segment(m, l, where)
        self.angle(rest[-1], self.vector(k, where), self.segment(j, i, where), axis, (1.0, rest[-3], rest[-2]))


ROW_READERS: dict[object, Callable[..., None]] = {
    1000: _Tables.distance,
    1001: _Tables.unit,
    1002: _Tables.vector_segment,
    1003: _Tables.vector_vector,
    1010: _Tables.segments_on_vector,
    1011: _Tables.segments_on_segment,
    1012: _Tables.vectors_on_vector,
    1013: _Tables.vectors_on_segment,
    1014: _Tables.vector_segment_on_vector,
    1015: _Tables.vector_segment_on_segment,
}
