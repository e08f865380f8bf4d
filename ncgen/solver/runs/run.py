"""A run as it was asked for: one object, checked in one place. Every door builds it before anything is generated, compiled or moved.

It needs names and sizes only, so a model will do where nothing is compiled yet (`outline`): `ncgen check` and the command line
build it like `simulate` does, and refuse in the same words.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, Literal, TypeAlias, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError, one_of, shown, written
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.own_formalism import OwnFormalism
from ncgen.methods.table import (
    AUTO,
    FORMALISMS,
    INTEGRATORS,
    Formalism,
    Integrator,
    find_formalism,
    find_integrator,
    in_c,
    is_real,
    options_of,
    partners,
)
from ncgen.model import Model
from ncgen.model.elements import Component
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import (
    ECHOED,
    ArrayOrNamed,
    Outline,
    checked_kernels,
    finite,
    known_name,
    names_of,
    parameters,
    position,
    real_numbers,
    several,
)
from ncgen.solver.groups import CONSISTENT_RESIDUAL, DEFAULTS, MotionArguments, check_names
from ncgen.solver.runs.progress_reports import ProgressOption, check_progress
from ncgen.solver.runs.signals import Signals, signals_of
from ncgen.solver.runs.stop import StopCondition, stop_at

COMPILED = "compiled"
ENGINES = (AUTO, COMPILED, "c", "emitted", "refined", "python")
EMITTED: tuple[Literal["emitted"], Literal["refined"]] = ("emitted", "refined")
"""Engines for which the state derivative is written out for a mechanism."""

Partitioned: TypeAlias = Literal["dense", "emitted", "refined"]
"""Of a state derivative in C: eliminated by the runtime, written out, or that with iterative refinement."""

Form: TypeAlias = Literal[Partitioned, "tree"]
"""Over all coordinates also by a recursion in loops over tables."""

NUMBERS = ("double", "float", "long double")
"""Number types of C."""

TWO_VELOCITIES = "zd0 and qd0 are both given; give the initial velocities once"

MIN_TIME_SPACING = 100 * np.finfo(float).eps
"""Instants nearer to each other than this, relative to the time, cannot be distinguished."""

MOST_STEPS = 10**9
"""Fixed steps of a run; more take hours."""

MAX_INTEGER = 10**300
"""Whole numbers beyond this are no doubles."""

MOST_NUMBERS = 2**31
"""Numbers in a trajectory's positions, velocities and accelerations: 16 GiB."""


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
        if zd0 is not None and qd0 is not None:
            raise ModelError(TWO_VELOCITIES)
        values = parameters(known, p)
        return cls(
            p=values,
            q=position(known, q0, values, "q0"),
            t=finite(t0, "t0"),
            z=names_of(z, "z", known.coordinates),
            zd=_rates(known, zd0, "zd0", whole=False),
            qd=_rates(known, qd0, "qd0", whole=True),
            closing=argument_checks.closing(closing),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """One simulation as it was asked for.

    formalism, integrator: entries of `ncgen.methods.table`, None where the choice is ncgen's; options: as given
    times (points,): the grid (s); rtol, atol: atol None for a hundredth of rtol in natural sizes; max_step: s, or inf
    stop: where to end before, or None; signals: what drives the mechanism, or None; engine, number: as of `simulate`
    """

    initial: Initial
    times: np.ndarray
    formalism: Formalism | None
    integrator: Integrator | None
    options: dict[str, Any] = field(default_factory=dict)
    rtol: float = 1e-8
    atol: float | None = None
    max_step: float = np.inf
    stop: StopCondition | None = None
    engine: str = AUTO
    number: str = "double"
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
        values = {**DEFAULTS, **arguments}
        inputs, formalism, integrator, options = (values.pop(name) for name in ("inputs", "formalism", "integrator", "options"))
        rtol, atol, max_step, engine, number = (values.pop(name) for name in ("rtol", "atol", "max_step", "engine", "number"))
        known = outline(subject)
        length = positive(duration, "duration", "number of seconds")
        start = Initial.from_arguments(subject, **values)
        formalism, integrator = _entries(formalism, integrator, options)
        unlimited = max_step is None or (is_real(max_step) and max_step == np.inf)
        check_progress(progress)
        run = cls(
            initial=start,
            times=_grid(start.t, length, points, len(known.coordinates)),
            formalism=formalism,
            integrator=integrator,
            options={} if options is None else dict(options),
            rtol=relative_tolerance(rtol),
            atol=None if atol is None else positive(atol, "atol"),
            max_step=np.inf if unlimited else positive(max_step, "max_step", "number of seconds"),
            stop=stop_at(known, stop),
            engine=one_of(engine, "engine", ENGINES),
            number=one_of(number, "number", NUMBERS),
            signals=signals_of(known, inputs, start.p),
        )
        run._check_steps()
        run._check_engine()
        return run

    @property
    def duration(self) -> float:
        """From the first instant to the last (s)."""
        return float(self.times[-1] - self.times[0])

    @property
    def promises(self) -> bool:
        """True where the integrator is ncgen's choice: rtol is then promised for the end of the run and not for every step."""
        return self.integrator is None

    def _check_steps(self) -> None:
        """A fixed step is needed, or not too small for the time there is."""
        if self.integrator is not None and self.integrator.has_fixed_step and self.max_step == np.inf:
            raise ModelError(f"max_step: {self.integrator.name} has a fixed step; give its length in seconds")
        if self.max_step == np.inf:
            return
        fixed = self.integrator is not None and self.integrator.has_fixed_step
        if self.max_step < MIN_TIME_SPACING * np.max(np.abs(self.times)):
            raise ModelError(
                f"max_step: {self.max_step:.6g} s cannot be distinguished at t = {np.max(np.abs(self.times)):.6g} s; take a longer one"
            )
        if self.duration / self.max_step > MOST_STEPS:
            kind = "steps" if fixed else "steps at least"
            raise ModelError(
                f"max_step: {self.max_step:.6g} s makes {self.duration / self.max_step:.3g} {kind}; "
                f"{MOST_STEPS:.0e} are the limit, take a longer one"
            )

    def _check_engine(self) -> None:
        """An engine that can never take the method."""
        if self.engine in EMITTED and self.formalism is not None and self.formalism.is_constrained:
            raise ModelError(
                f"engine {self.engine!r}: a state derivative is emitted for coordinate-partitioning, not for {self.formalism.name}"
            )
        named = self.integrator
        if named is not None and not named.in_c and (self.engine in (COMPILED, "c", *EMITTED) or self.number != "double"):
            label = f"engine {self.engine!r}" if self.engine in (COMPILED, "c", *EMITTED) else f"number {self.number!r}"
            raise ModelError(f"{label}: {named.name} runs in Python; in C there are {', '.join(in_c(INTEGRATORS))}")
        if self.engine == "python" and self.number != "double":
            raise ModelError(f"number {self.number!r}: Python computes with doubles; leave out engine='python'")


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


# -- single numbers and words --------------------------------------------------------------------------------------------------------------


def positive(value: object, name: str, noun: str = "number") -> float:
    """A positive, finite number. Raises ModelError naming the argument."""
    if isinstance(value, (bool, np.bool_)) or not is_real(value) or not 0 < value <= sys.float_info.max:
        raise ModelError(f"{name}: {echo(value)} given; it must be a positive {noun}")
    return float(value)


def relative_tolerance(value: object) -> float:
    """A tolerance relative to what is integrated. Raises ModelError unless it is above 0 and below 1, from where on all would pass."""
    number = positive(value, "rtol")
    if not number < 1:
        raise ModelError(f"rtol: {echo(value)} given; it must be below 1, such as 1e-8")
    return number


def count(value: object, name: str, least: int, why: str) -> int:
    """A whole number from `least` on. Raises ModelError naming the argument."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Integral) or value < least:
        raise ModelError(f"{name}: {echo(value)} given; {why}")
    return int(value)


def echo(value: object) -> str:
    """What was given, shortened."""
    text = written(value)
    return text if len(text) <= ECHOED else f"{text[: ECHOED - 1]}…"


def _grid(start: float, length: float, points: Any, n: int) -> np.ndarray:
    """Even instants, or those that are given. Raises ModelError where there are too many, or they cannot be distinguished."""
    is_single = not isinstance(points, Iterable) or isinstance(points, str) or (isinstance(points, np.ndarray) and points.ndim == 0)
    times = None if is_single else several(points, "points")
    size = count(points, "points", 2, "a trajectory has at least 2") if times is None else len(times)
    if size * (3 * n + 1) > MOST_NUMBERS:
        room = min(size * (3 * n + 1), MAX_INTEGER) * 8 / 2**30
        raise ModelError(f"points: {shown(size)} instants of {n} coordinates take {room:.3g} GiB; ask for fewer")
    end = start + length
    if not np.isfinite(end):
        raise ModelError(f"duration: {length:.6g} s from t0 = {start:.6g} s on is beyond all numbers; take a shorter one")
    shortest = MIN_TIME_SPACING * max(abs(start), abs(end))
    if times is not None:
        return _instants(times, start, end, shortest)
    if length / (size - 1) < shortest:
        raise ModelError(
            f"t0: {start:.6g} s with {size} points in {length:.6g} s: instants cannot be distinguished in double precision; "
            "begin nearer to 0, or ask for fewer points"
        )
    return np.linspace(start, end, size)


def _instants(times: np.ndarray, start: float, end: float, shortest: float) -> np.ndarray:
    """Given instants. Raises ModelError unless they ascend from the start of a run to its end."""
    if len(times) < 2 or abs(times[0] - start) > shortest or abs(times[-1] - end) > shortest:
        raise ModelError(f"points: {echo(times.tolist())} given; instants begin at t0 = {start:.6g} s and end at {end:.6g} s")
    for k in np.flatnonzero(~(np.diff(times) >= shortest))[:1]:
        raise ModelError(f"points: {times[k + 1]:.6g} s follows {times[k]:.6g} s; let the instants ascend")
    return times


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
    for k, rate in enumerate(rates.tolist()):
        finite(rate, f"{name}: {subject.coordinates[k] if whole else f'number {k + 1}'}")
    return rates


def _entries(formalism: str | OwnFormalism, integrator: str, options: dict[str, Any] | None) -> tuple[Formalism | None, Integrator | None]:
    """Entries of the table, None for "auto". Raises ModelError where they do not go together or an option is not theirs."""
    one = None if isinstance(formalism, str) and formalism == AUTO else find_formalism(formalism)
    other = None if isinstance(integrator, str) and integrator.lower() == AUTO else find_integrator(integrator)
    if one and not other and not one.is_ordinary:
        other = next(entry for entry in INTEGRATORS.values() if one.name in entry.steps)  # the only one that there can be
    if one and other:
        Method.of(one, other.name, options)
    elif one:  # whatever is chosen beside it, an option must belong to one of the methods that there may be
        _some_option([(one, INTEGRATORS[i]) for i in partners(one)], options)
    elif other:
        _some_option([(FORMALISMS[f], other) for f in partners(other)], options)
    elif options:
        _some_option([(FORMALISMS[f], i) for i in INTEGRATORS.values() for f in partners(i)], options)
    return one, other


def _some_option(pairs: list[tuple[Formalism, Integrator]], options: dict[str, Any] | None) -> None:
    """Raise the first refusal where no pair takes the options."""
    refusals = []
    for pair in pairs:
        try:
            options_of(*pair, options)
            return
        except ModelError as error:
            refusals.append(error)
    raise refusals[0]
