"""Whole simulations in one call: the generated state derivative with the C runtime around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from cffi import FFI

from ncgen.build.cache import build
from ncgen.build.compilers import FLAGS, find_compiler
from ncgen.build.library import STATUS, CompiledKernels, _abi
from ncgen.emit.c import dynamics_files
from ncgen.emit.environment import verbatim
from ncgen.emit.naming import identifier
from ncgen.program.dynamics import Split, assemble_dynamics
from ncgen.program.elimination import Samples

METHODS = {"dopri5": 0, "rk4": 1}
"""Integrators of the runtime, by the numbers of ncgen_runtime.h."""

STRAIGHT_LINE = tuple("-O1" if flag.startswith("-O") else flag for flag in FLAGS)
"""Thousands of operations in one line: more optimisation takes longer and was measured slower."""


@cache
def _runtime_abi() -> FFI:
    text = verbatim("c/ncgen_runtime.h")
    ffi = FFI()
    ffi.include(_abi())
    ffi.cdef(text.split("/* begin cdef */")[1].split("/* end cdef */")[0])
    for name in ("ncgen_dynamics", "ncgen_options", "ncgen_statistics"):
        ffi.sizeof(name)  # completed here, as in ncgen.build.library
    return ffi


@dataclass(frozen=True)
class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    q, qd (rows, n); work (rows,); status "ok" or the reason; reached: time (s) of the state `last` = (q, qd, work)
    """

    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    status: str
    reached: float
    last: tuple[np.ndarray, np.ndarray, float]
    steps: int
    rejected: int
    repeated: int
    evaluations: int
    newton_steps: int


class CompiledDynamics:
    """The state derivative of a mechanism for one choice of independent coordinates, compiled with the runtime."""

    def __init__(self, kernels: CompiledKernels, split: Split, samples: Samples, sizes):
        equations = kernels.programs.equations
        self.kernels = kernels
        self.split = split
        self.programs = assemble_dynamics(equations, split, samples, sizes)
        files = dynamics_files(self.programs, equations, kernels.row_sizes)
        files |= {name: verbatim(f"c/{name}") for name in ("ncgen.h", "ncgen_math.h")}
        getter = f"{identifier(kernels.name)}_dynamics"
        self._ffi = FFI()
        self._ffi.include(_runtime_abi())
        functions = verbatim("c/ncgen_runtime.h").split("/* begin functions */")[1].split("/* end functions */")[0]
        self._ffi.cdef(functions + f"const ncgen_dynamics *{getter}(void);")
        self._library = self._ffi.dlopen(str(build(files, find_compiler(), STRAIGHT_LINE).library))
        self._dynamics = getattr(self._library, getter)()
        self._model = self._ffi.cast("const ncgen_model *", kernels._descriptor)

    def simulate(self, method: str, times, q, zd, p, rtol, atol, max_step, tolerance, growth) -> Outcome:
        """Run over the times of a grid (first one is the start)."""
        ffi, n = self._ffi, self.kernels.n
        times = np.ascontiguousarray(times, dtype=float)
        rows_and_last = len(times) + 1
        out_q, out_qd, out_work = np.empty((rows_and_last, n)), np.empty((rows_and_last, n)), np.empty(rows_and_last)
        work = np.empty(self._library.ncgen_workspace(self._model, self._dynamics))
        statistics, rows = ffi.new("ncgen_statistics *"), ffi.new("int *")
        options = ffi.new("ncgen_options *", {"method": METHODS[method], "rtol": rtol, "atol": atol, "tolerance": tolerance, "growth": growth})
        options.max_step = 0.0 if np.isinf(max_step) else max_step
        inputs = [np.ascontiguousarray(a, dtype=float) for a in (p, q, zd)]
        pointers = [ffi.cast("double *", a.ctypes.data) for a in (*inputs, times, out_q, out_qd, out_work, work)]
        status = self._library.ncgen_simulate(
            self._model, self._dynamics, options, *pointers[:3], len(times), *pointers[3:7], rows, statistics, pointers[7]
        )
        done, s = rows[0], statistics
        counts = (s.steps, s.rejected, s.repeated, s.evaluations, s.newton_steps)
        return Outcome(out_q[:done], out_qd[:done], out_work[:done], STATUS[status], s.t, (out_q[-1], out_qd[-1], out_work[-1]), *counts)
