"""Runs of many states by an emitted motion that leave tapes, and the ways back: a state a lane of a vector (`ncgen_motions.c`).

Steps are the same for all states, from each time of a grid to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np

from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import PRINTED, RUNTIME_HEADERS, runtime_files
from ncgen.mechanism.arguments import laid, numbers, pointer
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.mechanism.kernel_batch import aligned, in_lanes
from ncgen.mechanism.sweep import Sizes
from ncgen.methods.table import INTEGRATORS, number_in_c
from ncgen.toolchain.abi import InC, Interface, declared, runtime_abi
from ncgen.toolchain.once import once

SOURCES = (
    "ncgen_motions.h", "ncgen_motions.c", "ncgen_adjoint.c", "ncgen_closing_rules.h", "ncgen_space.c", "ncgen_space.h",
    "ncgen_stage_sums.h", "ncgen_vectors.h", "ncgen_rows.h",
)  # fmt: skip

TAPED = 2**24
"""Bytes that the tapes of a part may take, so that parts that are run and swept by several threads stay in the caches."""

N_UNTAPED_BLOCKS = 32
"""Blocks of a part whose tapes are not kept."""

MAX_TAPE_BYTES = 2**28
"""Bytes that the tape of one block may take."""


@once
def _library() -> tuple[Interface, InC]:
    """What moves states in lanes, the same for all mechanisms."""
    return in_lanes(runtime_files(*SOURCES, *RUNTIME_HEADERS, *PRINTED), declared("ncgen_motions.h", "functions"), runtime_abi())


class _Emitted:
    """A mechanism's motion and its transposed derivative, in lanes; made when they are first asked for."""

    def __init__(self, dynamics: ConstrainedDynamics) -> None:
        self._dynamics, self._name = dynamics, prefix_of(dynamics.kernels.name)

    def _made(self, files: dict[str, str], getter: str) -> tuple[InC, InC]:
        """What a function of a library gives, and the library."""
        width = _library()[1].ncgen_motions_lanes()
        _, home = in_lanes(files | runtime_files(*RUNTIME_HEADERS), f"const void *{getter}(void);", runtime_abi(), width)
        return getattr(home, getter)(), home

    @cached_property
    def motion(self) -> tuple[InC, InC]:
        return self._made(self._dynamics.source("motion"), f"{self._name}_recursion")

    @cached_property
    def transposed(self) -> tuple[InC, InC]:
        return self._made(self._dynamics.source("adjoint"), f"{self._name}_adjoint")


@dataclass(frozen=True, eq=False, kw_only=True)
class LaneRuns:
    """Runs of some states over the times of a grid.

    q, qd (states, K, n); other (states,): which of them have to run alone, and have no numbers here
    """

    motions: Motions
    q: np.ndarray
    qd: np.ndarray
    other: np.ndarray
    tape: np.ndarray

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How a number of each state changes with q and q̇ at its start, (states, n) each, and with p, (states, n_p), from how it does with
        q and q̇ at all times, (states, K, n) each."""
        motions, n = self.motions, self.motions.sizes.n_coordinates
        derivatives = motions.call("ncgen_motions_adjoint", self.tape, 2 * n + motions.sizes.n_parameters, by_q, by_qd)
        return derivatives[:, :n], derivatives[:, n : 2 * n], derivatives[:, 2 * n :]

    def velocities_back(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How a sum with these weights (states, n) of the velocities that the joints allow at the start changes with q and p."""
        n = self.motions.sizes.n_coordinates
        derivatives = self._start_back(weights, 1, 2 * n)
        return derivatives[:, :n], derivatives[:, 2 * n :]

    def closing_back(self, weights: np.ndarray) -> np.ndarray:
        """How a sum with these weights (states, n) of a step of Newton's method at the start changes with p, (states, n_p)."""
        n = self.motions.sizes.n_coordinates
        return self._start_back(weights, 0, n)[:, n:]

    def _start_back(self, weights: np.ndarray, of_velocities: int, before: int) -> np.ndarray:
        motions = self.motions
        return motions.call("ncgen_starts_vjp", self.tape, before + motions.sizes.n_parameters, weights, which=(of_velocities,))


