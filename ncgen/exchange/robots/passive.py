"""Springs and dampers that are more than a factor, those of balls and free bodies, and compensated weights, as MJCF says them.

And coordinates of bodies as expressions, for outputs of robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Mass
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Combination, Component
from ncgen.model.values import Scalar, as_sympy

if TYPE_CHECKING:
    import sympy


def series(joint: Joint) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coefficients of stiffness and of damping."""
    return (joint.stiffness, *joint.more_stiffness), (joint.damping, *joint.more_damping)


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
    for mass in masses:
        force = [-mass.mass * g for g in gravity]
        if any(force):
            model.constant_force(body, mass.com.tolist(), force, f"compensated weight of {body.name}")


def spring_of_ball(model: Model, parent: Body, child: Body, joint: Joint, frame: Placement) -> None:
    """What acts at a ball between two bodies, or on a free body, which is at rest where the model begins. frame: of the child, there"""
    label = f"spring of {joint.name}"
    model.ball_spring(parent, child, *series(joint), frame.rotation.T.tolist(), label)
    if joint.kind == "floating":
        model.anchor_spring(child, frame.position.tolist(), *series(joint), f"{label}, force")


def turning_of(axes: Sequence[sympy.Matrix], rates: Sequence[sympy.Matrix]) -> sympy.Matrix:
    """½ Σ a × b: the angular velocity of three directions that are perpendicular to each other, from their rates."""
    import sympy

    twice_turning = sympy.zeros(3, 1)
    for axis, rate in zip(axes, rates, strict=True):
        twice_turning += axis.cross(rate) / 2
    return twice_turning
