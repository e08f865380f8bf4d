"""A motion by an implicit method that steps the constrained equations, with its derivatives: each step by the implicit function theorem.

A step from x solves F(u, x, p) = 0 and ends in G(u, x, p) (`ncgen.program.motions.step_equations`), so

    du = −F_u⁻¹ (F_x dx + F_p dp)          dx' = G_u du + G_x dx

with the exact F_u, whatever Newton's method took in its place. The steps are those of `simulate`; what they solved for is found again by
one Newton step from their ends, which leaves rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving_breaks import Jump
from ncgen.mechanism.program_functions import ProgramFunctions, functions
from ncgen.mechanism.taped import Driven
from ncgen.methods.method import Method
from ncgen.methods.newmark import newmark
from ncgen.program.motions.step_equations import INPUTS, INSTANTS, MIN_STEP, StepEquations, assemble_step, extra
from ncgen.solver.argument_checks import refuse_callbacks
from ncgen.solver.derivatives.jumps import Jumps, Stepping
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.formalisms.dynamics_jacobian import rate_slope
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import determined
from ncgen.solver.positions.rank import REMEMBERED
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import Signals
from ncgen.solver.runs.start import begin

SOLVED = 1e-7
"""A Newton step from the ends of a step of a run moves nothing by more than this, in natural sizes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Linear:
    """[F; G] by [u, x, w, p] in a step, for the rows that are kept."""

    F: np.ndarray
    F_u: np.ndarray
    F_rest: np.ndarray
    G_u: np.ndarray
    G_rest: np.ndarray

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """F_u⁻¹ right, or with the transpose; rows of any units."""
        sizes = np.max(np.abs(self.F_u), axis=1, keepdims=True, initial=np.finfo(float).tiny)
        scaled = self.F_u / sizes
        if transposed:
            return np.linalg.solve(scaled.T, right) / sizes[:, 0]
        return np.linalg.solve(scaled, right / (sizes if right.ndim > 1 else sizes[:, 0]))

    def forward(self, change: np.ndarray) -> np.ndarray:
        """Changes of G, (x, D), with those of [x, w, p], (rest, D)."""
        return self.G_rest @ change - self.G_u @ self.solve(self.F_rest @ change)

    def backward(self, weights: np.ndarray) -> np.ndarray:
        """How Σ weights G changes with [x, w, p]."""
        return self.G_rest.T @ weights - self.F_rest.T @ self.solve(self.G_u.T @ weights, transposed=True)


class _Equations:
    """Those of the steps of one method, ready to be called, for the rows that are kept.

    own: which unknowns, and which of the equations, are left where others are not
    """

    def __init__(self, kernels: Kernels, method: str, kept: np.ndarray) -> None:
        made: StepEquations = kernels.remember("step programs", method, lambda: assemble_step(kernels.programs, method))
        self.layout = layout = made.layout
        inputs, sizes = {"step": INPUTS}, {"step": made.program.size}
        kind = f"{method.replace('-', '_')}_step"
        n_p, instants = len(kernels.p0), len(INSTANTS) * len(kernels.inputs)
        counts = {"h": 1 + extra(method, kernels.n), "x": layout.state, "u": layout.unknowns, "w": instants, "p": n_p}
        self._functions: ProgramFunctions = functions(kernels, kind, inputs, sizes, counts, lambda: {"step": made.program})
        used = np.ones(layout.unknowns, dtype=bool)
        for first, count in layout.multipliers:
            used[first : first + count] = np.isin(np.arange(count), kept)
        self.own = np.flatnonzero(used)
        rows, columns = (np.append(used, np.ones(size - layout.unknowns, dtype=bool)) for size in made.pattern.shape)
        self._shape = int(rows.sum()), int(columns.sum())
        entries = np.divmod(made.pattern.flat, made.pattern.shape[1])
        self._there = np.flatnonzero(rows[entries[0]] & columns[entries[1]]) + layout.unknowns
        row, column = (np.cumsum(some)[at] - 1 for some, at in zip((rows, columns), entries, strict=True))
        self._flat = (row * self._shape[1] + column)[self._there - layout.unknowns]

    def linear(self, t: float, *arrays: np.ndarray) -> _Linear:
        """arrays: h, x, u, w, p"""
        values, count = self._functions("step", t, *arrays), len(self.own)
        dense = np.zeros(self._shape)
        dense.reshape(-1)[self._flat] = values[self._there]
        return _Linear(
            F=values[self.own],
            F_u=dense[:count, :count],
            F_rest=dense[:count, count:],
            G_u=dense[count:, :count],
            G_rest=dense[count:, count:],
        )


