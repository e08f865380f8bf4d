"""Programs beside a mechanism's kernels, such as those of its joint space, as functions of Python."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

import numpy as np

from ncgen.emit.c import files as in_c
from ncgen.emit.naming import prefix_of
from ncgen.emit.numpy import files as in_numpy
from ncgen.emit.runtime import HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism import recall
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.program.ir.blocks import Program
from ncgen.toolchain.abi import abi
from ncgen.toolchain.loader import executed, load

Made = Callable[[], Mapping[str, Program]]

Inputs = Mapping[str, tuple[str, ...]]
"""{function: names of what it takes}."""


class Functions(ABC):
    """Functions of numbers and arrays by name; sizes: of their outputs."""

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self.sizes = sizes

    @abstractmethod
    def __call__(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        """The output of a function."""


def functions(kernels: Kernels, kind: str, inputs: Inputs, sizes: Mapping[str, int], make: Made) -> Functions:
    """In the language of the kernels. kind: a word for all of them; make: called for the programs if they are not in the cache."""
    if isinstance(kernels, CompiledKernels):
        return CompiledFunctions(kernels, kind, inputs, sizes, make)
    return NumPyFunctions(kernels, kind, sizes, make)


class NumPyFunctions(Functions):
    """Leading axes of arrays are batches."""

    def __init__(self, kernels: Kernels, kind: str, sizes: Mapping[str, int], make: Made) -> None:
        super().__init__(sizes)
        self._functions = executed(in_numpy.function_files(make().values(), kernels.programs.equations, kind))

    def __call__(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):  # as in C, what is no number says so by itself
            return self._functions[name](t, *arrays)


class CompiledFunctions(Functions):
    """One state at a call; batches go through one after the other."""

    def __init__(self, kernels: CompiledKernels, kind: str, inputs: Inputs, sizes: Mapping[str, int], make: Made) -> None:
        super().__init__(sizes)
        equations, prefix = kernels.programs.equations, prefix_of(kernels.name)
        files = recall.derived(kernels.programs, kind, lambda: in_c.function_files(make().values(), equations, kind))
        heads = ", ".join
        declared = [
            f"int {prefix}_{name}({heads(['double'] * ('t' in taken) + ['const double *'] * (len(taken) - ('t' in taken)))}, double *);"
            for name, taken in inputs.items()
        ]
        self._ffi, self._library = load(files | runtime_files(*HEADERS), "\n".join(declared), abi())
        self._functions = {name: getattr(self._library, f"{prefix}_{name}") for name in inputs}
        self._owner = kernels.name

    def __call__(self, name: str, t: float, *arrays: np.ndarray) -> np.ndarray:
        shape = np.broadcast_shapes(*(a.shape[:-1] for a in arrays))
        if not shape:
            return self._one(name, t, arrays)
        states = [np.broadcast_to(a, (*shape, a.shape[-1])).reshape(math.prod(shape), a.shape[-1]) for a in arrays]
        rows = [self._one(name, t, row) for row in zip(*states, strict=True)]
        return np.array(rows).reshape(*shape, self.sizes[name])

    def _one(self, name: str, t: float, arrays: tuple[np.ndarray, ...]) -> np.ndarray:
        out = np.empty(self.sizes[name])
        given = [np.ascontiguousarray(a, dtype=float) for a in arrays]
        pointers = [self._ffi.from_buffer("double[]", a, require_writable=a is out) for a in (*given, out)]
        if self._functions[name](t, *pointers):
            raise NcgenError(f"{self._owner}.{name}: a function left its domain")
        return out
