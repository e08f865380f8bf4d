"""How healthy a motion is, instant by instant: closeness to singular positions, quality of the partition, energy, violation.

A partition is bad where Φ_q^d of the chosen coordinates is nearly singular although Φ_q has its rank: other independent
coordinates cure it. The mechanism bifurcates where the rank of Φ_q itself drops: then no choice helps, and formalisms over all
coordinates have to carry the motion through.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError, SingularError, counted
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import names_of
from ncgen.solver.positions.partition import Partition, PartitionsAt, choose_partition
from ncgen.solver.positions.position import residual
from ncgen.solver.positions.rank import best_rows, freedom
from ncgen.solver.trajectories.energy import energies

NEARLY_SINGULAR = 1e-3
"""σ below this means that the mechanism is near a bifurcation."""

MIN_QUALITY_RATIO = 0.05
"""A partition whose quality is below this share of the best one's is called bad."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Health:
    """Arrays (K,) over the instants of a motion.

    sigma: the smallest singular value of Φ_q that is not zero in general position, over the largest
    quality, best: of the partition by the coordinates `independent`, and of the best choice there, see `quality`
    energy: T + V (J); drift: |T + V − W − its start| relative to the energy that moves; violation: largest relative |Φ|
    """

    independent: tuple[str, ...]
    t: np.ndarray
    sigma: np.ndarray
    quality: np.ndarray
    best: np.ndarray
    energy: np.ndarray
    drift: np.ndarray
    violation: np.ndarray

    def __repr__(self) -> str:
        return f"<Health of {len(self.t)} instants: drift {self.drift.max():.1e}, violation {self.violation.max():.1e}>"

    @property
    def bifurcates(self) -> np.ndarray:
        """True where the rank of Φ_q drops, or nearly."""
        return self.sigma < NEARLY_SINGULAR

    @property
    def partition_is_bad(self) -> np.ndarray:
        """True where other independent coordinates would cure what these suffer from."""
        return ~self.bifurcates & (self.quality < MIN_QUALITY_RATIO * self.best)

    def findings(self) -> list[str]:
        """Messages about the motion, a line each."""
        lines = []
        if self.bifurcates.any():
            k = int(np.argmin(self.sigma))
            lines.append(
                f"the mechanism bifurcates near t = {self.t[k]:.6g} s (σ = {self.sigma[k]:.2g}): no choice of coordinates helps there; "
                "use a formalism over all coordinates, such as lagrange"
            )
        if self.partition_is_bad.any():
            k = int(np.argmin(np.where(self.partition_is_bad, self.quality / self.best, np.inf)))
            lines.append(
                f"{', '.join(self.independent)} are bad independent coordinates near t = {self.t[k]:.6g} s (quality {self.quality[k]:.2g}, "
                f"{self.best[k]:.2g} is possible): choose others, or leave the choice free"
            )
        return lines or ["no singular position and no bad choice of coordinates at these instants"]


def monitor(
    kernels: Kernels,
    t: ArrayLike,
    q: ArrayLike,
    qd: ArrayLike,
    work: ArrayLike | None = None,
    p: np.ndarray | None = None,
    independent: str | Iterable[str] = (),
) -> Health:
    """The health of a motion: t (K,) in s, q (K, n) in m and rad, qd (K, n) in the same per second, work (K,) in J (default: none).

    p (n_p,): parameters (default: the model's)

    independent: names of the independent coordinates (default: the model's, else the best ones at the first regular instant)
    Raises ModelError if they are not as many as the degrees of freedom.
    """
    t, q, qd = (np.asarray(x, dtype=float) for x in (t, q, qd))
    rank = freedom(kernels, q[0], t[0], p).rank
    instants = list(zip(t, q, strict=True))
    chosen = names_of(independent, "independent", kernels.index) or kernels.model.chosen_independent or _first_choice(kernels, instants, p)
    if len(chosen) != kernels.n - rank:
        raise ModelError(
            f"{counted(len(chosen), 'independent coordinate')} for {counted(kernels.n - rank, 'degree of freedom')}: {', '.join(chosen)}"
        )
    rows = np.array([_one(kernels, rank, chosen, t, q, p) for t, q in instants]).reshape(-1, 4)
    kinetic, potential, _ = energies(kernels, t, q, qd, p).T
    total = kinetic + potential
    error = np.abs(total - total[0] - (0.0 if work is None else np.asarray(work)))
    moved = max(np.max(kinetic), np.ptp(potential)) or 1.0
    return Health(
        independent=chosen,
        t=t,
        sigma=rows[:, 0],
        quality=rows[:, 1],
        best=rows[:, 2],
        energy=total,
        drift=error / moved,
        violation=rows[:, 3],
    )


def _one(
    kernels: Kernels, rank: int, chosen: tuple[str, ...], t: float, q: np.ndarray, p: np.ndarray | None
) -> tuple[float, float, float, float]:
    """σ, quality, best quality and violation of one instant."""
    here = PartitionsAt(kernels, q, t, p)
    values = here.singular_values
    sigma = values[rank - 1] / max(values[0], 1e-300) if rank else 1.0
    kept = best_rows(here.jacobian, rank) if rank else np.arange(0)
    independent = np.array([kernels.index[name] for name in chosen], dtype=int)
    partition = Partition(kept, np.setdiff1d(np.arange(kernels.n), independent), independent)
    now = here.quality(partition)
    try:
        best = here.quality(here.choose(rows=kept))
    except SingularError:
        best = now
    return float(sigma), now, max(best, now), residual(kernels, q, t, p)


def _first_choice(kernels: Kernels, instants: list[tuple[float, np.ndarray]], p: np.ndarray | None) -> tuple[str, ...]:
    for t, q in instants:
        try:
            return choose_partition(kernels, q, t, p).names(kernels)
        except SingularError:
            continue
    raise SingularError(f"{kernels.name}: the motion is singular at every instant; there are no independent coordinates")
