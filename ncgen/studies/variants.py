"""Variants computed: side by side in lanes where method and mechanism allow it, else one at a time.

What a variant gives depends on the study alone: independent coordinates and the order of elimination are chosen once, at the first
variants that can be started, and kernels are the study's own, so nothing that was run before is remembered in them.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ncgen.compiler import compile
from ncgen.errors import DomainError, ModelError, NcgenError, SingularError
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO
from ncgen.solver.argument_checks import has_events, position
from ncgen.solver.motions.batch import in_lanes, side_by_side
from ncgen.solver.motions.simulate import simulate_one
from ncgen.solver.motions.states import CommonCoordinates, States, closed
from ncgen.solver.positions.partition import determined
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import EMITTED
from ncgen.solver.runs.start import begin, check_count, check_independent
from ncgen.solver.trajectories.energy import drifts
from ncgen.solver.trajectories.output_values import outputs_of, uses_accelerations
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.studies.columns import StudiedMotion, columns_of
from ncgen.studies.definition import Study
from ncgen.studies.design import argument_of
from ncgen.studies.eventful import EventfulVariants
from ncgen.studies.kept import Histories
from ncgen.studies.slopes import Slopes

FIRST = 64
"""Variants among which one is looked for that can be started, again and again as many."""

MAX_TRIES = 16
"""How often."""

PROGRESS_INTERVAL = 0.02
"""The least share of variants after which somebody is told."""

ARGUMENTS_NOT_IN_LANES = ("stop", "inputs", "qd0", "options", "closing")
"""Arguments of `simulate` that lanes do not take."""


@dataclass(frozen=True, eq=False)
class Part:
    """Variants from `first` on: {column: values}, messages about some of them, {variant: sentence}, and which arrived (B,)."""

    first: int
    columns: dict[str, np.ndarray]
    messages: dict[int, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Part: variants {self.first} to {self.first + len(self) - 1}>"

    def __len__(self) -> int:
        return len(self.columns["ok"])

    def joined(self, names: tuple[str, ...], rows: np.ndarray) -> Part:
        """The part with the numbers (B, names) that varied before its own columns."""
        return Part(self.first, dict(zip(names, rows.T, strict=True)) | self.columns, self.messages)


Moved = tuple[Part, np.ndarray]
"""Variants, and where their motions end (B, n)."""


class Bench:
    """A study ready to compute, in one process. sample: numbers (some, names) of variants at which another process has chosen what all
    variants have in common; None to look for such ones."""

    def __init__(self, study: Study, sample: np.ndarray | None = None) -> None:
        self.study, self.kernels, self.sample = study, compile(study.model), sample
        self._choice: CommonCoordinates | None = None
        self.refused = self._why_not_in_lanes()
        if self.refused and study.simulation.get("engine", AUTO) in EMITTED:
            raise ModelError(
                f"engine {study.simulation['engine']!r}: variants run one at a time here ({self.refused}), and what is emitted for one "
                "would serve the next; leave engine out"
            )
        self.refused = self.refused or self._choose()
        self._slopes = Slopes(study, self.kernels, self._independent()) if study.gradients else None
        self._eventful = EventfulVariants(study, self.kernels)

    @property
    def made_with(self) -> str:
        """How variants are computed, in words."""
        how = f"one at a time by simulate: {self.refused}" if self.refused else f"{self._lanes_run[1]}, in lanes"
        if not self._eventful.refused:
            how = f"{self._eventful.method}, through events in C"
        return f"{how}; {self._slopes}" if self._slopes else how

    def part(self, first: int, count: int, threads: int | None = 1, progress: Callable[[float], None] | None = None) -> Part:
        """The variants from `first` on.

        threads: of lanes, None for all processors; progress: called with the share of them that are done. What it raises ends the call
        """
        rows = self.study.design.rows(first, count)
        return self.computed(first, rows, threads, progress).joined(self.study.design.names, rows)

    def computed(self, first: int, rows: np.ndarray, threads: int | None = 1, progress: Callable[[float], None] | None = None) -> Part:
        """The variants with these numbers (B, names), which are not in it; else as `part`."""
        moved = (lambda fraction: progress(0.0)) if progress and self._slopes else progress  # gradients take longer
        block, ends = self._alone(first, rows, threads, moved) if self._choice is None else self._together(first, rows, threads, moved)
        return self._with_slopes(block, rows, ends, progress)

    def _samples(self) -> Iterator[np.ndarray]:
        """Numbers of variants among which one may be found that can be started; those that were enough stay."""
        if self.sample is not None:
            yield self.sample
            return
        for first in range(0, min(MAX_TRIES * FIRST, self.study.size), FIRST):
            yield self.study.design.rows(first, min(FIRST, self.study.size - first))

    def _independent(self) -> tuple[str, ...]:
        """What starts independently in all variants: what is chosen for lanes, else at the first variants that can be started."""
        if self._choice is not None:
            return self._choice.names
        for rows in self._samples():
            for row in rows:
                with contextlib.suppress(NcgenError, np.linalg.LinAlgError), warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    initial = Run.from_arguments(self.kernels, **self.study.options(row)).initial
                    names = determined(begin(self.kernels, initial, partitioned=True).partitions).position.names(self.kernels)
                    self.sample = rows
                    return names
        return ()

    def _with_slopes(self, block: Part, rows: np.ndarray, ends: np.ndarray, progress: Callable[[float], None] | None) -> Part:
        """The same variants with their gradients. ends: where each arrives (B, n)."""
        if self._slopes is None:
            return block
        gradients = {column.word: np.full(len(rows), np.nan) for column in self.study.gradients}
        for i in np.flatnonzero(block.columns["ok"]).tolist():
            if progress:
                progress(i / len(rows))
            values, doubt = self._slopes.of(rows[i], ends[i])
            for word, value in values.items():
                gradients[word][i] = value
            if doubt:
                block.messages.setdefault(block.first + i, doubt)
        return Part(block.first, block.columns | gradients, block.messages)

    # -- in lanes --------------------------------------------------------------------------------------------------------------------------

    def _why_not_in_lanes(self) -> str | None:
        study, simulation = self.study, self.study.simulation
        if has_events(study.model):
            return "the model has events"
        conflicts = [name for name in ARGUMENTS_NOT_IN_LANES if simulation.get(name)]
        if conflicts:
            return f"{conflicts[0]} is given"
        if simulation.get("engine", AUTO) not in (AUTO, "emitted") or simulation.get("number", "double") != "double":
            return "engine or number is given"
        if simulation.get("formalism", AUTO) not in (AUTO, "coordinate-partitioning"):
            return f"formalism is {simulation['formalism']}"
        if simulation.get("integrator", AUTO) == AUTO and not study.left_open:
            return "a formalism is named, and no integrator"
        if uses_accelerations(study.model) and any(column.is_output(study.model) for column in study.values):
            return "outputs mention accelerations or loads"
        try:
            self._lanes_run = self._run_in_lanes()
        except ModelError as error:
            return str(error)
        return None

    def _run_in_lanes(self) -> tuple[Run, Method]:
        arguments = dict(self.study.simulation, formalism="coordinate-partitioning")
        run = Run.from_arguments(self.study.model, **arguments, points=self.study.grid)
        method = in_lanes(self.kernels, run)
        if not method.integrator.in_lanes:
            raise ModelError(f"{method.integrator.name} has no lanes")
        return run, method

    def _choose(self) -> str | None:
        """Choose independent coordinates, once for all variants; why there are none for lanes, or None."""
        run, method = self._lanes_run
        refused: NcgenError | None = None
        for rows in self._samples():
            q, _, p = self._starts(rows)
            q, _ = closed(self.kernels, q, run.initial.t, p)
            try:
                self._choice = CommonCoordinates.at_first(self.kernels, q, run.initial.t, p, run.initial.z, method, self._named_rates)
                self.sample = rows
                break
            except (SingularError, DomainError) as error:
                refused = error
            except ModelError as error:
                refused = error
                if np.isfinite(q).all(axis=1).any():
                    return str(error)
        if self._choice is None:
            return str(refused)
        self._rates({}, 1)
        return None

    def _starts(self, rows: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
        """Positions (B, n), the varied velocities by name and parameters (B, n_p) of variants with these numbers."""
        kernels, initial = self.kernels, self._lanes_run[0].initial
        columns = {argument_of(name): column for name, column in zip(self.study.design.names, rows.T, strict=True)}
        p = np.tile(initial.p, (len(rows), 1))
        for (argument, name), column in columns.items():
            if argument == "p":
                p[:, kernels.parameters.index(name)] = column
        q, start = np.array(kernels.start(p)), self.study.simulation.get("q0")
        if isinstance(start, dict):
            for name, value in start.items():
                q[:, kernels.index[name]] = value
        elif start is not None:
            q[:] = position(kernels, start)
        for (argument, name), column in columns.items():
            if argument == "q0":
                q[:, kernels.index[name]] = column
        return q, {name: column for (argument, name), column in columns.items() if argument == "zd0"}, p

    @cached_property
    def _named_rates(self) -> tuple[str, ...]:
        """Coordinates whose initial velocities are given by name, those that vary last."""
        velocities = self._lanes_run[0].initial.zd
        varied = (inner for argument, inner in map(argument_of, self.study.design.names) if argument == "zd0")
        return tuple(dict.fromkeys((*(velocities if isinstance(velocities, dict) else ()), *varied)))

    def _rates(self, varied: dict[str, np.ndarray], count: int) -> np.ndarray:
        """Velocities (B, nz) of the independent coordinates. Raises ModelError for those of others."""
        assert self._choice is not None
        names, start = self._choice.names, self._lanes_run[0].initial.zd
        velocities = np.zeros((count, len(names)))
        rates = start if isinstance(start, dict) else dict(zip(names, () if start is None else start, strict=False))
        if not isinstance(start, dict) and start is not None:
            check_count(start, names)
        check_independent(self._named_rates, names)
        for name, value in {**rates, **varied}.items():
            velocities[:, names.index(name)] = value
        return velocities

    def _together(self, first: int, rows: np.ndarray, threads: int | None, progress: Callable[[float], None] | None) -> Moved:
        assert self._choice is not None
        (run, method), kernels = self._lanes_run, self.kernels
        q, varied, p = self._starts(rows)
        zd = self._rates(varied, len(rows))
        q, faults = closed(kernels, q, run.initial.t, p)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of those that had to go on alone: their energy is a column for whoever wants it
            done = side_by_side(kernels, run, method, States(choice=self._choice, q=q, zd=zd, p=p, faults=faults), threads, progress)
        ok = done.ok
        done.q[~ok], done.qd[~ok] = np.nan, np.nan
        columns: dict[str, np.ndarray] = {"ok": ok}
        outputs = self._outputs(run.times, done, p, ok)
        histories = Histories(index=kernels.index, labels=tuple(kernels.model.outputs), t=run.times, q=done.q, qd=done.qd, outputs=outputs)
        for column in self.study.values:
            columns[column.word] = self._column(column, histories, done, p, ok)
        return Part(first, columns, {first + i: done.status[i] for i in np.flatnonzero(~ok).tolist()}), done.q[:, -1]

    def _column(self, column: Any, histories: Histories, done: Any, p: np.ndarray, ok: np.ndarray) -> np.ndarray:
        if column.over == "steps":
            return done.steps.astype(np.int64)
        if column.over == "time":
            return np.where(ok, histories.t[-1], np.nan)
        if column.over == "energy_drift":
            drift = np.full(len(ok), np.nan)
            if ok.any():
                drift[ok] = drifts(self.kernels, histories.t, done.q[ok], done.qd[ok], done.work[ok], p[ok])
            return drift
        return histories.column(column, self.study.times)

    def _outputs(self, t: np.ndarray, done: Any, p: np.ndarray, ok: np.ndarray) -> np.ndarray:
        """Outputs (B, K, outputs) that somebody keeps, only where they count; else none."""
        kernels, wanted = self.kernels, [column for column in self.study.values if column.is_output(self.study.model)]
        values = np.full((*done.q.shape[:2], len(kernels.model.outputs) if wanted else 0), np.nan)
        if wanted:
            rows_kept = [len(t) - 1] if all(column.over == "end" for column in wanted) else list(range(len(t)))
            for i in np.flatnonzero(ok):
                q, qd = done.q[i, rows_kept], done.qd[i, rows_kept]
                values[i, rows_kept] = outputs_of(kernels, t[rows_kept], q, qd, p[i])
        return values

    # -- one at a time ---------------------------------------------------------------------------------------------------------------------

    def _alone(self, first: int, rows: np.ndarray, threads: int | None, progress: Callable[[float], None] | None) -> Moved:
        study, messages = self.study, {}
        shapes = {column.word: (len(study.times),) if column.over == "history" else () for column in study.values}
        columns = {word: np.full((len(rows), *shape), np.nan) for word, shape in shapes.items()}
        columns |= {column.word: np.zeros(len(rows), dtype=np.int64) for column in study.values if column.is_count}
        ok, reported, ends = np.zeros(len(rows), dtype=bool), 0.0, np.full((len(rows), self.kernels.n), np.nan)
        carried = self._eventful.values(rows, threads, progress)
        for i, row in enumerate(rows):
            if progress and i / len(rows) - reported >= PROGRESS_INTERVAL:
                reported = i / len(rows)
                progress(reported)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                values = carried.pop(i, None) or self._simulated(row, progress)
            if isinstance(values, str):
                messages[first + i] = values
                continue
            ok[i] = True
            ends[i] = values[1]
            for word, value in values[0].items():
                columns[word][i] = value
            if caught:
                messages[first + i] = str(caught[0].message)
        return Part(first, {"ok": ok} | columns, messages), ends

    def _simulated(self, row: np.ndarray, progress: Callable[[float], None] | None) -> tuple[dict[str, Any], np.ndarray] | str:
        """What is kept of one variant and where it ends (n,), or why it has no motion."""
        study, kernels = self.study, self.kernels
        try:
            run = simulate_one(kernels, **study.options(row), points=study.grid, progress=(lambda t: None) if progress else None)
            return self._kept(run), run.q[-1]
        except NcgenError as error:
            return str(error)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            return f"{kernels.name}: a calculation failed ({' '.join(str(error).split())}); correct this variant"

    def _kept(self, run: Trajectory) -> dict[str, Any]:
        """What is kept of one motion."""
        motion = StudiedMotion(
            t=run.t,
            q=run.q,
            qd=run.qd,
            events=run.events,
            steps=run.statistics.steps,
            outputs=lambda: np.column_stack([*run.outputs.values()]),
            energy_drift=lambda: run.energy_drift,
        )
        return columns_of(self.study, self.kernels, motion)
