"""Motors of a robot as inputs of its model, where they are asked for: with the names, gears, servos and limits of the file.

In formats without actuators every hinge and slider that follows no other one has a motor, called motor_JOINT; where a file next to the
robot's names joints with motors, these alone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from ncgen.exchange.robots.robot import Actuator, Joint, Robot
from ncgen.model import Model
from ncgen.model.elements import Angle, Relative
from ncgen.model.names import word

if TYPE_CHECKING:
    import sympy

MOTORS, EFFORTS = "actuators", "effort limits"
"""The words for them and for their limits among what is left out."""

AWAY_FROM_ZERO = "motors of joints whose forces are bounded away from 0"
"""The words for joints at which there is a force whatever motors they have."""

PREFIX = "motor_"
"""Before the name of a joint, or of an actuator that is called like something else."""


def add_motors(model: Model, robot: Robot, joints: Mapping[str, Joint], coordinates: Mapping[str, Relative]) -> dict[str, str]:
    """Inputs and what they do at the joints; {actuator: its input}. joints, coordinates: by the names of joints"""
    import sympy

    inputs: dict[str, str] = {}
    totals: dict[str, sympy.Expr] = {name: sympy.S.Zero for name in away_from_zero(robot, joints)}
    for actuator in _of_joints(joints, coordinates, robot.motors) if robot.actuators is None else robot.actuators:
        if not all(name in coordinates for name in actuator.shares):
            continue
        inputs[actuator.name], force = _force(model, actuator, coordinates)
        for name, coefficient in actuator.shares.items():
            totals[name] = totals.get(name, 0) + coefficient * force
    for name, total in totals.items():
        model.torque(coordinates[name], bounded(total, joints[name].effort), f"motors of {coordinates[name].name}")
    return inputs


def away_from_zero(robot: Robot, joints: Mapping[str, Joint]) -> list[str]:
    """Joints at which the forces of motors add up to more than nothing even where there is none, in formats with actuators."""
    bounded = [joint for joint in joints.values() if joint.effort and robot.actuators is not None]
    return [joint.name for joint in bounded if joint.effort and not joint.effort[0] <= 0.0 <= joint.effort[1]]


def _of_joints(joints: Mapping[str, Joint], coordinates: Mapping[str, Relative], named: Collection[str]) -> list[Actuator]:
    """A motor for each joint that has a coordinate of its own, of these names if there are any."""
    names = [name for name in coordinates if name in joints and joints[name].mimic is None]
    return [Actuator(name=PREFIX + name, shares={name: 1.0}) for name in names if name in named or not named]


def _force(model: Model, actuator: Actuator, coordinates: Mapping[str, Relative]) -> tuple[str, sympy.Expr]:
    """An actuator's input by name, and its force (N m or N over the shares)."""
    import sympy

    terms = [(coefficient, coordinates[name]) for name, coefficient in actuator.shares.items()]
    has_unit = actuator.gain == (1.0, 0.0, 0.0) and len(terms) == 1 and abs(terms[0][0]) == 1
    unit = "" if not has_unit else "N m" if isinstance(terms[0][1], Angle) else "N"
    name = word(actuator.name, "motor")
    name = model.free_name(name if model.bearer(name) is None else PREFIX + name)
    u = bounded(model.input(name, unit).symbol, actuator.control)
    length: sympy.Expr = sympy.Add(*(coefficient * c.symbol for coefficient, c in terms))
    rate: sympy.Expr = sympy.Add(*(coefficient * c.rate for coefficient, c in terms))
    gain, bias = (a + b * length + c * rate for a, b, c in (actuator.gain, actuator.bias))
    return name, bounded(gain * u + bias, actuator.force)


def bounded(value: sympy.Expr, limits: tuple[float, float] | None) -> sympy.Expr:
    """A value between limits, if there are some."""
    import sympy

    return value if limits is None else sympy.Min(sympy.Max(value, limits[0]), limits[1])
