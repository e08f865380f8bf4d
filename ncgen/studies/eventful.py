"""Variants of a mechanism with events: many at a time in C, each to rounding what a single run makes of it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism.event_runs import MotionRows
from ncgen.mechanism.kernel_batch import thread_count
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.properties import is_definite
from ncgen.methods.table import AUTO
from ncgen.solver.argument_checks import has_events
from ncgen.solver.events.action_rows import Actions
from ncgen.solver.events.many_runs import ManyRuns, refusal_in_c
from ncgen.solver.events.passage import check_events
from ncgen.solver.formalisms.projection import least_energy
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.runs.choice import choose
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import COMPILED
from ncgen.solver.runs.start import Start, begin
from ncgen.solver.trajectories.energy import Instants, drift
from ncgen.solver.trajectories.happening import Happening
from ncgen.solver.trajectories.output_values import outputs_of, uses_accelerations
from ncgen.studies.columns import StudiedMotion, columns_of
from ncgen.studies.definition import Study

Values = tuple[dict[str, Any], np.ndarray]
"""What is kept of a variant, and where it ends (n,)."""


class EventfulVariants:
    """The variants of a study whose mechanism has events. refused: why they run one at a time instead, or None"""

    def __init__(self, study: Study, kernels: Kernels) -> None:
        self.study, self.kernels = study, kernels
        self.refused = self._refusal()

    def _refusal(self) -> str | None:
        study, kernels = self.study, self.kernels
        if not has_events(study.model):
            return "there are no events"
        if study.simulation.get("stop"):
            return "stop is given"
        if study.simulation.get("engine", AUTO) not in (AUTO, "c", COMPILED) or study.simulation.get("number", "double") != "double":
            return "engine or number is given"
        if uses_accelerations(study.model) and any(column.is_output(study.model) for column in study.values):
            return "outputs mention accelerations or loads"
        try:
            self.run = study.run
            self.method = choose(self.run.settings).method
            check_events(kernels, self.method, self.run)
            if why := refusal_in_c(kernels):
                return why
            of_parameters = any(column.over == "energy_drift" or column.is_output(study.model) for column in study.values)
            return "events change parameters" if of_parameters and Actions.of(kernels).changed(kernels) else None
        except ModelError as error:
            return str(error)

    def values(self, rows: np.ndarray, threads: int | None, progress: Callable[[float], None] | None) -> dict[int, Values]:
        """{place of a variant: what is kept of it} of variants with these numbers (B, names); those that are missing run alone."""
        if self.refused:
            return {}
        starts = {i: start for i, row in enumerate(rows) if (start := self._start(row))}
        if not starts:
            return {}
        kernels, times, count = self.kernels, self.run.times, len(starts)
        q, qd, p = (np.array([getattr(start, name) for start in starts.values()]) for name in ("q", "qd", "p"))
        shape = count, len(times)
        motions = MotionRows(
            times=times,
            q=q,
            qd=qd,
            p=p,
            out_q=np.empty((*shape, kernels.n)),
            out_qd=np.empty((*shape, kernels.n)),
            out_work=np.empty(shape),
            rows=np.zeros(count, dtype=np.intc),
            steps=np.zeros(count, dtype="l"),
            ended=np.zeros(count),
        )
        many = ManyRuns(kernels=kernels, run=self.run, method=self.method, motions=motions)
        many.carry_out(thread_count(threads, kernels.name), progress)
        numbers = dict(enumerate(starts))
        return {numbers[k]: values for k in sorted(many.carried) if (values := self._kept(motions, many.carried[k], k))}

    def _start(self, row: np.ndarray) -> Start | None:
        """Where a variant starts; None where that is impossible, or a warning has to be given."""
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                initial = Run.from_arguments(self.kernels, **self.study.options(row), points=self.study.grid).initial
                start = begin(self.kernels, initial, partitioned=False)
                check_mass(self.kernels, start.q, initial.t, start.p)
                if not is_definite(self.kernels):
                    least_energy(self.kernels, start.q, initial.t, start.p)  # which refuses motions without inertia by name
        except (NcgenError, ArithmeticError, np.linalg.LinAlgError):
            return None
        return None if caught else start

    def _kept(self, motions: MotionRows, events: tuple[Happening, ...], k: int) -> Values | None:
        """What is kept of motion k; None where C does not know it."""
        kernels, rows, p = self.kernels.driven_by(self.run.signals), int(motions.rows[k]), motions.p[k]
        t, q, qd, work = motions.times[:rows], motions.out_q[k, :rows], motions.out_qd[k, :rows], motions.out_work[k, :rows]
        if rows < len(motions.times):
            if any(column.over == "energy_drift" for column in self.study.values) or events[-1].limit is not None:
                return None  # the work at the end is not known, or the run warns of bounces that accumulate
            t, q, qd = np.append(t, motions.ended[k]), np.vstack([q, events[-1].q]), np.vstack([qd, events[-1].after])
        motion = StudiedMotion(
            t=t,
            q=q,
            qd=qd,
            events=events,
            steps=int(motions.steps[k]),
            outputs=lambda: outputs_of(kernels, t, q, qd, p),
            energy_drift=lambda: drift(kernels, Instants(t, q, qd, work), p),
        )
        return columns_of(self.study, kernels, motion), q[-1]
