"""A mechanism that moves from call to call of the C runtime (`ncgen_driven.h`): nothing is analysed or allocated in between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol, TypeAlias

import numpy as np

from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.break_times import DOUBLE, MIN_GAP_ROUNDINGS, NO_BREAKS, break_times
from ncgen.mechanism.conditions_in_c import Watched
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.mechanism.driver_jumps import driver_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.time_laws import time_laws
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.toolchain.abi import InC

N_STEPS_AHEAD = 50
"""Steps for which breaks are found at a time."""

ANY_STEP = 1e30
"""s; a longest step that is none."""


class Crossed(Protocol):
    """Velocities qd (n,) behind the jump of a driver's velocity, the work (J) of its impulses, and these."""

    @property
    def qd(self) -> np.ndarray: ...

    @property
    def work(self) -> float: ...

    @property
    def impulses(self) -> tuple[Any, ...]: ...


Cross: TypeAlias = Callable[[Kernels, np.ndarray, np.ndarray, float, float, np.ndarray], Crossed]
"""From q, qd, the times (s) before and after a jump of a driver's velocity, and p, to what is behind it."""


class Stepping:
    """How a mechanism moves in C, with a workspace of its own: for one thread at a time."""

    def __init__(
        self, dynamics: ConstrainedDynamics, method: str, rank: int, rtol: float, atol: float, sizes: np.ndarray | None, tolerance: float,
        cross: Cross | None = None, formalism: str = "lagrange", **settings: float,
    ) -> None:  # fmt: skip
        """method: an explicit one of `ncgen.methods.table`; rank: of Φ_q; sizes (2 n + 1,): what atol is multiplied by; tolerance: of
        the position problem; cross: what carries velocities over the jumps of drivers, None for mechanisms without; formalism: one over
        all coordinates; settings: other members of `ncgen_options`, by their names"""
        self.kernels, self.number, self._dynamics = dynamics.kernels, dynamics.number, dynamics  # which keeps its library
        self.ffi, self.library = ffi, library = dynamics.interface
        self._sizes = None if sizes is None else laid(sizes, self.number.dtype, 2 * self.kernels.n + 1, "sizes")
        self._options = ffi.new("ncgen_options *", {
            "method": number_in_c(INTEGRATORS[method]), "formalism": number_in_c(FORMALISMS[formalism]), "project": 1,
            "rtol": rtol, "atol": atol, "tolerance": tolerance, "max_step": ANY_STEP, **settings,
        })  # fmt: skip
        if self._sizes is not None:
            self._options.sizes = self.pointer(self._sizes)
        model, described = dynamics.described(rank)
        self._described = described  # lives as long
        self.driven = ffi.new("ncgen_driven *", {"model": model, "dynamics": described, "options": self._options})
        self.workspace = np.empty(library.ncgen_driven_workspace(self.driven), self.number.dtype)
        self._integers = np.empty(4 * self.kernels.n + 3 * self.kernels.m, np.intc)
        self.driven.workspace = self.pointer(self.workspace)
        self.driven.integers = pointer(ffi, self._integers, "int[]")
        self.statistics = ffi.new("ncgen_statistics *")
        self._laws = time_laws(self.kernels)
        self.has_breaks = self._laws.has_breaks
        self._known: tuple[float, float, bytes] = 0.0, 0.0, b""
        self._cross, self._jumps = cross, NO_BREAKS
        self.impulses: list[Any] = []

    def go_on(self, moment: InC, p: np.ndarray, q: np.ndarray, qd: np.ndarray, t_end: float) -> int:
        """Move to t_end (s) from break to break of laws in time, with the impulse of every jump of a driver's velocity before it.

        p (n_p,), q, qd (n,): what the moment points to. Returns a number of `STATUS`; where it is not 0 all is as it was. A step that ends
        at a jump ends before the impulse, with which the next one begins. `impulses` has those of the last call
        """
        self.impulses = []
        if not moment.t < t_end < np.inf:
            return self._call(moment, p, t_end)  # which refuses it
        self._look_ahead(p, q, moment.t, t_end)
        jumps = self._jumps[(self._jumps[:, 1] > moment.t) & (self._jumps[:, 0] < t_end)].tolist()
        if not jumps or self._cross is None:
            return self._call(moment, p, t_end)
        kept, evaluations = (q.copy(), qd.copy(), moment.t, moment.work, moment.h), 0
        for before, after in [*jumps, [t_end, t_end]]:
            status = 0
            if moment.t < before:
                status = self._call(moment, p, before)
                evaluations += self.statistics.evaluations
            if status:
                q[:], qd[:], moment.t, moment.work, moment.h = kept
                self.impulses = []
                return status
            if after >= t_end:
                break
            crossing = self._cross(self.kernels, q, qd, before, after, p)
            qd[:], moment.t, moment.work = crossing.qd, after, moment.work + crossing.work
            self.impulses += crossing.impulses
        moment.t, self.statistics.evaluations = t_end, evaluations
        return 0

    def _call(self, moment: InC, p: np.ndarray, t_end: float) -> int:
        return self.library.ncgen_advance(self.driven, self.pointer(p), moment, t_end, self.statistics)

    def _look_ahead(self, p: np.ndarray, q: np.ndarray, t: float, t_end: float) -> None:
        """Let steps from t to t_end (s) end at the breaks of parameters p (n_p,), which are found for many steps at a time."""
        reads = p[list(self._laws.parameters)].tobytes()
        first, last, known = self._known
        if first <= t and t_end <= last and known == reads:
            return
        last = t + N_STEPS_AHEAD * (t_end - t)
        parameters, margin = np.asarray(p, dtype=float), 2 * MIN_GAP_ROUNDINGS * DOUBLE * max(abs(t), abs(last))
        breaks = break_times(self.kernels, parameters, t - margin, last)  # a step may have ended at the middle of one
        self._jumps = driver_jumps(self.kernels, parameters, np.asarray(q, dtype=float), breaks)
        self._breaks = breaks.ravel().astype(self.number.dtype)
        self._signals = self.ffi.new("ncgen_signals *", {"n_breaks": len(self._breaks), "breaks": self.pointer(self._breaks)})
        self._options.signals, self._known = self._signals, (t, last, reads)

    def go_on_to_event(self, moment: InC, p: InC, h: float, watched: Watched) -> tuple[str, bool, int]:
        """Move on by h seconds or to the first of some conditions: "ok" or why not, whether it ended there, and evaluations."""
        self._options.event = watched.struct
        status = self.library.ncgen_advance(self.driven, p, moment, moment.t + h, self.statistics)
        self._options.event = self.ffi.NULL
        return STATUS[status], bool(self.statistics.stopped), self.statistics.evaluations

    def pointer(self, array: np.ndarray) -> InC:
        return pointer(self.ffi, array, self.number.array)


