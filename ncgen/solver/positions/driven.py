"""Positions of a mechanism whose drivers leave it no freedom, over time, and how they change with its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, DeadCentreError, ModelError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import ArrayOrNamed, checked_kernels
from ncgen.solver.groups import StartArguments, takes
from ncgen.solver.positions.dead_centres import approached, is_dead_centre
from ncgen.solver.positions.position import EASY, TOLERANCE, check_finite, check_mirror_roots, solve_position
from ncgen.solver.positions.rank import freedom_at

HALVINGS = 10
"""How often the way from one instant to the next is cut in half where it does not close at once."""

ROUNDING = 1e-13
"""A step of Newton's method, in natural sizes of the coordinates, after which a position is as near as it can be."""

REGULAR = 1e-11
"""Smallest reciprocal condition of the rows, in their natural sizes, with which derivatives have a digit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenPositions:
    """t (K,) in s, p (n_p,), q (K, n) in m and rad; rows: those that determine q, as many as there are coordinates."""

    kernels: Kernels
    t: np.ndarray
    p: np.ndarray
    q: np.ndarray
    rows: tuple[int, ...]

    def __repr__(self) -> str:
        return f"<DrivenPositions of {self.kernels.name}: {len(self.t)} instants>"

    @cached_property
    def q_by(self) -> np.ndarray:
        """∂q/∂p (K, n, n_p): Φ(q(p), t, p) = 0 stays so, hence Φ_q dq = −Φ_p dp.

        Raises SingularError naming the instant at which the position is singular: there is no derivative.
        """
        kernels, rows = self.kernels, list(self.rows)
        if not len(self.t):
            return np.empty((0, kernels.n, len(self.p)))
        states = list(zip(self.q, self.t.tolist(), strict=True))
        by_q = np.array([kernels.jacobian(q, t, self.p) for q, t in states])[:, rows]
        by_p = np.array([kernels.dense_tangent("phi_p", q=q, t=t, p=self.p) for q, t in states])[:, rows]
        amplified = np.linalg.cond(by_q / kernels.row_sizes[rows, None], 1)
        for k in np.flatnonzero(~(amplified < 1 / REGULAR))[:1]:
            at = f"the position at t = {self.t[k]:g} s"
            raise SingularError(f"{kernels.name}: {at} is singular and has no derivative; leave that instant out")
        return -np.linalg.solve(by_q, by_p)

    def foreseen(self, p: ArrayOrNamed) -> np.ndarray:
        """The positions with other parameters to first order, (K, n): what those are near, as far as derivatives tell.

        p: numbers (n_p,) or {name: number}. Raises ModelError for what is not one, and as `q_by` does.
        """
        return self.q + self.q_by @ (argument_checks.parameters(self.kernels, p) - self.p)


@takes(StartArguments, unused=("zd0", "qd0", "z", "t0", "closing"), former={"near": "q0"})
def driven_positions(kernels: Kernels, t: ArrayLike, **arguments: Unpack[StartArguments]) -> DrivenPositions:
    """Compute the positions over time of a mechanism without free degrees of freedom, with exact derivatives by its parameters.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    t : array_like, shape (K,)
        Times in s.
    **arguments : StartArguments
        `p`, `inputs` as numbers, and in `q0` a position near that at the first time; each position is found from the one before. With
        rows (K, n) in `q0` each position is found from its row.

    Returns
    -------
    DrivenPositions
        Positions, and their derivatives on demand.

    Raises
    ------
    ModelError
        Where drivers leave a degree of freedom, or constraints are not on positions.
    SingularError
        Where the first position is singular.
    ConvergenceError, DeadCentreError
        Where the mechanism cannot move on, or its drivers bring it to a dead centre; `positions` of the error are those found so far and
        the one at which it stopped.
    """
    near, p = arguments.get("q0"), arguments.get("p")
    checked_kernels(kernels)
    t, p = argument_checks.several(t, "t"), argument_checks.parameters(kernels, p)
    from ncgen.solver.runs.signals import signals_of

    if signals_of(kernels, arguments.get("inputs"), p):
        raise ModelError("inputs: driven_positions needs numbers; let a driver's law depend on the time instead")
    if len(kernels.holonomic) < kernels.m:
        raise ModelError(f"{kernels.name}: what rolls has positions that depend on its way, not on the time alone; take ncgen.simulate")
    given_near = None if near is None or isinstance(near, Mapping) else argument_checks.numbers_of(near, "q0")
    rows = None if given_near is None or given_near.ndim < 2 else given_near
    if rows is not None and rows.shape != (len(t), kernels.n):
        raise ModelError(f"{kernels.name}: q0 has shape {rows.shape}; it must be ({kernels.n},) or ({len(t)}, {kernels.n})")
    if not len(t):
        return DrivenPositions(kernels=kernels, t=t, p=p, q=np.empty((0, kernels.n)), rows=())
    motion = _Followed(kernels, p, tuple(range(kernels.m)) if kernels.m == kernels.n else ())
    q = [motion.begun(argument_checks.position(kernels, near if rows is None else rows[0], p, "q0"), float(t[0]))]
    if rows is None:
        for before, now in pairwise(t.tolist()):
            try:
                q.append(motion.from_one_to_next(q[-1], before, now))
            except ConvergenceError as error:
                q.append(motion.reached(q, before, now, error))
    else:
        q += motion.from_near(rows[1:], t[1:].tolist())
    return DrivenPositions(kernels=kernels, t=t, p=p, q=np.array(q), rows=motion.rows)


@dataclass
class _Followed:
    """Positions that rows determine, as many as there are coordinates; () where it is not known yet which."""

    kernels: Kernels
    p: np.ndarray
    rows: tuple[int, ...]

    def begun(self, q: np.ndarray, t: float) -> np.ndarray:
        """The first position, from one near it. Raises ModelError and SingularError where rows do not determine it."""
        if self.rows:
            with suppress(ConvergenceError):
                return self.closed(q, t)
        kernels = self.kernels
        q = solve_position(kernels, q, t, self.p).q
        free = freedom_at(kernels, q, t, self.p)
        if free.dof:
            kind = "freedom is" if free.dof == 1 else "freedoms are"
            raise ModelError(f"{kernels.name}: {free.dof} {kind} not driven, so the time alone leaves positions open; add m.drive for each")
        if free.is_singular:
            raise SingularError(f"{kernels.name}: the position at t = {t:g} s is singular; begin at another")
        self.rows = free.kept_rows
        return self.closed(q, t)

    def closed(self, q: np.ndarray, t: float) -> np.ndarray:
        """The position near another, to rounding. Raises ConvergenceError where Newton's method takes many steps, or finds an angle's other
        root, DomainError naming a row that is not a number."""
        q = self._root(q, t)
        check_mirror_roots(self.kernels, q, self.p)
        return q

    def _root(self, q: np.ndarray, t: float) -> np.ndarray:
        """As `closed`, where angles may be found at their other roots."""
        kernels, rows = self.kernels, slice(None) if len(self.rows) == self.kernels.m else list(self.rows)
        near, still = TOLERANCE * kernels.row_sizes[rows], ROUNDING * kernels.column_sizes
        for _ in range(EASY):
            try:
                value = kernels.phi(q, t, self.p)[rows]
                step = np.linalg.solve(kernels.jacobian(q, t, self.p)[rows], value)
            except np.linalg.LinAlgError:
                break
            q = q - step
            if (np.abs(value) <= near).all() or (np.abs(step) <= still).all():  # beside a singular position steps do not become so small
                return q
        check_finite(kernels, q, t, self.p)
        raise ConvergenceError(f"{kernels.name}: the position at t = {t:g} s does not close in {EASY} steps; give a position near it")

    def from_near(self, rows: np.ndarray, t: list[float]) -> list[np.ndarray]:
        """Positions at some instants, each near another that may be some way off."""
        with suppress(ConvergenceError):
            positions = [self._root(q, now) for q, now in zip(rows, t, strict=True)]
            check_mirror_roots(self.kernels, np.array(positions).reshape(rows.shape), self.p)
            return positions
        return [self._from_afar(q, now) for q, now in zip(rows, t, strict=True)]

    def _from_afar(self, q: np.ndarray, t: float) -> np.ndarray:
        with suppress(ConvergenceError):
            return self.closed(q, t)
        return self.closed(solve_position(self.kernels, q, t, self.p).q, t)

    def reached(self, path: list[np.ndarray], before: float, now: float, error: ConvergenceError) -> np.ndarray:
        """The position at a time (s) that ordinary steps from the last one of `path` do not reach. Raises ConvergenceError with all of them
        where there is none."""
        q, t = approached(self.closed, path[-1], before, now)
        if t == now:
            return q
        raise self._stopped([*path, q], t, now, error) from error

    def _stopped(self, path: list[np.ndarray], t: float, now: float, error: ConvergenceError) -> ConvergenceError:
        """The error of a motion to the time `now` (s) that ends at the last position of `path`, at the time t."""
        kernels, q = self.kernels, path[-1]
        rows = [(i, row.owner.name) for i, row in enumerate(kernels.rows) if row.owner.kind == "driver"]
        wanted = kernels.phi(q, now, self.p)
        drivers = [(name, q[kernels.index[name]], q[kernels.index[name]] - wanted[i]) for i, name in rows if name in kernels.index]
        targets = ", ".join(f"{name} = {value:.9g}" for name, _, value in drivers)
        reached = ", ".join(f"{name} = {value:.9g}" for name, value, _ in drivers)
        positions = np.array(path)
        if is_dead_centre(kernels, q, t, self.p, np.arange(kernels.n)):
            message = f"{kernels.name}: {targets} at t = {now:.9g} s is beyond a dead centre at {reached}, t = {t:.9g} s"
            return DeadCentreError(f"{message}; the positions up to there are `positions` of the error", error.history, positions)
        return ConvergenceError(f"{kernels.name}: the motion to t = {now:.9g} s ends at t = {t:.9g} s, {reached}; {error}", (), positions)

    def from_one_to_next(self, q: np.ndarray, before: float, now: float, halvings: int = HALVINGS) -> np.ndarray:
        """The position at an instant from that at another; in parts where it does not close at once, so that it stays on its branch."""
        try:
            return self.closed(q, now)
        except ConvergenceError:
            if not halvings:
                raise
        middle = (before + now) / 2
        q = self.from_one_to_next(q, before, middle, halvings - 1)
        return self.from_one_to_next(q, middle, now, halvings - 1)
