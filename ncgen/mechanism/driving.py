"""What drives a mechanism while it moves, as C reads it: tables there, functions of Python by a call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.listening import keeper
from ncgen.toolchain.abi import InC, Interface, Number, runtime_abi
from ncgen.toolchain.once import once


@dataclass(frozen=True, eq=False)
class InputPieces:
    """An input as polynomials from knot to knot.

    knots (K,): s, ascending; coefficients (K, 4): of 1, s, s² and s³ with s = t − knot
    The first value holds before the first knot, the last polynomial after the last one.
    """

    knots: np.ndarray
    coefficients: np.ndarray

    def __call__(self, t: float, begun: float | None = None) -> float:
        """The value at a time (s) inside a step that began at another one; at a jump the one after it."""
        return float(self.at(np.array(t), np.array(t if begun is None else begun)))

    def at(self, t: np.ndarray, begun: np.ndarray) -> np.ndarray:
        """The values at many times, each inside a step that began at another one."""
        k, powers = self.place(t, begun)
        return np.sum(self.coefficients[k] * powers, axis=-1)

    def place(self, t: np.ndarray, begun: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which piece holds at times, (…), and 1, s, s² and s³ there, (…, 4)."""
        k = np.maximum(np.searchsorted(self.knots, begun, side="right") - 1, 0)
        knot = self.knots[k]
        s = np.where((begun < knot) & (t < knot), 0.0, t - knot)
        return k, np.stack([np.ones_like(s), s, s * s, s * s * s], axis=-1)


Function = Callable[[float], float]


def signal_values(signal: InputPieces | Function, t: np.ndarray, begun: np.ndarray) -> np.ndarray:
    """A signal at times (s), each inside a step that began at another one; of functions of Python every time is asked for."""
    return signal.at(t, begun) if isinstance(signal, InputPieces) else np.vectorize(signal, otypes=[float])(t)


class Driver:
    """The signals of one run in C.

    told: one of the two kinds an input, None for one that keeps its value in p; () where all do
    breaks (B, 2): as `break_times` finds them, those of the tables among them
    raised: what a function raised, or None
    """

    def __init__(self, laws: Sequence[InputPieces | Function | None], number: Number, breaks: ArrayLike = ()) -> None:
        self._ffi: Interface = runtime_abi(number.name)
        self.raised: BaseException | None = None
        self._is_told = any(laws)
        self.functions = {i: each for i, each in enumerate(laws) if callable(each) and not isinstance(each, InputPieces)}
        pieces = [each if isinstance(each, InputPieces) else None for each in laws]
        self._arrays = [
            np.cumsum([0, *(len(each.knots) if each else 0 for each in pieces)]).astype(np.intc),
            np.concatenate([np.empty(0), *(each.knots for each in pieces if each)]).astype(number.dtype),
            np.concatenate([np.empty((0, 4)), *(each.coefficients for each in pieces if each)]).astype(number.dtype),
            np.ravel(breaks).astype(number.dtype),
        ]
        kinds = "int[]", number.array, number.array, number.array
        start, knots, coefficients, ends = (pointer(self._ffi, a, kind) for a, kind in zip(self._arrays, kinds, strict=True))
        self._handle = self._ffi.new_handle(self)
        self._piecewise: InC = self._ffi.new("ncgen_piecewise *", {"count": len(laws), "start": start, "knots": knots})
        self._piecewise.coefficients = coefficients
        if self.functions:
            self._piecewise.others, self._piecewise.context = _callback_of(number.name), self._handle
        self.breaks, self.n_breaks = ends, len(self._arrays[3])

    def signals(self, function: InC) -> InC:
        """The struct for a run; function: `ncgen_piecewise_inputs` of the runtime."""
        members = {
            "inputs": function if self._is_told else self._ffi.NULL,
            "context": self._piecewise,
            "n_breaks": self.n_breaks,
            "breaks": self.breaks,
        }
        self._signals: InC = self._ffi.new("ncgen_signals *", members)
        return self._signals


@once
def _callback_of(number: str) -> InC:
    """The function that C calls, whose context is the handle of a `Driver`; one serves all runs of a number type."""
    ffi: Interface = runtime_abi(number)

    def ask(context: InC, begun: InC, t: InC, values: InC) -> int:
        for i, function in ffi.from_handle(context).functions.items():
            values[i] = function(float(t))
        return 0

    return ffi.callback("ncgen_inputs *", ask, error=STATUS.index("interrupted"), onerror=keeper(ffi))
