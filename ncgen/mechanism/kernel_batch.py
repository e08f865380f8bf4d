"""Kernels of many states in one call.

In C there are two ways. Where a kernel computes much for every number that it reads and writes, the generated text is
compiled once more with vectors of 4 or 8 doubles for numbers, one state a lane; where it computes little, bringing rows into
lanes and back would take longer than it saves, and one state follows the other. Threads may share the states where the
compiler has OpenMP (without it there is one). Each state has the numbers that it has alone, to the last bit where the
compiler is asked to fuse nothing (-ffp-contract=off), else to rounding. In NumPy the leading axis is the batch.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ncgen.emit.c.files import model_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import numbers, pointer, writable
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.cost import cost
from ncgen.toolchain.abi import InC, Interface, abi, declared
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load as loaded
from ncgen.toolchain.once import once

if TYPE_CHECKING:
    from ncgen.mechanism.kernels import Kernels
    from ncgen.mechanism.library import CompiledKernels

LANES = (*FLAGS, "-fno-math-errno", "-include", "ncgen_lanes.h")
"""Square roots set no errno, so that they become one instruction; their values are the same."""

SOURCES = ("ncgen_batch.h", "ncgen_lanes.h", "ncgen_rows.h", "ncgen_batch.c")
LANES_PAY = 2.8
"""Operations per number read or written from which lanes pay; measured (docs/performance.md)."""

FUNCTION = 20
"""Operations that an elementary function counts for."""

ALIGNMENT = 64


class Batch(ABC):
    """Kernels of B states: q, qd (B, n) in m, rad and per second; t (s) one number or (B,); p (n_p,) or (B, n_p).

    Results have one row a state; of matrices the nonzeros, in the order of `kernels.phi_q_pattern` and `mass_pattern`.
    out: where to put them; an array that is used again saves the time that the system needs to give a new one
    Raises NcgenError naming the argument that is no array of real numbers, or whose shape is wrong, or for forces that a Python
    function computes.
    """

    def __init__(self, kernels: Kernels) -> None:
        self.kernels = kernels

    def __repr__(self) -> str:
        return f"<Batch of {self.kernels!r}>"

    def __reduce__(self) -> tuple[Callable[..., Batch], tuple[Kernels, str]]:
        """Pickled as the kernels that it belongs to."""
        return getattr, (self.kernels, "batch")

    def phi(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Constraint equations Φ, (B, m)."""
        return self.values("phi", t, q, None, p, out)

    def phi_q(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Nonzeros of the Jacobian Φ_q, (B, nonzeros)."""
        return self.values("phi_q", t, q, None, p, out)

    def nu(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """ν = −Φ_t, (B, m)."""
        return self.values("nu", t, q, None, p, out)

    def gamma(
        self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None
    ) -> np.ndarray:
        """γ, (B, m)."""
        return self.values("gamma", t, q, qd, p, out)

    def mass(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Nonzeros of the mass matrix M, (B, nonzeros)."""
        return self.values("mass", t, q, None, p, out)

    def force(
        self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None
    ) -> np.ndarray:
        """Generalised forces Q, (B, n)."""
        return self.values("force", t, q, qd, p, out)

    def energy(
        self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None, out: np.ndarray | None = None
    ) -> np.ndarray:
        """Kinetic and potential energy (J) and the power (W) of forces without a potential, (B, 3)."""
        return self.values("energy", t, q, qd, p, out)

    def values(
        self, kernel: str, t: ArrayLike, q: ArrayLike, qd: ArrayLike | None, p: ArrayLike | None, out: np.ndarray | None = None
    ) -> np.ndarray:
        """The plain output of a kernel, one row a state."""
        kernels = self.kernels
        if kernels.model.callbacks and kernel in ("force", "energy"):
            raise NcgenError(f"{kernels.name}.batch.{kernel}: the model calls a Python function; call kernels.{kernel} for every state")
        q = numbers(q, f"{kernels.name}.batch.{kernel}: q")
        if q.ndim != 2:
            raise NcgenError(f"{kernels.name}.batch.{kernel}: q has shape {q.shape}; one row for each state is needed, (…, {kernels.n})")
        count = len(q)
        q = self._checked(q, kernel, "q", (count, kernels.n))
        program = kernels.programs.programs.get(kernel)
        reads_qd = program is not None and "qd" in program.inputs
        qd = self._checked(qd, kernel, "qd", (count, kernels.n)) if reads_qd or qd is not None else None
        t = self._checked(t, kernel, "t", (), (count,))
        size = len(kernels.p0)
        p = self._checked(kernels.p0 if p is None else p, kernel, "p", (size,), (count, size))
        if program is None:
            return np.zeros((count, len(kernels.values(kernel, 0.0, kernels.q0, kernels.q0, None))))
        qd = qd if reads_qd else None
        if out is None:
            out = np.empty((count, program.size))
        else:
            other_arrays = [array for array in (t, q, qd, p) if array is not None]
            out = writable(out, (count, program.size), f"{kernels.name}.batch.{kernel}: out", other_arrays)
        self._evaluate(kernel, t, q, qd, p, out)
        return out

    def _checked(self, array: ArrayLike | None, kernel: str, name: str, *shapes: tuple[int, ...]) -> np.ndarray:
        array = numbers(array, f"{self.kernels.name}.batch.{kernel}: {name}")
        if array.shape not in shapes:
            wanted = " or ".join(map(str, shapes))
            raise NcgenError(f"{self.kernels.name}.batch.{kernel}: {name} has shape {array.shape}; {wanted} is needed for this batch")
        return array

    @abstractmethod
    def _evaluate(self, kernel: str, t: np.ndarray, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, out: np.ndarray) -> None:
        """Fill out."""


class NumPyBatch(Batch):
    """Through the leading axes of the generated NumPy source."""

    def _evaluate(self, kernel: str, t: np.ndarray, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, out: np.ndarray) -> None:
        out[:] = self.kernels.values(kernel, t, q, qd, p)


class CompiledBatch(Batch):
    """In C. Libraries are compiled when a kernel first needs them.

    threads: how many to use where there is OpenMP, at first 1: kernels take less time than numbers take to come from memory;
        None for one on every processor that this process may use, more than that are not started
    least: operations per number read or written from which a kernel is evaluated in lanes
    """

    def __init__(self, kernels: CompiledKernels, flags: tuple[str, ...] = LANES, least: float = LANES_PAY) -> None:
        super().__init__(kernels)
        self._alone = kernels.descriptor
        self._threads, self._flags, self._least = 1, flags, least
        self._kernels_in_lanes = {name for name, program in kernels.programs.programs.items() if self._pays(program)}

    @property
    def threads(self) -> int:
        """How many threads share the states."""
        return self._threads

    @threads.setter
    def threads(self, count: int | None) -> None:
        self._threads = thread_count(count, f"{self.kernels.name}.batch")

    def in_lanes(self, kernel: str) -> bool:
        """Whether a kernel of several states is evaluated in lanes, or one state after the other."""
        return kernel in self._kernels_in_lanes

    def _pays(self, program: Program) -> bool:
        moved = program.size + self.kernels.n * sum(name in program.inputs for name in ("q", "qd"))
        price = cost(program)
        return price.total + (FUNCTION - 1) * price.calls >= self._least * moved

    @cached_property
    def _in_lanes(self) -> _Loop:
        getter = f"{prefix_of(self.kernels.name)}_model"
        ffi, library, has_threads = load((), "", self._flags, abi())
        files, width = model_files(self.kernels.programs), library.ncgen_batch_lanes()
        _, self._emitted = in_lanes(files, f"const ncgen_model *{getter}(void);", abi(), width, self._flags)
        return _Loop(ffi, library, has_threads, getattr(self._emitted, getter)())

    @cached_property
    def _in_turn(self) -> _Loop:
        return _Loop(*load((), "", FLAGS, abi()), self._alone)

    def _evaluate(self, kernel: str, t: np.ndarray, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, out: np.ndarray) -> None:
        loop = self._in_lanes if self.in_lanes(kernel) else self._in_turn
        ffi, library, size = loop.ffi, loop.library, out.shape[1]
        counts = {"t": t.size, "q": len(q) * self.kernels.n, "qd": len(q) * self.kernels.n, "p": p.size}
        arguments = {"t": t, "q": q, "qd": qd, "p": p}
        arrays = {name: pointer(ffi, array, count=counts[name], label=f"{self.kernels.name}: {name}") for name, array in arguments.items()}
        states = ffi.new("ncgen_states *", arrays | {"count": len(q), "t_stride": int(t.ndim > 0), "p_stride": p.shape[-1] * (p.ndim - 1)})
        threads = self.threads if loop.has_threads else 1
        work = aligned(threads * library.ncgen_batch_workspace(loop.model, size))
        function = getattr(loop.model, kernel)
        either = (function, ffi.NULL) if qd is None else (ffi.NULL, function)
        status = library.ncgen_batch_kernel(
            loop.model, *either, states, size, pointer(ffi, out, count=len(q) * size), threads, pointer(ffi, work)
        )
        if status:
            from ncgen.mechanism.library import STATUS

            raise NcgenError(f"{self.kernels.name}.batch.{kernel}: the kernel returned “{STATUS[status]}” for a state of the batch")


@dataclass(frozen=True)
class _Loop:
    """One of the ways through many states: its library, whether that has threads, and the model with kernels for it."""

    ffi: Interface
    library: InC
    has_threads: bool
    model: InC


def in_lanes(
    files: dict[str, str], declarations: str, base: Interface, width: int | None = None, flags: tuple[str, ...] = LANES
) -> tuple[Interface, InC]:
    """(interface, library) of emitted sources with vectors for numbers; other arguments as for `load`.

    width: how many states stand side by side in a vector: what the library that calls these sources was compiled for. The compiler would
        choose its own, which may be another where it is another compiler, or has lost a flag meanwhile; None for a library that calls
    """
    extra_flags = () if width is None else (f"-DNCGEN_LANES={width}",)
    return loaded(files | runtime_files(*HEADERS, "ncgen_lanes.h"), declarations, base, (*flags, *extra_flags))


@once
def load(names: tuple[str, ...], declarations: str, flags: tuple[str, ...], base: Interface) -> tuple[Interface, InC, bool]:
    """(interface, library, whether it has threads) of ncgen_batch.c with other files of the runtime for many states.

    It stays loaded: OpenMP keeps its threads until the process ends, and their code must not go before them.

    declarations: of what the other files have; base: the interface that knows the types in them
    """
    declarations = declared("ncgen_batch.h", "cdef") + declared("ncgen_batch.h", "functions") + declarations
    ffi, library = loaded(runtime_files(*HEADERS, *SOURCES, *names), declarations, base, (*flags, "-fopenmp"))
    return ffi, library, bool(library.ncgen_batch_threads())


def available() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count(wanted: int | None, label: str) -> int:
    """How many threads to start: those wanted, but one on every processor at most, which is also what None is for."""
    if wanted is not None and not (isinstance(wanted, Integral) and wanted >= 1):
        raise NcgenError(f"{label}: threads is {wanted!r}; it must be a whole number from 1 on, or None")
    return min(available() if wanted is None else int(wanted), available())


def aligned(size: int) -> np.ndarray:
    """Numbers for vectors: they begin at a multiple of 64 bytes."""
    room = np.empty(size + ALIGNMENT // 8)
    start = -room.ctypes.data % ALIGNMENT // 8
    return room[start : start + size]
