"""A run as it was asked for: one object, checked in one place. Every door builds it before anything is generated, compiled or moved.

It needs names and sizes only, so a model will do where nothing is compiled yet (`outline`): `ncgen check` and the command line
build it like `simulate` does, and refuse in the same words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.elements import Component
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import (
    ArrayOrNamed,
    Outline,
    checked_kernels,
    finite,
    known_name,
    names_of,
    parameters,
    position,
    real_numbers,
)
from ncgen.solver.groups import CONSISTENT_RESIDUAL, DEFAULTS, MotionArguments, StartArguments, check_names
from ncgen.solver.runs.grid import MIN_TIME_SPACING, Grid, grid_of
from ncgen.solver.runs.progress_reports import ProgressOption, check_progress
from ncgen.solver.runs.settings import CACHED, Settings, echo, positive
from ncgen.solver.runs.signals import Signals, signals_of
from ncgen.solver.runs.stop import StopCondition, stop_at

START = tuple(name for name in StartArguments.__annotations__ if name != "inputs")
"""Arguments of a start without what drives it."""

TWO_VELOCITIES = "zd0 and qd0 are both given; give the initial velocities once"

MOST_STEPS = 10**9
"""Fixed steps of a run; more take hours."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Initial:
    """Where a mechanism begins, as it was asked for: nothing is closed or solved yet.

    p (n_p,), q (n,): parameters and position; t: time (s)
    z: names of the coordinates that are to be independent, () for the model's choice
    zd: initial rates of the independent coordinates by name or as an array in the order of z, or None
    qd: rates of any coordinates by name, or of all as an array (n,), or None
    closing: the relative residual up to which the position passes as closed
    """

    p: np.ndarray
    q: np.ndarray
    t: float = 0.0
    z: tuple[str, ...] = ()
    zd: dict[str, float] | np.ndarray | None = None
    qd: dict[str, float] | np.ndarray | None = None
    closing: float = CONSISTENT_RESIDUAL

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """What tells it from other starts of the mechanism."""
        zd, qd = (
            tuple(each.items()) if isinstance(each, dict) else None if each is None else each.tobytes() for each in (self.zd, self.qd)
        )
        return self.q.tobytes(), self.p.tobytes(), self.t, self.z, self.closing, zd, qd

    @classmethod
    def from_arguments(
        cls,
        subject: Kernels | Model,
        *,
        q0: ArrayOrNamed | None = None,
        zd0: ArrayOrNamed | None = None,
        qd0: ArrayOrNamed | None = None,
        z: str | Iterable[str] | None = None,
        p: ArrayOrNamed | None = None,
        t0: float = 0.0,
        closing: float = CONSISTENT_RESIDUAL,
    ) -> Initial:
        """From what the caller gives. Raises ModelError."""
        known = outline(subject)
        values = parameters(known, p)
        return cls(
            p=values,
            q=position(known, q0, values, "q0"),
            t=finite(t0, "t0"),
            z=names_of(z, "z", known.coordinates),
            closing=argument_checks.closing(closing),
        ).with_velocities(known, zd0, qd0)

    def with_velocities(self, known: Outline, zd0: ArrayOrNamed | None, qd0: ArrayOrNamed | None) -> Initial:
        """The same position with velocities, itself where none are given. Raises ModelError."""
        if zd0 is None and qd0 is None:
            return self
        if zd0 is not None and qd0 is not None:
            raise ModelError(TWO_VELOCITIES)
        return replace(self, zd=_rates(known, zd0, "zd0", whole=False), qd=_rates(known, qd0, "qd0", whole=True))


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """One simulation as it was asked for.

    settings: of the method; grid: its times
    stop: where to end before, or None; signals: what drives the mechanism, or None
    """

    initial: Initial
    settings: Settings
    grid: Grid
    stop: StopCondition | None = None
    signals: Signals | None = None

    @classmethod
    def from_arguments(
        cls,
        subject: Kernels | Model,
        duration: float,
        *,
        points: int | ArrayLike = 101,
        stop: Mapping[str, Any] | None = None,
        progress: ProgressOption = None,
        **arguments: Unpack[MotionArguments],
    ) -> Run:
        """From the arguments of `ncgen.simulate`. Raises ModelError with one sentence."""
        check_names("simulate", arguments, DEFAULTS)
        known, values = outline(subject), {**DEFAULTS, **arguments}
        length = positive(duration, "duration", "number of seconds")
        start = _initial(subject, values)
        settings = Settings.from_arguments(values)
        check_progress(progress)
        run = cls(
            initial=start,
            settings=settings,
            grid=grid_of(start.t, length, points, len(known.coordinates)),
            stop=stop_at(known, stop),
            signals=signals_of(known, values["inputs"], start.p),
        )
        run._check_steps()
        return run

    @property
    def times(self) -> np.ndarray:
        """The grid (points,) in s, which nobody changes."""
        return self.grid.times

    @property
    def duration(self) -> float:
        """From the first instant to the last (s)."""
        return self.grid.duration

    def _check_steps(self) -> None:
        """A longest step is not too small for the time there is."""
        max_step = self.settings.max_step
        if max_step == np.inf:
            return
        if max_step < MIN_TIME_SPACING * np.max(np.abs(self.times)):
            raise ModelError(
                f"max_step: {max_step:.6g} s cannot be distinguished at t = {np.max(np.abs(self.times)):.6g} s; take a longer one"
            )
        if self.duration / max_step > MOST_STEPS:
            kind = "steps" if self.settings.has_fixed_step else "steps at least"
            raise ModelError(
                f"max_step: {max_step:.6g} s makes {self.duration / max_step:.3g} {kind}; {MOST_STEPS:.0e} are the limit, take a longer one"
            )


