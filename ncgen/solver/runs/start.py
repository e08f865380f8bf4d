"""Where a simulation starts: a closed position and velocities that the constraints allow.

Velocities are given for the independent coordinates, for any coordinates by name, or for all of them; what the
constraints do not allow is projected, and said.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ncgen.errors import ModelError, SingularError, counted, warn
from ncgen.mechanism.arguments import constant
from ncgen.mechanism.driver_jumps import after_jump, may_jump
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.projection import least_energy, project_velocity
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.branches import check_choices, refresh_branches
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import Partition, Partitions, determined, partitions_for
from ncgen.solver.positions.position import check_finite, check_mirror_roots
from ncgen.solver.positions.rank import REMEMBERED
from ncgen.solver.positions.sparse_rows import DENSE
from ncgen.solver.runs.run import Initial

MIN_REPORTED_CHANGE = 1e-9
"""Changes of a given velocity up to this, relative to the largest velocity, are rounding and not reported."""

VELOCITY_ROUNDING = 1e-140
"""Velocities (sizes of the mechanism per second) below this are what projections leave of 0: their squares are no normal numbers."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Start:
    """A closed position q (n,) and velocities qd (n,) that the constraints allow; p (n_p,) with the paper rows' choice made there.

    partitions: the independent coordinates there, None where nothing asks for them or the position is singular
    warnings: what was given and could not be
    t: time (s), after a jump of a driver's velocity there; driven: whether drivers move then
    moved: what there is to say of a position that was open, or empty
    Of equal arguments it is the same object, and nobody writes to its arrays.
    """

    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    partitions: Partitions | None
    warnings: tuple[str, ...] = ()
    t: float = 0.0
    driven: bool = False
    moved: str = ""

    @property
    def rates(self) -> np.ndarray:
        """Velocities of the independent coordinates."""
        return self.qd[determined(self.partitions).velocity.independent]


def begin(kernels: Kernels, initial: Initial, partitioned: bool) -> Start:
    """Where a run starts, closed and with velocities; partitioned: whether it continues with independent coordinates alone.

    Raises ConvergenceError naming the rows that do not close, SingularError at a singular position that the method or the given
    velocities cannot do with, ModelError for independent coordinates that do not determine the motion.
    """
    start = start_of(kernels, initial, partitioned)
    for message in start.warnings:
        warn(message)
    return start


def start_of(kernels: Kernels, initial: Initial, partitioned: bool, at: Start | None = None) -> Start:
    """The same without warnings, which are the start's; at: a start at the same position, whatever its velocities are."""

    def find() -> Start:
        return _begin(kernels, initial, partitioned) if at is None else _with_velocities(kernels, initial, at, partitioned)

    return kernels.remember("starts", (*initial.key, partitioned), find, REMEMBERED)


def _begin(kernels: Kernels, initial: Initial, partitioned: bool) -> Start:
    p, t = refresh_branches(kernels, initial.q, initial.p), initial.t
    if may_jump(kernels):
        t = after_jump(kernels, p, initial.q, t)
        initial = replace(initial, t=t)
    key = initial.q.tobytes(), t, p.tobytes(), initial.closing
    q = kernels.remember("closed position", key, lambda: _closed(kernels, initial, p), REMEMBERED).copy()
    open_start = Start(
        q=constant(q), qd=q, p=constant(np.array(p)), partitions=None, t=t, moved=_moved(kernels, initial.q, q),
        driven="nu" in kernels.programs.programs and bool(np.any(kernels.nu(q, t, p))),
    )  # fmt: skip
    return _with_velocities(kernels, initial, open_start, partitioned)


def _with_velocities(kernels: Kernels, initial: Initial, at: Start, partitioned: bool) -> Start:
    """A start at the position of another one with velocities as they were asked for."""
    q, p, needed, partitions = at.q, at.p, partitioned or initial.zd is not None, None
    if at.t != initial.t:
        initial = replace(initial, t=at.t)
    if needed or initial.z or (at.driven and initial.qd is None):
        partitions = _partitions(kernels, q, p, initial, needed)
    qd, contradiction = _velocity(kernels, partitions, initial, q, p, at.driven)
    warnings = tuple(message for message in (at.moved, contradiction) if message)
    return Start(
        q=q, qd=constant(np.array(qd)), p=p, partitions=partitions, warnings=warnings, t=at.t, moved=at.moved, driven=at.driven
    )  # fmt: skip


def _closed(kernels: Kernels, initial: Initial, p: np.ndarray) -> np.ndarray:
    """The position closed, on the branches that the coordinates say."""
    check_finite(kernels, initial.q, initial.t, p)
    q = assemble(kernels, initial.q, initial.t, p, tolerance=initial.closing)
    check_mirror_roots(kernels, q, p)
    check_choices(kernels, q, initial.t, p)
    return q


def _moved(kernels: Kernels, start: np.ndarray, closed: np.ndarray) -> str:
    """What to say where the start was open, with what moved most; empty where it was not."""
    moved = np.abs(closed - start)
    if not np.any(moved > 0):
        return ""
    most = int(np.argmax(moved))
    return (
        f"{kernels.name}: the initial position was open and has been assembled; {kernels.coordinates[most]} moved most, "
        f"by {moved[most]:.3g}"
    )


def _partitions(kernels: Kernels, q: np.ndarray, p: np.ndarray, initial: Initial, needed: bool) -> Partitions | None:
    """Independent coordinates at the start; None at a singular position where they can be done without."""
    t, z, rates = initial.t, tuple(initial.z), tuple(initial.zd) if isinstance(initial.zd, dict) else ()
    try:
        key = ("partitions", q.tobytes(), float(t), p.tobytes(), z or kernels.model.chosen_independent, rates)
        return kernels.remember("partitions", key, lambda: partitions_for(kernels, q, t, p, z, rates), REMEMBERED)
    except SingularError:
        if needed:
            raise
        return None


