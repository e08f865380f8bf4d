"""Declaring numbers: parameters, inputs, functions through measured points, and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.model import curves
from ncgen.model.contents import Contents
from ncgen.model.curves import Curve
from ncgen.model.elements import AXES
from ncgen.model.facts import fact
from ncgen.model.names import LAW, check_scalar, numbered
from ncgen.model.outputs import Output
from ncgen.model.value_conditions import Condition
from ncgen.model.values import Driven, Input, Number, Numbers, Parameter, Value, Values, as_sympy, evaluate

if TYPE_CHECKING:
    import sympy


class Quantities(Contents):
    """The part of a model that owns names and numbers."""

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

    def _curve(self, curve: Curve) -> Curve:
        if curve.name in curves.BUILT_IN:
            raise ModelError(f"curve {curve.name}: every model has one of that name; choose another")
        self._claim(curve.name, "curve")
        self.curves[curve.name] = curve
        return curve

    def _claim(self, name: str, kind: str) -> None:
        """Refuse a name that it or one of its coordinates has from something else."""
        spatial = kind in ("point", "vector")
        if not spatial:
            check_scalar(name, kind)
        for word in (name, *(f"{name}.{axis}" for axis in AXES if spatial)):
            if (bearer := self.bearer(word)) is not None:
                raise ModelError(
                    f"{kind} {name}: the name {'' if word == name else word + ' '}is already used for {bearer!r}; choose another"
                )
        if name in LAW and kind in ("parameter", "input") and any(spring.law is not None for spring in self.springs):
            raise ModelError(f"{kind} {name}: in the law of a spring that is the name of {LAW[name]}; choose another")

    def _number(self, value: Value, where: str) -> float:
        """The number of a value at the parameters' defaults."""
        return evaluate(value, self.parameters, where)

    def _require(self, condition: Condition) -> None:
        """Raise ModelError where a condition does not hold at the parameters' defaults; keep it where they have a say in it."""
        condition.check([self._number(value, "") for value in condition.values])
        if condition.is_parametric:
            self.conditions.append(condition)

    def free_name(self, wish: str) -> str:
        """Return a name that nothing in the model has.

        Parameters
        ----------
        wish : str
            The name that is wanted; a number is added where it is taken.

        Returns
        -------
        str
            The name.
        """
        return numbered(wish, lambda name: self.bearer(name) is not None)

    def _numbers(self, values: Values) -> np.ndarray:
        """The numbers of values at the parameters' defaults, in the same shape."""
        values = np.asarray(values)
        return np.array([self._number(x, "") for x in values.flat]).reshape(values.shape)