def _initial(subject: Kernels | Model, values: Mapping[str, Any]) -> Initial:
    """The start in the arguments of a run; the model's own position is one object for equal arguments."""
    t0, z, closing = values["t0"], values["z"], values["closing"]
    is_own = values["q0"] is values["p"] is values["inputs"] is None  # inputs are put into the parameters
    if not is_own or isinstance(subject, Model) or not (type(t0) is type(closing) is float and (z is None or type(z) is str)):
        return Initial.from_arguments(subject, **{name: values[name] for name in START})
    initial = subject.remember("own starts", (t0, z, closing), lambda: Initial.from_arguments(subject, t0=t0, z=z, closing=closing), CACHED)
    return initial.with_velocities(subject, values["zd0"], values["qd0"])


@dataclass(frozen=True, eq=False)
class _Plan:
    """As much of a model as of its kernels; free: the coordinates that can move."""

    model: Model
    free: tuple[Component, ...]
    p0: np.ndarray

    @property
    def name(self) -> str:
        return self.model.name

    @property
    def n(self) -> int:
        return len(self.free)

    @property
    def coordinates(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.free)

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.model.numbers)

    @property
    def index(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.coordinates)}

    @property
    def q0(self) -> np.ndarray:
        return self.start()

    def start(self, p: ArrayLike | None = None) -> np.ndarray:
        """The initial position (n,) in m and rad; its numbers at the parameters' defaults are enough here."""
        return np.array([c.initial for c in self.free], dtype=float)


def outline(subject: Kernels | Model) -> Outline:
    """Names, sizes and defaults of a mechanism: the kernels themselves, or as much of a model. Raises ModelError for anything else."""
    if isinstance(subject, Model):
        values = [number.default for number in subject.numbers.values()]
        return _Plan(subject, tuple(c for c in subject.components if not c.fixed), np.array(values, dtype=float))
    return checked_kernels(subject)


def _rates(subject: Outline, velocities: ArrayOrNamed | None, name: str, whole: bool) -> dict[str, float] | np.ndarray | None:
    """Rates by name or as an array, or None; whole: an array has one number a free coordinate."""
    if velocities is None:
        return None
    if isinstance(velocities, dict):
        return {known_name(key, subject.coordinates, name): finite(value, f"{name}: {key}") for key, value in velocities.items()}
    rates = real_numbers(velocities, name)
    if rates is None or rates.ndim != 1 or (whole and len(rates) != len(subject.coordinates)):
        needed = f"{len(subject.coordinates)} numbers, one a free coordinate," if whole else "numbers in the order of z"
        raise ModelError(f"{name}: {echo(velocities)} given; give {needed} or {{name: rate}}")
    for k in np.flatnonzero(~np.isfinite(rates))[:1].tolist():
        finite(rates[k], f"{name}: {subject.coordinates[k] if whole else f'number {k + 1}'}")
    return rates
