"""Declaring what can move: parameters, points, vectors, and relative angles and distances."""

from __future__ import annotations

import math

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import rows as row
from ncgen.model.catalogue import BRANCH_WEIGHTS
from ncgen.model.elements import AXES, Angle, Combination, Component, Constant, Element, Length, Point, Relative, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.rows import UNIT_LENGTH, Row
from ncgen.model.values import Parameter, as_value, evaluate

ANGLE_FORMS = ("smooth", "paper", "sine", "cosine")


class Coordinates:
    """The part of a model that owns names and coordinates."""

    name: str
    scale: bool
    form: str
    elements: dict[str, Element]
    parameters: dict[str, Parameter]
    rows: list[Row]
    branches: dict[str, tuple[Parameter, ...]]
    chosen_independent: tuple[str, ...]

    @property
    def components(self) -> list[Component]:
        """All scalar coordinates in the order of q, free and fixed."""
        return [component for element in self.elements.values() for component in element.components]

    @property
    def time(self):
        """The sympy symbol of time, for drivers and forces."""
        import sympy

        return sympy.Symbol("t", real=True)

    @fact
    def parameter(self, name: str, default: float, unit: str = "") -> Parameter:
        """A number with a name, kept symbolic in the kernels and given in `p` at run time."""
        self._claim(name, "parameter")
        parameter = Parameter(name, as_value(default, f"parameter {name}"), unit)
        self.parameters[name] = parameter
        return parameter

    @fact
    def point(self, name: str, position, fixed: bool | str = False) -> Point:
        """A point (m). Two numbers make a point of the plane z = 0.

        fixed: True, False, or the axes that cannot move, such as "z" or "xz".
        """
        point = self._spatial(Point, name, position, fixed)
        self.elements[name] = point
        return point

    @fact
    def vector(self, name: str, direction, fixed: bool | str = False) -> Vector:
        """A unit vector; refused if its length is not 1. Its unit row is added by the first body that has it."""
        vector = self._spatial(Vector, name, direction, fixed)
        size = np.linalg.norm(vector.initial)
        if abs(size - 1.0) > UNIT_LENGTH:
            raise ModelError(f"vector {name}: its length is {size:.12g}, not 1; divide it by its length")
        self.elements[name] = vector
        return vector

    @fact
    def angle(
        self, name: str, start, end, axis, *, form: str | None = None, lengths=None, initial: float | None = None
    ) -> Angle:
        """A relative angle as a coordinate (rad), from `start` to `end`, positive about `axis`.

        start, end, axis: vectors, or segments such as `r4 - r2`, or either reversed (`-u3`)
        form: "smooth" (the default of the model unless changed), "cosine", "sine", or "paper", which
            follows the paper's rule of cosine or sine by the angle's value, chosen at run time
        lengths: of start, end and axis, 1 for unit vectors (default: measured)
        initial: the angle in the initial position, if it should count turns (default: measured, in (−π, π])
        """
        self._claim(name, "angle")
        form = check_form(form or self.form)
        start, end, axis = (self._direction(d, f"angle {name}") for d in (start, end, axis))
        if row.shape(start) == "segment" and row.shape(end) == "vector":
            # Table 4 has no such code: the same angle is measured from the vector, about the reversed axis.
            start, end, axis = end, start, -axis
            lengths = lengths and (lengths[1], lengths[0], lengths[2])
        lengths = lengths and tuple(as_value(length, f"angle {name}, lengths") for length in lengths)
        measured = _measure(name, start, end, axis)
        initial = measured if initial is None else as_value(initial, f"angle {name}")
        psi = Angle(name, (Component(name, False, initial, initial),), start, end, axis)
        branch = self._branch(name, psi, measured) if form == "paper" else ()
        self.elements[name] = psi
        self.rows.append(row.angle(psi, form, lengths, branch, self.scale))
        return psi

    @fact
    def length(self, name: str, start: Point, end: Point, initial: float | None = None) -> Length:
        """The distance between two points as a coordinate (m), such as the length of a hydraulic cylinder.

        Refused where the points coincide: there the distance has no direction.
        """
        self._claim(name, "length")
        segment = self._direction(end - start, f"length {name}")
        value = row.length(segment) if initial is None else as_value(initial, f"length {name}")
        return self._relative(Length(name, (Component(name, False, value, value),)), row.length_row, segment)

    @fact
    def slide(self, name: str, start: Point, end: Point, axis) -> Length:
        """How far `end` lies from `start` along a unit vector, as a coordinate (m); it may be zero or negative."""
        self._claim(name, "slide")
        axis = self._direction(axis, f"slide {name}")
        segment = as_combination(end) - start
        value = float(segment.initial @ axis.initial)
        return self._relative(Length(name, (Component(name, False, value, value),)), row.slide_row, segment, axis)

    @fact
    def independent(self, *coordinates) -> None:
        """Choose the independent coordinates z of coordinate partitioning (default: found by pivoting)."""
        names = [c if isinstance(c, str) else c.name for c in coordinates]
        known = {c.name: c for c in self.components}
        for name in names:
            if name not in known or known[name].fixed:
                raise ModelError(f"independent coordinate {name}: it is not a free coordinate of this model; name one that is")
        self.chosen_independent = tuple(names)

    # -- helpers -------------------------------------------------------------------------------

    def _relative(self, coordinate: Relative, make_row, *arguments):
        self.elements[coordinate.name] = coordinate
        self.rows.append(make_row(coordinate, *arguments, self.scale))
        return coordinate

    def _claim(self, name: str, what: str) -> None:
        check_name(name, what)
        taken = self.elements.get(name) or self.parameters.get(name)
        if name == "t" and what in ("parameter", "angle", "length", "slide"):
            raise ModelError(f"{what} t: that is the name of time; choose another")
        if what == "parameter" and any(c.name == name for c in self.components):
            raise ModelError(f"parameter {name}: the name is already used for a coordinate; choose another")
        if any(f"{name}.{axis}" in self.parameters for axis in AXES):
            raise ModelError(f"{what} {name}: a parameter is already named like one of its coordinates; choose another")
        if taken:
            raise ModelError(f"{what} {name}: the name is already used for {taken!r}; choose another")

    def _spatial(self, kind, name, position, fixed):
        what = kind.__name__.lower()
        self._claim(name, what)
        try:
            position = tuple(position)
        except TypeError:
            raise ModelError(f"{what} {name}: {position!r} given; give three numbers, or two for the plane z = 0") from None
        if isinstance(fixed, str) and set(fixed) - set(AXES):
            raise ModelError(f"{what} {name}: fixed={fixed!r} is not made of the axes x, y, z; correct it")
        if len(position) == 2:
            position, fixed = (*position, 0.0), fixed if fixed is True else f"{fixed or ''}z"
        if len(position) != 3:
            raise ModelError(f"{what} {name}: {len(position)} numbers given; give three, or two for the plane z = 0")
        held = AXES if fixed is True else fixed or ""
        components = []
        for axis, value in zip(AXES, position, strict=True):
            where = f"{what} {name}, {axis}"
            value = as_value(value, where)
            number = evaluate(value, self.parameters, where)
            components.append(Component(f"{name}.{axis}", axis in held, value if axis in held else number, number))
        return kind(name, tuple(components))

    def _own(self, thing, kind, where: str):
        if isinstance(thing, str):
            if thing not in self.elements:
                raise ModelError(f"{where}: there is no {kind.__name__.lower()} {thing}; define it first")
            thing = self.elements[thing]
        if not isinstance(thing, kind):
            raise ModelError(f"{where}: {thing!r} is not a {kind.__name__.lower()}")
        if not isinstance(thing, Constant) and self.elements.get(thing.name) is not thing:
            raise ModelError(f"{where}: {thing!r} belongs to another model; use this model's own")
        return thing

    def _direction(self, thing, where: str) -> Combination:
        direction = as_combination(thing)
        for element in direction.elements:
            self._own(element, Spatial, where)
        if not direction.is_direction:
            raise ModelError(f"{where}: {direction} is not a direction; give a vector or a difference of points")
        if not np.linalg.norm(direction.initial) > 0:
            raise ModelError(f"{where}: {direction} has length 0; give points that are apart")
        return direction

    def _branch(self, name: str, psi: Angle, measured: float) -> tuple[Parameter, ...]:
        """Run-time weights of the paper's rule, with its choice in the initial position as default."""
        chosen = paper_choice(measured, psi.axis.initial)
        weights = tuple(self.parameter(f"{name}.{w}", float(i == chosen)) for i, w in enumerate(BRANCH_WEIGHTS))
        self.branches[name] = weights
        return weights


