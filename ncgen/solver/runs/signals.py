"""What drives a mechanism while it moves: its inputs as functions of time, or as tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import DomainError, ModelError, counted, unknown_word
from ncgen.mechanism.driving import Function, InputPieces
from ncgen.solver.argument_checks import Outline, echo, finite, known_name, several

Hold: TypeAlias = Literal["zero", "linear", "cubic"]

HOLDS: tuple[Hold, ...] = get_args(Hold)
"""Between the instants of a table: the value before holds; straight lines; a cubic spline."""

Signal: TypeAlias = "ArrayLike | Callable[[float], float] | tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, Hold]"
"""An input over time, as `simulate` takes it, or numbers of many simulations, as `start` takes them."""

MIN_TIMES = 2
"""Instants of a table."""


@dataclass(frozen=True, eq=False)
class SignalTable(InputPieces):
    """An input as values at instants, and what holds between them; polynomials are linear in the values."""

    hold: Hold

    def by_values(self, t: np.ndarray, begun: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """How Σ weights · signal at times (each inside a step that began at another one) changes with the table's values, (K,)."""
        k, powers = self.place(t, begun)
        by_coefficients = np.zeros((len(self.knots), powers.shape[-1]))
        np.add.at(by_coefficients, k, weights[..., None] * powers)
        if self.hold == "cubic":
            return np.einsum("kc,kcv->v", by_coefficients, _coefficients(self.knots, np.eye(len(self.knots)), self.hold))
        sums = by_coefficients[:, 0]
        if self.hold == "linear":
            rises = by_coefficients[:-1, 1] / np.diff(self.knots)
            sums[:-1] -= rises
            sums[1:] += rises
        return sums


@dataclass(frozen=True, eq=False)
class Signals:
    """The inputs of one run.

    laws: one an input in their order, None for one that keeps its value
    begun: of tables the piece of this time (s) continues, whatever time is asked for; None for the piece of the time itself
    """

    name: str
    names: tuple[str, ...]
    laws: tuple[InputPieces | Function | None, ...]
    begun: float | None = None

    def begun_at(self, t: float) -> Signals:
        """The same inside a step that began at a time (s)."""
        return replace(self, begun=t)

    def __call__(self, t: float, p: np.ndarray) -> np.ndarray:
        """Parameters p (n_p,) with the inputs of a time in their places. Raises DomainError naming one that is no number."""
        p = np.array(p)
        first = len(p) - len(self.laws)
        for i, signal in enumerate(self.laws):
            if signal is not None:
                value = signal(t, self.begun) if isinstance(signal, InputPieces) else signal(t)
                p[first + i] = self._checked(i, value, t)
        return p

    def _checked(self, i: int, value: object, t: float) -> float:
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            problem = f"the input {self.names[i]} is {echo(value)} at t = {t:.6g} s"
            raise DomainError(f"{self.name}: {problem}; its function must give a finite number")
        return number

    @property
    def functions(self) -> tuple[InputPieces | Function | None, ...]:
        """As C asks for them: functions of Python are checked."""
        return tuple(s if s is None or isinstance(s, InputPieces) else self._watched(i, s) for i, s in enumerate(self.laws))

    def by_values(self, t: np.ndarray, begun: np.ndarray, weights: np.ndarray) -> dict[str, np.ndarray]:
        """{name: how Σ weights · inputs changes with its values, (K,)} of the inputs that are tables.

        weights (…, inputs) at times t (…), inside steps that began at `begun`."""
        tables = [(i, signal) for i, signal in enumerate(self.laws) if isinstance(signal, SignalTable)]
        return {self.names[i]: signal.by_values(t, begun, weights[..., i]) for i, signal in tables}

    def _watched(self, i: int, function: Function) -> Function:
        return lambda t: self._checked(i, function(t), t)


def signals_of(kernels: Outline, inputs: Mapping[str, Signal] | None, p: np.ndarray) -> Signals | None:
    """What drives a run, None where nothing changes with time; inputs that are numbers are put into p (n_p,).

    Raises ModelError for an unknown input, and for what is neither a number, a function nor a table.
    """
    names = tuple(kernels.model.inputs)
    if inputs is None:
        return None
    if not isinstance(inputs, Mapping):
        raise ModelError(f"inputs: {echo(inputs)} given; give {{name: number, function of time, or (times, values)}}")
    functions: list[InputPieces | Function | None] = [None] * len(names)
    for name, signal in inputs.items():
        index = names.index(known_name(name, names, "inputs", "input"))
        if callable(signal):
            functions[index] = signal
        elif isinstance(signal, (tuple, list)):
            functions[index] = _table(signal, f"inputs: {name}")
        else:
            p[len(p) - len(names) + index] = finite(signal, f"inputs: {name}")
    return Signals(kernels.name, names, tuple(functions)) if any(functions) else None


def _table(signal: Sequence[object], where: str) -> SignalTable:
    """A table as polynomials. Raises ModelError unless its instants are two or more, ascending, each with a value."""
    if len(signal) not in (2, 3):
        raise ModelError(f"{where}: {counted(len(signal), 'thing')} given; give (times, values) or (times, values, hold)")
    times, values = several(signal[0], f"{where}, times"), several(signal[1], f"{where}, values")  # type: ignore[arg-type]
    hold = signal[2] if len(signal) == 3 else "linear"
    if hold not in HOLDS:
        raise unknown_word(hold, f"{where}: hold", HOLDS)
    if len(times) != len(values) or len(times) < MIN_TIMES:
        raise ModelError(f"{where}: {len(times)} times and {counted(len(values), 'value')}; give as many of both, {MIN_TIMES} or more")
    if not np.all(np.diff(times) > 0):
        k = int(np.argmin(np.diff(times) > 0))
        raise ModelError(f"{where}: time {k + 1} is {times[k + 1]:.6g} s after {times[k]:.6g} s; times must ascend")
    return SignalTable(times, _coefficients(times, values, hold), hold)


def _coefficients(times: np.ndarray, values: np.ndarray, hold: Hold) -> np.ndarray:
    """Of the polynomials (K, 4, …), for values (K, …)."""
    coefficients = np.zeros((len(times), 4, *values.shape[1:]))
    coefficients[:, 0] = values
    if hold == "linear":
        coefficients[:-1, 1] = (np.diff(values, axis=0).T / np.diff(times)).T
    elif hold == "cubic":
        from scipy.interpolate import CubicSpline

        coefficients[:-1] = CubicSpline(times, values).c[::-1].swapaxes(0, 1)
    return coefficients
