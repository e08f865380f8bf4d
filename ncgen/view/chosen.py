"""Which histories of a trajectory are worth a picture, whoever draws it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ncgen.model.elements import Relative
from ncgen.solver.argument_checks import names_of

if TYPE_CHECKING:
    from ncgen.model import Model
    from ncgen.solver.trajectories.trajectory import Trajectory

MAX_COORDINATES = 6
"""How many coordinates are shown where the caller names none and there are no angles or lengths."""


def grouped(run: Trajectory, names: str | Iterable[str] | None = None) -> dict[str, list[str]]:
    """Names of coordinates by the label of their panel, which is that of their element's kind: angles and lengths first, else in order.

    names: one free coordinate or several; default: those of `informative`
    Raises ModelError for a name that is no free coordinate.
    """
    owners = {component.name: element for element in run.model.elements.values() for component in element.components}
    groups: dict[str, list[str]] = {}
    free = tuple(run.coordinates)
    chosen = informative(run.model, free, run.model.chosen_independent) if names is None else names_of(names, "names", free)
    for name in sorted(chosen, key=lambda name: not isinstance(owners[name], Relative)):
        groups.setdefault(f"{owners[name].quantity} ({owners[name].unit})", []).append(name)
    return groups


def above_lowest(run: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy and potential energy (J) over time, (K,) each; the latter counts from its lowest value, so that they compare."""
    kinetic, potential, _ = np.asarray(run.energy(), dtype=float).T
    return kinetic, potential - potential.min()


def informative(model: Model, free: tuple[str, ...], independent: tuple[str, ...]) -> tuple[str, ...]:
    """Of the free coordinates the angles and lengths; where there are none the independent ones, else the first ones."""
    relative = tuple(name for name in free if isinstance(model.elements.get(name), Relative))
    return relative or (independent or free)[:MAX_COORDINATES]
