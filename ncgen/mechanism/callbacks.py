"""Forces of a model's own Python functions, and their derivatives by differences, and parameters that Python chooses anew at every step,
as the C runtime calls them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ncgen.mechanism.in_python import INTERRUPTED, InPython, tangents_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.program.ir.blocks import Pattern
from ncgen.toolchain.abi import InC

ROUNDING = float(np.sqrt(np.finfo(float).eps))
"""Length of a difference over the size of what changes: where truncation and rounding are about the same."""


class ExternalForces(InPython):
    """`ncgen_dynamics.external` for the callbacks of a model.

    function: for C; what differs from other kernels is that its arrays are not made anew at every call, which takes as long as a callback
    """

    def __init__(self, kernels: Kernels) -> None:
        super().__init__(kernels)
        self._kernels, thread, array, n, force = kernels, self.thread, self.array, kernels.n, kernels.external_force
        nowhere, n_p = (self.ffi.NULL,) * 6, len(kernels.p0)

        def external(t: float, q: InC, qd: InC, p: InC, forces: InC) -> int:
            if thread.raised is not None:
                return INTERRUPTED
            buffers = thread.buffers or nowhere
            if q != buffers[0] or qd != buffers[1] or forces != buffers[2]:
                thread.buffers = buffers = q, qd, forces, array(q, n), array(qd, n), array(forces, n)
            numbers = array(p, n_p) if n_p else kernels.p0
            buffers[5][:] = force(t, buffers[3].copy(), buffers[4].copy(), numbers)  # copies: a callback may keep its arguments
            return 0

        self.function: InC = self._own_function(kernels) or self.put(external, "ncgen_velocity_kernel *")

    def _own_function(self, kernels: Kernels) -> InC | None:
        """The address of the only callback, where it is compiled."""
        first, *others = kernels.model.callbacks
        if others or not isinstance(first, ReactiveForce):
            return None
        return self.ffi.cast("ncgen_velocity_kernel *", first.address)

    @cached_property
    def tangents(self) -> InC:
        """An ncgen_tangents with the model's stiffness and damping less the derivatives of the callbacks, both as full matrices."""
        kernels, n = self._kernels, self._kernels.n

        def stiffness(t: float, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, lam: np.ndarray, p: np.ndarray) -> np.ndarray:
            return (kernels.stiffness(q, qd, qdd, lam, t, p).toarray() - self._derivative(t, (q, qd), p, 0)).ravel()

        def damping(t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
            return (kernels.damping(q, qd, t, p).toarray() - self._derivative(t, (q, qd), p, 1)).ravel()

        made = self.ffi.new("ncgen_tangents *", self.ffi.cast("ncgen_tangents *", tangents_of(kernels))[0])
        full = Pattern((n, n), tuple(range(0, n * n + 1, n)), tuple(range(n)) * n)
        made.stiffness_pattern = made.damping_pattern = self.pattern(full)
        made.stiffness = self.kernel(("t", "q", "qd", "qdd", "lam", "p"), n * n, stiffness)
        made.damping = self.kernel(("t", "q", "qd", "p"), n * n, damping)
        return made

    def _derivative(self, t: float, state: tuple[np.ndarray, np.ndarray], p: np.ndarray, index: int) -> np.ndarray:
        """∂force/∂q (index 0) or ∂force/∂q̇ (index 1), (n, n), by forward differences."""
        force, sizes = self._kernels.external_force, self._kernels.column_sizes
        at = force(t, state[0].copy(), state[1].copy(), p)
        full = np.empty((len(at), len(at)))
        for k, step in enumerate(ROUNDING * (sizes + np.abs(state[index]))):
            moved = [x.copy() for x in state]
            moved[index][k] += step
            full[:, k] = (force(t, moved[0], moved[1], p) - at) / step
        return full


class Choices(InPython):
    """`ncgen_options.parameter_rule`: the parameters (n_p,) that follow from a position q (n,) and those there are.

    function: for C
    """

    def __init__(self, kernels: Kernels, chosen: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
        super().__init__(kernels)
        array, counts = self.array, self.counts

        def choose(q: InC, p: InC) -> int:
            values = array(p, counts["p"])
            values[:] = chosen(array(q, counts["q"]), values)
            return 0

        self.function: InC = self.put(choose, "ncgen_parameter_rule *")
