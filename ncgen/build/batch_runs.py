"""Simulations of many states in one call: the emitted state derivative compiled with vectors for numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.build.abi import declared, runtime_abi
from ncgen.build.batch import LANES, aligned, available, load_lanes
from ncgen.build.library import STATUS, CompiledKernels
from ncgen.build.runtime import METHODS
from ncgen.emit.c import dynamics_files
from ncgen.emit.environment import verbatim
from ncgen.emit.naming import identifier
from ncgen.program.elimination import Samples
from ncgen.program.programs import Split

SOURCES = ("ncgen_batch_run.h", "ncgen_rows.h", "ncgen_batch_run.c", "ncgen_runtime.h")
METHODS_IN_LANES = ("dopri5", "rk4")


@dataclass(frozen=True)
class LaneOutcome:
    """q, qd (B, times, n), work (B, times), NaN where a state did not arrive; status (B,) words of ncgen_status."""

    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    status: list[str]
    steps: np.ndarray
    reached: np.ndarray


class LaneDynamics:
    """The state derivative of one choice of independent coordinates, for many states at a time."""

    def __init__(self, kernels: CompiledKernels, split: Split, samples: Samples):
        from ncgen.program.dynamics import assemble_dynamics

        equations = kernels.programs.equations
        programs = assemble_dynamics(equations, split, samples, kernels.column_sizes)
        files = dynamics_files(programs, equations, kernels.row_sizes) | {name: verbatim(f"c/{name}") for name in SOURCES}
        getter = f"{identifier(kernels.name)}_dynamics"
        declarations = f"{declared('ncgen_batch_run.h', 'functions')} const ncgen_dynamics *{getter}(void);"
        self._ffi, self._library, self.has_threads = load_lanes(files, declarations, LANES, runtime_abi())
        self._dynamics = getattr(self._library, getter)()
        self.kernels, self.split = kernels, split
        self._model = self._ffi.cast("const ncgen_model *", kernels._descriptor)  # its sizes are asked for, not its kernels

    def simulate(self, method: str, times, q, zd, p, threads: int | None = None, **options) -> LaneOutcome:
        """Run all states over the times of a grid.

        q (B, n), zd (B, nz): where they start; p (n_p,) or (B, n_p)
        threads: None for one on every processor that this process may use
        options: the members of `ncgen_options`, by their names
        """
        rows = len(q), len(times)
        q_rows, qd_rows = np.full((*rows, self.kernels.n), np.nan), np.full((*rows, self.kernels.n), np.nan)
        work = np.full(rows, np.nan)
        status, steps, reached = self._run(times, q, zd, p, (q_rows, qd_rows, work, None), threads, method=METHODS[method], **options)
        return LaneOutcome(q_rows, qd_rows, work, [STATUS[s] for s in status], steps, reached)

    def accelerate(self, t: float, q, zd, p, threads: int | None = None, out=None, **options) -> tuple[np.ndarray, ...]:
        """q closed and q̇ (B, n), z̈ (B, nz), and which states have them (B,); arguments as for `simulate`; out: the first three."""
        found = out or (np.empty(q.shape), np.empty(q.shape), np.empty(zd.shape))
        status, *_ = self._run([t], q, zd, p, (*found[:2], np.empty(0), found[2]), threads, **options)
        ok = status == 0
        if not ok.all():
            for array in found:
                array[~ok] = np.nan
        return *found, ok

    def _run(self, times, q, zd, p, out, threads: int | None, **options):
        """Status, steps and time reached of every state; out: q, q̇, work and z̈ (or None) to be filled."""
        ffi = self._ffi
        q, zd, p, times = (np.ascontiguousarray(a, dtype=float) for a in (q, zd, p, times))
        count = len(q)
        status, steps, reached = np.zeros(count, dtype=np.intc), np.zeros(count, dtype=np.int_), np.full(count, times[0])
        threads = (threads or available()) if self.has_threads else 1
        work = aligned(threads * self._library.ncgen_batch_run_workspace(self._model, self._dynamics))

        def place(array, kind="double[]"):
            return ffi.NULL if array is None else ffi.from_buffer(kind, array)

        self._library.ncgen_batch_simulate(
            self._model, self._dynamics, ffi.new("ncgen_options *", options), count, place(q), place(zd), place(p),
            p.shape[-1] * (p.ndim - 1), len(times), place(times), *map(place, out), place(status, "int[]"), place(steps, "long[]"),
            place(reached), threads, place(work),
        )  # fmt: skip
        return status, steps, reached
