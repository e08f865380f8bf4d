"""Simulations of many initial states or parameter sets of one mechanism, several side by side."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.solver.assembly import assemble
from ncgen.solver.compiled import GROWTH, dynamics, refusal
from ncgen.solver.integrators import canonical_name
from ncgen.solver.partition import choose_partitions
from ncgen.solver.position import TOLERANCE
from ncgen.solver.protocol import Kernels
from ncgen.solver.simulate import simulate


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class BatchAccelerations:
    """What B states of a mechanism do: q (B, n), closed; zdd (B, nz): accelerations of the independent coordinates.

    qd (B, n): all velocities, None if they were not asked for; independent: names of the independent coordinates
    ok (B,): False where a position does not close, the mechanism is singular or a number is not finite; rows are NaN there
    """

    q: np.ndarray
    qd: np.ndarray | None
    zdd: np.ndarray
    ok: np.ndarray
    choice: _Choice = field(repr=False)

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return self.choice.names


@dataclass(frozen=True)
class _Choice:
    """Names of the independent coordinates, and the state derivative for them in lanes."""

    names: tuple[str, ...]
    lanes: object

    @classmethod
    def at(cls, kernels: Kernels, q, t: float, p, z, method: str) -> _Choice:
        """A choice that is good at one position. Raises ModelError where lanes cannot do it."""
        partitions = choose_partitions(kernels, q, t, p, tuple(z or kernels.model.chosen_independent))
        if refused := _refusal(kernels, method, partitions):
            raise ModelError(f"{kernels.name} cannot be simulated in a batch: {refused}; use simulate for every state")
        return cls(partitions.velocity.names(kernels), dynamics(kernels, partitions, "lanes", q, p))


def accelerations_batch(
    kernels: Kernels,
    q,
    zd,
    *,
    p=None,
    t: float = 0.0,
    z=None,
    velocities: bool = False,
    threads: int | None = 1,
    out: BatchAccelerations | None = None,
) -> BatchAccelerations:
    """The state derivative of many states at a time, for an integrator, an optimiser or a sampler of one's own.

    q: (B, n), nearly closed: the dependent coordinates are brought onto the constraints by Newton's method; zd: (B, nz), in
    the order of z; p: (B, n_p) or (n_p,); z: names of the independent coordinates, chosen at the first finite state if not given
    velocities: whether all velocities are wanted, too; threads: None for one on every processor that this process may use
    out: results of before, whose arrays are filled again and whose independent coordinates stay. Positions may stay where
    they are (q = out.q): with less to move through memory all is found the faster
    Raises ModelError as `simulate_batch` does.
    """
    if out is not None and (z is not None or out.choice.lanes.kernels is not kernels):
        raise ModelError(f"{kernels.name}: out has results of {out.choice.lanes.kernels.name} with its own z; leave z or out out")
    states = _States.of(kernels, q, zd, p, t, z, "dopri5", out and out.choice)
    if out is not None and len(out.q) != len(states.q):
        raise ModelError(f"{kernels.name}: out has results of {len(out.q)} states; {len(states.q)} are needed, or leave it out")
    if out is not None:
        arrays = out.q, out.qd, out.zdd
    else:
        arrays = np.empty(states.q.shape), np.empty(states.q.shape) if velocities else None, np.empty(states.zd.shape)
    ok = states.choice.lanes.accelerate(t, states.q, states.zd, states.p, arrays, threads, tolerance=TOLERANCE)
    return BatchAccelerations(*arrays, ok, states.choice)


@dataclass(frozen=True, eq=False)
class _States:
    """States as rows, of one choice of independent coordinates."""

    choice: _Choice
    q: np.ndarray
    zd: np.ndarray
    p: np.ndarray

    @classmethod
    def of(cls, kernels: Kernels, q, zd, p, t: float, z, method: str, choice=None, assembled=False) -> _States:
        """From rows, or one row for all; assembled: after positions that are open have been closed.

        choice: of independent coordinates, a new one if not given
        Raises ModelError where shapes do not fit or lanes cannot do it.
        """
        q, zd, p = (None if a is None else np.asarray(a, dtype=float) for a in (q, zd, p))
        q, p = kernels.q0 if q is None else q, kernels.p0 if p is None else p
        counts = {len(a) for a in (q, zd, p) if a is not None and a.ndim == 2}
        if len(counts) != 1:
            raise ModelError(f"{kernels.name}: q0, zd0 and p have {sorted(counts) or 'no'} rows; a batch has one number of them")
        (count,) = counts
        if not count:
            raise ModelError(f"{kernels.name}: a batch of no states; give at least one row")
        q, p = _rows(kernels, "q0", q, count, kernels.n), _rows(kernels, "p", p, count, len(kernels.p0))
        if assembled:
            q = _closed(kernels, q, t, p)
        if choice is None:
            finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1))
            if not len(finite):
                raise ModelError(f"{kernels.name}: no state of the batch has finite q and p; correct them")
            choice = _Choice.at(kernels, q[finite[0]], t, p[finite[0]], z, method)
        nz = len(choice.names)
        return cls(choice, q, _rows(kernels, "zd0", np.zeros(nz) if zd is None else zd, count, nz), p)


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
    integrator: dopri5 or dop853 (each state with its own steps) or rk4 (fixed step max_step)
    threads: None for one on every processor that this process may use
    Everything else as in `simulate`, of which each state is one run with coordinate partitioning. The independent
    coordinates are chosen at the first state; where they become bad, that state is simulated by `simulate`.
    Raises ModelError where the mechanism cannot be simulated so, or shapes do not fit.
    """
    method = canonical_name(integrator)
    if not (np.isfinite(duration) and duration > 0 and points >= 2):
        raise ModelError(f"{kernels.name}: duration {duration} s, {points} points; the first must be positive, points at least 2")
    for name, array in {"q0": q0, "zd0": zd0, "p": p}.items():
        if array is not None and not np.all(np.isfinite(np.asarray(array, dtype=float))):
            raise ModelError(f"{kernels.name}: {name} has numbers that are not finite; correct them")
    states = _States.of(kernels, q0, zd0, p, t0, z, method, assembled=True)
    grid = np.linspace(t0, t0 + duration, points)
    done = states.choice.lanes.simulate(
        method, grid, states.q, states.zd, states.p, threads, tolerance=TOLERANCE, growth=GROWTH, rtol=rtol, atol=atol,
        max_step=0.0 if np.isinf(max_step) else max_step,
    )  # fmt: skip
    alone = np.array([s != "ok" for s in done.status])
    options = {"z": states.choice.names, "t0": t0, "points": points, "integrator": integrator, "rtol": rtol, "atol": atol, "max_step": max_step}
    for i in np.flatnonzero(alone):
        try:
            run = simulate(kernels, duration, q0=states.q[i], zd0=states.zd[i], p=states.p[i], **options)
        except NcgenError as error:
            done.status[i] = str(error)
            continue
        done.q[i], done.qd[i], done.work[i], done.status[i], done.steps[i] = run.q, run.qd, run.work, "ok", run.statistics.steps
    return BatchTrajectory(kernels, grid, done.q, done.qd, done.work, states.choice.names, tuple(done.status), done.steps, alone)


def _refusal(kernels: Kernels, method: str, partitions) -> str | None:
    from ncgen.build.batch_runs import METHODS_IN_LANES

    if method not in METHODS_IN_LANES:
        return f"{method} is not among {', '.join(METHODS_IN_LANES)}"
    return refusal(kernels, method, partitions, emitted=True)


def _rows(kernels: Kernels, name: str, array: np.ndarray, count: int, size: int) -> np.ndarray:
    if array.shape not in ((size,), (count, size)):
        raise ModelError(f"{kernels.name}: {name} has shape {array.shape}; {(size,)} or {(count, size)} is needed")
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
