"""A compiled library as kernels, through cffi in ABI mode: no Python.h, no setuptools."""

from __future__ import annotations

import threading
from functools import cache
from pathlib import Path

import numpy as np
from cffi import FFI

from ncgen.build.kernels import Kernels
from ncgen.build.tangents import CompiledTangents
from ncgen.emit.environment import verbatim
from ncgen.emit.naming import identifier
from ncgen.errors import NcgenError
from ncgen.program.assemble import Programs

STATUS = ("ok", "not converged", "singular", "pivot", "domain", "argument")


@cache
def _abi() -> FFI:
    """cffi's view of ncgen.h, the one definition of the ABI."""
    text = verbatim("c/ncgen.h")
    declarations = text.split("/* begin cdef */")[1].split("/* end cdef */")[0]
    ffi = FFI()
    ffi.cdef("typedef double ncgen_real; typedef double ncgen_scalar;" + declarations)
    # Complete the structs here: otherwise they are completed by, and die with, the first library that uses them.
    for name in ("ncgen_model", "ncgen_tangents"):
        ffi.sizeof(name)
    return ffi


class CompiledKernels(Kernels):
    """Kernels of a shared library; safe to call from several threads."""

    backend = "c"

    def __init__(self, programs: Programs, library: Path):
        super().__init__(programs)
        getter = f"{identifier(self.name)}_model"
        ffi = FFI()
        ffi.include(_abi())
        ffi.cdef(f"const ncgen_model *{getter}(void);")
        try:
            self._library = ffi.dlopen(str(library))
        except OSError as error:
            raise NcgenError(f"{library} cannot be loaded: {error}; run `ncgen cache --clear` and try again") from error
        self._ffi = ffi
        self._descriptor = getattr(self._library, getter)()
        if self._descriptor.struct_size != ffi.sizeof("ncgen_model"):
            raise NcgenError(f"{library}: its ncgen_model has another layout; run `ncgen cache --clear` and try again")
        self._buffers = threading.local()

    def function(self, kernel: str):
        """The function of a kernel in C."""
        return getattr(self._descriptor, kernel)

    @property
    def fingerprint(self) -> str:
        """A digest of the generated source."""
        return self._ffi.string(self._descriptor.fingerprint).decode()

    def _make_tangents(self):
        return CompiledTangents(self.programs)

    def _call(self, kernel, t, q, qd, p, size):
        try:
            call = self._buffers.calls[kernel]
        except AttributeError:
            self._buffers.calls = {name: _Call(self, name) for name in self.programs.programs}
            call = self._buffers.calls[kernel]
        return call(t, q, qd, p)


class _Call:
    """One kernel with its own buffers and their pointers: made once a thread, since making pointers costs more than a kernel."""

    def __init__(self, kernels: CompiledKernels, name: str):
        program = kernels.programs.programs[name]
        self.name = f"{kernels.name}.{name}"
        self.function = kernels.function(name)
        sizes = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}
        self.q, self.qd, self.p = (np.empty(size) for size in sizes.values())
        self.out = np.empty(program.size)
        arrays = {"q": self.q, "qd": self.qd, "p": self.p}
        used = [arrays[a] for a in program.inputs if a != "t"] + [self.out]
        self.pointers = [kernels._ffi.cast("double *", a.ctypes.data) for a in used]

    def __call__(self, t, q, qd, p):
        self.q[:] = q
        self.p[:] = p
        if qd is not None:
            self.qd[:] = qd
        status = self.function(t, *self.pointers)
        if status:
            raise NcgenError(f"{self.name}: the kernel returned “{STATUS[status]}”")
        return self.out.copy()