class Motions:
    """Of a mechanism, over the times (K,) s of a grid, by an explicit method. May be used by several threads at a time."""

    def __init__(self, dynamics: ConstrainedDynamics, method: str, times: np.ndarray) -> None:
        kernels = dynamics.kernels
        self.kernels, self._times = kernels, np.ascontiguousarray(times, dtype=float)
        self._ffi, self._library = _library()
        self._emitted = kernels.remember("motions in lanes", (), lambda: _Emitted(dynamics))
        is_driven = "nu" in kernels.programs.programs
        self.sizes = Sizes(
            n_coordinates=kernels.n,
            n_parameters=len(kernels.p0),
            n_prepared=dynamics.prepared,
            is_driven=is_driven,
            method=number_in_c(INTEGRATORS[method]),
            n_inputs=0,
        )
        self._in_c = self._ffi.new("ncgen_taped *", vars(self.sizes))
        self._tape = self._library.ncgen_motions_tape(self._in_c, len(times) - 1)
        self._work = self._library.ncgen_motions_workspace(self._in_c, kernels.m, len(times) - 1)
        self.lanes = self._library.ncgen_motions_lanes()

    @property
    def may_run(self) -> bool:
        """Whether a block's tape is short enough."""
        return 8 * self._tape <= MAX_TAPE_BYTES

    def part(self, back: bool) -> int:
        """States that are well run together by one thread; back: and gone back through, so that all of their tapes are kept meanwhile."""
        return self.lanes * (max(1, TAPED // (8 * self._tape)) if back else N_UNTAPED_BLOCKS)

    def run(
        self, q: np.ndarray, qd: np.ndarray, p: np.ndarray, back: bool = True, rows: tuple[np.ndarray, np.ndarray] | None = None
    ) -> LaneRuns:
        """Runs of states from closed positions q and velocities qd that the joints allow, (states, n) each, with parameters p,
        (states, n_p); back: whether there will be a reverse sweep; rows: where q and q̇ go, (states, K, n), each in one piece, None for new
        memory."""
        ffi, kernels, count = self._ffi, self.kernels, len(q)
        shape = count, len(self._times), kernels.n
        to_q, to_qd = rows or (np.empty(shape), np.empty(shape))
        other, taped = np.empty(count, dtype=np.intc), len(self._times) - 1 if back else 1
        size = self._library.ncgen_motions_tape(self._in_c, taped) * (-(-count // self.lanes) if back else 1)
        tape = aligned(size)
        start = [laid(a, float, size, f"{kernels.name}: {name}") for name, a, size in (
            ("q", q, kernels.n), ("qd", qd, kernels.n), ("p", p, len(kernels.p0))
        )]  # fmt: skip
        pointers = [pointer(ffi, a, count=a.shape[-1] * count, label=kernels.name) for a in start]
        column_sizes, row_sizes, times = (pointer(ffi, a) for a in (kernels.column_sizes, kernels.row_sizes, self._times))
        self._library.ncgen_motions(
            self._emitted.motion[0], self._in_c, kernels.m, column_sizes, row_sizes, len(self._times) - 1, times, count, *pointers,
            *(pointer(ffi, a, count=prod(shape)) for a in (to_q, to_qd)), pointer(ffi, other, "int[]"), taped, pointer(ffi, tape),
            pointer(ffi, aligned(self._work)),
        )  # fmt: skip
        return LaneRuns(motions=self, q=to_q, qd=to_qd, other=other != 0, tape=tape)

    def call(self, function: str, tape: np.ndarray, width: int, *weights: np.ndarray, which: tuple[int, ...] = ()) -> np.ndarray:
        """Slopes (states, width) of a function of the library that goes back; which: what it asks for besides."""
        ffi, size = self._ffi, self.kernels.n * (1 if which else len(self._times))
        arrays = [np.ascontiguousarray(numbers(a, "weights")) for a in weights]
        derivatives = np.empty((len(arrays[0]), width))
        when = self._times[0] if which else pointer(ffi, self._times)
        getattr(self._library, function)(
            self._emitted.transposed[0], self._in_c, *which, len(self._times) - 1, when, len(derivatives),
            *(pointer(ffi, a, count=len(derivatives) * size, label="weights") for a in arrays),
            *(pointer(ffi, a) for a in (tape, derivatives, aligned(self._work))),
        )  # fmt: skip
        return derivatives

    def prepare(self, back: bool) -> None:
        """Compile what runs, and ways back, need, before threads ask for it."""
        for name in ("motion", "transposed") if back else ("motion",):
            getattr(self._emitted, name)