def _member(name: str) -> Any:
    """A number of the moment that C works on."""
    return property(lambda self: getattr(self._moment, name), lambda self, value: setattr(self._moment, name, value))


class Moving:
    """Where a mechanism is, in memory that C works on.

    q, qd, qdd (n,): position, velocities and accelerations (m, rad, and per second); p (n_p,): parameters and inputs; all but qdd may be
        written to
    t: s; work: J; power: W, of the last `project_state` or `evaluate`; next_step: s, what error control tries next, 0 where it has to
        find one
    evaluations: of the last call of `go_on`
    """

    def __init__(self, stepping: Stepping) -> None:
        self._stepping, self._ffi, self._library = stepping, stepping.ffi, stepping.library
        n, dtype, kernels = stepping.kernels.n, stepping.number.dtype, stepping.kernels
        self.q, self.qd, self.qdd, self.p = (np.zeros(size, dtype) for size in (n, n, n, len(kernels.p0)))
        self._moment = self._ffi.new("ncgen_moment *", {name: stepping.pointer(getattr(self, name)) for name in ("q", "qd", "qdd")})
        self._p, self._driven, self._statistics = stepping.pointer(self.p), stepping.driven, stepping.statistics
        self._go_on, self._has_breaks = self._library.ncgen_advance, stepping.has_breaks

    t, work, power, next_step = _member("t"), _member("work"), _member("power"), _member("h")

    @property
    def workspace(self) -> int:
        """Numbers that C works in."""
        return len(self._stepping.workspace)

    @property
    def evaluations(self) -> int:
        return self._statistics.evaluations

    @property
    def impulses(self) -> tuple[Any, ...]:
        """Those of the last step."""
        return tuple(self._stepping.impulses)

    def go_on(self, h: float) -> str:
        """On by h seconds: "ok", or why not; then nothing has moved."""
        if self._has_breaks:
            return STATUS[self._stepping.go_on(self._moment, self.p, self.q, self.qd, self._moment.t + h)]
        return STATUS[self._go_on(self._driven, self._p, self._moment, self._moment.t + h, self._statistics)]

    def go_on_to_event(self, h: float, watched: Watched, mode: Stepping | None = None) -> tuple[str, bool, int]:
        """The same to the first of some conditions, for mechanisms without breaks: "ok" or why not, whether it ended there, evaluations.

        mode: how it moves with what is held, None where nothing is
        """
        return (mode or self._stepping).go_on_to_event(self._moment, self._p, h, watched)

    def project_state(self) -> str:
        """Position and velocities onto the constraints: "ok", or why not; then nothing has moved."""
        return STATUS[self._library.ncgen_project_moment(self._driven, self._p, self._moment)]

    def evaluate(self) -> str:
        """Accelerations with the present p into qdd: "ok", or why there are none. Velocities stay as they are, to the last bit."""
        kept = self.qd.copy()
        status = STATUS[self._library.ncgen_evaluate_moment(self._driven, self._p, self._moment)]
        self.qd[:] = kept
        return status


