"""State derivatives in C for a choice of independent coordinates, and the positions from which an order of elimination is chosen."""

from __future__ import annotations

import hashlib
from functools import partial
from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.program.algebra.elimination import EliminationError
from ncgen.program.programs import Split
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.partition import Partition, Partitions
from ncgen.solver.positions.position import newton_position
from ncgen.solver.positions.rank import can_move, closeness_at, trial_positions

if TYPE_CHECKING:
    from ncgen.mechanism.batch_runs import LaneDynamics
    from ncgen.mechanism.runtime import DenseDynamics, EmittedDynamics
    from ncgen.program.ir.sampling import Sample
from ncgen.solver.engines.capabilities import checked_compiled

N_PERTURBED_SAMPLES = 3
"""How many sample positions have other parameters and times."""

SAMPLE_PERTURBATION = 0.03
"""By which share of theirs, and of a second."""


@overload
def dynamics(
    kernels: Kernels, partitions: Partitions, form: Literal["lanes"], q: np.ndarray, p: np.ndarray, number: str = "double"
) -> LaneDynamics: ...


@overload
def dynamics(
    kernels: Kernels, partitions: Partitions, form: Literal["dense"], q: np.ndarray, p: np.ndarray, number: str = "double"
) -> DenseDynamics: ...


@overload
def dynamics(
    kernels: Kernels, partitions: Partitions, form: Literal["emitted", "refined"], q: np.ndarray, p: np.ndarray, number: str = "double"
) -> EmittedDynamics: ...


def dynamics(
    kernels: Kernels, partitions: Partitions, form: str, q: np.ndarray, p: np.ndarray, number: str = "double"
) -> LaneDynamics | DenseDynamics | EmittedDynamics:
    """The state derivative for a partition, made once for every kernels object, partition, form and number type.

    form: "dense", "emitted", "refined" (emitted, with iterative refinement), or "lanes" for many states at a time (double only)
    q (n,), p (n_p,): a typical position (m, rad) and parameters, with which the order of an emitted elimination is chosen
    """
    split, positions = split_of(partitions.velocity), split_of(partitions.position)
    apart = None if partitions.position is partitions.velocity else positions
    key = split, positions, form, number
    return kernels.remember("dynamics", key, lambda: _made(kernels, split, apart, form, number, q, p))


def _made(
    kernels: Kernels, split: Split, positions: Split | None, form: str, number: str, q: np.ndarray, p: np.ndarray
) -> LaneDynamics | DenseDynamics | EmittedDynamics:
    """A state derivative; positions: the choice for them where it is another than for velocities."""
    from ncgen.mechanism.batch_runs import LaneDynamics
    from ncgen.mechanism.motion_sources import Written
    from ncgen.mechanism.runtime import DenseDynamics, EmittedDynamics

    if form == "dense":
        return DenseDynamics(kernels, split, number, positions)
    kernels = checked_compiled(kernels)
    around = hashlib.sha256(np.concatenate([q, p]).tobytes()).hexdigest()
    written = Written(
        kernels=kernels, split=split, samples_of=partial(samples, kernels, q.copy(), p.copy()), around=around, refine=form == "refined"
    )
    try:
        return LaneDynamics(written) if form == "lanes" else EmittedDynamics(written, number)
    except EliminationError as error:
        raise ModelError(
            f"{kernels.name}: no order of elimination can be emitted for these coordinates: {error}; use engine='c'"
        ) from error


def split_of(partition: Partition) -> Split:
    """A choice of independent coordinates as numbers."""
    return Split(*(tuple(a.tolist()) for a in (partition.rows, partition.dependent, partition.independent)))


def samples(kernels: Kernels, q: np.ndarray, p: np.ndarray) -> list[Sample]:
    """Typical positions around q, from which the order of elimination is chosen, and seen what vanishes: with other parameters, too,
    and at other times, so that nothing is taken for 0 that is 0 only now."""
    from ncgen.program.ir.sampling import Sample

    positions = trial_positions(kernels, q, 0.0, p)
    if len(positions) == 1 and not can_move(kernels, q, 0.0, p):
        positions *= 2  # what cannot move is in no other: all that there is has been seen
    typical = [Sample(0.0, x, p) for x in positions]
    generator = np.random.default_rng(1)
    for _ in range(N_PERTURBED_SAMPLES if kernels.parameters or np.any(kernels.nu(q, 0.0, p)) else 0):
        other = p + SAMPLE_PERTURBATION * generator.uniform(-1, 1, len(p)) * np.where(p == 0.0, 1.0, np.abs(p))
        t = float(SAMPLE_PERTURBATION * generator.uniform())
        try:
            released, free = refresh_branches(kernels, q, other), np.arange(kernels.n)
            close = newton_position(kernels, typical[-1].q, t, released, free, closeness_at(kernels, q))
            typical.append(Sample(t, close.q, other))
        except NcgenError:
            continue  # these parameters leave no position
    return typical
