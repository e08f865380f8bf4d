"""States of a batch: rows of positions, velocities and parameters with the independent coordinates that they have in common."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import DomainError, ModelError, NcgenError, SingularError, warn
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import INTEGRATORS
from ncgen.solver.argument_checks import ArrayOrNamed, known_name
from ncgen.solver.batch_rows import common_size
from ncgen.solver.engines.capabilities import checked_compiled, refusal, refusal_of_size
from ncgen.solver.engines.partition_dynamics import dynamics
from ncgen.solver.geometry import angles, arms_have_parameters, measured_angles
from ncgen.solver.parameter_checks import refused_parameters
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.partition import Partitions, partitions_for
from ncgen.solver.positions.position import TOLERANCE, check_finite, check_mirror_roots
from ncgen.solver.runs.run import TWO_VELOCITIES
from ncgen.solver.runs.start import check_independent, given_velocity

if TYPE_CHECKING:
    from ncgen.mechanism.batch_runs import LaneDynamics

NEAR_HALF_A_TURN = 0.5
"""Cosine of an angle's error below which its own parameters decide whether it is on its mirror root."""


@dataclass(frozen=True, eq=False)
class CommonCoordinates:
    """Independent coordinates that states have in common; typical: a position and parameters at which they are good."""

    kernels: Kernels
    partitions: Partitions
    typical: tuple[np.ndarray, np.ndarray]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates whose velocities are independent."""
        return self.partitions.velocity.names(self.kernels)

    @property
    def indices(self) -> np.ndarray:
        """Theirs in q."""
        return self.partitions.velocity.independent

    @cached_property
    def lanes(self) -> LaneDynamics:
        """The state derivative for them in lanes. Raises ModelError where it cannot be emitted."""
        return dynamics(checked_compiled(self.kernels), self.partitions, "lanes", *self.typical)

    @classmethod
    def at(
        cls, kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, z: tuple[str, ...], method: Method | None, rates: Iterable[str] = ()
    ) -> CommonCoordinates:
        """A choice that is good at one position.

        z, rates: as of `partitions_for`; method: None where no state derivative is wanted in lanes
        Raises ModelError where lanes cannot do it, SingularError or DomainError for a position at which there is none.
        """
        check_finite(kernels, q, t, p)
        choice = cls(kernels, partitions_for(kernels, q, t, p, z, rates), (q, p))
        if method and (refused := _refusal(kernels, method, choice.partitions)):
            raise ModelError(f"{kernels.name} cannot be simulated in a batch: {refused}; use simulate for every state")
        if method:
            choice.lanes  # noqa: B018
        return choice

    @classmethod
    def at_first(
        cls, kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, z: tuple[str, ...], method: Method | None, rates: Iterable[str] = ()
    ) -> CommonCoordinates:
        """A choice that is good at the first position where there is one."""
        finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1))
        if not len(finite):
            raise ModelError(f"{kernels.name}: no state of the batch has finite q and p; correct them")
        refused: dict[bytes, NcgenError] = {}
        for i in finite:
            key = q[i].tobytes() + p[i].tobytes()
            if key not in refused:
                try:
                    return cls.at(kernels, q[i], t, p[i], z, method, rates)
                except (SingularError, DomainError) as error:
                    refused[key] = error
        raise next(iter(refused.values()))


@dataclass(frozen=True, eq=False, kw_only=True)
class States:
    """States as rows, of one choice of independent coordinates; faults: {state: why it has no start}, its q is NaN."""

    choice: CommonCoordinates
    q: np.ndarray
    zd: np.ndarray
    p: np.ndarray
    faults: dict[int, str]

    @classmethod
    def of(
        cls,
        kernels: Kernels,
        method: Method | None,
        choice: CommonCoordinates | None = None,
        assembled: bool = False,
        *,
        q0: ArrayOrNamed | None,
        zd0: ArrayOrNamed | None,
        p: ArrayOrNamed | None,
        t0: float,
        z: tuple[str, ...] = (),
        qd0: ArrayOrNamed | None = None,
    ) -> States:
        """From rows, one row for all, or {name: number, or one a state}; assembled: after positions that are open have been closed.

        method: of `CommonCoordinates.at`; choice: of independent coordinates, a new one if not given; others as of `StartArguments`
        One warning sums up where the constraints do not allow velocities qd0.
        Raises ModelError where shapes do not fit or lanes cannot do it.
        """
        if zd0 is not None and qd0 is not None:
            raise ModelError(TWO_VELOCITIES)
        p = _given(kernels, "p", p, kernels.parameters, kernels.p0)
        has_q = q0 is not None  # a start that follows from rows of p has rows as well
        usual = kernels.start(p) if q0 is None or isinstance(q0, Mapping) else kernels.q0  # rows that are given need none beside them
        q = _given(kernels, "q0", q0, kernels.coordinates, usual)
        rates = zd0 if isinstance(zd0, Mapping) else None
        zd = None if zd0 is None else _given(kernels, "zd0", zd0, kernels.coordinates, np.zeros(kernels.n))
        wanted = tuple(qd0) if isinstance(qd0, Mapping) else None
        qd = None if qd0 is None else _given(kernels, "qd0", qd0, kernels.coordinates, np.zeros(kernels.n))
        arrays = {"q0": q if has_q else None, "zd0": zd, "qd0": qd, "p": p}
        size = common_size(kernels.name, {name: len(a) for name, a in arrays.items() if a is not None and a.ndim == 2})
        q, p = _rows(kernels, "q0", q, size, kernels.n), _rows(kernels, "p", p, size, len(kernels.p0), np.asarray)
        q, faults = closed(kernels, q, t0, p) if assembled else (q, {})
        if not assembled and (refused := refused_parameters(kernels, p)):
            raise ModelError(f"p of state {min(refused)}: {refused[min(refused)]}")
        if len(faults) == size:
            raise ModelError(f"no state of the batch has a start; the first: {faults[0]}")
        choice = choice or CommonCoordinates.at_first(kernels, q, t0, p, z, method, rates or ())
        if rates is not None and zd is not None:
            check_independent(rates, choice.names)
            zd = zd[..., [kernels.index[name] for name in choice.names]]
        nz = len(choice.names)
        if qd is not None:
            zd, unlike = _rates_given(choice, _rows(kernels, "qd0", qd, size, kernels.n), wanted, q, t0, p)
            faults.update(unlike)
        return cls(choice=choice, q=q, zd=_rows(kernels, "zd0", np.zeros(nz) if zd is None else zd, size, nz), p=p, faults=faults)


def _refusal(kernels: Kernels, method: Method, partitions: Partitions) -> str | None:
    if not method.integrator.in_lanes:
        return f"{method.integrator.name} is not among {those_in_lanes()}"
    return refusal(kernels, method, "emitted", "double") or refusal_of_size(kernels, partitions, "emitted")


def those_in_lanes() -> str:
    """Names of the integrators that run in lanes."""
    return ", ".join(name for name, entry in INTEGRATORS.items() if entry.in_lanes)


def _given(kernels: Kernels, label: str, argument: ArrayOrNamed | None, names: tuple[str, ...], defaults: np.ndarray) -> np.ndarray:
    """Rows, one row for all, or {name: number, or one a state} in place of the defaults, as an array.

    Raises ModelError for other things.
    """
    from ncgen.mechanism.arguments import numbers

    def array(value: ArrayLike, of: str) -> np.ndarray:
        try:
            return numbers(value, f"{kernels.name}: {of}")
        except NcgenError as error:
            raise ModelError(str(error)) from None

    if argument is None:
        return defaults
    if not isinstance(argument, Mapping):
        return array(argument, label)
    for name in argument:
        known_name(name, names, label, "parameter" if label == "p" else "free coordinate")
    columns = {name: array(value, f"{label}, {name}") for name, value in argument.items()}
    counts = {column.shape for column in columns.values() if column.shape}
    if len(counts) > 1 or any(len(shape) > 1 for shape in counts):
        raise ModelError(f"{kernels.name}: {label} has arrays of shapes {sorted(counts)}; give each name a number, or one for every state")
    rows = np.tile(defaults, (*counts.pop(), 1)) if counts else np.array(defaults)
    for name, column in columns.items():
        rows[..., names.index(name)] = column
    return rows


def _rates_given(
    choice: CommonCoordinates, qd: np.ndarray, names: tuple[str, ...] | None, q: np.ndarray, t: float, p: np.ndarray
) -> tuple[np.ndarray, dict[int, str]]:
    """Velocities of the independent coordinates (B, nz) from those of all (B, n), and {state: why it has none}.

    names: of the coordinates whose velocities count, the others are those of least kinetic energy; None for all
    """
    kernels, faults, warned = choice.kernels, {}, []
    velocities = np.full((len(q), len(choice.names)), np.nan)
    known: dict[bytes, np.ndarray] = {}
    finite = np.isfinite(qd).all(axis=1) & np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    for i in np.flatnonzero(finite).tolist():
        key = qd[i].tobytes() + q[i].tobytes() + p[i].tobytes()
        if key not in known:
            velocity = qd[i] if names is None else {name: qd[i, kernels.index[name]] for name in names}
            try:
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always")
                    known[key] = given_velocity(kernels, velocity, q[i], t, p[i])[choice.indices]
            except (NcgenError, np.linalg.LinAlgError) as error:
                faults[i] = str(error)
                continue
            warned += [f"state {i}: {caught[0].message}"] if caught else []
        velocities[i] = known[key]
    if warned:
        warn(f"{kernels.name}: qd0 of {len(warned)} of {len(q)} states is not what they start with; {warned[0]}")
    return velocities, faults


def _rows(
    kernels: Kernels, name: str, array: np.ndarray, count: int, size: int, laid: Callable[[np.ndarray], np.ndarray] = np.ascontiguousarray
) -> np.ndarray:
    """laid: how a row for all becomes many: one after the other, or as it is, with the same memory for each (np.asarray)."""
    if array.shape not in ((size,), (count, size)):
        raise ModelError(f"{kernels.name}: {name} has shape {array.shape}; {(size,)} or {(count, size)} is needed")
    return laid(array if array.shape == (count, size) else np.broadcast_to(array, (count, size)))


def closed(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> tuple[np.ndarray, dict[int, str]]:
    """Positions that close: those that do not are assembled, one after the other. Those that have none become NaN: {state: why}, as do
    those with parameters that the model could not have been made with."""
    with np.errstate(invalid="ignore"):
        relative = np.abs(kernels.batch.phi(q, t, p) / kernels.row_sizes)[:, kernels.holonomic]
    open_ = np.max(relative, axis=1, initial=0.0) > TOLERANCE
    q, faults = q.copy(), refused_parameters(kernels, p)
    q[list(faults)] = np.nan
    open_[list(faults)] = False
    positions_by_key: dict[bytes, np.ndarray | str] = {}
    for i in np.flatnonzero(open_ | _may_be_mirrored(kernels, q, p)):
        key = q[i].tobytes() + p[i].tobytes()
        if key not in positions_by_key:
            positions_by_key[key] = _assembled(kernels, q[i], t, p[i])
        position = positions_by_key[key]
        if isinstance(position, str):
            faults[int(i)], q[i] = position, np.nan
        else:
            q[i] = position
    return q, faults


def _assembled(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray | str:
    """One position closed, or why it cannot be."""
    try:
        q = assemble(kernels, q, t, p)
        check_mirror_roots(kernels, q, p)
    except (NcgenError, np.linalg.LinAlgError) as error:
        return str(error)
    return q


def _may_be_mirrored(kernels: Kernels, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """States some angle of which is about half a turn off its elements, (B,)."""
    known = angles(kernels)
    if not known:
        return np.zeros(len(q), dtype=bool)
    if arms_have_parameters(kernels):
        measured = np.array([measured_angles(kernels, *state) for state in zip(q, p, strict=True)])
    else:
        measured = measured_angles(kernels, q, p[0])
    errors = q[:, [kernels.index[angle.name] for angle in known]] - measured
    with np.errstate(invalid="ignore"):  # an angle that is no number is reported by its run
        return np.min(np.cos(errors), axis=1) < NEAR_HALF_A_TURN
