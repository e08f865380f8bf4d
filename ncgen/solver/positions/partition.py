"""Coordinate partitioning: which coordinates are independent, and which rows are kept."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError, SingularError, counted
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import singular_values
from ncgen.program.algebra.pivoting import column_order
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.rank import Freedom, best_rows, freedom, scaled_jacobian
from ncgen.solver.positions.sparse_rows import DENSE

MIN_REGULARITY = 1e-7
"""A partition of lower regularity is refused."""

MIN_GAIN = 1.3
"""A new partition must be better by this factor to be worth a change."""


@dataclass(frozen=True, eq=False)
class Partition:
    """rows: kept rows; dependent, independent: positions in q; all index arrays."""

    rows: np.ndarray
    dependent: np.ndarray
    independent: np.ndarray

    def __repr__(self) -> str:
        return f"<Partition: {len(self.independent)} independent, {len(self.dependent)} dependent>"

    def names(self, kernels: Kernels) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return tuple(kernels.coordinates[i] for i in self.independent)


@dataclass(frozen=True)
class Partitions:
    """One partition for positions and one for velocities: the same unless there are rolling conditions."""

    position: Partition
    velocity: Partition

    def columns(self, kernels: Kernels) -> tuple[str, ...]:
        """Names of what motions are differentiated by: parameters, z, rate(z)."""
        return *kernels.parameters, *self.position.names(kernels), *(f"rate({name})" for name in self.velocity.names(kernels))


def determined(partitions: Partitions | None) -> Partitions:
    """The partitions of a motion on independent coordinates. Raises SingularError where there are none."""
    if partitions is None:
        raise SingularError("there are no independent coordinates here: the position is singular, or nothing asked for them")
    return partitions


def choose_partitions(
    kernels: Kernels,
    q: np.ndarray,
    t: float = 0.0,
    p: np.ndarray | None = None,
    independent: tuple[str, ...] = (),
    rows: np.ndarray | None = None,
) -> Partitions:
    """Well-conditioned partitions at q; arguments and errors as for `PartitionsAt.choose`."""
    return PartitionsAt(kernels, q, t, p).choose_both(independent, rows)


def choose_partition(
    kernels: Kernels,
    q: np.ndarray,
    t: float = 0.0,
    p: np.ndarray | None = None,
    independent: tuple[str, ...] = (),
    rows: np.ndarray | None = None,
) -> Partition:
    """A partition that is well conditioned at q; arguments and errors as for `PartitionsAt.choose`."""
    return PartitionsAt(kernels, q, t, p).choose(independent, rows)


def partitions_for(
    kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, z: Sequence[str] = (), rates: Iterable[str] = ()
) -> Partitions:
    """Partitions at q on the coordinates that were asked for, z, else those that the model names, else those whose rates are given by name,
    if they determine the position. Arguments and errors as for `PartitionsAt.choose`."""
    here, wanted = PartitionsAt(kernels, q, t, p), tuple(z or kernels.model.chosen_independent)
    if not wanted and (named := tuple(rates)):
        try:
            return here.choose_both(named)
        except (ModelError, SingularError):  # whoever needs these rates says which is not independent
            pass
    return here.choose_both(wanted)


class PartitionsAt:
    """The partitions at one position: which are good, and how good they are. What they share there is computed once."""

    def __init__(self, kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> None:
        self.kernels, self.q, self.t, self.p = kernels, q, t, p
        self._by_rows: dict[bytes, tuple[np.ndarray, float]] = {}
        self._by_partition: dict[Partition, float] = {}

    @cached_property
    def jacobian(self) -> np.ndarray:
        """Φ_q of all rows, scaled."""
        return scaled_jacobian(self.kernels, self.q, self.t, self.p)

    @cached_property
    def singular_values(self) -> np.ndarray:
        """Those of `jacobian`."""
        return singular_values(self.jacobian)

    # -- choices ------------------------------------------------------------------------------

    def choose_both(self, independent: tuple[str, ...] = (), rows: np.ndarray | None = None) -> Partitions:
        """Well-conditioned partitions for positions and velocities; arguments and errors as for `choose`."""
        kernels, velocity = self.kernels, self.choose(independent, rows)
        if len(kernels.holonomic) == kernels.m:
            return Partitions(velocity, velocity)
        kept = np.array([r for r in velocity.rows if r in set(kernels.holonomic)], dtype=int)
        return Partitions(self.choose(velocity.names(kernels), kept), velocity)

    def choose(self, independent: tuple[str, ...] = (), rows: np.ndarray | None = None) -> Partition:
        """A partition that is well conditioned here.

        independent: coordinates the user wants independent; those that fit are taken, the rest is found by pivoting
        rows: kept rows, if known (default: found by rank at several positions)
        Raises SingularError if the position is singular, ModelError if the wanted coordinates do not determine it.
        """
        kernels = self.kernels
        if rows is None:
            mobility = freedom(kernels, self.q, self.t, self.p)
            if mobility.is_singular:
                raise SingularError(singular_message(kernels, mobility))
            rows = np.array(mobility.kept_rows, dtype=int)
        wanted = [_position(kernels, name) for name in independent]
        if kernels.m == len(rows) >= DENSE and (measured := _measured(kernels, wanted)):
            return Partition(rows, np.setdiff1d(np.arange(kernels.n), measured), np.array(measured))
        count = len(rows)
        if len(wanted) > kernels.n - count:
            raise ModelError(
                f"{counted(len(wanted), 'independent coordinate')} chosen, but the mechanism has "
                f"{counted(kernels.n - count, 'degree of freedom')}; leave some out"
            )
        # The last ones come first here, so that of two that serve equally well the first one stays independent.
        others = np.array([i for i in reversed(range(kernels.n)) if i not in set(wanted)], dtype=int)
        pivots = column_order(self.jacobian[np.ix_(rows, others)]) if 0 < count < len(others) else np.arange(len(others))
        dependent = np.sort(others[pivots[:count]])
        partition = Partition(rows, dependent, np.array(wanted + sorted(set(others[pivots[count:]].tolist())), dtype=int))
        if self.regularity(partition) < MIN_REGULARITY:
            names = ", ".join(independent) or "the coordinates"
            raise SingularError(
                f"{names} do not determine the position here: the partition is singular; choose other independent coordinates"
            )
        return partition

    def others(self, present: Partitions) -> Partitions:
        """The best partitions here of a motion that runs on others: other coordinates, and of redundant rows others too.

        Rows that represent all of them at one position may degenerate on the way (Bennett's linkage does this to them).
        With rolling conditions the kept rows stay. Raises SingularError if the position is singular.
        """
        rows = present.velocity.rows
        if len(rows) < self.kernels.m == len(self.kernels.holonomic):
            rows = best_rows(self.jacobian, len(rows))
        return self.choose_both(rows=rows)

    def better(self, present: Partitions) -> tuple[Partitions | None, float]:
        """The best partitions here, None where they are not clearly better than the present ones, or no choice is good; and the quality of
        the better of both.
        """
        quality = self.worth(present)
        try:
            best = self.others(present)
        except SingularError:
            return None, quality
        possible = self.worth(best)
        return best if possible >= MIN_GAIN * quality else None, max(possible, quality)

    # -- how good they are --------------------------------------------------------------------

    def worth(self, partitions: Partitions) -> float:
        """The quality of the worse of two partitions."""
        return min(self.quality(partition) for partition in {partitions.position, partitions.velocity})

    def quality(self, partition: Partition) -> float:
        """How little errors of the independent coordinates grow in all others: 1/‖R‖ in natural sizes, times how far the kept rows are
        from dependent next to all rows. 0 is singular, 1 is best.

        With an orthonormal basis in the place of the rows of Φ_q, the least singular value of the dependent columns is 1/‖R‖. That of
        Φ_q^d itself is at most the least one of Φ_q, which may be small whatever the choice is.
        """
        if not len(partition.rows):
            return 1.0
        if partition not in self._by_partition:
            basis, fraction = self._kept(partition.rows)
            self._by_partition[partition] = fraction * float(singular_values(basis[partition.dependent])[-1])
        return self._by_partition[partition]

    def _kept(self, rows: np.ndarray) -> tuple[np.ndarray, float]:
        """An orthonormal basis of kept rows, in columns, and how far they are from dependent next to all rows."""
        key = rows.tobytes()
        if key not in self._by_rows:
            kept, fraction = self.jacobian[rows], 1.0
            if len(kept) < len(self.jacobian):
                fraction = float(singular_values(kept)[-1] / max(self.singular_values[len(kept) - 1], 1e-300))
            self._by_rows[key] = np.linalg.qr(kept.T)[0], fraction
        return self._by_rows[key]

    def regularity(self, partition: Partition) -> float:
        """Smallest singular value of the scaled Φ_q^d over the norm of Φ_q: 0 where the partition or the position is singular."""
        if not len(partition.rows):
            return 1.0
        jacobian = self.jacobian[partition.rows]
        smallest = singular_values(jacobian[:, partition.dependent])[-1]
        return float(smallest / max(np.linalg.norm(jacobian), 1e-300))


def _measured(kernels: Kernels, wanted: list[int]) -> list[int]:
    """Coordinates that measure the joints of a large open tree, one each, wanted ones first; [] where they are not among these."""
    tree = open_tree(kernels)
    if tree is None:
        return []
    free = set(range(len(tree.screws))) - set(tree.coupled.leaders)
    measuring = set({screw: c for c, (screw, _) in tree.measured.items() if screw in free}.values())
    return wanted + sorted(measuring - set(wanted)) if len(measuring) == tree.freedoms and set(wanted) <= measuring else []


def _position(kernels: Kernels, name: str) -> int:
    if name not in kernels.index:
        raise ModelError(f"independent coordinate {name}: {kernels.name} has no such free coordinate")
    return kernels.index[name]


def singular_message(kernels: Kernels, mobility: Freedom) -> str:
    """One line about a singular position: the rank, and what can move there and nowhere else."""
    motion = mobility.vanishing[:, 0]
    movers = np.argsort(-np.abs(motion))[:3]
    names = ", ".join(kernels.coordinates[i] for i in movers if abs(motion[i]) > 1e-6)
    return (
        f"{kernels.name}: the position is singular, rank {mobility.rank_here} where {mobility.rank} is general; "
        f"the extra motion moves {names}; start from another position"
    )


def stuck_message(kernels: Kernels, t: float, step: float | None = None) -> str:
    """One line about a motion on independent coordinates that ends; step (s): the fixed one of the method."""
    ended = f"the step of {step:.6g} s from t = {t:.6g} s fails" if step else f"the motion cannot continue beyond t = {t:.6g} s"
    return (
        f"{kernels.name}: {ended}; the mechanism locks or comes to a singular position there, "
        f"which formalism='lagrange' passes; or take smaller steps ({'max_step' if step else 'rtol, max_step'})"
    )
