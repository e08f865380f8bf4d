"""A kernel on arrays of its own, for loops in Python: a call costs little more than the kernel."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from cffi import FFI

from ncgen.build.abi import abi, declared
from ncgen.build.cache import build
from ncgen.build.compilers import FLAGS, find_compiler
from ncgen.build.library import STATUS, CompiledKernels
from ncgen.emit.environment import verbatim
from ncgen.errors import NcgenError


@cache
def _caller():
    ffi = FFI()
    ffi.include(abi())
    ffi.cdef(declared("ncgen_call.c"))
    files = {name: verbatim(f"c/{name}") for name in ("ncgen_call.c", "ncgen.h")}
    return ffi, ffi.dlopen(str(build(files, find_compiler(), FLAGS).library))


class Direct:
    """One kernel of a compiled mechanism with its arguments and its result in place.

    q, qd: free coordinates (m, rad) and velocities, shape (n,); p: parameters, shape (n_p,); t: time (s)
    out: the result, shape (m,), (n,) or (3,); of a matrix the nonzeros in the order of its pattern
    Fill the arrays (`direct.q[:] = ...`), call the object, read `out`; the next call overwrites it. Nothing is checked or
    copied. An object serves one thread; make one for each.
    Raises NcgenError for a kernel that the mechanism does not have or that calls Python, and where a kernel fails.
    """

    __slots__ = ("q", "qd", "p", "out", "_name", "_frame", "_run", "_owner")

    def __init__(self, kernels: CompiledKernels, name: str):
        program = kernels.programs.programs.get(name)
        self._name = f"{kernels.name}.{name}"
        if program is None:
            raise NcgenError(f"{self._name}: there is no such kernel here; there are {', '.join(kernels.programs.programs)}")
        if kernels.model.callbacks and name in ("force", "energy"):
            raise NcgenError(f"{self._name}: the model calls a Python function; call kernels.{name} instead")
        self.q, self.qd, self.p = kernels.q0.copy(), np.zeros(kernels.n), kernels.p0.copy()
        self.out = np.zeros(program.size)
        ffi, library = _caller()
        self._frame = ffi.new("ncgen_frame *")
        for array in ("q", "qd", "p", "out"):
            setattr(self._frame, array, ffi.cast("double *", getattr(self, array).ctypes.data))
        setattr(self._frame, "velocity" if "qd" in program.inputs else "position", kernels.function(name))
        self._run = partial(library.ncgen_call, self._frame)
        self._owner = kernels  # the library lives as long

    @property
    def t(self) -> float:
        """Time (s)."""
        return self._frame.t

    @t.setter
    def t(self, value: float) -> None:
        self._frame.t = value

    def __call__(self) -> None:
        """Evaluate the kernel into `out`."""
        if status := self._run():
            raise NcgenError(f"{self._name}: the kernel returned “{STATUS[status]}”")
