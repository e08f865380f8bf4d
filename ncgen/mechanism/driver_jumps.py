"""Breaks of a run at which the velocity of a driver jumps: an impulse moves the mechanism there. A position that jumps is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.break_times import DOUBLE, MIN_GAP_ROUNDINGS, NO_BREAKS, UNCERTAINTY, break_times
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.time_laws import may_switch

SMALLEST_RATE = 1e-10
"""Jump of a driver's velocity, relative to that velocity, below which it is rounding of the law."""

SMALLEST_STEP = 1e-9
"""Jump of a driver's position, relative to the natural size of its constraint, below which it is rounding of typed numbers."""

SMOOTH = 10.0
"""A change over a break and as long a time before and after it is a jump where it is more than this many times the changes beside that."""


def may_jump(kernels: Kernels) -> bool:
    """Return whether constraints depend on time by laws that change their formula; asked once for a mechanism."""

    def found() -> bool:
        programs = kernels.programs.programs
        return any(name in programs and may_switch(programs[name]) for name in ("phi", "nu"))

    return kernels.remember("drivers may jump", (), found)


def driver_jumps(kernels: Kernels, p: np.ndarray, q: np.ndarray, breaks: np.ndarray) -> np.ndarray:
    """Find the breaks (B, 2) of a run, as `break_times` gives them, at which the velocity of a driver jumps, shape (J, 2) in s.

    p (n_p,): parameters; q (n,): a position (m, rad), on which drivers do not depend
    Raises ModelError naming the driver and the time where its position jumps.
    """
    if not len(breaks) or not may_jump(kernels):
        return NO_BREAKS
    moves = breaks[breaks[:, 0] < breaks[:, 1]]
    jumping = [row for row in moves.tolist() if _jumps(kernels, p, q, *row)]
    return np.array(jumping).reshape(-1, 2)


def has_driver_jumps(kernels: Kernels, p: np.ndarray, q: np.ndarray, breaks: np.ndarray) -> bool:
    """Return whether a driver's velocity, or its position, jumps at one of the breaks of a run; arguments as of `driver_jumps`."""
    try:
        return len(driver_jumps(kernels, p, q, breaks)) > 0
    except ModelError:
        return True


def after_jump(kernels: Kernels, p: np.ndarray, q: np.ndarray, t: float) -> float:
    """Return the time (s) just after the jump of a driver's velocity at t, or t itself where there is none: a run that begins at a jump
    begins with the velocities after it."""
    margin = MIN_GAP_ROUNDINGS * DOUBLE * max(abs(t), 1.0)
    jumps = driver_jumps(kernels, p, q, break_times(kernels, p, t - margin, t + margin)) if may_jump(kernels) else NO_BREAKS
    gap = UNCERTAINTY * DOUBLE * abs(t)
    return float(jumps[-1, 1]) if len(jumps) and jumps[0, 0] - gap <= t else t


def refuse_jumps(kernels: Kernels, p: np.ndarray, q: np.ndarray, breaks: np.ndarray, subject: str) -> None:
    """Raise ModelError where a driver's velocity jumps in a run; subject: that does not go through such a jump. Else as `driver_jumps`."""
    if len(jumps := driver_jumps(kernels, p, q, breaks)):
        raise ModelError(
            f"{kernels.name}: the velocity of a driver jumps at t = {jumps[0].mean():.6g} s, and {subject} do not go through that impulse; "
            "round the law, by ncgen.smooth_step or m.spline, or end before"
        )


def _jumps(kernels: Kernels, p: np.ndarray, q: np.ndarray, before: float, after: float) -> bool:
    """Whether a velocity jumps from one time to the next. Raises ModelError where a position does."""
    step, _ = _change(lambda t: kernels.phi(q, t, p), before, after)
    relative_jump = np.abs(step) / kernels.row_sizes
    if np.max(relative_jump, initial=0.0) > SMALLEST_STEP:
        row = int(np.argmax(relative_jump))
        is_driver = kernels.rows[row].owner.kind == "driver"
        raise ModelError(
            f"{kernels.name}: the {kernels.rows[row].label} jumps by {-step[row] if is_driver else step[row]:.4g} at "
            f"t = {(before + after) / 2:.6g} s, and a position cannot jump; let the law get there in some time, as by ncgen.smooth_step"
        )
    rate, size = _change(lambda t: kernels.nu(q, t, p), before, after)
    return bool(np.any(np.abs(rate) > SMALLEST_RATE * size))


def _change(function: Callable[[float], np.ndarray], before: float, after: float) -> tuple[np.ndarray, np.ndarray]:
    """How a function of time (m,) jumps from one time (s) to the next, 0 where it merely changes, and the largest of its values around."""
    width = after - before  # at an end of a run a break may end at its middle, so the sides are looked at from farther away
    values = np.array([function(t) for t in (before - 2 * width, before - width, after + width, after + 2 * width)])
    steps = np.diff(values, axis=0)
    smooth = np.nan_to_num(np.abs(steps[0])) + np.nan_to_num(np.abs(steps[2]))
    return np.where(np.abs(steps[1]) > SMOOTH * smooth, steps[1], 0.0), np.max(np.abs(values[1:3]), axis=0)