def _velocity(
    kernels: Kernels, partitions: Partitions | None, initial: Initial, q: np.ndarray, p: np.ndarray, driven: bool
) -> tuple[np.ndarray, str]:
    """All initial velocities, and what to say where they are not those that were given."""
    if initial.qd is not None:
        return _allowed_velocity(kernels, initial.qd, q, initial.t, p)
    if partitions is not None:
        rates = independent_rates(kernels, partitions.velocity, initial.zd)
        return velocity_from_rates(kernels, partitions.velocity, rates, q, initial.t, p), ""
    return _allowed_velocity(kernels, {}, q, initial.t, p) if driven else (np.zeros(kernels.n), "")


def independent_rates(kernels: Kernels, partition: Partition, velocities: dict[str, float] | np.ndarray | None) -> np.ndarray:
    """Rates of the independent coordinates in their order. Raises ModelError for others, or where their number is another."""
    names = partition.names(kernels)
    if velocities is None:
        return np.zeros(len(names))
    if isinstance(velocities, dict):
        check_independent(velocities, names)
        return np.array([velocities.get(name, 0.0) for name in names], dtype=float)
    return check_count(velocities, names)


def check_independent(rates: Iterable[str], names: tuple[str, ...]) -> None:
    """Raise ModelError where an initial velocity is given for a coordinate that is not among the independent ones, `names`."""
    for name in rates:
        if name not in names:
            raise ModelError(
                f"initial velocity of {name}: it is not independent; the independent coordinates are {', '.join(names)}; "
                "choose others by z, or give velocities of any coordinates by qd0"
            )


def check_count(rates: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Return velocities, as many as there are independent coordinates. Raises ModelError for another number."""
    if len(rates) != len(names):
        raise ModelError(
            f"zd0: {counted(len(rates), 'number')} given, {len(names)} needed for the independent coordinates {', '.join(names)}"
        )
    return rates


def velocity_from_rates(kernels: Kernels, partition: Partition, rates: np.ndarray, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """All velocities (n,) from those of the independent coordinates."""
    key = q.tobytes(), float(t), p.tobytes(), partition.rows.tobytes(), partition.independent.tobytes()
    if kernels.m >= DENSE and len(kernels.holonomic) == kernels.m:

        def factors() -> scipy.sparse.linalg.SuperLU:
            held = scipy.sparse.csr_array((np.ones(len(rates)), (np.arange(len(rates)), partition.independent)), (len(rates), kernels.n))
            return scipy.sparse.linalg.splu(scipy.sparse.vstack([kernels.phi_q(q, t, p)[partition.rows], held], format="csc"))

        lu = kernels.remember("factors for rates", key, factors, REMEMBERED)
        return lu.solve(np.concatenate([kernels.nu(q, t, p)[partition.rows], rates]))

    def matrices() -> tuple[np.ndarray, np.ndarray]:
        frame = kinematics(kernels, partition, q, t, p)
        return frame.R, frame.particular(kernels.nu(q, t, p))

    R, driven = kernels.remember("matrices for rates", key, matrices, REMEMBERED)
    return R @ rates + driven


def given_velocity(kernels: Kernels, qd0: dict[str, float] | np.ndarray, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """All velocities (n,) from `qd0`, an array over the coordinates or {name: rate}.

    Rates by name leave the others free: they become those of least kinetic energy. A warning with the number says
    where the constraints did not allow what was given.
    """
    allowed, contradiction = _allowed_velocity(kernels, qd0, q, t, p)
    if contradiction:
        warn(contradiction)
    return allowed


def _allowed_velocity(
    kernels: Kernels, qd0: dict[str, float] | np.ndarray, q: np.ndarray, t: float, p: np.ndarray
) -> tuple[np.ndarray, str]:
    """The same, and what to say where it is not what was given."""
    wanted = {kernels.index[name]: rate for name, rate in qd0.items()} if isinstance(qd0, dict) else dict(enumerate(qd0))
    where, rates = np.array(list(wanted), dtype=int), np.array(list(wanted.values()), dtype=float)
    qd = _least_energy(kernels, where, rates, q, t, p) if isinstance(qd0, dict) else rates
    allowed = project_velocity(kernels, q, qd, t, p)
    changed = np.abs(allowed[where] - rates) / kernels.column_sizes[where]
    if np.max(changed, initial=0.0) <= MIN_REPORTED_CHANGE * np.max(np.abs(allowed / kernels.column_sizes), initial=VELOCITY_ROUNDING):
        return allowed, ""
    most = where[int(np.argmax(changed))]
    return allowed, (
        f"{kernels.name}: the initial velocities contradict the constraints and have been projected; "
        f"rate({kernels.coordinates[most]}) changed most, from {wanted[most]:.6g} to {allowed[most]:.6g}"
    )


def _least_energy(kernels: Kernels, where: np.ndarray, rates: np.ndarray, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """Velocities of least kinetic energy among those with the given rates: the given ones are rows like the others."""
    sizes = kernels.column_sizes
    held = scipy.sparse.csr_array((np.ones(len(where)), (np.arange(len(where)), where)), (len(where), kernels.n))
    right = np.concatenate([kernels.nu(q, t, p) / kernels.row_sizes, rates / sizes[where]])
    return sizes * least_energy(kernels, q, t, p, held).solve(np.zeros(kernels.n), right)[0]
