"""The reverse sweep through a taped run: how a number changes with where the run began and with its parameters; in dual numbers, how
that changes along a direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.emit.runtime_files import HEADERS, PRINTED, RUNTIME_HEADERS, runtime_files
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.recall import Files
from ncgen.toolchain.abi import DUAL, InC, Interface, declared, runtime_abi
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load
from ncgen.toolchain.once import once

DUAL_STEP = 2.0**-332
"""What changes are multiplied by in dual numbers: what is of second order in it vanishes, and nothing of first order does."""

IN_DUAL_NUMBERS = ("ncgen_adjoint.c", "ncgen_space.c", "ncgen_space.h", "ncgen_vectors.h")


@dataclass(frozen=True, eq=False, kw_only=True)
class Numbers:
    """What sweeps are computed with: the runtime's library, an emitted motion transposed for it, NumPy's type of its numbers, and the
    library that the motion lives in."""

    ffi: Interface
    library: InC
    transposed: InC
    dtype: np.dtype
    home: InC


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """The numbers of an `ncgen_taped`."""

    n_coordinates: int
    n_parameters: int
    n_prepared: int
    is_driven: bool
    method: int
    n_inputs: int


class Sweep:
    """Through a run whose steps began and ended at times (steps + 1,), with the states of its tape, and p with what is prepared of it."""

    def __init__(
        self, numbers: Numbers, sizes: Sizes, times: np.ndarray, states: np.ndarray, p: np.ndarray, inputs: np.ndarray
    ) -> None:  # fmt: skip
        """inputs (steps, stages, n_inputs): what drives the run."""
        self.numbers, self._sizes, ffi = numbers, sizes, numbers.ffi
        self._times = np.ascontiguousarray(times, dtype=float)  # C reads these three where they are
        self._states, self._p, self._inputs = (np.ascontiguousarray(a, dtype=numbers.dtype) for a in (states, p, inputs))
        tape = {"steps": len(times) - 1, "times": pointer(ffi, self._times, "ncgen_scalar[]"), "states": self._real(self._states)}
        self._tape = ffi.new("ncgen_tape *", tape)
        arrays = {"p": self._real(self._p), "inputs": self._real(self._inputs), "tape": self._tape}
        self._run = ffi.new("ncgen_taped *", vars(sizes) | arrays)

    def backward(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """How a number changes with q and q̇ at the start, (n,) each, with p, (n_p,), and with the inputs of all stages, (steps, stages,
        n_inputs), from how it does with [q, q̇] at all times, (steps + 1, 2 n)."""
        n, library = self._sizes.n_coordinates, self.numbers.library
        derivatives = self._empty(2 * n + self._sizes.n_parameters)
        by_inputs, work = np.empty_like(self._inputs), self._empty(library.ncgen_adjoint_workspace(self._run))
        library.ncgen_adjoint(
            self._run,
            self.numbers.transposed,
            self._real(weights, 2 * n * len(self._times)),
            *map(self._real, (derivatives, by_inputs, work)),
        )
        return derivatives[:n], derivatives[n : 2 * n], derivatives[2 * n :], by_inputs

    def velocities_back(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How a sum with these weights (n,) of the velocities that the joints allow at the start changes with q, (n,), and p, (n_p,)."""
        n = self._sizes.n_coordinates
        derivatives = self._part("velocities", weights, self._states[:n], self._states[n : 2 * n])
        return derivatives[:n], self._by_parameters(derivatives[2 * n :])

    def closing_back(self, weights: np.ndarray) -> np.ndarray:
        """How a sum with these weights (n,) of a step of Newton's method at the start changes with p, (n_p,)."""
        n = self._sizes.n_coordinates
        return self._by_parameters(self._part("closing", weights, self._states[:n])[n:])

    def _part(self, name: str, weights: np.ndarray, *state: np.ndarray) -> np.ndarray:
        """What a transposed part says at the start; state: what it reads besides time and p."""
        gradient = self._empty(sum(map(len, state)) + len(self._p))
        function = getattr(self.numbers.library, f"ncgen_{name}_vjp")
        pointers = *map(self._real, (*state, self._p)), self._real(weights, self._sizes.n_coordinates), self._real(gradient)
        function(self.numbers.transposed, self._times[0], *pointers)
        return gradient

    def _by_parameters(self, derivatives: np.ndarray) -> np.ndarray:
        """Slopes (n_p,) by parameters from those by parameters and what is prepared of them."""
        by_p, prepared = np.split(derivatives, [self._sizes.n_parameters])
        if not len(prepared):
            return by_p
        more = self._empty(len(by_p))
        self.numbers.library.ncgen_prepare_vjp(self.numbers.transposed, *map(self._real, (self._p, prepared, more)))
        return by_p + more

    def _empty(self, size: int) -> np.ndarray:
        return np.empty(size, dtype=self.numbers.dtype)

    def _real(self, array: np.ndarray, count: int | None = None) -> InC:
        return pointer(self.numbers.ffi, np.ascontiguousarray(array, dtype=self.numbers.dtype), "ncgen_real[]", count)


@once
def _in_dual_numbers() -> tuple[Interface, InC]:
    """The sweep, the same for all mechanisms."""
    return _load(runtime_files(*IN_DUAL_NUMBERS, *PRINTED), declared("ncgen_differentiated.h", "functions"))


def _load(files: Files, declarations: str) -> tuple[Interface, InC]:
    files = files | runtime_files("ncgen_dual.h", *RUNTIME_HEADERS, *HEADERS)
    return load(files, declarations, runtime_abi(DUAL.name), (*FLAGS, *DUAL.flags))


def dual_numbers(source: Files, getter: str) -> Numbers:
    """Of a motion's source, transposed, whose function `getter` tells its parts."""
    ffi, library = _in_dual_numbers()
    _, home = _load(source, f"const ncgen_seeded_motion *{getter}(void);")
    return Numbers(
        ffi=ffi, library=library, transposed=ffi.cast("const ncgen_seeded_motion *", getattr(home, getter)()), dtype=DUAL.dtype, home=home
    )
