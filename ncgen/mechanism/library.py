"""A compiled library as kernels, through cffi in ABI mode: no Python.h, no setuptools."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ncgen.emit.naming import prefix_of
from ncgen.emit.number_table import table_getter
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.kernel_batch import CompiledBatch
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.structured_kernels import compiled_sources
from ncgen.mechanism.tangents import CompiledTangents
from ncgen.program.programs import Programs
from ncgen.toolchain.abi import InC, abi
from ncgen.toolchain.cache import compiled
from ncgen.toolchain.compilers import flags_for
from ncgen.toolchain.loader import opened

if TYPE_CHECKING:
    from ncgen.mechanism.direct import Direct

STATUS = (
    "ok", "not converged", "singular", "pivot", "domain", "argument", "interrupted", "stiff", "short", "full", "singular ahead"
)  # fmt: skip


class CompiledKernels(Kernels):
    """Kernels of a shared library; safe to call from several threads."""

    backend = "c"

    def __init__(self, programs: Programs, library: Path, values: Sequence[float] | None = None) -> None:
        """values: what the library's table of numbers is filled with, None where it has none."""
        super().__init__(programs)
        prefix = prefix_of(self.name)
        getter = f"{prefix}_model"
        self._ffi, self._library = opened(library, f"const ncgen_model *{getter}(void);", abi(), table_getter(prefix), values)
        self.library, self._numbers = library, values
        self.descriptor: InC = getattr(self._library, getter)()
        if self.descriptor.struct_size != self._ffi.sizeof("ncgen_model"):
            raise NcgenError(f"{library}: its ncgen_model has another layout; run `ncgen cache --clear` and try again")
        self._buffers = threading.local()

    @classmethod
    def _of(cls, programs: Programs) -> CompiledKernels:
        files, values, _ = compiled_sources(programs)
        return cls(programs, compiled(files, flags_for(files)).library, values)

    def function(self, kernel: str) -> InC:
        """The function of a kernel in C."""
        return getattr(self.descriptor, kernel)

    @property
    def computed_by(self) -> str:
        """As of all kernels: the key of the library, which its compiler and flags are part of."""
        return f"{self.backend} {self.library.parent.name}"

    @property
    def fingerprint(self) -> str:
        """A digest of the generated source, and of the numbers that it reads."""
        of_source = self._ffi.string(self.descriptor.fingerprint).decode()
        if self._numbers is None:
            return of_source
        return hashlib.sha256(" ".join((of_source, *map(float.hex, self._numbers))).encode()).hexdigest()[:16]

    _tangents = CompiledTangents
    _batch = CompiledBatch

    @cached_property
    def tangents(self) -> CompiledTangents:
        """As of all kernels; here with a descriptor, which the C runtime takes."""
        return CompiledTangents.by_state(self.programs)

    def direct(self, kernel: str) -> Direct:
        """A kernel ("phi", "phi_q", ...) on arrays of its own, for loops where the way into C matters: see `Direct`."""
        from ncgen.mechanism.direct import Direct

        return Direct(self, kernel)

    def _call(self, kernel: str, t: ArrayLike, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, size: int) -> np.ndarray:
        function, result, pointer = self._call_of(kernel)
        try:
            if qd is None:
                status = function(t, q.tobytes(), p.tobytes(), pointer)
            else:
                status = function(t, q.tobytes(), qd.tobytes(), p.tobytes(), pointer)
        except TypeError:
            raise NcgenError(f"{self.name}.{kernel}: t is {t!r}; compiled kernels take one real number") from None
        if status:
            raise self._failed(kernel, status)
        return result.copy()

    def _called_at(
        self, kernel: str, instants: tuple[np.ndarray, np.ndarray, np.ndarray], p: np.ndarray, rows: list[int] | None
    ) -> np.ndarray:
        function, n, ffi, count = self.function(kernel), len(self.coordinates), self._ffi, len(instants[0])
        if rows is None:
            rows = [*range(count)]
        size, times = self.programs.programs[kernel].size, instants[0]
        q, qd = np.ascontiguousarray(instants[1], dtype=float), np.ascontiguousarray(instants[2], dtype=float)
        out, parameters = np.empty((len(rows), size)), pointer(ffi, p, count=len(self.p0))
        at, rates, to = pointer(ffi, q, count=count * n), pointer(ffi, qd, count=count * n), pointer(ffi, out)
        for i, row in enumerate(rows):
            if status := function(times.item(row), at + row * n, rates + row * n, parameters, to + i * size):
                raise self._failed(kernel, status)
        return out

    def _call_of(self, kernel: str) -> _Call:
        """A kernel with this thread's own place for its result."""
        try:
            return self._buffers.calls[kernel]
        except AttributeError:
            self._buffers.calls = {name: _Call.of(self, name) for name in self.programs.programs}
            return self._buffers.calls[kernel]

    def _failed(self, kernel: str, status: int) -> NcgenError:
        return NcgenError(f"{self.name}.{kernel}: the kernel returned “{STATUS[status]}”")


class _Call(NamedTuple):
    """One kernel and a thread's own place for its result. Inputs go as bytes: cffi passes these on without looking for an
    array's address, which takes longer than a kernel."""

    function: InC
    result: np.ndarray
    pointer: InC

    @classmethod
    def of(cls, kernels: CompiledKernels, name: str) -> _Call:
        program = kernels.programs.programs[name]
        arrays = ", ".join("double" if a == "t" else "const char *" for a in program.inputs)
        result = np.empty(program.size)
        return cls(kernels._ffi.cast(f"int (*)({arrays}, double *)", kernels.function(name)), result, pointer(kernels._ffi, result))
