"""Kernels of many states in one call.

In C the generated text is compiled once more with vectors of 4 or 8 doubles for numbers, one state a lane; threads
may share the states where the compiler has OpenMP (without it there is one). Each state has the numbers that it has alone,
to the last bit where the compiler is told to fuse nothing (-ffp-contract=off), else to rounding. In NumPy the leading axis
is the batch.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod

import numpy as np
from cffi import FFI

from ncgen.build.abi import abi, declared
from ncgen.build.cache import build
from ncgen.build.compilers import FLAGS, find_compiler
from ncgen.emit.c import HEADERS, c_files
from ncgen.emit.environment import verbatim
from ncgen.emit.naming import identifier
from ncgen.errors import CompileError, NcgenError

LANES = (*FLAGS, "-fno-math-errno", "-include", "ncgen_lanes.h")
"""Square roots set no errno, so that they become one instruction; their values are the same."""

SOURCES = ("ncgen_batch.h", "ncgen_rows.h", "ncgen_batch.c")
ALIGNMENT = 64


class Batch(ABC):
    """Kernels of B states: q, qd (B, n) in m, rad and per second; t (s) one number or (B,); p (n_p,) or (B, n_p).

    Results have one row a state; of matrices the nonzeros, in the order of `kernels.phi_q_pattern` and `mass_pattern`.
    out: where to put them; an array that is used again saves the time that the system needs to give a new one
    Raises NcgenError naming the argument whose shape is wrong, or for forces that a Python function computes.
    """

    def __init__(self, kernels):
        self.kernels = kernels

    def phi(self, q, t=0.0, p=None, out=None) -> np.ndarray:
        """Constraint equations Φ, (B, m)."""
        return self.values("phi", t, q, None, p, out)

    def phi_q(self, q, t=0.0, p=None, out=None) -> np.ndarray:
        """Nonzeros of the Jacobian Φ_q, (B, nonzeros)."""
        return self.values("phi_q", t, q, None, p, out)

    def nu(self, q, t=0.0, p=None, out=None) -> np.ndarray:
        """ν = −Φ_t, (B, m)."""
        return self.values("nu", t, q, None, p, out)

    def gamma(self, q, qd, t=0.0, p=None, out=None) -> np.ndarray:
        """γ, (B, m)."""
        return self.values("gamma", t, q, qd, p, out)

    def mass(self, q, t=0.0, p=None, out=None) -> np.ndarray:
        """Nonzeros of the mass matrix M, (B, nonzeros)."""
        return self.values("mass", t, q, None, p, out)

    def force(self, q, qd, t=0.0, p=None, out=None) -> np.ndarray:
        """Generalised forces Q, (B, n)."""
        return self.values("force", t, q, qd, p, out)

    def energy(self, q, qd, t=0.0, p=None, out=None) -> np.ndarray:
        """Kinetic and potential energy (J) and the power (W) of forces without a potential, (B, 3)."""
        return self.values("energy", t, q, qd, p, out)

    def values(self, kernel: str, t, q, qd, p, out=None) -> np.ndarray:
        """The plain output of a kernel, one row a state."""
        kernels = self.kernels
        if kernels.model.callbacks and kernel in ("force", "energy"):
            raise NcgenError(f"{kernels.name}.batch.{kernel}: the model calls a Python function; call kernels.{kernel} for every state")
        q = np.asarray(q, dtype=float)
        count = len(q) if q.ndim == 2 else 0
        q = self._checked(q, kernel, "q", (count, kernels.n))
        program = kernels.programs.programs.get(kernel)
        if program is None:
            return np.zeros((count, len(kernels.values(kernel, 0.0, kernels.q0, kernels.q0, None))))
        qd = self._checked(qd, kernel, "qd", (count, kernels.n)) if "qd" in program.inputs else None
        t = self._checked(t, kernel, "t", (), (count,))
        size = len(kernels.p0)
        p = self._checked(kernels.p0 if p is None else p, kernel, "p", (size,), (count, size))
        if out is None:
            out = np.empty((count, program.size))
        elif not (isinstance(out, np.ndarray) and out.dtype == float and out.flags.c_contiguous and out.shape == (count, program.size)):
            raise NcgenError(f"{kernels.name}.batch.{kernel}: out must be a contiguous array of {(count, program.size)} doubles")
        self._evaluate(kernel, t, q, qd, p, out)
        return out

    def _checked(self, array, kernel: str, name: str, *shapes) -> np.ndarray:
        array = np.ascontiguousarray(array, dtype=float).reshape(np.shape(array))
        if array.shape not in shapes:
            wanted = " or ".join(map(str, shapes))
            raise NcgenError(f"{self.kernels.name}.batch.{kernel}: {name} has shape {array.shape}; {wanted} is needed for this batch")
        return array

    @abstractmethod
    def _evaluate(self, kernel: str, t, q, qd, p, out) -> None: ...


class NumPyBatch(Batch):
    """Through the leading axes of the generated NumPy source."""

    def _evaluate(self, kernel, t, q, qd, p, out):
        t = t[:, None] if t.ndim else t
        out[:] = self.kernels.values(kernel, t, q, qd, p)


class CompiledBatch(Batch):
    """Through a library with vectors for numbers, compiled when it is first needed.

    threads: how many to use where there is OpenMP, at first 1: kernels take less time than numbers take to come from memory
    """

    def __init__(self, kernels, flags=LANES):
        super().__init__(kernels)
        parts = [declared("ncgen_batch.h", part) for part in ("cdef", "functions")]
        getter = f"const ncgen_model *{identifier(kernels.name)}_model(void);"
        files = c_files(kernels.programs) | {name: verbatim(f"c/{name}") for name in SOURCES}
        self.ffi, self.library, has_threads = load_lanes(files, "".join(parts) + getter, flags, abi())
        self.model = getattr(self.library, f"{identifier(kernels.name)}_model")()
        self._has_threads, self.threads = has_threads, 1
        self.lanes: int = self.library.ncgen_batch_lanes()

    def _evaluate(self, kernel, t, q, qd, p, out):
        ffi, size = self.ffi, out.shape[1]
        states = ffi.new("ncgen_states *", {"count": len(q), "t_stride": int(t.ndim > 0), "p_stride": p.shape[-1] * (p.ndim - 1)})
        for name, array in {"t": t, "q": q, "qd": qd, "p": p}.items():
            setattr(states, name, ffi.NULL if array is None else ffi.cast("double *", array.ctypes.data))
        threads = self.threads if self._has_threads else 1
        work = aligned(threads * self.library.ncgen_batch_workspace(self.model, size))
        function = getattr(self.model, kernel)
        either = (function, ffi.NULL) if qd is None else (ffi.NULL, function)
        pointers = [ffi.cast("double *", a.ctypes.data) for a in (out, work)]
        status = self.library.ncgen_batch_kernel(self.model, *either, states, size, pointers[0], threads, pointers[1])
        if status:
            from ncgen.build.library import STATUS

            raise NcgenError(f"{self.kernels.name}.batch.{kernel}: the kernel returned “{STATUS[status]}” for a state of the batch")


def load_lanes(files: dict[str, str], declarations: str, flags, base: FFI):
    """(interface, library, whether it has threads) of generated sources compiled with vectors for numbers.

    base: the interface that knows the types in `declarations`
    """
    ffi = FFI()
    ffi.include(base)
    ffi.cdef(declarations)
    files = files | {name: verbatim(f"c/{name}") for name in (*HEADERS, "ncgen_lanes.h")}
    compiler = find_compiler()
    try:
        built = build(files, compiler, (*flags, "-fopenmp"))
    except CompileError:
        built = build(files, compiler, flags)
    library = ffi.dlopen(str(built.library))
    return ffi, library, bool(library.ncgen_batch_threads())


def available() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def aligned(size: int) -> np.ndarray:
    """Numbers for vectors: they begin at a multiple of 64 bytes."""
    room = np.empty(size + ALIGNMENT // 8)
    start = -room.ctypes.data % ALIGNMENT // 8
    return room[start : start + size]
