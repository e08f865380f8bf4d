"""Simulations of many initial states or parameter sets of one mechanism, several side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.solver.assembly import assemble
from ncgen.solver.compiled import GROWTH, emission, refusal
from ncgen.solver.integrators import canonical_name
from ncgen.solver.partition import choose_partitions
from ncgen.solver.position import TOLERANCE
from ncgen.solver.protocol import Kernels
from ncgen.solver.simulate import simulate


@dataclass(frozen=True)
class BatchTrajectory:
    """The motions of B states.

    t (points,): the time grid (s); q, qd (B, points, n); work (B, points): J, of drivers and forces without a potential
    independent: names of the independent coordinates
    status (B,): "ok", or why a state did not arrive; its rows from there on are NaN
    alone (B,): states whose independent coordinates became bad, so that they were simulated one at a time
    """

    kernels: Kernels
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    independent: tuple[str, ...]
    status: tuple[str, ...]
    steps: np.ndarray
    alone: np.ndarray

    @property
    def ok(self) -> np.ndarray:
        """Which states arrived, (B,)."""
        return np.array([s == "ok" for s in self.status])


@dataclass(frozen=True)
class BatchAccelerations:
    """What B states of a mechanism do: q, qd (B, n), q closed; zdd (B, nz): accelerations of the independent coordinates.

    independent: their names; ok (B,): False where a position does not close or the mechanism is singular, and rows are NaN
    """

    q: np.ndarray
    qd: np.ndarray
    zdd: np.ndarray
    independent: tuple[str, ...]
    ok: np.ndarray


def accelerations_batch(
    kernels: Kernels, q, zd, *, p=None, t: float = 0.0, z=None, threads: int | None = 1, out: BatchAccelerations | None = None
) -> BatchAccelerations:
    """The state derivative of many states at a time, for an integrator, an optimiser or a sampler of one's own.

    q: (B, n), nearly closed: the dependent coordinates are brought onto the constraints by Newton's method; zd: (B, nz), in
    the order of z; p: (B, n_p) or (n_p,); z: names of the independent coordinates, chosen at the first state if not given
    threads: None for one on every processor that this process may use; out: results of before, whose arrays are filled
    again, which saves the time that the system needs to give new ones
    Raises ModelError as `simulate_batch` does.
    """
    states = _States.of(kernels, q, zd, p, t, z, "dopri5")
    if out is not None and (out.q.shape, out.zdd.shape) != (states.q.shape, states.zd.shape):
        raise ModelError(f"{kernels.name}: out has results of {len(out.q)} states; {len(states.q)} are needed, or leave it out")
    arrays = None if out is None else (out.q, out.qd, out.zdd)
    q, qd, zdd, ok = states.lanes.accelerate(t, states.q, states.zd, states.p, threads, arrays, tolerance=TOLERANCE)
    return BatchAccelerations(q, qd, zdd, states.names, ok)


@dataclass(frozen=True)
class _States:
    """States of one choice of independent coordinates, and its state derivative in lanes."""

    lanes: object
    q: np.ndarray
    zd: np.ndarray
    p: np.ndarray
    names: tuple[str, ...]

    @classmethod
    def of(cls, kernels: Kernels, q, zd, p, t: float, z, method: str, assembled: bool = False) -> _States:
        """From rows, or one row for all. Raises ModelError where shapes do not fit or lanes cannot do it."""
        q, zd, p = (None if a is None else np.asarray(a, dtype=float) for a in (q, zd, p))
        q, p = kernels.q0 if q is None else q, kernels.p0 if p is None else p
        counts = {len(a) for a in (q, zd, p) if a is not None and a.ndim == 2}
        if len(counts) != 1:
            raise ModelError(f"{kernels.name}: q0, zd0 and p have {sorted(counts) or 'no'} rows; a batch has one number of them")
        (count,) = counts
        if not count:
            raise ModelError(f"{kernels.name}: a batch of no states; give at least one row")
        q = _rows(kernels, "q0", q, count, kernels.n)
        if assembled:
            q = _closed(kernels, q, t, p)
        p = _rows(kernels, "p", p, count, len(kernels.p0))
        partitions = choose_partitions(kernels, q[0], t, p[0], tuple(z or kernels.model.chosen_independent))
        if refused := _refusal(kernels, method, partitions):
            raise ModelError(f"{kernels.name} cannot be simulated in a batch: {refused}; use simulate for every state")
        names = partitions.velocity.names(kernels)
        zd = _rows(kernels, "zd0", np.zeros(len(names)) if zd is None else zd, count, len(names))
        return cls(emission(kernels, partitions, "lanes", q[0], p[0]), q, zd, p, tuple(names))


def simulate_batch(
    kernels: Kernels,
    duration: float,
    *,
    q0=None,
    zd0=None,
    p=None,
    t0: float = 0.0,
    z=None,
    integrator: str = "dopri5",
    rtol: float = 1e-8,
    atol: float = 1e-10,
    max_step: float = np.inf,
    points: int = 2,
    threads: int | None = None,
) -> BatchTrajectory:
    """Simulate a mechanism from many states, with many parameter sets, or both.

    q0: (B, n) or (n,) for all, assembled where open; zd0: (B, nz) or (nz,), in the order of z; p: (B, n_p) or (n_p,)
    integrator: dopri5 (each state with its own steps) or rk4 (fixed step max_step)
    threads: None for one on every processor that this process may use
    Everything else as in `simulate`, of which each state is one run with coordinate partitioning. The independent
    coordinates are chosen at the first state; where they become bad, that state is simulated by `simulate`.
    Raises ModelError where the mechanism cannot be simulated so, or shapes do not fit.
    """
    method = canonical_name(integrator)
    if not (np.isfinite(duration) and duration > 0 and points >= 2):
        raise ModelError(f"{kernels.name}: duration {duration} s, {points} points; the first must be positive, points at least 2")
    states = _States.of(kernels, q0, zd0, p, t0, z, method, assembled=True)
    grid = np.linspace(t0, t0 + duration, points)
    done = states.lanes.simulate(
        method, grid, states.q, states.zd, states.p, threads, tolerance=TOLERANCE, growth=GROWTH, rtol=rtol, atol=atol,
        max_step=0.0 if np.isinf(max_step) else max_step,
    )  # fmt: skip
    alone = np.array([s != "ok" for s in done.status])
    options = {"z": states.names, "t0": t0, "points": points, "integrator": integrator, "rtol": rtol, "atol": atol, "max_step": max_step}
    for i in np.flatnonzero(alone):
        try:
            run = simulate(kernels, duration, q0=states.q[i], zd0=states.zd[i], p=states.p[i], **options)
        except NcgenError as error:
            done.status[i] = str(error)
            continue
        done.q[i], done.qd[i], done.work[i], done.status[i], done.steps[i] = run.q, run.qd, run.work, "ok", run.statistics.steps
    return BatchTrajectory(kernels, grid, done.q, done.qd, done.work, states.names, tuple(done.status), done.steps, alone)


def _refusal(kernels: Kernels, method: str, partitions) -> str | None:
    from ncgen.build.batch_runs import METHODS_IN_LANES

    if method not in METHODS_IN_LANES:
        return f"{method} is not among {', '.join(METHODS_IN_LANES)}"
    return refusal(kernels, method, partitions, emitted=True)


def _rows(kernels: Kernels, name: str, array: np.ndarray, count: int, size: int) -> np.ndarray:
    if array.shape not in ((size,), (count, size)) or not np.all(np.isfinite(array)):
        raise ModelError(f"{kernels.name}: {name} has shape {array.shape}; {(size,)} or {(count, size)} finite numbers are needed")
    return np.ascontiguousarray(np.broadcast_to(array, (count, size)))


def _closed(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """Positions that close: those that do not are assembled, one after the other."""
    open_ = np.max(np.abs(kernels.batch.phi(q, t, p) / kernels.row_sizes)[:, kernels.holonomic], axis=1, initial=0.0) > TOLERANCE
    q = q.copy()
    found = {}
    for i in np.flatnonzero(open_):
        own = p[i] if p.ndim == 2 else p
        key = q[i].tobytes() + own.tobytes()
        if key not in found:
            found[key] = assemble(kernels, q[i], t, own)
        q[i] = found[key]
    return q
