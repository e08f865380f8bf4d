"""Simulations of many states in one call: the emitted state derivative compiled with vectors for numbers.

What moves them is compiled once for all mechanisms.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import RUNTIME_HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.kernel_batch import LANES, aligned, in_lanes, load, thread_count
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.listening import Listener, watch
from ncgen.mechanism.motion_sources import Written
from ncgen.mechanism.run_arguments import InitialState
from ncgen.methods.table import INTEGRATORS, number_in_c
from ncgen.toolchain.abi import InC, declared, runtime_abi

SOURCES = (
    "ncgen_tableaus.h", "ncgen_batch_run.h", "ncgen_batch_run.c", "ncgen_block.h", "ncgen_block.c", "ncgen_block_steps.c",
    "ncgen_stage_sums.h", "ncgen_step_rules.h", "ncgen_stiff_steps.h", *RUNTIME_HEADERS,
)  # fmt: skip


MIN_STEP_SECONDS = 1e-7
"""Seconds that a step of a block takes at least: who is asked again sooner is asked by a thread that waits."""

PAUSE = 2e-3
"""Seconds for which such a thread sleeps, so that the others have its processor."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LaneOutcome:
    """q, qd (B, times, n), work (B, times), NaN where a state did not arrive; status (B,) words of ncgen_status.

    steps, reached (B,): accepted steps, and the time (s) after them; raised: what ended the call from outside, or None
    """

    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    status: list[str]
    steps: np.ndarray
    reached: np.ndarray
    raised: BaseException | None = None


class _BatchListener(Listener):
    """Who listens to many runs: its progress is called with the share of them that have arrived."""

    def hear(self, t: float) -> int:
        if time.perf_counter() - self._clock < MIN_STEP_SECONDS * self.attempts:
            time.sleep(PAUSE)
        return super().hear(t)