class SteppedMotion:
    """A motion over the steps of a grid, which are split at breaks of laws in time; members as of `TapedMotion`.

    t (K,); q, qd (K, n); names: of the columns of derivatives: parameters, z, rate(z)
    """

    def __init__(
        self, kernels: Kernels, initial: Initial, times: np.ndarray, start_follows: bool, run: Stepping, method: Method,
        signals: Signals | None = None,
    ) -> None:  # fmt: skip
        """start_follows: whether the position at the start is the model's own, which may change with parameters; signals: what drives the
        run."""
        refuse_callbacks(kernels)
        begun = begin(kernels, initial, partitioned=True)
        self.kernels, self.p, self._method, self.signals = kernels, begun.p, method, signals
        self.t, self.jumps = times, Jumps.of(kernels, begun.p, begun.q, times, signals)
        self._ends = self.jumps.ends(times)
        steps = run(self._ends.of_steps, self.jumps.rows)
        self._q, self._qd = self._ends.spread(steps.q), self._ends.spread(steps.qd)
        # A table's piece is that of the step's start.
        self._looks_back = len(self.jumps.rows) > 0 or not steps.engine.startswith("python")
        self._partitions, self._follows = determined(begun.partitions), start_follows
        self.names = self._partitions.columns(kernels)

    @property
    def q(self) -> np.ndarray:
        return self._q[self._ends.on_grid]

    @property
    def qd(self) -> np.ndarray:
        return self._qd[self._ends.on_grid]

    # -- steps ---------------------------------------------------------------------------------

    @cached_property
    def _first(self) -> _Equations | None:
        """What a method carries besides q and q̇ at the start, where it does."""
        return self._equations("start") if self._method.integrator.name == "generalized-alpha" else None

    def _equations(self, name: str) -> _Equations:
        kept = self._partitions.velocity.rows
        return self.kernels.remember("step equations", (name, kept.tobytes()), lambda: _Equations(self.kernels, name, kept), REMEMBERED)

    @cached_property
    def _solved(self) -> list[tuple[float, tuple[np.ndarray, ...]] | None]:
        """Of every step the time when it begins, and (h, x, u, w, p); None where a jump is crossed."""
        solved: list[tuple[float, tuple[np.ndarray, ...]] | None] = []
        equations, n, carried = self._equations(self._method.integrator.name), self.kernels.n, np.empty(0)
        for k, t in enumerate(self._ends.t[:-1].tolist()):
            if self._ends.is_crossed[k]:
                solved.append(None)
                continue
            if k in self._begun:
                _, (_, _, u, *_) = self._begun[k]
                carried = np.concatenate([u[:n], u[:n]])
            h, p = self._numbers(k), refresh_branches(self.kernels, self._q[k], self.p)
            x, u = np.concatenate([self._q[k], self._qd[k], carried]), self._guess(k, equations.layout.unknowns, carried)
            solution = self._solved_step(equations, t, h, x, u, self._inputs(k), p)
            solved.append((t, solution))
            if self._first:
                carried = self._carried(h, carried, solution[2][:n])
        return solved

    @cached_property
    def _begun(self) -> dict[int, tuple[float, tuple[np.ndarray, ...]]]:
        """The equations of the accelerations, as of a step, at the start and where laws begin with another formula: what a method carries
        follows from them there. None for methods that carry nothing."""
        if self._first is None:
            return {}
        beginnings = {}
        for k in [0, *(np.flatnonzero(self._ends.begins[1:-1]) + 1).tolist()]:
            x, t, p = np.concatenate([self._q[k], self._qd[k]]), float(self._ends.t[k]), refresh_branches(self.kernels, self._q[k], self.p)
            unknown = np.zeros(self._first.layout.unknowns)
            beginnings[k] = t, self._solved_step(self._first, t, np.zeros(1), x, unknown, self._inputs(k), p)
        return beginnings

    def _solved_step(
        self, equations: _Equations, t: float, h: np.ndarray, x: np.ndarray, u: np.ndarray, w: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """(h, x, u, w, p) with u moved by one Newton step."""
        n, u = self.kernels.n, u.copy()
        linear = equations.linear(t, h, x, u, w, p)
        if explicit := equations.layout.explicit:
            u[-explicit:] -= linear.F[-explicit:]
            linear = equations.linear(t, h, x, u, w, p)
        try:
            change = linear.solve(linear.F)
        except np.linalg.LinAlgError:
            change = np.array([np.nan])
        if h[0] and not np.max(np.abs(change[:n]) / self.kernels.column_sizes, initial=0.0) * self._reach(h[0]) < SOLVED:
            raise ModelError(
                f"{self.kernels.name}: the equations of the step from t = {t:.6g} s are next to a singular position, where derivatives by "
                "what goes before have no correct digits; end the motion before, or start elsewhere"
            )
        u[equations.own] -= change
        return h, x, u, w, p

    def _reach(self, h: float) -> float:
        """How far positions move with what is solved for first: velocities, or accelerations."""
        return h * h if self._first else h

    def _numbers(self, k: int) -> np.ndarray:
        """h of a step."""
        h, sizes, options = self._ends.t[k + 1] - self._ends.t[k], self.kernels.column_sizes, self._method.options
        if self._method.integrator.name == "energy-momentum":
            moved = (self._q[k + 1] - self._q[k]) / sizes
            return np.array([h, float(moved @ moved >= MIN_STEP**2), float(options["project_velocities"]), *sizes])
        return np.array([h, *newmark(options["rho"], options["hht"])]) if self._first else np.array([h])

    def _guess(self, k: int, unknowns: int, carried: np.ndarray) -> np.ndarray:
        """Unknowns of a step but for what its equations are linear in."""
        n, m, name = self.kernels.n, self.kernels.m, self._method.integrator.name
        u, h, q, qd = np.zeros(unknowns), self._ends.t[k + 1] - self._ends.t[k], self._q, self._qd
        moved = q[k + 1] - q[k]
        if name == "generalized-alpha":
            alpha_m, alpha_f, beta, _ = newmark(self._method.options["rho"], self._method.options["hht"])
            before, a = carried[:n], carried[n:]
            new = (moved - h * qd[k] - h**2 * (0.5 - beta) * a) / (h**2 * beta)
            u[:n] = ((1 - alpha_m) * new + alpha_m * a - alpha_f * before) / (1 - alpha_f)
            return u
        u[:n] = moved / h if name == "rattle" else 2 * moved / h - qd[k]
        u[n + m : 2 * n + m] = qd[k + 1]
        return u

    def _carried(self, h: np.ndarray, carried: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """[q̈, a] at the end of a step of generalised α."""
        before, a = np.split(carried, 2)
        alpha_m, alpha_f = h[1:3]
        return np.concatenate([qdd, ((1 - alpha_f) * qdd + alpha_f * before - alpha_m * a) / (1 - alpha_m)])

    def _inputs(self, k: int) -> np.ndarray:
        """At the start, in the middle and at the end of a step."""
        count, instants = len(self.kernels.inputs), zip(*(a[k].tolist() for a in self._instants), strict=True)
        values_of_inputs = [self.signals.begun_at(begun)(t, self.p) if self.signals else self.p for t, begun in instants]
        return np.concatenate([p[len(p) - count :] for p in values_of_inputs])

    @cached_property
    def _instants(self) -> tuple[np.ndarray, np.ndarray]:
        """When inputs are read (steps, 3), and times whose pieces of tables hold there."""
        start, end = self._ends.t[:-1], self._ends.t[1:]
        t = np.column_stack([start, (start + end) / 2, end])
        return t, np.broadcast_to(start[:, None], t.shape) if self._looks_back else t

    # -- derivatives ---------------------------------------------------------------------------

    @cached_property
    def _jumps(self) -> Mapping[int, Jump]:
        """Jumps that parameters move, by the number of what stands in the place of a step there."""
        return self.jumps(self._ends.t, self._q, self._qd) if self.jumps.breaks.moved else {}

    def _linear(self, k: int) -> _Linear | None:
        """What a step changes with; None where a jump is crossed."""
        step = self._solved[k]
        return None if step is None else self._equations(self._method.integrator.name).linear(step[0], *step[1])

    def _before(self, k: int) -> _Linear | None:
        """The same of what a method carries from here on, where it begins anew."""
        return self._first.linear(self._begun[k][0], *self._begun[k][1]) if self._first and k in self._begun else None

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all instants, (K, n, D) each, along directions, (columns, D)."""
        n, inputs, jumps = self.kernels.n, len(self.kernels.inputs), self._jumps
        self.jumps.check_along(directions)
        change, dp = np.vstack(self._start) @ directions, directions[: len(self.p)]
        fixed = np.vstack([np.tile(dp[len(self.p) - inputs :], (len(INSTANTS), 1)), dp])
        changes_by_step = [change[: 2 * n]]
        for k in range(len(self._ends.t) - 1):
            if before := self._before(k):
                change = before.forward(np.vstack([change[: 2 * n], fixed]))
            if k in jumps:
                change = change + np.pad(jumps[k].along(dp), ((n, len(change) - 2 * n), (0, 0)))
            if linear := self._linear(k):
                change = linear.forward(np.vstack([change, fixed]))
            changes_by_step.append(change[: 2 * n])
        both = np.array(changes_by_step)[self._ends.on_grid]
        return both[:, :n], both[:, n:]

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray, by: Iterable[str] | None = None) -> tuple[np.ndarray, Driven]:
        """As of `TapedMotion`."""
        count, n, inputs = len(self._ends.t) - 1, self.kernels.n, len(self.kernels.inputs)
        weights_at_steps = np.zeros((count + 1, 2 * n))
        weights_at_steps[self._ends.on_grid] = np.hstack([by_q, by_qd])
        weights, by_p = np.zeros(4 * n if self._first else 2 * n), np.zeros(len(self.p))
        driven = np.zeros((count, len(INSTANTS), inputs))
        weights[: 2 * n] += weights_at_steps[-1]
        for k in reversed(range(count)):
            if linear := self._linear(k):
                weights, felt, more = _parted(linear.backward(weights), driven.shape[1:], len(by_p))
                driven[k], by_p = felt, by_p + more
            if k in self._jumps:
                by_p = by_p + self._jumps[k].felt(weights[n : 2 * n])
            if before := self._before(k):
                weights, felt, more = _parted(before.backward(weights), driven.shape[1:], len(by_p))
                driven[k], by_p = driven[k] + felt, by_p + more
                weights = np.pad(weights, (0, 2 * n if k else 0))
            weights[: 2 * n] += weights_at_steps[k]
        self.jumps.check(by)
        by_p[len(by_p) - inputs :] += driven.sum(axis=(0, 1))
        gradient = np.vstack(self._start).T @ weights
        gradient[: len(by_p)] += by_p
        return gradient, Driven(*self._instants, driven)

    @cached_property
    def _start(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of q and q̇ at the start, (n, columns) each."""
        kernels, t, q, qd, p = self.kernels, float(self._ends.t[0]), self._q[0], self._qd[0], self.p
        position, rate = (kinematics(kernels, partition, q, t, p) for partition in (self._partitions.position, self._partitions.velocity))
        count, nz = len(p), position.R.shape[1]
        arguments = {"t": t, "q": q, "qd": qd, "p": p}
        dz = np.eye(nz, len(self.names), count)
        if self._follows:
            dz[:, :count] = kernels.start_p(p)[self._partitions.position.independent]
        q_by = position.R @ dz
        q_by[:, :count] -= _columns(position.particular, kernels.dense_tangent("phi_p", **arguments), kernels.n)
        now = motion_at(kernels, self._partitions.velocity, t, q, qd[self._partitions.velocity.independent], p)
        off = rate_slope(kernels, now, p) @ q_by
        off[:, :count] += kernels.dense_tangent("phid_p", **arguments)
        qd_by = rate.R @ np.eye(rate.R.shape[1], len(self.names), count + nz) - _columns(rate.particular, off, kernels.n)
        return q_by, qd_by


def _parted(derivatives: np.ndarray, driven: tuple[int, ...], parameters: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes by a state, by inputs at all instants of a step and by parameters."""
    size = int(np.prod(driven))
    state, inputs, by_p = np.split(derivatives, [len(derivatives) - parameters - size, len(derivatives) - parameters])
    return state, inputs.reshape(driven), by_p


def _columns(solve: Callable[[np.ndarray], np.ndarray], right: np.ndarray, rows: int) -> np.ndarray:
    return np.array([solve(column) for column in right.T]).reshape(-1, rows).T
