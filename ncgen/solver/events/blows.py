"""Impulses of several contacts with friction at one instant.

Each contact has an impulse Λ along its gap and P across it, and all velocities change by the matrix G of their responses. With the law of
Newton 0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0, and P is within the disc of radius μ Λ: inside it w⁺ + e_t w⁻ = 0, at its edge P = −μ Λ (w⁺ + e_t w⁻)/|…|
(Moreau, 1988; Glocker, Set-Valued Force Laws, 2001). With that of Poisson this holds for e = e_t = 0 first, at the end of the compression;
then the same with Λ ≥ e Λ of the compression.

What sticks, slides and opens is tried, or told by projections in turn where that would be too much; then impulses follow from linear
equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

import numpy as np

MAX_SWEEPS = 20_000
"""Projections of all contacts in turn."""

MAX_TRIED = 4
"""Contacts in the plane of which all that they may do together is tried; of more, projections tell what they do."""

CONE_TOLERANCE = 1e-7
"""An impulse that is shorter than the radius of its disc by this share is inside it."""

Manner: TypeAlias = "tuple[bool, np.ndarray | None]"
"""What a contact does: whether its gap does not open, and the direction (d,) in which it slides, None where it sticks."""

SWEEP_ROUNDING = 1e-15
"""Changes of a sweep, relative to the impulses, that are rounding."""

LAW_TOLERANCE = 1e-10
"""What the laws may miss, relative to the velocities and impulses."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Blow:
    """A contact: places of its gap and of its one, two or no directions of sliding in G; coefficients"""

    places: np.ndarray
    restitution: float
    friction: float
    tangential: float
    is_poisson: bool


def simultaneous(G: np.ndarray, u: np.ndarray, blows: Sequence[Blow]) -> np.ndarray | None:
    """Impulses (r,) for velocities u (r,) and responses G (r, r); those of places that no contact has are zero. None if none are found."""
    bias = u.copy()
    for blow in blows:
        if not blow.is_poisson:
            bias[blow.places[0]] *= 1 + blow.restitution
            bias[blow.places[1:]] *= 1 + blow.tangential
    first = _solved(G, bias, blows, np.zeros(len(u)))
    if first is None or not any(blow.is_poisson and blow.restitution for blow in blows):
        return first
    least = np.zeros(len(u))
    for blow in blows:
        if blow.is_poisson:
            least[blow.places[0]] = blow.restitution * first[blow.places[0]]
    second = _solved(G, bias + G @ first, blows, least)
    return None if second is None else first + second


def _solved(G: np.ndarray, bias: np.ndarray, blows: Sequence[Blow], least: np.ndarray) -> np.ndarray | None:
    """Impulses whose velocities G Λ + bias obey the laws without restitution; least: of the impulses along gaps."""
    choices = [_manners(len(blow.places) - 1) for blow in blows]
    if all(choices) and len(blows) <= MAX_TRIED:
        solutions = (_of_manners(G, bias, blows, least, manners) for manners in product(*choices))
        return next((impulses for impulses in solutions if _obeys(G, bias, blows, least, impulses)), None)
    impulses = least.copy()
    for _ in range(MAX_SWEEPS):
        before = impulses.copy()
        for blow in blows:
            gap, across = blow.places[0], blow.places[1:]
            impulses[gap] = max(least[gap], impulses[gap] - (G[gap] @ impulses + bias[gap]) / G[gap, gap])
            if len(across):
                size = float(np.max(np.diag(G)[across]))
                new = impulses[across] - (G[across] @ impulses + bias[across]) / size
                impulses[across] = _into(new, blow.friction * float(impulses[gap]))
        if np.max(np.abs(impulses - before)) <= SWEEP_ROUNDING * np.max(np.abs(impulses)):
            break
    manners = [_manner(G @ impulses + bias, impulses, blow, least) for blow in blows]
    exact = _of_manners(G, bias, blows, least, manners)
    return next((each for each in (exact, impulses) if _obeys(G, bias, blows, least, each)), None)


def _manners(directions: int) -> list[Manner]:
    """What a contact may do; nothing where its directions are not known before."""
    across = {0: [None], 1: [None, np.array([1.0]), np.array([-1.0])]}.get(directions, [])
    return list(product((True, False), across))


def _into(vector: np.ndarray, radius: float) -> np.ndarray:
    """The vector, shortened to a radius."""
    size = float(np.linalg.norm(vector))
    return vector if size <= radius else vector * (radius / size)


def _of_manners(G: np.ndarray, bias: np.ndarray, blows: Sequence[Blow], least: np.ndarray, manners: Sequence[Manner]) -> np.ndarray:
    """Impulses of the linear equations that follow from what each contact does."""
    matrix, right = np.eye(len(bias)), least.copy()
    for blow, (is_closed, direction) in zip(blows, manners, strict=True):
        gap, across = blow.places[0], blow.places[1:]
        if is_closed:
            matrix[gap], right[gap] = G[gap], -bias[gap]
        if direction is not None:
            matrix[across, gap] = blow.friction * direction
        elif is_closed or least[gap]:
            matrix[across], right[across] = G[across], -bias[across]
    return np.linalg.lstsq(matrix, right, rcond=None)[0]


def _manner(velocity: np.ndarray, impulses: np.ndarray, blow: Blow, least: np.ndarray) -> Manner:
    """What a contact with this impulse does."""
    gap, across = blow.places[0], blow.places[1:]
    limit, push, speed = blow.friction * impulses[gap], float(np.linalg.norm(impulses[across])), float(np.linalg.norm(velocity[across]))
    sticks = push < limit * (1 - CONE_TOLERANCE) or not len(across) or not speed
    return bool(impulses[gap] > least[gap]), None if sticks else velocity[across] / speed


def _obeys(G: np.ndarray, bias: np.ndarray, blows: Sequence[Blow], least: np.ndarray, impulses: np.ndarray) -> bool:
    """Whether impulses and their velocities obey the laws, but for rounding."""
    velocity = G @ impulses + bias
    slack = LAW_TOLERANCE * float(np.max(np.abs(bias), initial=0.0) + np.max(np.abs(G) @ np.abs(impulses), initial=0.0))
    size = LAW_TOLERANCE * float(np.max(np.abs(impulses), initial=0.0))
    for blow in blows:
        gap, across = blow.places[0], blow.places[1:]
        if velocity[gap] < -slack or impulses[gap] < least[gap] - size:
            return False
        if impulses[gap] > least[gap] + size and velocity[gap] > slack:
            return False
        if not len(across):
            continue
        limit, push, speed = blow.friction * impulses[gap], impulses[across], float(np.linalg.norm(velocity[across]))
        if np.linalg.norm(push) > limit + size:
            return False
        if speed > slack and float(np.linalg.norm(push + limit * velocity[across] / speed)) > 10 * size:
            return False
    return True