class LaneDynamics:
    """The state derivative of one choice of independent coordinates, for many states at a time."""

    def __init__(self, written: Written) -> None:
        kernels = written.kernels
        declarations, types = declared("ncgen_batch_run.h", "functions"), runtime_abi()
        self._ffi, self._library, self.has_threads = load(SOURCES, declarations, LANES, types)
        getter = f"{prefix_of(kernels.name)}_dynamics"
        files = written.files | runtime_files(*RUNTIME_HEADERS)
        _, self._emitted = in_lanes(files, f"const ncgen_dynamics *{getter}(void);", types, self._library.ncgen_batch_lanes())
        self._dynamics = self._ffi.cast("const ncgen_dynamics *", getattr(self._emitted, getter)())
        self.kernels, self.split, self._written = kernels, written.split, written
        self._model = self._ffi.cast("const ncgen_model *", kernels.descriptor)  # its sizes are asked for, not its kernels

    def __reduce__(self) -> tuple[type[LaneDynamics], tuple[Written]]:
        """Pickled as what it was made of; it is compiled again, or found in the cache, where it arrives."""
        return LaneDynamics, (self._written,)

    def simulate(
        self,
        method: str,
        times: ArrayLike,
        initial: InitialState,
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
        breaks: Sequence[np.ndarray] | None = None,
        **options: InC,
    ) -> LaneOutcome:
        """Run all states over the times (s) of a grid.

        threads: None for one on every processor that this process may use
        progress: called now and then with the share of the states that have arrived. What it raises, or a handler of a signal
            such as that of Ctrl-C, ends the call: it is in the outcome, and the states that were on their way are "interrupted"
        breaks: of every state those of its laws in time, (…, 2), as `break_times` finds them; None where there are none
        options: the members of `ncgen_options`, by their names; sizes is an array, or None for 1
        Raises NcgenError for a method, times or fixed steps that there cannot be.
        """
        times, count = np.ascontiguousarray(times, dtype=float), len(np.asarray(initial.q))
        rows = count, len(times)
        q_rows, qd_rows = np.full((*rows, self.kernels.n), np.nan), np.full((*rows, self.kernels.n), np.nan)
        work = np.full(rows, np.nan)
        status, steps, reached = np.zeros(count, dtype=np.intc), np.zeros(count, dtype="l"), np.full(count, times[0])
        out = [(array, "double[]") for array in (q_rows, qd_rows, work)] + [(status, "int[]"), (steps, "long[]"), (reached, "double[]")]
        listener = _BatchListener(progress, self.kernels.n + self.kernels.m)
        sizes = options.pop("sizes", None)
        if sizes is not None:
            nz = len(self.split.independent)
            sizes = laid(sizes, float, 2 * nz + 1, f"{self.kernels.name}: sizes")
            options["sizes"] = pointer(self._ffi, sizes)
        ends: tuple[InC, ...] = (self._ffi.NULL, self._ffi.NULL)
        if breaks is not None:
            starts = np.cumsum([1, *(each.size for each in breaks)]).astype(np.intc)
            flat = np.concatenate([np.zeros(1), *(each.ravel() for each in breaks)])
            ends = pointer(self._ffi, starts, "int[]"), pointer(self._ffi, flat)
        context = self._ffi.new_handle(listener)
        options |= {
            "method": number_in_c(INTEGRATORS[method]),
            "progress": watch("double"),
            "context": context,
            "attempts_left": listener.attempts,
        }
        ended = self._call(
            self._library.ncgen_batch_simulate, options, initial, (*ends, len(times), pointer(self._ffi, times)), out, threads
        )
        if STATUS[ended] == "argument":
            remedy = "let them ascend, and give rk4 a max_step that is not tiny"
            raise NcgenError(f"{self.kernels.name}: {method} cannot step over these times; {remedy}")
        words = [STATUS[s] for s in status.tolist()]
        return LaneOutcome(q=q_rows, qd=qd_rows, work=work, status=words, steps=steps, reached=reached, raised=listener.raised)

    def accelerate(
        self,
        t: float,
        q: np.ndarray,
        zd: np.ndarray,
        p: np.ndarray,
        out: tuple[np.ndarray, np.ndarray | None, np.ndarray],
        threads: int | None = None,
        **options: InC,
    ) -> np.ndarray:
        """Fill out, arrays for q closed (B, n), q̇ (B, n) or None, and z̈ (B, nz), and return the ncgen_status of every state (B,).

        Other arguments as for `simulate`; rows of states that failed become NaN.
        """
        status = np.zeros(len(q), dtype=np.intc)
        outputs = [(array, "double[]") for array in out] + [(status, "int[]")]
        self._call(self._library.ncgen_batch_accelerate, options, InitialState(q, zd, p), (t,), outputs, threads)
        if status.any():
            for array in (a for a in out if a is not None):
                array[status != 0] = np.nan
        return status

    def _checked(self, states: InitialState) -> list[np.ndarray]:
        """States as C reads them: q (B, n), zd (B, nz) and p (B, n_p), or (n_p,) where it is the same row for all."""
        kernels, p = self.kernels, np.asarray(states.p)
        p = p[0] if p.ndim == 2 and p.strides[0] == 0 else p
        counts = {"q": (states.q, kernels.n), "zd": (states.velocities, len(self.split.independent)), "p": (p, len(kernels.p0))}
        laid_out = [laid(array, float, count, f"{kernels.name}: {name}") for name, (array, count) in counts.items()]
        if len({len(array) for array in laid_out if array.ndim == 2}) != 1:
            raise NcgenError(f"{kernels.name}: q, zd and p have {[array.shape for array in laid_out]}; one row for each state is needed")
        return laid_out

    def _call(
        self,
        function: InC,
        options: dict[str, InC],
        states: InitialState,
        instants: tuple[InC, ...],
        out: Sequence[tuple[np.ndarray | None, str]],
        threads: int | None,
    ) -> int:
        """One call of the library for states at some instants; out: (array, kind) to be filled."""
        q, zd, p = self._checked(states)
        threads = thread_count(threads, self.kernels.name) if self.has_threads else 1
        work = aligned(threads * self._library.ncgen_batch_run_workspace(self._model, self._dynamics))
        in_c = partial(pointer, self._ffi)  # out was made here, or has gone through `arguments.writable`
        return function(
            self._model, self._dynamics, self._ffi.new("ncgen_options *", options), len(q), in_c(q), in_c(zd), in_c(p),
            p.shape[-1] * (p.ndim - 1), *instants, *(in_c(array, kind) for array, kind in out), threads, in_c(work),
        )  # fmt: skip
