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


def balanced(robot: Robot, inertias: str, stacklevel: int = 1) -> Robot:
    """The robot, where "balanced" is asked for with all three moments of a link at their mean if no body has them.

    That is what MuJoCo's `balanceinertia` does. Warns of how many links there are. Raises ModelError for a word that is none of `INERTIAS`.
    """
    if inertias not in INERTIAS:
        raise ModelError(f"inertias: {shown(inertias)} given; give {' or '.join(map(repr, INERTIAS))}")
    if inertias == "refused":
        return robot
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
            stacklevel=stacklevel + 1,
        )
    return replace(robot, links=links)
