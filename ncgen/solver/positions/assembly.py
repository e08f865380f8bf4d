"""Assembly: closing a mechanism whose initial position is only approximately known.

A consistent position is left untouched to the last bit. Otherwise Newton's method with minimum-norm steps in
natural units (lengths in the mechanism's size) moves everything a little; steps are kept short, so the
mechanism stays on the branch it was drawn on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import least_squares
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import ArrayOrNamed
from ncgen.solver.finite import is_finite, watched
from ncgen.solver.groups import CONSISTENT_RESIDUAL
from ncgen.solver.positions.position import TOLERANCE, check_finite, residual
from ncgen.solver.positions.sparse_rows import DENSE, least_damped, scaled

LIMIT = 100
LONGEST_STEP = 0.1
"""Largest change of any coordinate in one step, relative to its natural size."""

MAX_NEWTON_RATIO = 0.5
"""A step that leaves more than this of the residual is not one of Newton's method near a solution."""

MAX_NAMED_ROWS = 4
"""How many rows a failure names."""


def assemble(
    kernels: Kernels,
    q: ArrayOrNamed | None = None,
    t: float = 0.0,
    p: ArrayOrNamed | None = None,
    weights: Mapping[str, float] | None = None,
    tolerance: float = CONSISTENT_RESIDUAL,
) -> np.ndarray:
    """Assemble a mechanism: find a consistent position near another.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,), or {name: value}, optional
        Position in m and rad to begin from. Default: the model's at the parameters p.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.
    weights : {coordinate: weight}, optional
        How much dearer than others it is to move a coordinate. Default: 1.
    tolerance : float
        Relative residual up to which a position counts as assembled. A position with a larger residual than 1e-9 is assembled as far as its
        constraints allow: those of an overconstrained mechanism contradict each other by as much as its dimensions are rounded.

    Returns
    -------
    array, shape (n,)
        The position in m and rad.

    Raises
    ------
    ConvergenceError
        With the names of the constraints that are not satisfied.
    DomainError
        With the name of a constraint that is NaN or infinite.
    ModelError
        For invalid arguments.
    """
    p, tolerance = argument_checks.parameters(kernels, p), argument_checks.closing(tolerance)
    q, t = argument_checks.position(kernels, q, p), argument_checks.finite(t, "t")
    dearer = argument_checks.numbers_by_name(weights or {}, kernels.index, "weights")
    for name, weight in dearer.items():
        argument_checks.positive(weight, f"weights: {name}")
    if residual(kernels, q, t, p) <= min(tolerance, CONSISTENT_RESIDUAL):
        return q
    sizes = kernels.column_sizes / np.array([dearer.get(name, 1.0) for name in kernels.coordinates])
    rows = kernels.holonomic
    history, value = [], np.zeros(len(rows))
    for _ in range(LIMIT):
        value = kernels.phi(q, t, p)[rows] / kernels.row_sizes[rows]
        history.append(float(np.max(np.abs(value), initial=0.0)))
        if history[-1] <= TOLERANCE or (history[-1] <= tolerance and _stands_still(history)):
            return q
        if not np.isfinite(history[-1]):
            if len(history) == 1 or is_finite(q):
                check_finite(kernels, q, t, p)
            break
        step = _damped_step(watched(kernels), q, t, p, sizes, value)
        step *= min(1.0, LONGEST_STEP / max(np.max(np.abs(step), initial=0.0), 1e-300))
        q = q + sizes * step
    raise ConvergenceError(_open_rows(kernels, value, tolerance), tuple(history))


def _stands_still(history: list[float]) -> bool:
    """True if the last step has not made a residual smaller: rows that contradict each other do not close further."""
    return len(history) > 1 and history[-1] > MAX_NEWTON_RATIO * history[-2]


def _damped_step(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, sizes: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Levenberg-Marquardt: the damping fades with the residual, so the end is Newton's."""
    rows = kernels.holonomic
    damping = float(min(1e-3, np.linalg.norm(value) ** 2))
    if len(rows) >= DENSE:
        return least_damped(scaled(kernels.phi_q(q, t, p)[rows], 1 / kernels.row_sizes[rows], sizes), -value, damping)
    jacobian = kernels.jacobian(q, t, p)[rows] * sizes / kernels.row_sizes[rows, None]
    stacked = np.vstack([jacobian, np.sqrt(damping) * np.eye(jacobian.shape[1])])
    return least_squares(stacked, np.concatenate([-value, np.zeros(jacobian.shape[1])]))


def _open_rows(kernels: Kernels, value: np.ndarray, tolerance: float) -> str:
    worst = [i for i in np.argsort(-np.abs(value)) if not abs(value[i]) <= min(tolerance, CONSISTENT_RESIDUAL)][:MAX_NAMED_ROWS] or [
        int(np.argmax(np.abs(value)))
    ]
    rows = [(kernels.holonomic[i], value[i]) for i in worst]
    named = "; ".join(f"{r + 1} ({kernels.rows[r].label}, {kernels.rows[r].owner}) by {v:.2g}" for r, v in rows)
    advice = "correct a length, start nearer to a closed position, or allow more"
    return f"{kernels.name}: the mechanism does not close: constraint{'s' * (len(rows) > 1)} {named} (relative); {advice}"