def paper_choice(psi: float, axis: np.ndarray) -> int:
    """The paper's rule: 0 for the cosine row where |sin ψ| > √½, else 1 + the axis' largest component."""
    return 0 if abs(math.sin(psi)) > math.sqrt(0.5) else 1 + row.largest_component(axis)


def _measure(name: str, start: Combination, end: Combination, axis: Combination) -> float:
    a, b, n = start.initial, end.initial, axis.initial / np.linalg.norm(axis.initial)
    for direction, vector in ((start, a), (end, b)):
        if np.linalg.norm(vector - (vector @ n) * n) < 1e-9 * np.linalg.norm(vector):
            raise ModelError(f"angle {name}: {direction} is parallel to the axis {axis}; no angle about it is defined, choose another")
    return math.atan2(np.cross(a, b) @ n, a @ b - (a @ n) * (b @ n))


def check_form(form: str) -> str:
    if form not in ANGLE_FORMS:
        raise ModelError(f"form {form!r} is unknown; choose one of {', '.join(ANGLE_FORMS)}")
    return form


def check_name(name: str, what: str) -> None:
    if not isinstance(name, str) or not name or not all(c.isalnum() or c in "_." for c in name) or not name[0].isalpha():
        raise ModelError(f"{what} name {name!r}: give a word of letters, digits and '_' that begins with a letter")
