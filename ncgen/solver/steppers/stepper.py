"""What the methods share that discretise the constrained equations themselves.

A stepper has a state (t, q, q̇, q̈, λ) and `step()`, which advances it by h. Its equations are solved by Newton's method with
the tangents of the model, on the system with multipliers of `KKT`, without units.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from ncgen.errors import ConvergenceError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import Motion
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.positions.position import check_mirror_roots
from ncgen.solver.positions.rank import best_rows, freedom_at, scaled_jacobian
from ncgen.solver.runs.divergence import unsolved_step

LIMIT = 25
ENOUGH = 1e-14
"""Newton steps below this, in natural sizes, end the iteration."""


class Stepper(ABC):
    """One method at work, from a state at t (s): q (n,) in m and rad, qd (n,) in the same per second; p (n_p,), and the step h (s).

    newton: Newton steps taken so far; work: of drivers and forces without a potential since the start (J)
    """

    takes_all_rows = False
    """Whether redundant rows count: those of a penalty do."""

    def __init__(self, kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray, h: float, **options: Any) -> None:
        self.kernels, self.p, self.h = kernels, p, h
        self.start, self.t, self.q, self.qd, self.work = t, t, q, qd, 0.0
        self.taken = self.newton = 0
        self.settings = options
        self._rank = freedom_at(kernels, q, t, p).rank
        self._choose_rows()
        first = self._instant(t, q, qd)
        self.qdd, self.lam, self.power = first.qdd, first.lam, first.power
        self.columns, self.rows = kernels.column_sizes, kernels.row_sizes
        self.lam = np.where(self._kept, self.lam, 0.0)

    def step(self) -> None:
        """Advance by h. Raises ConvergenceError with the time where Newton's method fails, or naming an angle that jumped."""
        self.taken += 1
        end = self.start + self.taken * self.h
        self._advance(end)
        self.t = end
        check_mirror_roots(self.kernels, self.q, self.p)
        self._choose_rows()
        self.lam = np.where(self._kept, self.lam, 0.0)

    def _choose_rows(self) -> None:
        """Of redundant rows those farthest from dependent, as in C: off the constraints the others contradict them."""
        self._kept = np.ones(self.kernels.m, dtype=bool)
        if self._rank < self.kernels.m and not self.takes_all_rows:
            self._kept[:] = False
            self._kept[best_rows(scaled_jacobian(self.kernels, self.q, self.t, self.p), self._rank)] = True

    @abstractmethod
    def _advance(self, end: float) -> None:
        """Bring q, qd, qdd, lam and work to the end of a step."""

    # -- equations -----------------------------------------------------------------------------

    def solve(
        self, weight: np.ndarray, left: np.ndarray, jacobian: np.ndarray, force: np.ndarray, gap: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """x (n,), y (m,) of [weight left; jacobian 0][x; y] = [force; gap], solved without units; y is 0 for rows that are not kept.

        weight (n, n) in units of mass, left (n, m), jacobian (m, n)
        """
        weight = self.columns[:, None] * weight * self.columns
        unit = float(np.max(np.abs(np.diag(weight)), initial=0.0)) or 1.0
        kept = self._kept
        rows, left = (jacobian * self.columns / self.rows[:, None])[kept], (self.columns[:, None] * left / self.rows)[:, kept]
        x, y = KKT(weight / unit, rows, self.kernels, left).solve(self.columns * force / unit, (gap / self.rows)[kept])
        push = np.zeros(len(kept))
        push[kept] = y
        return self.columns * x, unit * push / self.rows

    def closure(self, q: np.ndarray, end: float) -> np.ndarray:
        """Φ at the end of a step; of a rolling condition, which is none of positions, its integral by the midpoint rule."""
        value = self.kernels.phi(q, end, self.p)
        if len(self.kernels.holonomic) < self.kernels.m:
            half, at = (self.t + end) / 2, (self.q + q) / 2
            rolled = self.kernels.jacobian(at, half, self.p) @ (q - self.q) - (end - self.t) * self.kernels.nu(at, half, self.p)
            value = value + np.where(self._rolling, rolled, 0.0)
        return value

    def closure_slope(self, q: np.ndarray, end: float) -> np.ndarray:
        """∂(closure)/∂q: Φ_q at the end, for rolling conditions that in the middle."""
        rows = self.kernels.jacobian(q, end, self.p)
        if len(self.kernels.holonomic) < self.kernels.m:
            halfway = self.kernels.jacobian((self.q + q) / 2, (self.t + end) / 2, self.p)
            rows[self._rolling] = halfway[self._rolling]
        return rows

    @property
    def _rolling(self) -> np.ndarray:
        return ~np.isin(np.arange(self.kernels.m), self.kernels.holonomic)

    def tangents(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, lam: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping at a state, dense."""
        stiffness = self.kernels.stiffness(q, qd, qdd, lam, t, self.p)
        return stiffness.toarray(), self.kernels.damping(q, qd, t, self.p).toarray()

    def iterate(self, correct: Callable[[], float]) -> None:
        """Call `correct()`, which makes a Newton step and returns its size, until the steps are rounding."""
        last = np.inf
        for _ in range(LIMIT):
            try:
                size = correct()
            except SingularError:
                size = np.nan  # the start had inertia; far from a solution anything may happen
            self.newton += 1
            if size <= ENOUGH:
                return
            if size < 1e4 * ENOUGH and size > last / 4:
                return  # rounding: Newton's steps no longer fall
            if not np.isfinite(size):
                break
            last = size
        raise ConvergenceError(unsolved_step(self.kernels.name, self.t, self.h))

    def relative(self, dq: np.ndarray) -> float:
        """The largest entry of a change of position, in natural sizes."""
        return float(np.max(np.abs(dq) / self.columns, initial=0.0))

    def add_work(self, end: float, q: np.ndarray, qd: np.ndarray) -> None:
        """Work over a step by the trapezoidal rule, from powers at its ends: a step's own multipliers are means over it."""
        before, self.power = self.power, self._instant(end, q, qd).power
        self.work += (end - self.t) / 2 * (before + self.power)

    def _instant(self, t: float, q: np.ndarray, qd: np.ndarray) -> Motion:
        return accelerations_by("lagrange").motion(self.kernels, q, qd, t, self.p, {})
