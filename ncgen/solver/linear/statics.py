"""Equilibria: positions where applied forces and multipliers balance, Φ_qᵀ λ = Q and Φ = 0 at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, counted, one_of
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import least_squares
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import ArrayOrNamed, refuse_sticking
from ncgen.solver.finite import watched
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.position import solve_position
from ncgen.solver.positions.rank import null_space, scaled_jacobian

MAX_STEPS, STEPS_PER_DOF = 200, 10
"""Steps that are tried, and how many more for every degree of freedom: a long chain has far to fall."""

MAX_HALVINGS = 10
"""How often a step is halved whose end cannot be brought back onto the constraints."""

LONGEST_STEP = 0.2
"""Largest change of any coordinate in one step, relative to its natural size."""

FORCE_TOLERANCE = 1e-13
"""Steps, or forces left over, below this are rounding (relative)."""

NEUTRAL = 1e-9
"""Stiffnesses below this, relative to the largest, count as none."""

KINDS = ("stable", "nearest")


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A position q (n,) at rest, its multipliers (m,), and the stiffnesses of the motions that the constraints allow.

    stiffnesses: eigenvalues (dof,) in J, for motions measured in natural sizes, ascending; stable: all are positive
    """

    q: np.ndarray
    lam: np.ndarray
    stiffnesses: np.ndarray
    steps: int

    def __repr__(self) -> str:
        kind = "stable" if self.stable else "not stable"
        freedom = counted(len(self.stiffnesses), "degree of freedom")
        return f"<Equilibrium {kind}: {counted(len(self.q), 'coordinate')}, {freedom}, {counted(self.steps, 'step')}>"

    @property
    def stable(self) -> bool:
        largest = np.max(np.abs(self.stiffnesses), initial=0.0)
        return bool(np.all(self.stiffnesses > NEUTRAL * largest))


def equilibrium(
    kernels: Kernels, q: ArrayOrNamed | None = None, t: float = 0.0, p: ArrayOrNamed | None = None, kind: str = "stable"
) -> Equilibrium:
    """Find an equilibrium near a position.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,), or {name: value}, optional
        Position in m and rad to begin from. Default: the initial one.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.
    kind : str
        "stable" decreases the potential energy, by Newton's steps with stiffnesses taken positive; "nearest" takes Newton's own steps and
        may end at an unstable equilibrium. A position that is in balance already is kept, stable or not.

    Returns
    -------
    Equilibrium
        The position, and whether it is stable.

    Raises
    ------
    ConvergenceError
        With the force that remains if no equilibrium is found.
    ModelError
        For rolling constraints, dry friction, locks and ratchets, and for invalid arguments.
    """
    p = argument_checks.parameters(kernels, p)
    one_of(kind, "kind", KINDS)
    if len(kernels.holonomic) < kernels.m:
        raise ModelError(f"{kernels.name}: an equilibrium with rolling conditions is one of many; hold the position instead")
    refuse_sticking(kernels.model, "equilibrium")
    q = assemble(kernels, q, t, p)
    steps = 0
    while True:
        basis, pull, stiffness, lam, left = _balance(kernels, q, t, p)
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
        step = _step(pull, stiffness, values, vectors, kind)
        if left <= FORCE_TOLERANCE or np.max(np.abs(basis @ step), initial=0.0) <= FORCE_TOLERANCE:
            return Equilibrium(q, lam, values, steps)
        if steps == MAX_STEPS + STEPS_PER_DOF * len(values):
            raise ConvergenceError(
                f"{kernels.name}: no equilibrium found in {counted(steps, 'step')}, {left:.2g} of the forces is left over; "
                "start nearer to one, "
                "or the forces have no balance"
            )
        step = basis @ step
        q = _moved(kernels, q, kernels.column_sizes * step * min(1.0, LONGEST_STEP / np.max(np.abs(step))), t, p)
        steps += 1


def _moved(kernels: Kernels, q: np.ndarray, step: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """The closed position a step (n,) away from q, or a part of it away. Raises ConvergenceError where even a small part does not close."""
    for _ in range(MAX_HALVINGS):
        try:
            return solve_position(kernels, q + step, t, p).q
        except ConvergenceError:
            step = step / 2
    return solve_position(kernels, q + step, t, p).q


def _balance(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Allowed motions N, the force along them, their stiffness, the multipliers, and the share of forces not balanced."""
    kernels = watched(kernels)
    rest, sizes = np.zeros(kernels.n), kernels.column_sizes
    jacobian = scaled_jacobian(kernels, q, t, p)
    force = sizes * kernels.force(q, rest, t, p)
    push = least_squares(jacobian.T, force, 1e-9)
    lam = push / kernels.row_sizes
    basis = null_space(jacobian)
    pull = basis.T @ force
    stiffness = sizes[:, None] * kernels.stiffness(q, rest, rest, lam, t, p).toarray() * sizes
    size = np.max(np.abs(force) + np.abs(jacobian.T) @ np.abs(push), initial=0.0)
    return basis, pull, basis.T @ stiffness @ basis, lam, float(np.max(np.abs(pull), initial=0.0) / max(size, 1e-300))


def _step(pull: np.ndarray, stiffness: np.ndarray, values: np.ndarray, vectors: np.ndarray, kind: str) -> np.ndarray:
    if not len(pull):
        return pull
    if kind == "nearest":
        return least_squares(stiffness, pull, NEUTRAL)
    floor = max(NEUTRAL * np.max(np.abs(values)), NEUTRAL * np.max(np.abs(pull)), 1e-300)  # what it lets pass is cut to LONGEST_STEP
    return vectors @ ((vectors.T @ pull) / np.maximum(np.abs(values), floor))
