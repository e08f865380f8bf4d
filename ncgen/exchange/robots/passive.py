"""Springs and dampers that are more than a factor, those of balls and free bodies, and compensated weights, as MJCF says them.

Turning from where a ball is at rest is the vector θ n of angle and axis. With three directions a of the parent that are b on the child
where nothing has turned, Σ a × b = 2 sin θ n and Σ a · b = 1 + 2 cos θ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Mass
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Combination, Component, as_combination
from ncgen.model.values import Scalar, as_sympy

if TYPE_CHECKING:
    import sympy

Law: TypeAlias = "Callable[[sympy.Expr, sympy.Expr], sympy.Expr]"
"""Torque against growth, or tension, from a value and its rate."""

LEAST_SINE = 1e-15
"""Added to the sine of a turning (1), whose quotient with its angle is then 1 where nothing has turned."""


def polynomial(joint: Joint) -> Law:
    """The tension k x + k₂ x² + k₃ x³ + c v + c₂ v |v| + c₃ v³ at x beyond the rest."""
    return lambda x, v: (x - joint.rest) * _stiffness(joint, x - joint.rest) + v * _damping(joint, v)


def _stiffness(joint: Joint, x: sympy.Expr) -> sympy.Expr | float:
    """Tension over x."""
    return joint.stiffness + sum(factor * x**power for power, factor in enumerate(joint.more_stiffness, 1) if factor)


def _damping(joint: Joint, v: sympy.Expr) -> sympy.Expr | float:
    """Tension over v."""
    import sympy

    return joint.damping + sum(factor * sympy.Abs(v) ** power for power, factor in enumerate(joint.more_damping, 1) if factor)


def point_of(model: Model, body: Body, position: np.ndarray) -> Combination:
    """A point of a body, by where it is initially (3,)."""
    first = body.points[0]
    offset = position - first.initial
    return as_combination(first) + model.direction_of(body, offset.tolist(), "arm") if offset.any() else as_combination(first)


def expressions(combination: Combination, order: int = 0) -> sympy.Matrix:
    """The three components of a combination, or their derivatives by time of an order up to 2, as expressions of coordinates."""
    import sympy

    rows = []
    for axis in range(3):
        parts = [(weight, element.components[axis]) for weight, element in combination.terms]
        rows.append(sum(weight * _scalar(c, order) for weight, c in parts))
    return sympy.Matrix(rows)


def _scalar(c: Component, order: int) -> Scalar:
    """A coordinate or its derivative by time; the number of one that is fixed, or its expression of parameters."""
    return (0.0 if order else as_sympy(c.value)) if c.fixed else (c.symbol, c.rate, c.acceleration)[order]


def lift(model: Model, body: Body, masses: Iterable[Mass], gravity: Sequence[float]) -> None:
    """Forces against the weight of masses, at their centres; positions in the world where the model begins."""
    import sympy

    pull = sympy.Matrix(gravity)
    lifted = sympy.zeros(3, 1)
    for mass in masses:
        lifted += mass.mass * expressions(point_of(model, body, mass.com))
    if (energy := pull.dot(lifted)) != 0:
        model.potential(energy, f"compensated weight of {body.name}")


def spring_of_ball(model: Model, parent: Body, child: Body, joint: Joint, frame: Placement) -> None:
    """What acts at a ball between two bodies, or on a free body, which is at rest where the model begins. frame: of the child, there"""
    import sympy

    before, after = ([model.direction_of(body, axis, "axis") for axis in frame.rotation.T.tolist()] for body in (parent, child))
    a, b = ([expressions(each) for each in axes] for axes in (before, after))
    couple = sympy.zeros(3, 1)
    if joint.stiffness or any(joint.more_stiffness):
        across = turning_of(a, b)
        sine = sympy.sqrt(across.dot(across) + LEAST_SINE**2)
        angle = sympy.atan2(sine, (sum(x.dot(y) for x, y in zip(a, b, strict=True)) - 1) / 2)
        couple -= _stiffness(joint, angle) * angle / sine * across
    if joint.damping or any(joint.more_damping):
        turning = turning_of(a, [expressions(each, 1) for each in before]), turning_of(b, [expressions(each, 1) for each in after])
        couple -= _damped(joint, turning[1] - turning[0], b)
    label = f"spring of {joint.name}"
    model.couple(child, list(couple), label)
    if parent is not model.ground:
        model.couple(parent, list(-couple), f"{label} on {parent.name}")
    if joint.kind == "floating":
        _spring_of_place(model, child, joint, frame.position, label)


def turning_of(axes: Sequence[sympy.Matrix], rates: Sequence[sympy.Matrix]) -> sympy.Matrix:
    """½ Σ a × b: the angular velocity of three directions that are perpendicular to each other, from their rates."""
    import sympy

    twice_turning = sympy.zeros(3, 1)
    for axis, rate in zip(axes, rates, strict=True):
        twice_turning += axis.cross(rate) / 2
    return twice_turning


def _damped(joint: Joint, v: sympy.Matrix, axes: Sequence[sympy.Matrix]) -> sympy.Matrix:
    """The damper's vector at a velocity; powers are of its components along axes."""
    if not any(joint.more_damping):
        return joint.damping * v
    damping = 0 * v
    for axis in axes:
        along = v.dot(axis)
        damping += along * _damping(joint, along) * axis
    return damping


def _spring_of_place(model: Model, body: Body, joint: Joint, origin: np.ndarray, label: str) -> None:
    """The force at a free body's origin, which is at rest where the model begins."""
    import sympy

    attached = point_of(model, body, origin)
    offset = expressions(attached) - sympy.Matrix(origin.tolist())
    size = sympy.sqrt(offset.dot(offset) + LEAST_SINE**2)
    axes = [sympy.Matrix(axis) for axis in np.eye(3).tolist()]
    force = -_stiffness(joint, size) * offset - _damped(joint, expressions(attached, 1), axes)
    first = body.points[0]
    model.force(first, list(force), f"{label}, force")
    arm = expressions(attached) - expressions(as_combination(first))
    if not arm.is_zero_matrix:
        model.couple(body, list(arm.cross(force)), f"{label}, moment of the force")
