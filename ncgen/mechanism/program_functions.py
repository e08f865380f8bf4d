"""Programs other than a mechanism's kernels, such as those of its joint space, as functions of Python."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

import numpy as np

from ncgen.emit.c import files as in_c
from ncgen.emit.naming import prefix_of
from ncgen.emit.numpy import files as in_numpy
from ncgen.emit.runtime_files import HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism import recall
from ncgen.mechanism.arguments import pointer, sized
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.program.ir.blocks import Program
from ncgen.toolchain.abi import InC, abi
from ncgen.toolchain.compilers import flags_for
from ncgen.toolchain.loader import executed, load

Made = Callable[[], Mapping[str, Program]]

Inputs = Mapping[str, tuple[str, ...]]
"""{function: names of what it takes}."""

Counts = Mapping[str, int]
"""{input: how many numbers it has}."""


class ProgramFunctions(ABC):
    """Functions of numbers and arrays by name; inputs: what they take; sizes: of their outputs; counts: of the numbers of every input."""

    complex_too = False
    """Whether they take complex numbers."""

    def __init__(self, owner: str, inputs: Inputs, sizes: Mapping[str, int], counts: Counts) -> None:
        self.owner, self.sizes = owner, sizes
        self._expected = {name: tuple((f"{owner}.{name}: {a}", counts[a]) for a in taken if a != "t") for name, taken in inputs.items()}

    def __call__(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        """The output of a function, (…, sizes[name]), for arrays (…, counts[input]). Raises NcgenError for arrays of other sizes."""
        expected = self._expected[name]
        if len(arrays) != len(expected):
            raise NcgenError(f"{self.owner}.{name}: {len(arrays)} arrays given, {len(expected)} needed")
        checked = (sized(a, count, label, self.complex_too) for a, (label, count) in zip(arrays, expected, strict=True))
        return self._evaluate(name, t, *checked)

    @abstractmethod
    def _evaluate(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        """The output of a function for arrays that were checked."""


def functions(kernels: Kernels, kind: str, inputs: Inputs, sizes: Mapping[str, int], counts: Counts, make: Made) -> ProgramFunctions:
    """In the language of the kernels. kind: a word for all of them; make: called for the programs if they are not in the cache.

    sizes: {function: numbers of its output}; counts: {input: its numbers}
    """
    made = CompiledFunctions if isinstance(kernels, CompiledKernels) else NumPyFunctions
    return made(kernels, kind, inputs, sizes, counts, make)


class NumPyFunctions(ProgramFunctions):
    """Leading axes of arrays are batches."""

    complex_too = True

    def __init__(self, kernels: Kernels, kind: str, inputs: Inputs, sizes: Mapping[str, int], counts: Counts, make: Made) -> None:
        super().__init__(kernels.name, inputs, sizes, counts)
        self._functions = executed(in_numpy.function_files(make().values(), kernels.programs.equations, kind))

    def _evaluate(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):  # as in C, what is no number says so by itself
            return self._functions[name](t, *arrays)


class CompiledFunctions(ProgramFunctions):
    """One state at a call; batches go through one after the other."""

    def __init__(self, kernels: Kernels, kind: str, inputs: Inputs, sizes: Mapping[str, int], counts: Counts, make: Made) -> None:
        super().__init__(kernels.name, inputs, sizes, counts)
        equations, prefix = kernels.programs.equations, prefix_of(kernels.name)
        files = recall.derived(kernels.programs, kind, lambda: in_c.function_files(make().values(), equations, kind))
        heads = ", ".join
        declared = [
            f"int {prefix}_{name}({heads(['double'] * ('t' in taken) + ['const double *'] * (len(taken) - ('t' in taken)))}, double *);"
            for name, taken in inputs.items()
        ]
        self._ffi, self._library = load(files | runtime_files(*HEADERS), "\n".join(declared), abi(), flags_for(files))
        self._functions = {name: getattr(self._library, f"{prefix}_{name}") for name in inputs}

    def address(self, name: str) -> int:
        """Where a function is, for a caller in C."""
        return int(self._ffi.cast("uintptr_t", self._functions[name]))

    def raw(self, name: str) -> InC:
        """A function that takes pointers."""
        return self._functions[name]

    def _evaluate(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        if all(a.ndim == 1 for a in arrays):
            return self.at_state(name, t, arrays)
        shape = np.broadcast_shapes(*(a.shape[:-1] for a in arrays))
        states = [np.broadcast_to(a, (*shape, a.shape[-1])).reshape(math.prod(shape), a.shape[-1]) for a in arrays]
        rows = [self.at_state(name, t, row) for row in zip(*states, strict=True)]
        return np.array(rows).reshape(*shape, self.sizes[name])

    def at_state(self, name: str, t: float, arrays: tuple[np.ndarray, ...]) -> np.ndarray:
        """The output of a function, (sizes[name],), for arrays of doubles, (counts[input],) each."""
        out = np.empty(self.sizes[name])
        pairs = zip(arrays, self._expected[name], strict=True)
        pointers = [pointer(self._ffi, np.ascontiguousarray(a), "double[]", count, label) for a, (label, count) in pairs]
        if self._functions[name](t, *pointers, pointer(self._ffi, out)):
            raise NcgenError(f"{self.owner}.{name}: a function left its domain")
        return out
