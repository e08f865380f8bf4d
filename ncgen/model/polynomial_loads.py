"""Declaring springs and dampers whose laws are polynomials, those of balls and of places of bodies among them, and constant forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError, counted
from ncgen.model.bodies import Body
from ncgen.model.body_elements import BodyElements
from ncgen.model.elements import Combination, Relative, as_combination
from ncgen.model.facts import fact
from ncgen.model.loads import three_components
from ncgen.model.values import Numbers, Value, Values, as_sympy, is_number

if TYPE_CHECKING:
    from ncgen.model.polynomial_forces import AnchorSpring, BallSpring, ConstantForce, PolynomialSpring

GLOBAL_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

MOST_COEFFICIENTS = 3
"""Coefficients of a stiffness or of a damping."""

PERPENDICULAR = 1e-9
"""By how much cosines of axes that are given may miss 0 and 1."""


class PolynomialLoads(BodyElements):
    """The part of a model that owns these loads."""

    @fact
    def polynomial_spring(
        self,
        angle: Relative,
        stiffness: Values = (0.0,),
        damping: Values = (0.0,),
        free_angle: Value | None = None,
        label: str | None = None,
    ) -> PolynomialSpring:
        """Add a spring and damper along a relative angle or distance, whose tension is a polynomial.

        Parameters
        ----------
        angle : Relative
            The angle or the distance.
        stiffness : sequence of float or expression of parameters
            Up to three coefficients, k, k₂, k₃ in N m/rad, N m/rad², N m/rad³ or N/m, N/m², N/m³: the tension at a stretch s is
            k s + k₂ s² + k₃ s³.
        damping : sequence of float or expression of parameters
            Up to three coefficients, c, c₂, c₃ in N m s/rad and so on: the tension at a rate v is c v + c₂ |v| v + c₃ v³.
        free_angle : float or expression of parameters, optional
            Value in rad or m without torque. Default: the initial one.
        label : str, optional
            Name in messages. Default: spring of the coordinate.

        Returns
        -------
        PolynomialSpring
            The spring.
        """
        from ncgen.model.polynomial_forces import PolynomialSpring  # which few models have

        label = label or f"spring of {angle.name}"
        free = angle.components[0].value if free_angle is None else free_angle
        spring = PolynomialSpring(label, angle, _series(stiffness, damping, label), free)
        self.springs.append(spring)
        return spring

    @fact
    def ball_spring(
        self,
        parent: Body,
        child: Body,
        stiffness: Values = (0.0,),
        damping: Values = (0.0,),
        axes: Sequence[Numbers] = GLOBAL_AXES,
        label: str | None = None,
    ) -> BallSpring:
        """Add a spring and damper against every rotation between two bodies, such as of a ball joint; at rest in the initial position.

        Parameters
        ----------
        parent : Body
            One body, or the ground.
        child : Body
            The other one.
        stiffness : sequence of float or expression of parameters
            Up to three coefficients, k, k₂, k₃ in N m/rad, N m/rad², N m/rad³: the couple at an angle θ is (k + k₂ θ + k₃ θ²) θ.
        damping : sequence of float or expression of parameters
            Up to three coefficients, c, c₂, c₃ in N m s/rad, N m s²/rad², N m s³/rad³: the couple about an axis of the child, about which
            it turns by w, is (c + c₂ |w| + c₃ w²) w.
        axes : sequence of three sequences of float
            These three axes of the child in the initial position, perpendicular unit vectors.
        label : str, optional
            Name in messages. Default: ball spring with both bodies.

        Returns
        -------
        BallSpring
            What acts on the child.

        Raises
        ------
        ModelError
            Where both bodies are one, the child is the ground, or axes are not perpendicular unit vectors.
        """
        from ncgen.model.polynomial_forces import BallSpring

        label = label or f"ball spring {parent.name}-{child.name}"
        if child is parent or child is self.ground:
            raise ModelError(f"{label}: give another body as child than {child.name}")
        rows = np.array(axes, dtype=float) if [len(axis) for axis in axes] == [3, 3, 3] else np.zeros((3, 3))
        if np.max(np.abs(rows @ rows.T - np.eye(3))) > PERPENDICULAR:
            raise ModelError(f"{label}: axes are {len(axes)} vectors; give three perpendicular unit vectors")
        before, after = (tuple(self.direction_of(body, axis, "axis") for axis in rows.tolist()) for body in (parent, child))
        series = _series(stiffness, damping, label)
        on_child = BallSpring(label, child, before, after, series, 1.0)
        self.forces.append(on_child)
        if parent is not self.ground:
            self.forces.append(BallSpring(f"{label} on {parent.name}", parent, before, after, series, -1.0))
        return on_child

    @fact
    def anchor_spring(
        self, body: Body, position: Values, stiffness: Values = (0.0,), damping: Values = (0.0,), label: str | None = None
    ) -> AnchorSpring:
        """Add a spring that pulls a place of a body back to where it is in the initial position, and a damper against its velocity.

        Parameters
        ----------
        body : Body
            The body.
        position : sequence of float or expression of parameters, shape (3,)
            The place in the initial position, in m.
        stiffness : sequence of float or expression of parameters
            Up to three coefficients, k, k₂, k₃ in N/m, N/m², N/m³: the force at a distance d is (k + k₂ d + k₃ d²) d.
        damping : sequence of float or expression of parameters
            Up to three coefficients, c, c₂, c₃ in N s/m, N s²/m², N s³/m³: the force along a global axis, along which the place moves with
            the velocity v, is (c + c₂ |v| + c₃ v²) v.
        label : str, optional
            Name in messages. Default: anchor spring of the body.

        Returns
        -------
        AnchorSpring
            The spring.
        """
        from ncgen.model.polynomial_forces import AnchorSpring

        label = label or f"anchor spring of {body.name}"
        end = self.attached(body, position, label)
        rest = self.direction_of(self.ground, tuple(map(as_sympy, position)), "rest")
        spring = AnchorSpring(label, body, end - rest, _series(stiffness, damping, label))
        self.forces.append(spring)
        return spring

    @fact
    def constant_force(self, body: Body, position: Values, vector: Values, label: str | None = None) -> ConstantForce:
        """Apply a constant force at a place of a body; its potential energy counts.

        Parameters
        ----------
        body : Body
            The body.
        position : sequence of float or expression of parameters, shape (3,)
            The place in the initial position, in m.
        vector : sequence of float or expression of parameters, shape (3,)
            Force in N, along global axes.
        label : str, optional
            Name in messages. Default: constant force on the body.

        Returns
        -------
        ConstantForce
            The force.
        """
        from ncgen.model.polynomial_forces import ConstantForce

        label = label or f"constant force on {body.name}"
        three_components(vector, label, False)
        force = ConstantForce(label, body, self.attached(body, position, label), tuple(vector))
        self.potentials.append(force)
        return force

    def attached(self, body: Body, position: Values, where: str) -> Combination:
        """Return a place that moves with a body.

        Parameters
        ----------
        body : Body
            The body; not the ground.
        position : sequence of float or expression of parameters, shape (3,)
            The place in the initial position, in m.
        where : str
            What it is for, in messages.

        Returns
        -------
        Combination
            The place.

        Raises
        ------
        ModelError
            For the ground, and for a body without points.
        """
        if body is self.ground or not body.points:
            raise ModelError(f"{where}: {body.name} has no point that moves; give a body with points")
        three_components(position, where, False)
        first = body.points[0]
        # A place in numbers is one of the initial position, whatever parameters the point's own place has.
        begins = first.initial.tolist() if all(map(is_number, position)) else first.given
        offset = [as_sympy(x) - y for x, y in zip(position, begins, strict=True)]
        return as_combination(first) + self.direction_of(body, offset, "arm") if any(offset) else as_combination(first)


def _series(stiffness: Values, damping: Values, label: str) -> tuple[Value, ...]:
    """All MOST_COEFFICIENTS coefficients of both. Raises ModelError where there are too many."""
    for name, coefficients in (("stiffness", stiffness), ("damping", damping)):
        if not 1 <= len(coefficients) <= MOST_COEFFICIENTS:
            raise ModelError(f"{label}, {name}: {counted(len(coefficients), 'coefficient')} given; give one to three")
    return tuple(x for each in (stiffness, damping) for x in (*each, 0.0, 0.0)[:MOST_COEFFICIENTS])
