"""Implicit methods as nothing but their equations: one Newton for all of them on `ncgen.program.motions.step_equations`.

What the C runtime steps is compared with this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import functions
from ncgen.methods.newmark import newmark
from ncgen.program.ir.derivatives import gradient
from ncgen.program.lines import line
from ncgen.program.motions.step_equations import INPUTS, INSTANTS, METHODS, MIN_STEP, StepLayout, _Step, extra
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.positions.rank import best_rows, freedom_at, scaled_jacobian


@dataclass(frozen=True, eq=False)
class Motion:
    """Rows at the ends of steps, the start first: t (K,), q (K, n), qd (K, n)."""

    kernels: Kernels
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray


class Equations:
    """F, G and ∂F/∂u of one method."""

    def __init__(self, kernels: Kernels, method: str) -> None:
        step = _Step(kernels.programs)
        (F, G), graph = METHODS[method](step), step.graph
        self.layout = StepLayout.of(method, step.n, step.m)
        unknowns = {graph.load("u", i): i for i in range(self.layout.unknowns)}
        entries = [(row, unknowns[v], slope) for row, f in enumerate(F) for v, slope in gradient(graph, f.number, unknowns).items()]
        self.places = np.array([entry[:2] for entry in entries]).T
        outputs = [*(f.number for f in F), *(g.number for g in G), *(entry[2] for entry in entries)]
        program = line(graph, "step", INPUTS, outputs, kernels.programs.equations)
        counts = {"h": 1 + extra(method, kernels.n), "x": self.layout.state, "u": self.layout.unknowns, "p": len(kernels.p0)}
        counts["w"] = len(INSTANTS) * len(kernels.inputs)
        kind, self.ends = f"newton_{method.replace('-', '_')}", np.cumsum([len(F), len(G)])
        self._call = functions(kernels, kind, {"step": INPUTS}, {"step": len(outputs)}, counts, lambda: {"step": program})
        self.rank = freedom_at(kernels, kernels.q0, 0.0, kernels.p0).rank
        self.kernels, self.p = kernels, kernels.p0
        self.w = np.tile(self.p[len(self.p) - len(kernels.inputs) :], len(INSTANTS))

    def parts(self, t: float, h: np.ndarray, x: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
        return np.split(self._call("step", t, h, x, u, self.w, self.p), self.ends)

    def solve(self, t: float, h: np.ndarray, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """G, and the u that it is of; multipliers of redundant rows are 0."""
        n, last, own = self.kernels.n, np.inf, np.flatnonzero(self._own(t, x))
        u = np.where(np.isin(np.arange(len(u)), own), u, 0.0)
        for _ in range(30):
            F, _, slopes = self.parts(t, h, x, u)
            matrix = np.zeros((len(F), len(u)))
            matrix[tuple(self.places)] = slopes
            matrix = matrix[np.ix_(own, own)]
            size = np.max(np.abs(matrix), axis=1, initial=1e-300)
            scale = np.max(np.abs(matrix / size[:, None]), axis=0, initial=1e-300)
            change = np.linalg.solve(matrix / size[:, None] / scale, -F[own] / size) / scale
            u[own] += change
            moved = float(np.max(np.abs(change[:n]), initial=0.0) / np.max(np.abs(u[:n]), initial=1e-300))
            if moved < 1e-15 or (moved < 1e-7 and moved > last / 4):  # the rest is rounding
                return self.parts(t, h, x, u)[1], u
            last = moved
        raise AssertionError(f"Newton's method does not converge at {t} s: {moved:.1e}")

    def _own(self, t: float, x: np.ndarray) -> np.ndarray:
        """A mask of the unknowns, and of the equations, but for those of redundant rows."""
        own, q = np.ones(self.layout.unknowns, dtype=bool), x[: self.kernels.n]
        if self.rank < self.kernels.m:
            kept = best_rows(scaled_jacobian(self.kernels, q, t, self.p), self.rank)
            for first, count in self.layout.multipliers:
                own[first : first + count] = np.isin(np.arange(count), kept)
        return own


def motion(kernels, integrator, q, qd, step, count, formalism="lagrange", options=None):
    """The motion over so many equal steps (s) from consistent q and q̇ at t = 0."""
    n, m, options = kernels.n, kernels.m, options or {}
    x, start = np.concatenate([q, qd]), Equations(kernels, "start")
    first, u = start.solve(0.0, np.zeros(1), x, np.zeros(n + m))
    qdd, lam, rows = first[2 * n : 3 * n], u[n:], [x]
    if formalism == "ali3p":
        integrator, weights = "generalized-alpha", [0.0, 0.0, 0.25, 0.5]
    elif integrator == "generalized-alpha":
        weights = newmark(options.get("rho", 0.8), options.get("hht"))
    equations, state = Equations(kernels, integrator), first if integrator == "generalized-alpha" else x
    for k in range(count):
        t, rates = k * step, state[n : 2 * n]
        guess, h = np.concatenate([qdd, lam]), np.array([step])
        if integrator == "generalized-alpha":
            h = np.array([step, *weights])
        elif integrator == "rattle":
            guess = np.concatenate([rates + step / 2 * qdd, lam, rates + step * qdd, lam])
        else:
            guess = np.concatenate([rates + step * qdd, lam, rates + step * qdd, np.zeros(2 * m + 1)])
            moved = np.linalg.norm(step * (rates + step / 2 * qdd) / kernels.column_sizes)  # a step that stands still has no direction
            h = np.array([step, float(moved > MIN_STEP), float(options.get("project_velocities", False)), *kernels.column_sizes])
        state, u = equations.solve(t, h, state, guess)
        if integrator == "generalized-alpha":
            qdd, lam = u[:n], u[n : n + m]
        if formalism == "ali3p":
            state = _projected(kernels, t + step, step, state[:n], state[n : 2 * n], qdd, lam)
            qdd = state[2 * n : 3 * n]
        rows.append(state[: 2 * n])
    found = np.array(rows)
    return Motion(kernels, step * np.arange(count + 1), found[:, :n], found[:, n:])


def trapezoidal_residual(run):
    """What the rows of a run with a step from each to the next are off y₁ = y₀ + h/2 (ẏ₀ + ẏ₁) by, in natural sizes and relative to the
    largest velocity; accelerations are those of its formalism in Python."""
    kernels, h, options = run.kernels, np.diff(run.t)[:, None], run.options
    own, qdd = np.arange(kernels.n), run.qdd
    if run.partitions is not None:
        own = run.partitions.velocity.independent
    else:
        by = accelerations_by(run.formalism)
        qdd = np.array([by.motion(kernels, q, qd, t, run.p, options, None).qdd for t, q, qd in zip(run.t, run.q, run.qd, strict=True)])
    q, qd, qdd, sizes = run.q[:, own], run.qd[:, own], qdd[:, own], kernels.column_sizes[own]
    off = [np.abs(np.diff(y, axis=0) - h / 2 * (slope[1:] + slope[:-1])) / sizes for y, slope in ((q, qd), (qd, qdd))]
    return np.max(off[0]), np.max(off[1]) / np.max(np.abs(qd) / sizes)


def _projected(kernels, t, h, q, qd, qdd, lam):
    """[q, q̇, q̈, q̈] with velocities and accelerations on the constraints, the nearest in the metric M + h/2 C + h²/4 K (Bayo, Ledesma)."""
    stiffness, damping = kernels.stiffness(q, qd, qdd, lam, t).toarray(), kernels.damping(q, qd, t).toarray()
    metric = kernels.mass_matrix(q, t) + h / 2 * damping + h**2 / 4 * stiffness
    rows = kernels.jacobian(q, t)
    matrix = np.block([[metric, rows.T], [rows, np.zeros((kernels.m, kernels.m))]])

    def onto(x, right):
        gap = np.concatenate([np.zeros(len(x)), right - rows @ x])
        return x + np.linalg.lstsq(matrix, gap, rcond=1e-13)[0][: len(x)]

    qd = onto(qd, kernels.nu(q, t))
    qdd = onto(qdd, kernels.gamma(q, qd, t))
    return np.concatenate([q, qd, qdd, qdd])
