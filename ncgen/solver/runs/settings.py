"""How a run was asked to be computed: the arguments that are neither the start nor times, checked once for equal ones."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from numbers import Integral
from operator import itemgetter
from typing import Any, Literal, TypeAlias

import numpy as np

from ncgen.errors import ModelError, one_of, written
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
from ncgen.solver.argument_checks import ECHOED
from ncgen.solver.groups import MethodArguments

COMPILED = "compiled"
ENGINES = (AUTO, COMPILED, "c", "emitted", "refined", "python")
EMITTED: tuple[Literal["emitted"], Literal["refined"]] = ("emitted", "refined")
"""Engines for which the state derivative is written out for a mechanism."""

IN_C = (COMPILED, "c", *EMITTED)
"""Engines that do not go on in Python."""

Partitioned: TypeAlias = Literal["dense", "emitted", "refined"]
"""Of a state derivative in C: eliminated by the runtime, written out, or that with iterative refinement."""

Form: TypeAlias = Literal[Partitioned, "tree"]
"""Over all coordinates also by a recursion in loops over tables."""

NUMBERS = ("double", "float", "long double")
"""Number types of C."""

CACHED = 128
"""Different settings that are kept."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """The method of a run and what it is to keep, as asked for; equal arguments have the same object.

    formalism, integrator: entries of `ncgen.methods.table`, None where the choice is ncgen's; options: as given
    rtol, atol: atol None for a hundredth of rtol in natural sizes; max_step: s, or inf; engine, number: as of `simulate`
    """

    formalism: Formalism | None
    integrator: Integrator | None
    options: dict[str, Any] = field(default_factory=dict)
    rtol: float = 1e-8
    atol: float | None = None
    max_step: float = np.inf
    engine: str = AUTO
    number: str = "double"

    @classmethod
    def from_arguments(cls, arguments: Mapping[str, Any]) -> Settings:
        """From those of `MethodArguments`. Raises ModelError with one sentence."""
        *values, options = _in_order(arguments)
        items = None if options is None else tuple((k, type(v), v) for k, v in options.items()) if type(options) is dict else ...
        if items is ... or type(values[0]) is not str:
            return _checked(values, options)
        try:
            return _cached(*values, items)
        except TypeError:  # something is no key of a cache
            return _checked(values, options)

    @property
    def has_fixed_step(self) -> bool:
        """Whether the method was named and has one."""
        return self.integrator is not None and self.integrator.has_fixed_step

    @property
    def needs_c(self) -> bool:
        """Whether nothing but a run in C will do."""
        return self.engine in IN_C or self.number != "double"

    def _check(self) -> None:
        """A fixed step that is missing, and an engine that can never take the method."""
        named = self.integrator
        if named is not None and self.has_fixed_step and self.max_step == np.inf:
            raise ModelError(f"max_step: {named.name} has a fixed step; give its length in seconds")
        if self.engine in EMITTED and self.formalism is not None and self.formalism.is_constrained:
            raise ModelError(
                f"engine {self.engine!r}: a state derivative is emitted for coordinate-partitioning, not for {self.formalism.name}"
            )
        if named is not None and not named.in_c and self.needs_c:
            label = f"engine {self.engine!r}" if self.engine in IN_C else f"number {self.number!r}"
            raise ModelError(f"{label}: {named.name} runs in Python; in C there are {', '.join(in_c(INTEGRATORS))}")
        if self.engine == "python" and self.number != "double":
            raise ModelError(f"number {self.number!r}: Python computes with doubles; leave out engine='python'")


_in_order = itemgetter(*MethodArguments.__annotations__)
"""The values of a dictionary of them, the options last."""


def _checked(values: Sequence[Any], options: Any) -> Settings:
    formalism, integrator, rtol, atol, max_step, engine, number = values
    one, other = _entries(formalism, integrator, options)
    unlimited = max_step is None or (is_real(max_step) and max_step == np.inf)
    settings = Settings(
        formalism=one,
        integrator=other,
        options={} if options is None else dict(options),
        rtol=relative_tolerance(rtol),
        atol=None if atol is None else positive(atol, "atol"),
        max_step=np.inf if unlimited else positive(max_step, "max_step", "number of seconds"),
        engine=one_of(engine, "engine", ENGINES),
        number=one_of(number, "number", NUMBERS),
    )
    settings._check()
    return settings


@lru_cache(maxsize=CACHED, typed=True)
def _cached(*values: Any) -> Settings:
    """The same of arguments that a cache can compare; the options (name, type, value) each."""
    *others, items = values
    return _checked(others, None if items is None else {name: value for name, _, value in items})


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
