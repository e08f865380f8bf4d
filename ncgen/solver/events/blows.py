"""Impulses of several contacts with friction at one instant.

Each contact has an impulse Λ along its gap and P across it, and all velocities change by the matrix G of their responses. With the law of
Newton 0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0, and P is within the disc of radius μ Λ: inside it w⁺ + e_t w⁻ = 0, at its edge P = −μ Λ (w⁺ + e_t w⁻)/|…|
(Moreau, 1988; Glocker, Set-Valued Force Laws, 2001). With that of Poisson this holds for e = e_t = 0 first, at the end of the compression;
then the same with Λ ≥ e Λ of the compression.

Impulses are first found by projections in turn, which tell what sticks, slides and opens; then they follow from linear equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SWEEPS = 20_000
"""Projections of all contacts in turn."""

POLISH = 50
"""Between two attempts at the linear equations."""

CLOSE = 1e-10
"""What the laws may miss, relative to the velocities and impulses."""

TURNS = 200
"""Changes of the directions of sliding in space, each of which follows from the last impulses."""


@dataclass(frozen=True, eq=False)
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
    impulses = least.copy()
    for sweep in range(SWEEPS):
        for blow in blows:
            gap, across = blow.places[0], blow.places[1:]
            impulses[gap] = max(least[gap], impulses[gap] - (G[gap] @ impulses + bias[gap]) / G[gap, gap])
            if len(across):
                size = float(np.max(np.diag(G)[across]))
                new = impulses[across] - (G[across] @ impulses + bias[across]) / size
                impulses[across] = _into(new, blow.friction * impulses[gap])
        if sweep % POLISH == POLISH - 1 and (found := _polished(G, bias, blows, least, impulses)) is not None:
            return found
    return None


def _into(vector: np.ndarray, radius: float) -> np.ndarray:
    """The vector, shortened to a radius."""
    size = float(np.linalg.norm(vector))
    return vector if size <= radius else vector * (radius / size)


def _polished(G: np.ndarray, bias: np.ndarray, blows: Sequence[Blow], least: np.ndarray, guess: np.ndarray) -> np.ndarray | None:
    """Impulses of the linear equations that follow from what a guess says of each contact; None where these do not obey the laws."""
    impulses, size = guess, float(np.max(np.abs(bias)))
    for _ in range(TURNS):
        matrix, right = np.eye(len(bias)), least.copy()
        directions = []
        for blow in blows:
            gap, across = blow.places[0], blow.places[1:]
            velocity = G @ impulses + bias
            if impulses[gap] > least[gap] or abs(velocity[gap]) <= CLOSE * size:
                matrix[gap], right[gap] = G[gap], -bias[gap]
            if not len(across):
                continue
            limit, push = blow.friction * impulses[gap], float(np.linalg.norm(impulses[across]))
            if limit > 0 and push < limit * (1 - 1e-7):
                matrix[across], right[across] = G[across], -bias[across]
                continue
            direction = -impulses[across] / push if push else np.zeros(len(across))
            if (speed := float(np.linalg.norm(velocity[across]))) > CLOSE * size:
                direction = velocity[across] / speed
            matrix[across, gap] = blow.friction * direction
            directions.append((across, direction))
        new = np.linalg.lstsq(matrix, right, rcond=None)[0]
        settled = np.max(np.abs(new - impulses)) <= 1e-15 * np.max(np.abs(new), initial=0.0)
        impulses = new
        if settled or not any(len(across) > 1 for across, _ in directions):
            break
    return impulses if _obeys(G, bias, blows, least, impulses) else None


def _obeys(G: np.ndarray, bias: np.ndarray, blows: Sequence[Blow], least: np.ndarray, impulses: np.ndarray) -> bool:
    """Whether impulses and their velocities obey the laws, but for rounding."""
    velocity = G @ impulses + bias
    slack = CLOSE * float(np.max(np.abs(bias), initial=0.0) + np.max(np.abs(G) @ np.abs(impulses), initial=0.0))
    size = CLOSE * float(np.max(np.abs(impulses), initial=0.0))
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
