"""Forces of a model's own Python functions, and their derivatives by differences, as the C runtime calls them."""

from __future__ import annotations

import threading
from functools import cached_property
from types import TracebackType
from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.toolchain.abi import InC, Interface, runtime_abi

INTERRUPTED = STATUS.index("interrupted")


ROUNDING = float(np.sqrt(np.finfo(float).eps))
"""Length of a difference over the size of what changes: where truncation and rounding are about the same."""


class _Thread(threading.local):
    """State of one thread.

    raised: what a callback raised, or None
    places: pointers of C to q, qd and the forces, and arrays that are this memory; None after something was raised
    """

    def __init__(self, nowhere: InC) -> None:
        self.raised: BaseException | None = None
        self.places: tuple[Any, ...] | None = (nowhere,) * 6


class ExternalForces:
    """`ncgen_dynamics.external` for the callbacks of a model, in doubles.

    function: for C. What a callback raises ends the run on its thread: `raised` has it then, and no callback is called again before `begin`
    """

    def __init__(self, kernels: Kernels) -> None:
        ffi: Interface = runtime_abi()
        force = kernels.external_force
        self._ffi, self._kernels, self._nowhere = ffi, kernels, ffi.NULL
        self._thread = thread = _Thread(ffi.NULL)

        def external(t: float, q: InC, qd: InC, p: InC, forces: InC) -> int:
            places = thread.places
            if places is None:
                return INTERRUPTED
            if q != places[0] or qd != places[1] or forces != places[2]:
                thread.places = places = q, qd, forces, self._array(q), self._array(qd), self._array(forces)
            places[5][:] = force(t, places[3].copy(), places[4].copy())  # copies: a callback may keep its arguments
            return 0

        self.function: InC = ffi.callback("ncgen_velocity_kernel *", external, error=INTERRUPTED, onerror=self._keep)

    def _keep(self, kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        self._thread.raised, self._thread.places = raised, None

    def _array(self, place: InC, count: int | None = None) -> np.ndarray:
        """The numbers (count,) in C's memory, or (n,)."""
        return np.frombuffer(self._ffi.buffer(place, 8 * (self._kernels.n if count is None else count)))

    def begin(self) -> None:
        """Forget what was raised on this thread."""
        self._thread.raised, self._thread.places = None, (self._nowhere,) * 6

    @property
    def raised(self) -> BaseException | None:
        """What a callback raised on this thread since `begin`, or None."""
        return self._thread.raised

    @cached_property
    def tangents(self) -> InC:
        """An ncgen_tangents with the model's stiffness and damping less the derivatives of the callbacks, both as full matrices."""
        ffi, kernels, n = self._ffi, self._kernels, self._kernels.n
        counts = n, n, n, kernels.m, len(kernels.p0)

        def stiffness(t: float, *places: InC) -> int:
            q, qd, qdd, lam, p = (self._array(each, count).copy() for each, count in zip(places, counts, strict=False))
            full = kernels.stiffness(q, qd, qdd, lam, t, p).toarray() - self._derivative(t, (q, qd), 0)
            self._array(places[-1], n * n)[:] = full.ravel()
            return 0

        def damping(t: float, *places: InC) -> int:
            q, qd, p = (self._array(each, count).copy() for each, count in zip(places, (n, n, len(kernels.p0)), strict=False))
            full = kernels.damping(q, qd, t, p).toarray() - self._derivative(t, (q, qd), 1)
            self._array(places[-1], n * n)[:] = full.ravel()
            return 0

        made = ffi.new("ncgen_tangents *", ffi.cast("ncgen_tangents *", kernels.tangents.descriptor)[0])
        starts, columns = ffi.new("int[]", [n * row for row in range(n + 1)]), ffi.new("int[]", [*range(n)] * n)
        made.stiffness_pattern = made.damping_pattern = {"rows": n, "columns": n, "indptr": starts, "indices": columns}
        by_q = ffi.callback("ncgen_balance_kernel *", stiffness, error=INTERRUPTED, onerror=self._keep)
        by_qd = ffi.callback("ncgen_velocity_kernel *", damping, error=INTERRUPTED, onerror=self._keep)
        made.stiffness, made.damping = by_q, by_qd
        self._alive = starts, columns, by_q, by_qd  # as long as `made` points to them
        return made

    def _derivative(self, t: float, state: tuple[np.ndarray, np.ndarray], part: int) -> np.ndarray:
        """∂force/∂q (part 0) or ∂force/∂q̇ (part 1), (n, n), by forward differences."""
        force, sizes = self._kernels.external_force, self._kernels.column_sizes
        at = force(t, *(x.copy() for x in state))
        full = np.empty((len(at), len(at)))
        for k, step in enumerate(ROUNDING * (sizes + np.abs(state[part]))):
            moved = [x.copy() for x in state]
            moved[part][k] += step
            full[:, k] = (force(t, *moved) - at) / step
        return full
