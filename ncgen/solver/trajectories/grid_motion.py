"""A motion on a grid of times: what a run stores, and accelerations and multipliers as they follow."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import FORMALISMS, Formalism
from ncgen.solver.formalisms import accelerations_of
from ncgen.solver.formalisms.coordinate_partitioning import Motion, motion_at
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.partition import Partitions, PartitionsAt, choose_partitions, determined
from ncgen.solver.trajectories.happening import Happening

if TYPE_CHECKING:
    from ncgen.model import Model
    from ncgen.solver.events.modes import Mode

Made = TypeVar("Made")

CONDITION = 1e-3
"""Quality of a partition below which accelerations are computed with a better one."""


def made(kind: type[Made], **members: Any) -> Made:
    """Return an object of a frozen dataclass from all its members at once: its own function sets one after the other, which takes as long
    as the run of a small mechanism."""
    new = object.__new__(kind)
    object.__setattr__(new, "__dict__", members)
    return new


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """What a simulation cost.

    steps, evaluations of the state derivative, Newton steps of position problems and projections, changes of the
    independent coordinates, steps repeated because the position problem failed, and seconds of the run; how often a state was
    projected onto the constraints, and how far a position was moved at most, relative to its natural size. Of implicit
    methods how many Jacobians were taken; of emitted ones how many accelerations were computed with row exchanges, since
    a pivot vanished, a step had to be repeated, or Newton's steps in the degrees of freedom did not converge.
    preparation: seconds for generating and compiling what the run needed first; a second run of the kernels needs none.
    """

    steps: int
    evaluations: int
    newton_steps: int
    partition_changes: int
    repeated_steps: int
    seconds: float
    projections: int = 0
    largest_projection: float = 0.0
    jacobians: int = 0
    fallbacks: int = 0
    preparation: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class GridMotion:
    """What a run stores of a motion; its fields are those of `Trajectory`."""

    kernels: Kernels
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    p: np.ndarray
    partitions: Partitions | None
    statistics: Statistics
    formalism: str
    integrator: str
    engine: str = "python"
    chosen: tuple[str, ...] = ()
    moved_by: Kernels | None = None
    options: dict[str, Any] = field(default_factory=dict)
    stopped: bool = False
    number: str = "double"
    made_with: str = ""
    impulses: tuple[Impulse, ...] = ()
    events: tuple[Happening, ...] = ()
    modes: tuple[Mode, ...] = ()
    changed: bool = False
    user_formalism: Formalism | None = None

    @cached_property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates: those that were chosen, else those at the end of the run."""
        partitions = self.partitions or choose_partitions(self.kernels, self.q[-1], self.t[-1], self.p)
        used = partitions.position.names(self.kernels)
        return self.chosen if len(self.chosen) == len(used) else used

    @cached_property
    def _motions(self) -> list[Motion]:
        """Every instant once more with accelerations and multipliers."""
        instants = zip(self.t, self.q, self.qd, strict=True)
        return [self._motion(*instant) for instant in instants]

    def _motion(self, t: float, q: np.ndarray, qd: np.ndarray) -> Motion:
        kernels = self.moved_by or self.kernels
        for mode in self.modes:
            if mode.t <= t:
                kernels = mode.kernels
        p = refresh_branches(kernels, q, self.p)
        formalism = self.user_formalism or FORMALISMS[self.formalism]
        if formalism.is_constrained:
            return accelerations_of(formalism).motion(kernels, q, qd, t, p, self.options)
        present = determined(self.partitions)
        partition, here = present.velocity, PartitionsAt(kernels, q, t, p)
        if here.quality(partition) < CONDITION:
            partition = here.others(present).velocity
        return motion_at(kernels, partition, t, q, qd[partition.independent], p)

    @cached_property
    def qdd(self) -> np.ndarray:
        """Accelerations (K, n)."""
        return np.array([m.qdd for m in self._motions])

    @cached_property
    def lam(self) -> np.ndarray:
        """Multipliers of the rows (K, m)."""
        return np.array([m.lam[: self.kernels.m] for m in self._motions])

    @property
    def model(self) -> Model:
        """Return the model.

        Returns
        -------
        Model
            The model of the kernels.
        """
        return self.kernels.model

    @property
    def name(self) -> str:
        """Return the name of the model.

        Returns
        -------
        str
            The name.
        """
        return self.kernels.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Return the names of the free coordinates.

        Returns
        -------
        tuple of str
            The names, in the order of q.
        """
        return self.kernels.coordinates
