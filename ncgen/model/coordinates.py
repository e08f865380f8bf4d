"""Declaring what can move: points, vectors, and relative angles and distances."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from ncgen.errors import ModelError, counted, one_of
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.argument_readers import own_direction
from ncgen.model.catalogue import BRANCH_WEIGHTS
from ncgen.model.elements import AXES, Angle, Combination, Component, Direction, Length, Point, Relative, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.quantities import Quantities
from ncgen.model.rows import SIX_DIGITS, Row
from ncgen.model.value_conditions import UNIT_LENGTH
from ncgen.model.values import Parameter, Value, Values, is_number, mentioned, vanishes

S = TypeVar("S", Point, Vector)

ANGLE_FORMS = ("smooth", "paper", "sine", "cosine")


class Coordinates(Quantities):
    """The part of a model that owns coordinates."""

    @fact
    def point(self, name: str, position: Values, fixed: bool | str = False) -> Point:
        """Add a point.

        Parameters
        ----------
        name : str
            Name of the point, whose coordinates are `name.x`, `name.y` and `name.z`.
        position : sequence of float or expression of parameters, shape (3,) or (2,)
            Initial position in m; two numbers make a point of the plane z = 0.
        fixed : bool or str
            Whether it cannot move, or the axes along which it cannot, such as "z" or "xz".

        Returns
        -------
        Point
            The point.
        """
        point = self._spatial(Point, name, position, fixed)
        self.elements[name] = point
        return point

    @fact
    def vector(self, name: str, direction: Values, fixed: bool | str = False) -> Vector:
        """Add a unit vector. The first body that has it adds the constraint of its length.

        Parameters
        ----------
        name : str
            Name of the vector, whose coordinates are `name.x`, `name.y` and `name.z`.
        direction : sequence of float or expression of parameters, shape (3,) or (2,)
            Initial direction. Numbers of six digits are brought to length 1.
        fixed : bool or str
            Whether it cannot turn, or the components that cannot change, such as "z".

        Returns
        -------
        Vector
            The unit vector.

        Raises
        ------
        ModelError
            For a vector whose length is not 1 to six digits.
        """
        vector = self._spatial(Vector, name, direction, fixed)
        size = arithmetic.norm(vector.initial)
        if not abs(size - 1.0) <= SIX_DIGITS:
            raise ModelError(f"vector {name}: its length is {size:.12g}, not 1; divide it by its length")
        if vector.is_parametric:
            self._check_unit(vector)
        elif abs(size - 1.0) > UNIT_LENGTH:
            vector = self._spatial(Vector, name, tuple(x / size for x in vector.initial), fixed)
        self.elements[name] = vector
        return vector

    @fact
    def angle(
        self,
        name: str,
        start: Direction,
        end: Direction,
        axis: Direction,
        *,
        form: str | None = None,
        lengths: Values | None = None,
        initial: Value | None = None,
    ) -> Angle:
        """Add a relative angle as a coordinate, from one direction to another about an axis.

        Parameters
        ----------
        name : str
            Name of the coordinate.
        start, end, axis : Direction
            Vectors, or segments such as `r4 - r2`, or either reversed (`-u3`); the angle is positive about the axis.
        form : str, optional
            "smooth", "cosine", "sine", or "paper", the paper's rule of cosine or sine by the angle's value at run time. Default: that of
            the model.
        lengths : sequence of float or expression of parameters, shape (3,), optional
            Lengths in m of start, end and axis, 1 for unit vectors. Default: measured.
        initial : float or expression of parameters, optional
            Initial angle in rad, where turns count. Default: measured, in (−π, π].

        Returns
        -------
        Angle
            The angle in rad.

        Raises
        ------
        ModelError
            Where a direction is parallel to the axis.
        """
        self._claim(name, "angle")
        form = check_form(form or self.form)
        start, end, axis = (self._direction(d, f"angle {name}") for d in (start, end, axis))
        if lengths is not None and len(lengths) != 3:
            raise ModelError(f"angle {name}, lengths: {counted(len(lengths), 'number')} given; give those of start, end and axis")
        if measures.shape(start) == "segment" and measures.shape(end) == "vector":
            # Table 4 has no such code: the same angle is measured from the vector, about the reversed axis.
            start, end, axis = end, start, -axis
            lengths = None if lengths is None else (lengths[1], lengths[0], lengths[2])
        measured = _measure(name, start, end, axis)
        value = measures.angle(start, end, axis) if initial is None else initial
        number = measured if initial is None else self._number(value, f"angle {name}, initial")
        psi = Angle(name, (Component(name, False, value, number),), start, end, axis)
        branch = self._branch(name, psi, measured) if form == "paper" else ()
        self.elements[name] = psi
        self.rows.append(row.angle(psi, form, None if lengths is None else tuple(lengths), branch, self.scale))
        return psi

    @fact
    def length(self, name: str, start: Point, end: Point, initial: Value | None = None) -> Length:
        """Add the distance between two points as a coordinate, such as the length of a hydraulic cylinder.

        Parameters
        ----------
        name : str
            Name of the coordinate.
        start, end : Point
            The two points.
        initial : float or expression of parameters, optional
            Initial distance in m. Default: measured.

        Returns
        -------
        Length
            The distance in m.

        Raises
        ------
        ModelError
            Where the points coincide: there the distance has no direction.
        """
        self._claim(name, "length")
        segment = self._direction(end - start, f"length {name}")
        value = measures.length(segment) if initial is None else initial
        number = self._number(value, f"length {name}, initial")
        s = Length(name, (Component(name, False, value, number),))
        return self._relative(s, row.length_row(s, segment, self.scale))

    @fact
    def slide(self, name: str, start: Point, end: Point, axis: Direction) -> Length:
        """Add as a coordinate how far a point lies from another along a unit vector; it may be zero or negative.

        Parameters
        ----------
        name : str
            Name of the coordinate.
        start, end : Point
            From which point to which.
        axis : Direction
            A unit vector.

        Returns
        -------
        Length
            The distance in m.

        Raises
        ------
        ModelError
            For an axis whose length is not 1.
        """
        self._claim(name, "slide")
        axis = self._direction(axis, f"slide {name}")
        size = arithmetic.norm(axis.initial)
        if abs(size - 1.0) > SIX_DIGITS:
            raise ModelError(f"slide {name}: the axis {axis} has length {size:.6g}, not 1; give a unit vector")
        segment = as_combination(end) - start
        value = measures.along(segment, axis)
        number = arithmetic.dot(segment.initial, axis.initial)
        s = Length(name, (Component(name, False, value, number),))
        return self._relative(s, row.slide_row(s, segment, axis, self.scale))

    @fact
    def independent(self, *coordinates: Component | Relative) -> None:
        """Choose the independent coordinates z of coordinate partitioning. Without this call they are found by pivoting.

        Parameters
        ----------
        *coordinates : Component or Relative
            Free coordinates, such as `A.x` or an angle.
        """
        names = [c.name for c in coordinates]
        known = {c.name: c for c in self.components}
        for name in names:
            if name not in known or known[name].fixed:
                raise ModelError(f"independent coordinate {name}: it is not a free coordinate of this model; name one that is")
        self.chosen_independent = tuple(names)

    # -- helpers -------------------------------------------------------------------------------

    def _relative(self, coordinate: Length, row: Row) -> Length:
        self.elements[coordinate.name] = coordinate
        self.rows.append(row)
        return coordinate

    def _spatial(self, kind: type[S], name: str, position: Values, fixed: bool | str) -> S:
        kind_name = kind.__name__.lower()
        self._claim(name, kind_name)
        if isinstance(fixed, str) and set(fixed) - set(AXES):
            raise ModelError(f"{kind_name} {name}: fixed={fixed!r} is not made of the axes x, y, z; correct it")
        if len(position) == 2:
            position, fixed = (*position, 0.0), fixed if fixed is True else f"{fixed or ''}z"
        if len(position) != 3:
            raise ModelError(f"{kind_name} {name}: {counted(len(position), 'number')} given; give three, or two for the plane z = 0")
        held = AXES if fixed is True else fixed or ""
        components = []
        for axis, value in zip(AXES, position, strict=True):
            number = self._number(value, f"{kind_name} {name}, {axis}")
            components.append(Component(f"{name}.{axis}", axis in held, number if is_number(value) else value, number))
        return kind(name, tuple(components))

    def _check_unit(self, vector: Vector) -> None:
        """A direction that turns with parameters must keep its length, since nothing at run time corrects it."""
        if not vanishes(measures.norm(vector.given) - 1.0, self.parameters, SIX_DIGITS):
            names = mentioned(vector.given, self.parameters)
            raise ModelError(f"vector {vector.name}: its length is 1 only at the default of {names}; divide it by its length")

    def _direction(self, reference: Direction, where: str) -> Combination:
        direction = own_direction(self, reference, where)
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
    """The angle's number in the initial position; refused where there is none."""
    a, b, n = start.initial, end.initial, arithmetic.unit(axis.initial)
    for direction, vector in ((start, a), (end, b)):
        if np.linalg.norm(vector - (vector @ n) * n) < 1e-9 * np.linalg.norm(vector):
            raise ModelError(f"angle {name}: {direction} is parallel to the axis {axis}; no angle about it is defined, choose another")
    return measures.angle_of(a, b, n)


def check_form(form: str) -> str:
    return one_of(form, "form", ANGLE_FORMS)
