"""Runs in C that leave a tape behind, and what the tape tells: how a motion changes with its start and its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import PRINTED, RUNTIME_HEADERS, runtime_files
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.mechanism.driving import Function, InputPieces, signal_values
from ncgen.mechanism.kernel_batch import aligned, in_lanes
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving import ANY_STEP
from ncgen.mechanism.moving_breaks import Jump, Jumping
from ncgen.mechanism.run_arguments import NO_INPUTS, InitialState, RunInputs
from ncgen.mechanism.run_rows import Outcome
from ncgen.mechanism.sweep import DUAL_STEP, Numbers, Sizes, Sweep, dual_numbers
from ncgen.methods.table import FORMALISMS, INTEGRATORS, Integrator, number_in_c
from ncgen.toolchain.abi import InC, Interface, declared, runtime_abi
from ncgen.toolchain.once import once

STEPS_PER_INTERVAL = 4
"""Steps with error control from one time of a grid to the next for which there is room at first."""

SWEEP = (
    "ncgen_directions.h", "ncgen_directions.c", "ncgen_space.c", "ncgen_space.h", "ncgen_stage_sums.h", "ncgen_vectors.h",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Driven:
    """Numbers of all inputs, values (steps, stages, inputs), at stages of steps: their times and when the steps began, t, begun (steps,
    stages) in s. None of them where nothing drives a run."""

    t: np.ndarray
    begun: np.ndarray
    values: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[Driven]) -> Driven:
        return cls(*(np.concatenate([getattr(driven, name) for driven in parts]) for name in ("t", "begun", "values")))


MAX_TAPE_BYTES = 2**31
"""Bytes that the states of a tape may take."""

SEGMENT = 2**28
"""Bytes that they may take before a run of given steps is taped in segments."""


def taped(
    dynamics: ConstrainedDynamics, method: str, times: np.ndarray, initial: InitialState, tolerances: Mapping[str, InC] | None = None,
    **options: InC,
) -> Taped | Segmented:  # fmt: skip
    """A run that leaves a tape, or where that would be too long segments of one; arguments as of `Taped`."""
    steps = SEGMENT // (8 * step_size(method, dynamics.kernels.n))
    if tolerances is None and len(times) > steps + 1:
        return Segmented(dynamics, method, times, initial, max(steps, 1), **options)
    return Taped(dynamics, method, times, initial, tolerances, **options)


def step_size(method: str, n: int) -> int:
    """Numbers that a step leaves on a tape, for n coordinates."""
    return (2 * INTEGRATORS[method].coefficients.stages + 3) * n


class Taped:
    """A run over the times of a grid, (K,) s, by an emitted motion and an explicit method: one step from each to the next, or as many as
    tolerances take. Their lengths count as given, whatever changes.

    initial: with all velocities, (n,); tolerances: members of `ncgen_options`, as are the other options
    outcome: as of `Dynamics.simulate`; the derivatives are there where that is "ok" and nothing is `not_differentiable`
    """

    def __init__(
        self, dynamics: ConstrainedDynamics, method: str, times: np.ndarray, initial: InitialState,
        tolerances: Mapping[str, InC] | None = None, inputs: RunInputs = NO_INPUTS, jumps: Jumping | None = None, **options: InC,
    ) -> None:  # fmt: skip
        self._jumping = jumps
        self._dynamics, self._kernels = dynamics, dynamics.kernels
        self._ffi, self._library = dynamics.adjoint_interface
        self._p, self._parameters = dynamics.with_prepared(np.asarray(initial.p)), np.size(initial.p)
        options |= {"formalism": number_in_c(FORMALISMS["lagrange"]), "project": 1}
        options |= tolerances if tolerances else {"rtol": 0.0, "atol": 0.0, "max_step": ANY_STEP}
        ends = replace(inputs, breaks=np.union1d(inputs.breaks, times if tolerances else ()))
        steps = (len(times) - 1) * (STEPS_PER_INTERVAL if tolerances else 1) + np.size(inputs.breaks)
        while True:
            self._take_room(method, steps)
            self.outcome: Outcome = dynamics.simulate(method, times, initial, tape=self._tape, inputs=ends, **options)
            if self.outcome.status != "full" or 2 * self._states.nbytes > MAX_TAPE_BYTES:
                break
            steps *= 2
        self._times = self._times[: self._tape.steps + 1]
        self._seen = np.searchsorted(self._times, times)
        self.driven = self._stages(INTEGRATORS[method], inputs.signals)
        self._sizes = replace(self._sizes, n_inputs=self.driven.values.shape[2])

    def _stages(self, method: Integrator, signals: Sequence[InputPieces | Function | None]) -> Driven:
        """The inputs of all stages."""
        begun = self._times[:-1, None]
        nodes = np.array([float(c) for c in method.coefficients.c[: method.coefficients.stages]])
        t, begun = np.broadcast_arrays(begun + nodes * np.diff(self._times)[:, None], begun)
        first = self._parameters - len(signals)
        values = [self._p[first + i] + 0 * t if signal is None else signal_values(signal, t, begun) for i, signal in enumerate(signals)]
        return Driven(t, begun, np.array(values).reshape(len(signals), *t.shape).transpose(1, 2, 0))

    def _take_room(self, method: str, steps: int) -> None:
        """A tape for so many steps."""
        kernels, method_in_c = self._kernels, number_in_c(INTEGRATORS[method])
        self._step_size = step_size(method, kernels.n)
        self._times, self._states = np.empty(steps + 1), np.empty(steps * self._step_size + 2 * kernels.n)
        tape = {"capacity": steps, "times": self._real(self._times), "states": self._real(self._states)}
        self._tape = self._ffi.new("ncgen_tape *", tape)
        is_driven = "nu" in kernels.programs.programs
        self._sizes = Sizes(
            n_coordinates=kernels.n,
            n_parameters=self._parameters,
            n_prepared=self._dynamics.prepared,
            is_driven=is_driven,
            method=method_in_c,
            n_inputs=0,
        )

    @property
    def not_differentiable(self) -> float | None:
        """When (s) the first step began that went otherwise, near a singular position; None where there is none."""
        return float(self._times[self._tape.first_other - 1]) if self._tape.first_other else None

    @cached_property
    def back(self) -> Sweep:
        """The reverse sweep through the run."""
        transposed, home = self._dynamics.transposed
        numbers = Numbers(ffi=self._ffi, library=self._library, transposed=transposed, dtype=np.dtype(float), home=home)
        return Sweep(numbers, self._sizes, self._times, self._states, self._p, self.driven.values)

    def _states_at_ends(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All instants at which steps end (steps + 1,), s, and q and q̇ there, (steps + 1, n)."""
        count, n = len(self._times), self._sizes.n_coordinates
        first = self._states[: (count - 1) * self._step_size].reshape(count - 1, self._step_size)[:, : 2 * n]
        last = self._states[(count - 1) * self._step_size :][: 2 * n]
        whole = np.vstack([first, last])
        return self._times, whole[:, :n], whole[:, n:]

    @cached_property
    def jumps(self) -> Mapping[int, Jump]:
        """Those that parameters move, by the number of the instant just before."""
        return self._jumping(*self._states_at_ends()) if self._jumping else {}

    def _pieces(self) -> list[tuple[int, int]]:
        """First and last instant of all parts of the run that no jump divides."""
        count = len(self._times) - 1
        return [*pairwise([0, *(k for k in sorted(self.jumps) if k), count])]

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, Driven]:
        """How a number changes with q and q̇ at the start, (n,) each, with p, (n_p,), and with what drove the run, from how it does with q
        and q̇ at all times of the grid, (K, n) each."""
        weights = self.at_all_steps(by_q, by_qd)
        if not self.jumps:
            to_q, to_qd, by_p, by_inputs = self.back.backward(weights)
            return to_q, to_qd, by_p, replace(self.driven, values=by_inputs)
        n, by_p = self._sizes.n_coordinates, np.zeros(self._parameters)
        by_inputs, numbers = np.empty_like(self.driven.values), self.back.numbers
        for first, last in reversed(self._pieces()):
            first_weights = weights[first].copy()
            weights[first] = 0.0
            states = self._states[first * self._step_size : last * self._step_size + 2 * n]
            inputs = self.driven.values[first:last]
            sweep = Sweep(numbers, self._sizes, self._times[first : last + 1], states, self._p, inputs)
            to_q, to_qd, more, by_inputs[first:last] = sweep.backward(weights[first : last + 1])
            by_p += more + (self.jumps[first].felt(to_qd) if first in self.jumps else 0.0)
            weights[first] = first_weights + np.concatenate([to_q, to_qd])
        return weights[0, :n], weights[0, n:], by_p, replace(self.driven, values=by_inputs)

    def at_all_steps(self, by_q: np.ndarray, by_qd: np.ndarray) -> np.ndarray:
        """Weights (steps + 1, 2 n) of [q, q̇] from those at the times of the grid."""
        rows = np.hstack([by_q, by_qd])
        weights = np.zeros((len(self._times), rows.shape[1]), dtype=rows.dtype)
        weights[self._seen] = rows
        return weights

    def forward(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all times of the grid, (K, n, D) each, with those of both at the start, (n, D), and of p, (n_p, D)."""
        changes = self._at_the_grid(self._along(dq, dqd, dp, None))
        n = self._sizes.n_coordinates
        return changes[:, :n], changes[:, n:]

    def _at_the_grid(self, rows: np.ndarray) -> np.ndarray:
        """Those of all steps that are at times of the grid; no copy where all are."""
        return rows if len(self._seen) == len(rows) else rows[self._seen]

    def second(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[Sweep]]:
        """The same, and for every direction the reverse sweep in dual numbers."""
        sizes, columns = self._sizes, dp.shape[1]
        used = len(self._states) - (self._tape.capacity - self._tape.steps) * self._step_size
        taped = np.empty((used + sizes.n_prepared, columns))
        changes, n = self._at_the_grid(self._along(dq, dqd, dp, taped)), sizes.n_coordinates
        numbers = self._kernels.remember("dual numbers", (), self._dual_numbers)
        sweeps = []
        for k in range(columns):
            states = self._states[:used] + DUAL_STEP * 1j * taped[:used, k]
            p = self._p + DUAL_STEP * 1j * np.concatenate([dp[:, k], taped[used:, k]])
            shifts = dp[len(dp) - sizes.n_inputs :, k]
            sweeps.append(Sweep(numbers, sizes, self._times, states, p, self.driven.values + DUAL_STEP * 1j * shifts))
        return changes[:, :n], changes[:, n:], sweeps

    def _along(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray, taped: np.ndarray | None) -> np.ndarray:
        """Changes (steps + 1, 2 n, D) where steps begin and end, and where they are wanted of all that is on the tape."""
        n = self._sizes.n_coordinates
        changes, size = np.empty((len(self._times), 2 * n, dp.shape[1])), self._step_size
        changes[0] = np.vstack([dq, dqd])
        for first, last in self._pieces():
            begun = changes[first].copy()
            if first in self.jumps:
                begun[n:] += self.jumps[first].along(dp)
            seeds, inputs = np.vstack([begun, dp]).astype(float, order="C"), self.driven.values[first:last]
            times, states = self._times[first : last + 1], self._states[first * size :]
            first_changes = changes[first].copy()
            self._directions.run(self._sizes, self._p, inputs, times, states, seeds, changes[first : last + 1], taped)
            changes[first] = first_changes
        return changes

    def velocities_along(self, dq: np.ndarray, dp: np.ndarray) -> np.ndarray:
        """How the velocities that the joints allow at the start change, (n, D), with q, (n, D), and p, (n_p, D)."""
        return self._start_along(True, dq, dp)

    def closing_along(self, dp: np.ndarray) -> np.ndarray:
        """How a step of Newton's method at the start changes, (n, D), with p, (n_p, D)."""
        return self._start_along(False, np.zeros((self._sizes.n_coordinates, dp.shape[1])), dp)

    def _start_along(self, of_velocities: bool, dq: np.ndarray, dp: np.ndarray) -> np.ndarray:
        seeds = np.vstack([dq, np.zeros_like(dq), dp]).astype(float, order="C")
        return self._directions.start(of_velocities, self._sizes, self._p, self._times[0], self._states, seeds)

    @property
    def _directions(self) -> _Directions:
        return self._kernels.remember("directions", (), lambda: _Directions(self._kernels, self._dynamics))

    def _dual_numbers(self) -> Numbers:
        return dual_numbers(self._dynamics.source("adjoint"), f"{prefix_of(self._kernels.name)}_adjoint")

    def _real(self, array: np.ndarray) -> InC:
        return pointer(self._ffi, array)


class Segmented:
    """A long run with one step from each time to the next, of which a segment is on tape at a time: to go back, a segment is run again from
    the state in which it began. Members as of `Taped`, without second derivatives.
    """

    def __init__(
        self, dynamics: ConstrainedDynamics, method: str, times: np.ndarray, initial: InitialState, steps: int, **options: InC
    ) -> None:
        """steps: of a segment"""
        self._run, self._initial = partial(Taped, dynamics, method, **options), initial
        self._times, self._bounds = times, [*range(0, len(times) - 1, steps), len(times) - 1]
        self.not_differentiable: float | None = None
        parts: list[Outcome] = []
        for begin, end in pairwise(self._bounds):
            segment = self._run(times=times[begin : end + 1], initial=initial)
            parts.append(segment.outcome)
            if self.not_differentiable is None:
                self.not_differentiable = segment.not_differentiable
            if segment.outcome.status != "ok":
                break
            q, qd, _ = segment.outcome.last
            initial = replace(initial, q=q, velocities=qd)
        rows = {name: np.concatenate([getattr(segment, name)[k > 0 :] for k, segment in enumerate(parts)]) for name in ("q", "qd", "work")}
        self.outcome = parts[-1].with_rows(**rows)

    @cached_property
    def _first(self) -> Taped:
        """Its first step: all that is asked of the start."""
        return self._segment(slice(0, 2))

    @property
    def back(self) -> Sweep:
        """The reverse sweep through its first step."""
        return self._first.back

    def velocities_along(self, dq: np.ndarray, dp: np.ndarray) -> np.ndarray:
        """As of `Taped`."""
        return self._first.velocities_along(dq, dp)

    def closing_along(self, dp: np.ndarray) -> np.ndarray:
        """As of `Taped`."""
        return self._first.closing_along(dp)

    def _segments(self) -> Iterator[tuple[slice, Taped]]:
        """The last one first, each with its place among the times."""
        for begin, end in reversed(list(pairwise(self._bounds))):
            rows = slice(begin, end + 1)
            yield rows, self._segment(rows)

    def _segment(self, rows: slice) -> Taped:
        begun = replace(self._initial, q=self.outcome.q[rows.start], velocities=self.outcome.qd[rows.start])
        return self._run(times=self._times[rows], initial=begun)

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, Driven]:
        """As of `Taped`."""
        by_q, by_qd = by_q.copy(), by_qd.copy()
        by_p: np.ndarray | float = 0.0
        driven: list[Driven] = []
        for rows, segment in self._segments():
            by_q[rows.start], by_qd[rows.start], more, felt = segment.backward(by_q[rows], by_qd[rows])
            by_p = by_p + more
            driven.append(felt)
        return by_q[0], by_qd[0], np.asarray(by_p), Driven.joined(driven)

    def forward(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As of `Taped`."""
        rows = [(dq[None], dqd[None])]
        for begin, end in pairwise(self._bounds):
            q, qd = self._segment(slice(begin, end + 1)).forward(rows[-1][0][-1], rows[-1][1][-1], dp)
            rows.append((q[1:], qd[1:]))
        first, second = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        return first, second


@once
def _sweep_in_lanes() -> tuple[Interface, InC]:
    """What goes along directions, the same for all mechanisms."""
    return in_lanes(runtime_files(*SWEEP, *RUNTIME_HEADERS, *PRINTED), declared("ncgen_directions.h", "functions"), runtime_abi())


class _Directions:
    """The emitted motion along directions, a direction a lane of a vector."""

    def __init__(self, kernels: Kernels, dynamics: ConstrainedDynamics) -> None:
        self._ffi, self._library = _sweep_in_lanes()
        getter = f"{prefix_of(kernels.name)}_tangent"
        files = dynamics.source("tangent") | runtime_files(*RUNTIME_HEADERS)
        _, self._emitted = in_lanes(files, f"const void *{getter}(void);", runtime_abi(), self._library.ncgen_directions_lanes())
        self._motion = getattr(self._emitted, getter)()

    def start(self, of_velocities: bool, sizes: Sizes, p: np.ndarray, t: float, states: np.ndarray, seeds: np.ndarray) -> np.ndarray:
        """Changes (n, D) of what comes before the run, as of `ncgen_starts_jvp`; states begin with that of the start."""
        counts, changes = self._counts(sizes), np.empty((sizes.n_coordinates, seeds.shape[1]))
        work = aligned(self._library.ncgen_directions_workspace(*counts, sizes.method))
        p_in_c, *arrays = (pointer(self._ffi, a) for a in (p, states, seeds, changes, work))
        self._library.ncgen_starts_jvp(
            self._motion, *counts, sizes.method, p_in_c, of_velocities, t, arrays[0], seeds.shape[1], *arrays[1:]
        )
        return changes

    def run(
        self, sizes: Sizes, p: np.ndarray, inputs: np.ndarray, times: np.ndarray, states: np.ndarray, seeds: np.ndarray,
        changes: np.ndarray, taped: np.ndarray | None,
    ) -> None:  # fmt: skip
        counts = self._counts(sizes)
        work = aligned(self._library.ncgen_directions_workspace(*counts, sizes.method))
        pointers = [pointer(self._ffi, a) for a in (p, np.ascontiguousarray(inputs), times, states, seeds, changes, taped, work)]
        p_in_c, inputs_in_c, *tape, seeds_in_c = pointers[:5]
        self._library.ncgen_directions(
            self._motion,
            *counts,
            sizes.is_driven,
            sizes.method,
            sizes.n_inputs,
            p_in_c,
            inputs_in_c,
            len(times) - 1,
            *tape,
            seeds.shape[1],
            seeds_in_c,
            *pointers[5:],
        )

    @staticmethod
    def _counts(sizes: Sizes) -> tuple[int, int, int]:
        return sizes.n_coordinates, sizes.n_parameters, sizes.n_prepared