MOMENT = [("t", float), ("next_step", float), ("work", float), ("power", float), ("q", np.intp), ("qd", np.intp), ("qdd", np.intp)]
"""`ncgen_moment` as NumPy sees it, for numbers that are doubles."""


class MovingRows:
    """Many of them in rows of arrays, which go on together: q, qd, qdd (N, n), p (N, n_p), t, work and next_step (N,).

    steppings: one for every thread; they share the rows
    """

    def __init__(self, steppings: Sequence[Stepping], count: int) -> None:
        self._steppings = steppings
        first = steppings[0]
        kernels, ffi = first.kernels, first.ffi
        self.q, self.qd, self.qdd = (np.zeros((count, kernels.n)) for _ in range(3))
        self.p = np.zeros((count, len(kernels.p0)))
        self.statuses = np.zeros(count, np.intc)
        self._moments = ffi.new("ncgen_moment[]", count)
        moments = np.frombuffer(ffi.buffer(self._moments), dtype=MOMENT)
        for name in ("q", "qd", "qdd"):
            rows = getattr(self, name)
            moments[name] = rows.ctypes.data + np.arange(count) * rows.strides[0]
        self.t, self.work, self.next_step = moments["t"], moments["work"], moments["next_step"]
        ends = np.linspace(0, count, len(steppings) + 1).astype(int)
        self._parts = [job for job in zip(steppings, ends[:-1].tolist(), ends[1:].tolist(), strict=True) if job[1] < job[2]]
        self._pool = ThreadPoolExecutor(len(self._parts)) if len(self._parts) > 1 else None

    def go_on(self, h: float) -> bool:
        """All rows on by h seconds; whether all of them could. `statuses` has the numbers of `STATUS`; who could not stays where it was."""
        if self._pool is None:
            for job in self._parts:
                self._share(h, *job)
        else:
            list(self._pool.map(lambda job: self._share(h, *job), self._parts))
        return not self.statuses.any()

    def _share(self, h: float, stepping: Stepping, first: int, last: int) -> None:
        """Some of the rows, by one call of C."""
        p = stepping.pointer(self.p[first:last])
        statuses = pointer(stepping.ffi, self.statuses[first:last], "int[]")
        moments = self._moments + first
        if stepping.has_breaks:
            self._one_after_the_other(h, stepping, first, last)
            return
        stepping.library.ncgen_advance_each(stepping.driven, last - first, self.p.shape[1], p, moments, h, statuses, stepping.statistics)

    def _one_after_the_other(self, h: float, stepping: Stepping, first: int, last: int) -> None:
        """The same, each with the breaks of its own parameters."""
        for row in range(first, last):
            arrays, t_end = (self.p[row], self.q[row], self.qd[row]), self.t[row] + h
            self.statuses[row] = stepping.go_on(self._moments + row, *arrays, t_end)

    def project_state(self, row: int) -> str:
        """One row's position and velocities onto the constraints: "ok", or why not."""
        return self._one("ncgen_project_moment", row)

    def evaluate(self, row: int) -> str:
        """One row's accelerations into qdd: "ok", or why there are none. Its velocities stay as they are, to the last bit."""
        kept = self.qd[row].copy()
        status = self._one("ncgen_evaluate_moment", row)
        self.qd[row] = kept
        return status

    def go_on_to_event(self, row: int, h: float, watched: Watched, mode: Stepping | None) -> tuple[str, bool, int]:
        """One row, as of `Moving`, with evaluations."""
        stepping = mode or self._steppings[0]
        return stepping.go_on_to_event(self._moments + row, stepping.pointer(self.p[row : row + 1]), h, watched)

    def _one(self, function: str, row: int) -> str:
        first = self._steppings[0]
        return STATUS[getattr(first.library, function)(first.driven, first.pointer(self.p[row : row + 1]), self._moments + row)]


def _entry(name: str) -> Any:
    """A number of a row."""

    def put(self: MovingRow, value: float) -> None:
        getattr(self.rows, name)[self.row] = value

    return property(lambda self: float(getattr(self.rows, name)[self.row]), put)


class MovingRow:
    """One of many, with those members of a `Moving` that say where it is."""

    def __init__(self, rows: MovingRows, row: int) -> None:
        self.rows, self.row = rows, row
        self.q, self.qd, self.p = rows.q[row], rows.qd[row], rows.p[row]

    def go_on_to_event(self, h: float, watched: Watched, mode: Stepping | None = None) -> tuple[str, bool, int]:
        """As of `Moving`."""
        return self.rows.go_on_to_event(self.row, h, watched, mode)

    t, work, next_step = _entry("t"), _entry("work"), _entry("next_step")
