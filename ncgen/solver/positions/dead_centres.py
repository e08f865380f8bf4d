"""Where a mechanism stops on its way to a position that it cannot reach, and whether it is at a dead centre there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import singular_values

RESOLUTION = 1e-10
"""Fraction of a way to which the place where it ends is found."""

MIN_SINGULAR_RATIO = 1e-3
"""Smallest singular value of the constraints over their largest, in natural sizes, below which a position is at a dead centre.

At a distance d from it that ratio is of the order of √d; a place that is found to RESOLUTION of a way has about 1e-5.
"""


def approached(reach: Callable[[np.ndarray, float], np.ndarray], q: np.ndarray, begin: float, end: float) -> tuple[np.ndarray, float]:
    """Return the last position that can be reached on a way by ever shorter steps, and its place between begin and end.

    reach(q, s): the position (n,) at the place s from one near it, which raises ConvergenceError where there is none
    q: the position at the place `begin`
    """
    reached, step = begin, (end - begin) / 2
    while reached != end and abs(step) > RESOLUTION * abs(end - begin):
        further = reached + step if abs(reached + step - begin) < abs(end - begin) else end
        try:
            q, reached = reach(q, further), further
        except ConvergenceError:
            step /= 2
    return q, reached


def is_dead_centre(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, free: np.ndarray) -> bool:
    """Return whether coordinates are no function of the others at a position, as the mechanism turns back there.

    free: indices of the coordinates that follow, all of them for a mechanism that its drivers move
    """
    rows = kernels.holonomic
    whole = kernels.jacobian(q, t, p)[rows] / kernels.row_sizes[rows, None] * kernels.column_sizes
    every = singular_values(whole)
    count = min(int(np.sum(every > 1e-9 * np.max(every, initial=0.0))), len(free))
    values = singular_values(whole[:, free])
    return count > 0 and bool(values[count - 1] < MIN_SINGULAR_RATIO * values[0])
