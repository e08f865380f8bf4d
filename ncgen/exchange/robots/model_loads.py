"""What a model tells of its bodies and coordinates, in numbers as files of links and joints have them."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from ncgen.exchange.robots.robot import Mass
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.forces import TorsionSpring
from ncgen.model.values import evaluate
from ncgen.symbolic.tree import TreeLink


class Acting(TypedDict):
    """What acts along a coordinate, by the names of `Joint`."""

    armature: float
    damping: float
    stiffness: float
    rest: float


def acting(model: Model, coordinate: str, zero: float = 0.0) -> Acting:
    """Rotors, springs and dampers at a coordinate; zero: its value where the joint's is 0."""
    sums: Acting = {"armature": 0.0, "damping": 0.0, "stiffness": 0.0, "rest": 0.0}
    for rotor in model.rotors:
        if rotor.coordinate.name == coordinate:
            sums["armature"] += evaluate(rotor.inertia, model.parameters, f"rotor of {coordinate}")
    torque = 0.0
    for spring in model.springs:
        if isinstance(spring, TorsionSpring) and spring.coordinate.name == coordinate:
            stiffness, damping, free = (
                evaluate(x, model.parameters, spring.label) for x in (spring.stiffness, spring.damping, spring.free)
            )
            sums["stiffness"] += stiffness
            sums["damping"] += damping
            torque += stiffness * (free - zero)
    sums["rest"] = torque / sums["stiffness"] if sums["stiffness"] else 0.0
    return sums


def mass_of(model: Model, body: Body | None, origin: np.ndarray) -> Mass | None:
    """A body's mass in a frame along the global axes; None where it has none."""
    if body is None or body.inertia is None:
        return None
    mass, com, tensor = body.inertia.numbers(model.parameters)
    return Mass(mass, com - origin, tensor)


def gravity_of(model: Model) -> tuple[float, float, float]:
    """m/s²."""
    x, y, z = (evaluate(g, model.parameters, "gravity") for g in model.gravity_field)
    return x, y, z


def origin_of(link: TreeLink) -> np.ndarray:
    """Where a link's frame stands in the world: where its joint is, else at the body's first point."""
    turning = next((screw.point for screw in link.screws if screw.point), None)
    return (turning or link.body.points[0]).initial
