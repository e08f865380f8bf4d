"""Moments of inertia that no body has, as many files have them, made such that there is one."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.robot import Robot
from ncgen.model.bodies import conditions

INERTIAS = ("refused", "balanced")
"""What can become of a link whose largest moment of inertia exceeds the sum of the others."""


def check_word(inertias: str) -> None:
    """Raise ModelError for another word than those of `INERTIAS`."""
    if inertias not in INERTIAS:
        raise ModelError(f"inertias: {shown(inertias)} given; give {' or '.join(map(repr, INERTIAS))}")


def balanced(robot: Robot) -> Robot:
    """The robot with all three moments at their mean where no body has them, as MuJoCo's `balanceinertia` does; warns of how many."""
    links, found = dict(robot.links), []
    for name, link in robot.links.items():
        if link.mass is None or conditions(name, link.mass.mass, link.mass.tensor)[1].holds(link.mass.tensor.ravel()):
            continue
        mean = np.trace(link.mass.tensor) / 3
        if mean > 0:
            links[name] = replace(link, mass=replace(link.mass, tensor=mean * np.eye(3)))
            found.append(name)
    if found:
        warnings.warn(
            f"{robot.name}: moments of inertia that no body has are replaced by their mean, those of {found[0]} first ({len(found)})",
            stacklevel=5,
        )
    return replace(robot, links=links)
