"""Declaring what acts on a mechanism: gravity, forces, couples, springs, dampers, and functions of your own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from ncgen.errors import ModelError, counted, shown
from ncgen.model import measures
from ncgen.model.argument_readers import expression, sequence
from ncgen.model.bodies import Body
from ncgen.model.coordinates import Coordinates
from ncgen.model.elements import Angle, Component, Point, Relative, as_combination
from ncgen.model.facts import fact
from ncgen.model.forces import Callback, Couple, Force, Load, Potential, Rotor, Spring, TorsionSpring
from ncgen.model.value_conditions import Bound
from ncgen.model.values import Driven, Expression, Expressions, Moment, Value, Values, as_sympy, is_number

if TYPE_CHECKING:
    import sympy

F = TypeVar("F", bound=Callback)
L = TypeVar("L", bound=Load)

Law: TypeAlias = "Expression | Callable[[sympy.Symbol, sympy.Symbol], Expression]"
"""In signatures: a spring's law as an expression of the symbols x and v, or as a function of both."""


class Loads(Coordinates):
    """The part of a model that owns applied forces."""

    @fact
    def gravity(self, field: Values) -> None:
        """Set the acceleration of gravity.

        Parameters
        ----------
        field : sequence of float or expression of parameters, shape (3,) or (2,)
            Acceleration in m/s²; two numbers in the plane.
        """
        if len(field) not in (2, 3):
            raise ModelError(
                f"gravity: {counted(len(field), 'number')} given; give three, as (0, 0, -9.81), or two in the plane, (0, -9.81)"
            )
        self.gravity_field = tuple(float(g) if is_number(g) else g for g in (*field, 0.0)[:3])

    @fact
    def force(self, point: Point, vector: Expressions, label: str | None = None) -> Force:
        """Apply a force at a point.

        Parameters
        ----------
        point : Point
            Where it acts.
        vector : sequence of expressions, shape (3,) or (2,)
            Force in N in global axes: numbers, or expressions of m.time, coordinates, rates, parameters and inputs; two in the plane.
        label : str, optional
            Name in messages. Default: force on the point.

        Returns
        -------
        Force
            The force.
        """
        label = label or f"force on {point.name}"
        return self._apply(label, zip(point.components, three_components(vector, label, point.components[2].fixed), strict=True))

    @fact
    def torque(self, coordinate: Relative, expression: Driven, label: str | None = None) -> Force:
        """Apply a couple along a relative angle, or a force along a relative distance, such as a motor's.

        Parameters
        ----------
        coordinate : Relative
            The angle or the distance.
        expression : expression
            Couple in N m or force in N, as of `force`.
        label : str, optional
            Name in messages. Default: torque on the coordinate.

        Returns
        -------
        Force
            The generalised force.
        """
        return self._apply(label or f"torque on {coordinate.name}", [(coordinate.components[0], expression)])

    @fact
    def couple(self, body: Body, vector: Moment, label: str | None = None) -> Couple:
        """Apply a couple to a body.

        Parameters
        ----------
        body : Body
            The body.
        vector : expression or sequence of expressions, shape (3,)
            Couple in N m in global axes, as of `force`; for a body in the plane one is enough, about the plane's normal.
        label : str, optional
            Name in messages. Default: couple on the body.

        Returns
        -------
        Couple
            The couple.
        """
        label = label or f"couple on {body.name}"
        is_single = body.frame.planar and not (isinstance(vector, (str, Iterable)) or getattr(vector, "ndim", 0))
        components = (0.0, 0.0, vector) if is_single else three_components(vector, label, False)
        x, y, z = (expression(e, f"{label}, {axis}") for axis, e in zip("xyz", components, strict=True))
        couple = Couple(label, body, (x, y, z))
        self.forces.append(couple)
        return couple

    @fact
    def potential(self, expression: Expression, label: str = "potential") -> Potential:
        """Add a potential energy, from which its force follows.

        Parameters
        ----------
        expression : expression
            Energy in J, of coordinates and parameters.
        label : str
            Name in messages.

        Returns
        -------
        Potential
            The potential.
        """
        potential = Potential(label, as_sympy(expression))
        self.potentials.append(potential)
        return potential

    @fact
    def spring(
        self,
        start: Point,
        end: Point,
        stiffness: Value = 0.0,
        damping: Value = 0.0,
        free_length: Value | None = None,
        law: Law | None = None,
        label: str | None = None,
    ) -> Spring:
        """Add a spring and damper between two points.

        Parameters
        ----------
        start, end : Point
            Its ends.
        stiffness : float or expression of parameters
            In N/m.
        damping : float or expression of parameters
            In N s/m.
        free_length : float or expression of parameters, optional
            Length in m without tension. Default: the initial distance. With 0, and without damping, the points may coincide.
        law : callable or expression, optional
            Instead of these the tension in N: a function (length, rate) that returns an expression, or an expression of the symbols x and
            v, in m and m/s.
        label : str, optional
            Name in messages. Default: spring with both points.

        Returns
        -------
        Spring
            The spring.

        Raises
        ------
        ModelError
            Where the points coincide, and the spring has a damper or a free length.
        """
        label = label or f"spring {start.name}-{end.name}"
        segment = as_combination(end) - start
        regular = law is None and free_length == 0.0 and damping == 0.0
        if start is end or not (regular or np.linalg.norm(segment.initial) > 0):
            raise ModelError(f"{label}: {segment} has length 0; give points that are apart, or free_length=0 without damping")
        free = measures.length(segment) if free_length is None else free_length
        return self._pulling(Spring(label=label, segment=segment, stiffness=stiffness, damping=damping, free=free, law=_tension(law)))

    @fact
    def torsion_spring(
        self,
        angle: Relative,
        stiffness: Value = 0.0,
        damping: Value = 0.0,
        free_angle: Value | None = None,
        law: Law | None = None,
        label: str | None = None,
    ) -> TorsionSpring:
        """Add a spring and damper along a relative angle or distance.

        Parameters
        ----------
        angle : Relative
            The angle or the distance.
        stiffness : float or expression of parameters
            In N m/rad or N/m.
        damping : float or expression of parameters
            In N m s/rad or N s/m.
        free_angle : float or expression of parameters, optional
            Value in rad or m without torque. Default: the initial one.
        law : callable or expression, optional
            Instead of these the torque in N m or the force in N, against growth: a function (angle, rate) that returns an expression, or an
            expression of the symbols x and v.
        label : str, optional
            Name in messages. Default: spring of the coordinate.

        Returns
        -------
        TorsionSpring
            The spring.
        """
        label = label or f"spring of {angle.name}"
        free = angle.components[0].value if free_angle is None else free_angle
        return self._pulling(
            TorsionSpring(label=label, coordinate=angle, stiffness=stiffness, damping=damping, free=free, law=_tension(law))
        )

    @fact
    def rotor(self, coordinate: Relative, inertia: Value) -> Rotor:
        """Add the inertia of what turns with a relative angle, such as a motor's armature. Its own turning has no other effect.

        Parameters
        ----------
        coordinate : Relative
            The angle or the distance.
        inertia : float or expression of parameters
            Moment of inertia in kg m², times the square of the gear's ratio; along a distance mass in kg.

        Returns
        -------
        Rotor
            The rotor.
        """
        unit = "kg m2" if isinstance(coordinate, Angle) else "kg"
        self._require(
            Bound(
                wording=f"rotor of {coordinate.name}: its inertia is",
                value=inertia,
                relation=">=",
                unit=unit,
                remedy="give a positive number",
            )
        )
        self.rotors.append(Rotor(coordinate, inertia))
        return self.rotors[-1]

    @fact
    def callback(self, function: F) -> F:
        """Add a force that no expression describes, as a Python function.

        Its work counts in the energy balance. The C runtime calls it at every evaluation; an exception ends the run and arrives unchanged.
        Kernels in C do not contain it.

        Parameters
        ----------
        function : callable
            Function (t, q, qd, kernels) to generalised forces (n,), which are added to Q.

        Returns
        -------
        callable
            The function itself, so that this method can be a decorator.
        """
        if not callable(function):
            raise ModelError(f"callback: {shown(function)} is not a function; give one of (t, q, qd, kernels)")
        self.callbacks.append(function)
        return function

    # -- helpers -------------------------------------------------------------------------------

    def _pulling(self, load: L) -> L:
        self.springs.append(load)
        return load

    def _apply(self, label: str, components: Iterable[tuple[Component, object]]) -> Force:
        pairs = tuple((component, expression(e, f"{label}, {component.name}")) for component, e in components)
        force = Force(label, pairs)
        self.forces.append(force)
        return force


def three_components(vector: object, label: str, is_flat: bool) -> tuple[object, ...]:
    """The three components of a vector, of which a flat one has a third of 0. Raises ModelError for other numbers of them."""
    components = sequence(vector, label, "two or three numbers or expressions" if is_flat else "three numbers or expressions")
    if len(components) == 2 and is_flat:
        return (*components, 0.0)
    if len(components) != 3:
        raise ModelError(f"{label}: {len(components)} components given; give three")
    return components


def _tension(law: object) -> sympy.Expr | None:
    """A law, as read, in the form in which a load keeps it."""
    if law is None:
        return None
    import sympy

    return sympy.sympify(expression(law, "law"))
