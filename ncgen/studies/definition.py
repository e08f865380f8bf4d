"""A study as data: a model, what varies, what is kept, and how it is simulated. It can be pickled, and has a digest."""

from __future__ import annotations

import hashlib
import json
import pickle
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ncgen.errors import MAX_ECHO, ModelError, counted, shortened
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.own_formalism import is_own
from ncgen.methods.table import AUTO
from ncgen.model import Model
from ncgen.model.digest import OF_EVENTS, digest, digest_of_events
from ncgen.model.elements import coordinate_of
from ncgen.model.model import checked_model
from ncgen.solver.argument_checks import count as whole
from ncgen.solver.argument_checks import has_events, known_name, several
from ncgen.solver.runs.run import Run, outline
from ncgen.solver.runs.simulation_options import check_options, simulation_of
from ncgen.solver.trajectories.output_values import uses_accelerations
from ncgen.studies.design import Design, Varied, argument_of, started
from ncgen.studies.kept import Kept, kept

DEFAULT_TIMES = 101
"""Instants of a run whose extremes or energy are looked at, unless `points` says something else."""

NO_GRADIENT = ("stop", "inputs")
"""Arguments of `simulate` beside which no gradients are kept."""

TIME_TOLERANCE = 1e-9
"""Share of a run within which two instants are one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """design: the variants; kept: columns; times (K,): of histories (s); simulation: arguments of `simulate` that all have in common, but
    for points: how many instants are looked at, or which; None where that follows from what is kept; steps: of equal length, of the motions
    that gradients go through."""

    model: Model
    design: Design
    kept: tuple[Kept, ...]
    times: np.ndarray
    simulation: dict[str, Any] = field(default_factory=dict)
    points: Any = None
    steps: int | None = None

    def __repr__(self) -> str:
        return f"<Study {self.model.name}: {counted(self.size, 'variant')}, {shortened(', '.join(k.word for k in self.kept), MAX_ECHO)}>"

    @classmethod
    def of(
        cls,
        model: Model | Kernels,
        vary: Varied,
        *,
        design: str = "grid",
        count: int | None = None,
        seed: int = 0,
        keep: str | Sequence[str] = (),
        times: Iterable[float] | None = None,
        steps: int | None = None,
        simulation: Mapping[str, Any] | None = None,
    ) -> Study:
        """From the arguments of `ncgen.study`. Raises ModelError with one sentence, before anything is generated."""
        model = checked_model(getattr(model, "model", model))
        options = simulation_of(model, **(simulation or {}))
        check_options(options)
        run, known = Run.from_arguments(model, **options), outline(model)
        if model.callbacks:
            raise ModelError(f"{model.name}: a force is a Python function, which is no data; a study needs a model that can travel")
        if called := [event.name for event in model.events.values() if event.is_called]:
            raise ModelError(
                f"{model.name}: event {called[0]} calls a Python function, which is no data; write what it does as expressions"
            )
        if is_own(options.get("formalism")):
            raise ModelError("formalism: an object is no data; a study takes the name of a formalism of ncgen's")
        for name, signal in (options.get("inputs") or {}).items():
            if callable(signal):
                raise ModelError(f"inputs, {name}: a Python function is no data; give a number or a table of times and values")
        variants = Design.of(vary, design, count, seed)
        columns = kept(keep, known, variants.names)
        points = options.pop("points", None)
        instants = several(sorted(times or ()), "times")
        if any(column.over == "history" for column in columns) != bool(len(instants)):
            raise ModelError("times: history(…) is kept at times (s), such as times=[0.1, 0.2]; give both or neither")
        ends = run.times[[0, -1]]
        if len(instants) and not ends[0] <= instants[0] <= instants[-1] <= ends[1]:
            raise ModelError(f"times: from {instants[0]:g} to {instants[-1]:g} s given; the run goes from {ends[0]:g} to {ends[1]:g} s")
        if len(instants) and run.stop is not None:
            raise ModelError("times: where a run may end before, it has no instants of its own; keep the end, or leave stop out")
        if len(instants) and (ending := [event.name for event in model.events.values() if event.is_last]):
            raise ModelError(f"times: event {ending[0]} may end a run before; keep the end, or leave the event out")
        steps = None if steps is None else whole(steps, "steps")
        study = cls(
            model=model, design=variants, kept=columns, times=_apart(instants, ends), simulation=options, points=points, steps=steps
        )
        study._check_names()
        study._check_gradients()
        return study

    def _check_names(self) -> None:
        known = outline(self.model)
        for name in self.design.names:
            if (inner := started(name)) is not None:
                known_name(coordinate_of(inner), known.coordinates, f"vary, {name}")
            elif coordinate_of(name) in known.coordinates:
                raise ModelError(f"vary, {name}: it is a coordinate, whose start varies; write start({name})")
            else:
                known_name(name, known.parameters, "vary", "parameter")
        columns = ["ok", *(column.word for column in self.kept)]
        if twice := [name for name in self.design.names if name in columns]:
            raise ModelError(f"vary, {twice[0]}: the results have another column of that name; rename the parameter")
        if "qd0" in self.simulation and any(coordinate_of(started(n) or "") != started(n) for n in self.design.names if started(n)):
            raise ModelError("vary: the start of a velocity varies, and qd0 is given; give the others by zd0")
        for name in ("q0", "zd0", "p"):
            if self.simulation.get(name) is not None and not isinstance(self.simulation[name], Mapping) and self._varied(name):
                raise ModelError(f"{name}: some of it varies; give the rest by name, {{name: number}}")

    def _check_gradients(self) -> None:
        if bool(self.gradients) != (self.steps is not None):
            raise ModelError("steps: gradient(…) goes through steps of equal length, as ncgen.gradient does; give both or neither")
        for column in self.gradients:
            if has_events(self.model):
                raise ModelError(
                    f"keep, {column.word}: the model has events, and studies have no gradients of such runs; leave one of them out"
                )
            if conflicts := [name for name in NO_GRADIENT if self.simulation.get(name)]:
                raise ModelError(f"keep, {column.word}: {conflicts[0]} is given, and such runs have no derivative; leave one of them out")
            if column.is_output(self.model) and uses_accelerations(self.model):
                raise ModelError(f"keep, {column.word}: outputs mention accelerations or loads, of which no gradient is kept; leave it out")

    @cached_property
    def values(self) -> tuple[Kept, ...]:
        """Columns that are no gradients."""
        return tuple(column for column in self.kept if not column.by)

    @cached_property
    def gradients(self) -> tuple[Kept, ...]:
        """Columns that are."""
        return tuple(column for column in self.kept if column.by)

    def _varied(self, argument: str) -> list[str]:
        return [name for name in self.design.names if argument_of(name)[0] == argument]

    @property
    def size(self) -> int:
        """How many variants there are."""
        return self.design.size

    @cached_property
    def run(self) -> Run:
        """The run that all variants have in common, on the instants that are looked at."""
        return Run.from_arguments(self.model, **self.simulation, points=self.grid)

    @cached_property
    def grid(self) -> np.ndarray:
        """The instants of every run (s): those of histories, and even ones where the whole run counts."""
        usual = DEFAULT_TIMES if any(column.whole for column in self.values) else 2
        even = Run.from_arguments(self.model, **self.simulation, points=usual if self.points is None else self.points).times
        inner = even[1:-1]
        near = np.abs(inner[:, None] - self.times).min(axis=1, initial=np.inf) < TIME_TOLERANCE * (even[-1] - even[0])
        return np.union1d(np.concatenate([even[[0, -1]], inner[~near]]), self.times)

    def options(self, row: np.ndarray) -> dict[str, Any]:
        """Arguments of `simulate` for a variant with these numbers (names,)."""
        arguments = dict(self.simulation)
        for name, value in zip(self.design.names, row.tolist(), strict=True):
            argument, inner = argument_of(name)
            arguments[argument] = {**(arguments.get(argument) or {}), inner: value}
        return arguments

    @cached_property
    def digest(self) -> str:
        """What tells the study from others, 64 hexadecimal digits: equal if and only if variants and columns are."""
        model_digest = digest(self.model) or hashlib.sha256(pickle.dumps(self.model)).hexdigest()
        axes = [[a.name, a.kind, [float(x).hex() for x in (*a.values, *a.ends)]] for a in self.design.axes]
        content = [
            model_digest, axes, self.design.kind, self.design.count, self.design.seed, [column.word for column in self.kept],
            [t.hex() for t in self.times.tolist()], [t.hex() for t in self.grid.tolist()], _plain(self.simulation),
        ] + ([self.steps] if self.steps else [])  # fmt: skip
        if has_events(self.model):
            content.append(
                digest_of_events(self.model) or hashlib.sha256(pickle.dumps([getattr(self.model, name) for name in OF_EVENTS])).hexdigest()
            )
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    @property
    def left_open(self) -> bool:
        """Whether formalism and integrator are ncgen's choice."""
        return self.simulation.get("formalism", AUTO) == AUTO and self.simulation.get("integrator", AUTO) == AUTO


def _apart(times: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Instants without those that another one, or an end, stands for."""
    near = TIME_TOLERANCE * (ends[1] - ends[0])
    for end in ends:
        times = np.where(np.abs(times - end) < near, end, times)
    return times[np.diff(times, prepend=-np.inf) > near] if len(times) else times


def _plain(value: Any) -> Any:
    """A value in what JSON has, numbers to the last bit."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, list, tuple)):
        return [_plain(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    return float(value).hex()
