"""Runs in C that leave a tape behind, and what the tape tells: how a motion changes with its start and its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from ncgen.emit.naming import identifier
from ncgen.emit.runtime import PRINTED, RUNTIME_HEADERS, runtime_files
from ncgen.mechanism.batch import aligned, in_lanes
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.moving import ANY_STEP
from ncgen.mechanism.runtime import ConstrainedDynamics, Outcome
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.toolchain.abi import InC, Interface, declared, runtime_abi

ROOMY = 4
"""Steps with error control from one time of a grid to the next for which there is room at first."""

SWEEP = ("ncgen_directions.h", "ncgen_directions.c", "ncgen_vectors.h")


LONGEST = 2**31
"""Bytes that the states of a tape may take."""


class Taped:
    """A run over the times of a grid, (K,) s, by an emitted motion and an explicit method: one step from each to the next, or as many as
    tolerances take. Their lengths count as given, whatever changes.

    q, qd (n,), p (n_p,): where it starts, and the parameters; tolerances: members of `ncgen_options`, as are the other options
    outcome: as of `Dynamics.simulate`; the derivatives are there where that is "ok" and nothing is `not_differentiable`
    """

    def __init__(
        self, dynamics: ConstrainedDynamics, method: str, times: np.ndarray, q: np.ndarray, qd: np.ndarray, p: np.ndarray,
        tolerances: Mapping[str, InC] | None = None, **options: InC,
    ) -> None:  # fmt: skip
        self._dynamics, self._kernels = dynamics, dynamics.kernels
        self._ffi, self._library = dynamics.interface
        self._p, self._parameters = dynamics.with_prepared(p), len(p)
        options |= {"formalism": number_in_c(FORMALISMS["lagrange"]), "project": 1}
        options |= tolerances if tolerances else {"rtol": 0.0, "atol": 0.0, "max_step": ANY_STEP}
        steps = (len(times) - 1) * (ROOMY if tolerances else 1)
        while True:
            self._take_room(method, steps)
            self.outcome: Outcome = dynamics.simulate(method, times, q, qd, p, tape=self._tape, ends=times if tolerances else (), **options)
            if self.outcome.status != "full" or 2 * self._states.nbytes > LONGEST:
                break
            steps *= 2
        self._times = self._times[: self._tape.steps + 1]
        self._seen = np.searchsorted(self._times, times)

    def _take_room(self, method: str, steps: int) -> None:
        """A tape for so many steps."""
        kernels, method_in_c = self._kernels, number_in_c(INTEGRATORS[method])
        stages = INTEGRATORS[method].coefficients.stages
        self._times, self._states = np.empty(steps + 1), np.empty((steps * (2 * stages + 3) + 2) * kernels.n)
        tape = {"room": steps, "times": self._real(self._times), "states": self._real(self._states)}
        self._tape = self._ffi.new("ncgen_tape *", tape)
        run = {"is_driven": "nu" in kernels.programs.programs, "method": method_in_c, "p": self._real(self._p), "tape": self._tape}
        run |= {"n_coordinates": kernels.n, "n_parameters": self._parameters, "n_prepared": self._dynamics.prepared}
        self._run = self._ffi.new("ncgen_taped *", run)

    @property
    def not_differentiable(self) -> float | None:
        """When (s) the first step began that went otherwise, beside a singular position; None where there is none."""
        return float(self._times[self._tape.other - 1]) if self._tape.other else None

    def velocities_back(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How a sum with these weights (n,) of the velocities that the joints allow at the start changes with q, (n,), and p, (n_p,)."""
        n = self._kernels.n
        slopes = self._back(self._dynamics.transposed.velocities, weights, self._states[:n], self._states[n : 2 * n])
        return slopes[:n], self._by_parameters(slopes[2 * n :])

    def closing_back(self, weights: np.ndarray) -> np.ndarray:
        """How a sum with these weights (n,) of a step of Newton's method at the start changes with p, (n_p,)."""
        n = self._kernels.n
        return self._by_parameters(self._back(self._dynamics.transposed.closing, weights, self._states[:n])[n:])

    def _back(self, transposed: InC, weights: np.ndarray, *state: np.ndarray) -> np.ndarray:
        """What a transposed part says at the start; state: what it reads besides time and p."""
        found = np.empty(sum(map(len, state)) + len(self._p))
        transposed(self._times[0], *(self._real(a) for a in (*state, self._p, np.ascontiguousarray(weights), found)))
        return found

    def _by_parameters(self, slopes: np.ndarray) -> np.ndarray:
        """Slopes (n_p,) by parameters from those by parameters and what is prepared of them."""
        own, prepared = slopes[: self._parameters].copy(), slopes[self._parameters :]
        if len(prepared):
            more = np.empty_like(own)
            self._dynamics.transposed.prepare(*(self._real(a) for a in (self._p, np.ascontiguousarray(prepared), more)))
            own += more
        return own

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How a number changes with q and q̇ at the start, (n,) each, and with p, (n_p,), from how it does with q and q̇ at all times of the
        grid, (K, n) each."""
        n = self._kernels.n
        weights, slopes = np.zeros((len(self._times), 2 * n)), np.empty(2 * n + self._parameters)
        weights[self._seen] = np.hstack([by_q, by_qd])
        work = np.empty(self._library.ncgen_adjoint_workspace(self._run))
        self._library.ncgen_adjoint(self._run, self._dynamics.transposed, self._real(weights), self._real(slopes), self._real(work))
        return slopes[:n], slopes[n : 2 * n], slopes[2 * n :]

    def forward(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all times of the grid, (K, n, D) each, with those of both at the start, (n, D), and of p, (n_p, D)."""
        n, columns = self._kernels.n, dp.shape[1]
        seeds = np.vstack([dq, dqd, dp]).astype(float, order="C")
        changes = np.empty((len(self._times), 2 * n, columns))
        lanes = self._kernels.remember("directions", (), lambda: _Directions(self._kernels, self._dynamics))
        lanes(self._run, self._times, self._states, seeds, changes)
        return changes[self._seen, :n], changes[self._seen, n:]

    def _real(self, array: np.ndarray) -> InC:
        return self._ffi.from_buffer("double[]", array)


@cache
def _sweep_in_lanes() -> tuple[Interface, InC]:
    """What goes along directions, the same for all mechanisms."""
    return in_lanes(runtime_files(*SWEEP, *RUNTIME_HEADERS, *PRINTED), declared("ncgen_directions.h", "functions"), runtime_abi())


class _Directions:
    """The emitted motion along directions, a direction a lane of a vector."""

    def __init__(self, kernels: CompiledKernels, dynamics: ConstrainedDynamics) -> None:
        self._ffi, self._library = _sweep_in_lanes()
        getter = f"{identifier(kernels.name)}_tangent"
        files = dynamics.differentiated_source("tangent") | runtime_files(*RUNTIME_HEADERS)
        _, self._emitted = in_lanes(files, f"const void *{getter}(void);", runtime_abi())
        self._motion = getattr(self._emitted, getter)()

    def __call__(self, run: InC, times: np.ndarray, states: np.ndarray, seeds: np.ndarray, changes: np.ndarray) -> None:
        sizes = run.n_coordinates, run.n_parameters, run.n_prepared
        work = aligned(self._library.ncgen_directions_workspace(*sizes, run.method))
        arrays = [self._ffi.from_buffer("double[]", a) for a in (times, states, seeds, changes, work)]
        p = self._ffi.cast("double *", run.p)
        self._library.ncgen_directions(
            self._motion, *sizes, run.is_driven, run.method, p, len(times) - 1, *arrays[:2], seeds.shape[1], *arrays[2:]
        )
