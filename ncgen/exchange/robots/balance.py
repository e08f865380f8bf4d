"""Moments of inertia that no body has, as many files have them: refused, made such that there is one, or taken as they are."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.robot import Link, Robot, together
from ncgen.model.bodies import conditions

INERTIAS = ("refused", "balanced", "as given")
"""What can become of a link whose largest moment of inertia exceeds the sum of the others."""


def accepted(robot: Robot, inertias: str, floats: bool, stacklevel: int = 1) -> Robot:
    """The robot with what is to become of moments that no body has; warns of how many bodies there are.

    "balanced": all three moments of a link are their mean, as MuJoCo's `balanceinertia` does
    "as given": bodies, which are links with what is fixed to them, have the file's moments, as in Pinocchio
    floats: whether the root is a free body, not part of the ground. Raises ModelError for a word that is not one of `INERTIAS`.
    """
    if inertias not in INERTIAS:
        raise ModelError(f"inertias: {shown(inertias)} given; give {', '.join(map(repr, INERTIAS[:-1]))} or {INERTIAS[-1]!r}")
    if inertias == "refused":
        return robot
    if inertias == "as given":
        names = [name for name, link in together(robot).links.items() if is_impossible(link) and (floats or name != robot.root)]
        alone = (name for name, link in robot.links.items() if is_impossible(link))
        changed, treatment = replace(robot, as_given=frozenset((*names, *alone))), "are taken as given"
    else:
        means = {name: _balanced(link) for name, link in robot.links.items() if is_impossible(link) and _mean(link) > 0}
        changed, treatment, names = replace(robot, links={**robot.links, **means}), "are replaced by their mean", list(means)
    if names:
        warnings.warn(
            f"{robot.name}: moments of inertia that no body has {treatment}, those of {names[0]} first ({len(names)})",
            stacklevel=stacklevel + 1,
        )
    return changed


def is_impossible(link: Link) -> bool:
    """Whether no body has the moments of inertia of a link."""
    return link.mass is not None and not conditions(link.name, link.mass.mass, link.mass.tensor)[1].holds(link.mass.tensor.ravel())


def remedy(link: Link) -> str:
    """What ends a refusal of a link whose moments no body has: how to load the file all the same; empty for other links."""
    return "; inertias='as given' takes the file's numbers" if is_impossible(link) else ""


def _mean(link: Link) -> float:
    return float(np.trace(link.mass.tensor)) / 3 if link.mass else 0.0


def _balanced(link: Link) -> Link:
    return replace(link, mass=replace(link.mass, tensor=_mean(link) * np.eye(3))) if link.mass else link
