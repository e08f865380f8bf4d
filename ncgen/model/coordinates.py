"""Declaring what can move: parameters, points, vectors, and relative angles and distances."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ncgen.errors import ModelError, counted, one_of, shown
from ncgen.model import arithmetic, curves, measures
from ncgen.model import rows as row
from ncgen.model.argument_readers import own_direction
from ncgen.model.catalogue import BRANCH_WEIGHTS
from ncgen.model.contents import Contents
from ncgen.model.curves import Curve
from ncgen.model.elements import AXES, Angle, Combination, Component, Direction, Length, Point, Relative, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.names import LAW, check_scalar
from ncgen.model.outputs import Output
from ncgen.model.rows import SIX_DIGITS, Row
from ncgen.model.value_conditions import UNIT_LENGTH, Condition
from ncgen.model.values import Driven, Input, Number, Numbers, Parameter, Value, Values, as_sympy, evaluate, is_number, mentioned, vanishes

if TYPE_CHECKING:
    import sympy

S = TypeVar("S", Point, Vector)

ANGLE_FORMS = ("smooth", "paper", "sine", "cosine")


class Coordinates(Contents):
    """The part of a model that owns names and coordinates."""

    @property
    def time(self) -> sympy.Symbol:
        """The sympy symbol of time, for drivers and forces."""
        import sympy

        return sympy.Symbol("t", real=True)

    @fact
    def parameter(self, name: str, default: Number, unit: str = "") -> Parameter:
        """Add a parameter: a number with a name, which stays symbolic in the kernels and is given in `p` at run time.

        Parameters
        ----------
        name : str
            Name of the parameter.
        default : float
            Its value where `p` does not give another.
        unit : str
            Unit, for people.

        Returns
        -------
        Parameter
            The parameter, for positions, lengths, masses, laws and expressions.
        """
        self._claim(name, "parameter")
        parameter = Parameter(name, float(default), unit)
        self.parameters[name] = parameter
        return parameter

    @fact
    def input(self, name: str, unit: str = "", default: Number = 0.0) -> Input:
        """Add an input: a number that may change at any time of a motion, such as a motor's torque.

        In `p` the inputs follow the parameters, each at the value that it keeps.

        Parameters
        ----------
        name : str
            Name of the input.
        unit : str
            Unit, for people.
        default : float
            Its value where a run does not give another.

        Returns
        -------
        Input
            The input, for forces, torques and couples.
        """
        self._claim(name, "input")
        self.inputs[name] = Input(name, float(default), unit)
        return self.inputs[name]

    @fact
    def spline(self, name: str, knots: Numbers, values: Numbers, end: str = "natural") -> Curve:
        """Add a cubic spline through values at knots: a function with continuous second derivatives, for any expression.

        Beyond its knots it continues straight, with the slope at the end, unless it is periodic.

        Parameters
        ----------
        name : str
            Name of the function: `profile(x)` is its value, `profile(x, 1)` its derivative.
        knots : array_like, shape (K,)
            Increasing arguments.
        values : array_like, shape (K,)
            Values at the knots.
        end : str
            "natural" (no curvature at the ends), "clamped" (slope 0), "not-a-knot" (the first two pieces are one polynomial, and the last
            two) or "periodic" (begins again at its last knot).

        Returns
        -------
        Curve
            The function.
        """
        return self._curve(curves.spline(name, knots, values, end))

    @fact
    def table(self, name: str, knots: Numbers, values: Numbers, periodic: bool = False) -> Curve:
        """Add a table: a function of straight lines between values at knots, with a kink at each.

        Use it for forces; the laws of drivers should be smooth (`spline`). The first and the last line go on beyond the knots.

        Parameters
        ----------
        name : str
            Name of the function: `profile(x)` is its value, `profile(x, 1)` its derivative.
        knots : array_like, shape (K,)
            Increasing arguments.
        values : array_like, shape (K,)
            Values at the knots.
        periodic : bool
            Whether the table begins again at its last knot.

        Returns
        -------
        Curve
            The function.
        """
        return self._curve(curves.table(name, knots, values, periodic))

    @fact
    def output(self, label: str, expression: Driven, unit: str = "") -> Output:
        """Add an output, which trajectories and exports list by its label.

        Parameters
        ----------
        label : str
            The label.
        expression : expression
            Of coordinates, rates (`psi.rate`), accelerations (`psi.acceleration`), joint reactions (`rod.force(A).x`, `rod.moment(u).z`),
            driver forces (`psi.driver`), m.time, parameters and inputs.
        unit : str
            Unit, for people.

        Returns
        -------
        Output
            The output.

        Raises
        ------
        ModelError
            For a label that another output has.
        """
        if label in self.outputs:
            raise ModelError(f"output {label}: there is one of that label already; choose another")
        if not label.strip() or not label.isprintable():
            raise ModelError(f"output {shown(label)}: give it a label of printable letters")
        self.outputs[label] = Output(label, as_sympy(expression), unit)
        return self.outputs[label]

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
        return self._relative(s, row.slide_row(s, segment, axis, self.extent(), self.scale))

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

    def _curve(self, curve: Curve) -> Curve:
        if curve.name in curves.BUILT_IN:
            raise ModelError(f"curve {curve.name}: every model has one of that name; choose another")
        self._claim(curve.name, "curve")
        self.curves[curve.name] = curve
        return curve

    def _relative(self, coordinate: Length, row: Row) -> Length:
        self.elements[coordinate.name] = coordinate
        self.rows.append(row)
        return coordinate

    def _claim(self, name: str, what: str) -> None:
        """Refuse a name that it or one of its coordinates has from something else."""
        spatial = what in ("point", "vector")
        if not spatial:
            check_scalar(name, what)
        for word in (name, *(f"{name}.{axis}" for axis in AXES if spatial)):
            if (bearer := self.bearer(word)) is not None:
                raise ModelError(
                    f"{what} {name}: the name {'' if word == name else word + ' '}is already used for {bearer!r}; choose another"
                )
        if name in LAW and what in ("parameter", "input") and any(spring.law is not None for spring in self.springs):
            raise ModelError(f"{what} {name}: in the law of a spring that is the name of {LAW[name]}; choose another")

    def _spatial(self, kind: type[S], name: str, position: Values, fixed: bool | str) -> S:
        what = kind.__name__.lower()
        self._claim(name, what)
        if isinstance(fixed, str) and set(fixed) - set(AXES):
            raise ModelError(f"{what} {name}: fixed={fixed!r} is not made of the axes x, y, z; correct it")
        if len(position) == 2:
            position, fixed = (*position, 0.0), fixed if fixed is True else f"{fixed or ''}z"
        if len(position) != 3:
            raise ModelError(f"{what} {name}: {counted(len(position), 'number')} given; give three, or two for the plane z = 0")
        held = AXES if fixed is True else fixed or ""
        components = []
        for axis, value in zip(AXES, position, strict=True):
            number = self._number(value, f"{what} {name}, {axis}")
            components.append(Component(f"{name}.{axis}", axis in held, number if is_number(value) else value, number))
        return kind(name, tuple(components))

    def _number(self, value: Value, what: str) -> float:
        """The number of a value at the parameters' defaults."""
        return evaluate(value, self.parameters, what)

    def _require(self, condition: Condition) -> None:
        """Raise ModelError where a condition does not hold at the parameters' defaults; keep it where they have a say in it."""
        condition.check([self._number(value, "") for value in condition.values])
        if condition.is_parametric:
            self.conditions.append(condition)

    def _check_unit(self, vector: Vector) -> None:
        """A direction that turns with parameters must keep its length, since nothing at run time corrects it."""
        if not vanishes(measures.norm(vector.given) - 1.0, self.parameters, SIX_DIGITS):
            names = mentioned(vector.given, self.parameters)
            raise ModelError(f"vector {vector.name}: its length is 1 only at the default of {names}; divide it by its length")

    def _direction(self, thing: Direction, where: str) -> Combination:
        direction = own_direction(self, thing, where)
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
