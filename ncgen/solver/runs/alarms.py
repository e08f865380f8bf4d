"""What a run says against itself: energy that changes, constraints that are open. An alarm that cries wolf is not heard."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ncgen.mechanism.run_rows import Inspection
from ncgen.methods.method import Method
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.energy import Instants, drift, is_small
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.toolchain.abi import NUMBERS

MAX_ENERGY_CHANGE = 1e-2
"""Relative change of energy from which no motion is believed: nobody chooses steps of a fixed length, or feedback, to get this."""

WORK_ERRORS = 10.0
"""How many times atol (J) the work may be wrong by. What rests, slips a little between two instants at which the energy is looked at, and
rests again has no energy at either of them, and all its work may be such errors."""

MAX_RESIDUAL_OVER_RTOL = 100.0
"""Residuals of feedback, over rtol, from which they are told."""

VELOCITY_TOLERANCE = 1e-6
"""Share of what all rows' velocities add up to that a row may be off by, in double precision."""

LEAST_DURATION = float(np.finfo(float).tiny)
"""Seconds that do no harm as a divisor."""

ROUNDINGS = 64.0
"""The same in roundings of a number type that has fewer digits."""


@dataclass(frozen=True)
class Limits:
    """Up to which what C saw of a motion speaks for it, so that `doubts` has nothing to say.

    change: of the energy, relative to the largest kinetic one; remainder: of Φ_q q̇ − ν, relative to the sizes of rows
    can_tell: False where constraints are held by feedback alone; has_doubts: False for methods about which `doubts` never reports anything,
        which take energy away on purpose
    """

    change: float
    remainder: float
    can_tell: bool
    has_doubts: bool

    @classmethod
    def of(cls, tolerances: Tolerances, method: Method, duration: float) -> Limits:
        """Of a run of some length (s)."""
        feedback = _has_feedback(method)
        remainder = math.inf if method.has_fixed_step else VELOCITY_TOLERANCE * _slow(duration)
        return cls(_limit(tolerances, method), remainder, not feedback, feedback or not _is_damping(method))

    def allow(self, seen: Inspection | None) -> bool:
        """Whether nothing can speak against a motion of which C saw this."""
        if not self.has_doubts:
            return True
        if seen is None or not self.can_tell:
            return False
        return is_small(seen.change, seen.energy, seen.kinetic, self.change) and seen.remainder <= self.remainder


def _has_feedback(method: Method) -> bool:
    """Whether constraints are held by feedback alone, if at all."""
    return method.options.get("stabilisation") in ("baumgarte", "none")


def _is_damping(method: Method) -> bool:
    """Whether steps of a fixed length take energy away on purpose."""
    return method.has_fixed_step and "rho" in method.integrator.options


def _limit(tolerances: Tolerances, method: Method) -> float:
    """The least relative change of energy that is reported."""
    return MAX_ENERGY_CHANGE if method.has_fixed_step else min(MAX_ENERGY_CHANGE, math.sqrt(tolerances.rtol))


def _slow(duration: float) -> float:
    """Velocities (sizes of the mechanism per second) that move nothing by a share of its size in a run of some length (s)."""
    return VELOCITY_TOLERANCE / max(duration, LEAST_DURATION)


def doubts(run: Trajectory, instants: Instants, tolerances: Tolerances, method: Method) -> list[str]:
    """What speaks against a motion, in words.

    instants: at which the energy was looked at, the ends of the run included; tolerances: that were kept
    """
    rtol, feedback = tolerances.rtol, _has_feedback(method)
    reasons = [] if feedback or method.has_fixed_step else _contradiction(run, instants)
    unseen = WORK_ERRORS * tolerances.atol if any(instants.works()) else 0.0
    change = drift(run.kernels, instants, run.p, unseen, limit=_limit(tolerances, method))
    if feedback and change > MAX_ENERGY_CHANGE:
        reasons.append(
            f"{method.formalism.name} without projection changes the energy by {change:.1g} of what moves; "
            "the motion may have left its branch, take smaller steps or another formalism"
        )
    elif method.has_fixed_step and not _is_damping(method) and change > MAX_ENERGY_CHANGE:
        reasons.append(
            f"the energy changes by {change:.1g} of what moves: the steps are too long for {method.integrator.name} here, or the motion "
            "has passed a singular position; take smaller ones (max_step) or a method with error control"
        )
    elif not method.has_fixed_step and change > math.sqrt(rtol):
        other = (
            "or be too long for the tolerance"
            if method.is_constrained
            else "which formalism='lagrange' does better, or be too long for the tolerance"
        )
        reasons.append(
            f"the energy changes by {change:.1g} of what moves, although rtol is {rtol:g}: "
            f"the motion may have passed a singular position, {other}"
        )
    if feedback and not method.has_fixed_step and (violation := _violation(run, instants)) > MAX_RESIDUAL_OVER_RTOL * rtol:
        reasons.append(
            f"{method.formalism.name} holds the constraints to {violation:.1g} only (relative), although rtol is {rtol:g}; "
            + (
                "raise alpha or omega (options), or take formalism='lagrange'"
                if "alpha" in method.options
                else "take stabilisation='projection'"
            )
        )
    return reasons


def _violation(run: Trajectory, instants: Instants) -> float:
    """The largest relative residual of the constraints at some instants."""
    return float(replace(run, t=instants.t, q=instants.q, qd=instants.qd, work=instants.work).violation().max())


def _contradiction(run: Trajectory, instants: Instants) -> list[str]:
    """What drivers and velocity rows demand that no velocity can do: projections then leave a remainder in Φ_q q̇ = ν. Velocities of rest
    always satisfy rows without either. A remainder is compared with the velocities; where a driver comes to rest these are rounding, and
    count as what would move nothing by a share of its size in the whole run."""
    kernels, p = run.kernels, run.p
    if len(kernels.holonomic) == kernels.m and "nu" not in kernels.programs.programs:
        return []
    rounding = float(np.finfo(NUMBERS[run.number].dtype).eps)
    worst, reasons, slow = max(VELOCITY_TOLERANCE, ROUNDINGS * rounding), [], _slow(instants.t[-1] - instants.t[0])
    for t, q, qd in zip(instants.t, instants.q, instants.qd, strict=True):
        nu = kernels.nu(q, t, p)
        if len(kernels.holonomic) == kernels.m and not np.any(nu):
            continue
        rows = kernels.jacobian(q, t, refresh_branches(kernels, q, p))
        rest = np.abs(rows @ qd - nu)
        if (rest <= worst * slow * kernels.row_sizes).all():
            continue  # no remainder is larger then, whatever moves
        terms = np.abs(rows) @ np.abs(qd) + np.abs(nu)
        remainders = rest / (np.max(terms / kernels.row_sizes, initial=slow) * kernels.row_sizes)
        row = int(np.argmax(remainders))
        if remainders[row] > worst:
            worst = remainders[row]
            reasons = [f"at t = {t:.6g} s no velocities satisfy all rows: {kernels.rows[row].label} is off by {rest[row]:.3g} a second, "
                    "so a driver or a velocity row contradicts the others"]  # fmt: skip
    return reasons
