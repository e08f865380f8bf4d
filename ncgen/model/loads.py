"""Declaring what acts on a mechanism: gravity, forces, couples, springs, dampers, and functions of your own."""

from __future__ import annotations

from collections.abc import Callable

from ncgen.errors import ModelError
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Relative
from ncgen.model.facts import fact
from ncgen.model.forces import Couple, Force, Potential, Spring, TorsionSpring
from ncgen.model.values import as_sympy, as_value, is_number


class Loads:
    """The part of a model that owns applied forces."""

    forces: list
    potentials: list[Potential]
    springs: list[Spring]
    callbacks: list[Callable]

    @fact
    def gravity(self, field) -> None:
        """The acceleration of gravity (m/s²), three values."""
        if len(field) != 3:
            raise ModelError(f"gravity: {len(field)} numbers given; give three, for example (0, 0, -9.81)")
        self.gravity_field = tuple(as_value(g, "gravity") for g in field)

    @fact
    def force(self, point: Point, vector, label: str | None = None) -> Force:
        """A force (N) on a point: three numbers or expressions of m.time, coordinates, rates and parameters."""
        point = self._own(point, Point, "force")
        label = label or f"force on {point.name}"
        if len(vector) != 3:
            raise ModelError(f"{label}: {len(vector)} components given; give three")
        return self._apply(label, zip(point.components, vector, strict=True))

    @fact
    def torque(self, coordinate: Relative, expression, label: str | None = None) -> Force:
        """A couple (N m) along a relative angle, or a force (N) along a relative distance, such as a motor's."""
        coordinate = self._own(coordinate, Relative, "torque")
        return self._apply(label or f"torque on {coordinate.name}", [(coordinate.components[0], expression)])

    @fact
    def couple(self, body: Body, vector, label: str | None = None) -> Couple:
        """A couple (N m, global axes) on a body: three numbers or expressions."""
        label = label or f"couple on {body.name}"
        components = tuple(self._checked(e, f"{label}, {axis}") for axis, e in zip("xyz", vector, strict=True))
        self.forces.append(Couple(label, body, components))
        return self.forces[-1]

    @fact
    def potential(self, expression, label: str = "potential") -> Potential:
        """A potential energy (J) as an expression of coordinates and parameters; its force follows."""
        self.potentials.append(Potential(label, as_sympy(expression)))
        return self.potentials[-1]

    @fact
    def spring(
        self, start: Point, end: Point, stiffness=0.0, damping=0.0, free_length=None, law: Callable | None = None, label: str | None = None
    ) -> Spring:
        """A spring and damper between two points.

        stiffness: N/m; damping: N s/m; free_length: m (default: the distance in the initial position)
        law: instead of these, a function (length, rate) -> tension (N) that returns a sympy expression, or an expression of
            the symbols x and v
        """
        start, end = (self._own(p, Point, "spring") for p in (start, end))
        label = label or f"spring {start.name}-{end.name}"
        segment = self._direction(end - start, label)
        free = _length(segment) if free_length is None else as_value(free_length, f"{label}, free length")
        values = tuple(as_value(v, label) for v in (stiffness, damping))
        self.springs.append(Spring(label, segment, *values, free, _law(law, label)))
        return self.springs[-1]

    @fact
    def torsion_spring(
        self, angle: Relative, stiffness=0.0, damping=0.0, free_angle=None, law: Callable | None = None, label: str | None = None
    ) -> TorsionSpring:
        """A spring and damper along a relative angle or distance.

        stiffness: N m/rad or N/m; damping; free_angle: rad or m (default: the initial one)
        law: instead of these, a function (angle, rate) -> torque, positive against growth, or an expression of x and v
        """
        angle = self._own(angle, Relative, "torsion spring")
        label = label or f"spring of {angle.name}"
        free = angle.components[0].initial if free_angle is None else as_value(free_angle, f"{label}, free angle")
        values = tuple(as_value(v, label) for v in (stiffness, damping))
        self.springs.append(TorsionSpring(label, angle, *values, free, _law(law, label)))
        return self.springs[-1]

    @fact
    def callback(self, function: Callable) -> Callable:
        """A force that no expression says: function(t, q, qd, kernels) returns generalised forces (n,), added to Q in Python.

        Its work counts in the energy balance. Kernels in C do not contain it.
        """
        if not callable(function):
            raise ModelError(f"callback: {function!r} is not a function; give one of (t, q, qd, kernels)")
        self.callbacks.append(function)
        return function

    # -- helpers -------------------------------------------------------------------------------

    def _apply(self, label: str, components) -> Force:
        pairs = tuple((component, self._checked(e, f"{label}, {component.name}")) for component, e in components)
        self.forces.append(Force(label, pairs))
        return self.forces[-1]

    def _checked(self, expression, what: str):
        expression = as_sympy(expression)
        if is_number(expression):
            return as_value(expression, what)
        if getattr(expression, "is_number", False) and not expression.is_finite:
            raise ModelError(f"{what}: {expression} is not a finite number; correct it")
        return expression


def _length(segment) -> float:
    return float((segment.initial**2).sum() ** 0.5)


def _law(law, label: str):
    """The user's law as an expression of the symbols x and v."""
    if law is None:
        return None
    import sympy

    return sympy.sympify(law(*sympy.symbols("x v", real=True)) if callable(law) else law)
