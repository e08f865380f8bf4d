"""Whether the emitted motion of a mechanism, which was generated for other numbers, is right for those that it has now.

What vanishes in a mechanism with loops is seen in sample positions, and may be a coincidence of numbers, as in a parallelogram. So before a
motion with other numbers is used, it closes positions and gives accelerations near the first one, and both are compared with the kernels
of Φ, M and Q, in which nothing was left out.
"""

from __future__ import annotations

import numpy as np

from ncgen.emit.number_table import FilledSources
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.kernels import Kernels
from ncgen.toolchain.abi import InC, Interface

AGREEMENT = 1e-11
"""By which results may differ, over the sums of sizes of what they are differences of."""

POSITIONS = 3
"""Positions in which the motion is compared."""

DISPLACEMENT = 0.1
"""How far coordinates move from one of these positions to the next at most, in natural sizes."""

MAX_STEPS = 20
"""Newton steps after which a position counts as not closed."""


def serves(kernels: Kernels, source: FilledSources, ffi: Interface, motion: InC) -> bool:
    """True of a motion that was generated for the numbers of the kernels, or agrees with them."""
    return source.is_own or _Check(kernels, ffi, motion).agrees()


class _Check:
    """The emitted motion as functions of arrays."""

    def __init__(self, kernels: Kernels, ffi: Interface, motion: InC) -> None:
        self.kernels, self._ffi, self._motion = kernels, ffi, motion
        self._random = np.random.default_rng(1)

    def agrees(self) -> bool:
        """Whether it closes positions and gives accelerations as the kernels say in some positions."""
        with np.errstate(all="ignore"):  # what is no number does not agree
            q = self._closed(self.kernels.q0)
            for _ in range(POSITIONS):
                q = None if q is None else self._closed(self._displaced(q))
                if q is None or not self._accelerates(q):
                    return False
        return True

    def _displaced(self, q: np.ndarray) -> np.ndarray:
        """A position nearby, not closed."""
        sizes = self.kernels.column_sizes
        qd = self._velocities(q) - self._velocities(q)
        largest = np.max(np.abs(qd) / sizes, initial=0.0)
        return q + (DISPLACEMENT / largest if largest > 0 else 0.0) * qd

    def _closed(self, q: np.ndarray) -> np.ndarray | None:
        """The position after Newton steps, None where they do not close it."""
        n, m = self.kernels.n, self.kernels.m
        for _ in range(MAX_STEPS):
            q = q + self._called("closing", n + m, q)[:n]
            if np.all(np.abs(self.kernels.phi(q)) <= AGREEMENT * self.kernels.row_sizes):
                return q
        return None

    def _accelerates(self, q: np.ndarray) -> bool:
        """Whether velocities satisfy Φ_q q̇ = ν, accelerations Φ_q q̈ = γ, and M q̈ − Q does no work on what constraints allow."""
        kernels, n = self.kernels, self.kernels.n
        jacobian, mass = kernels.jacobian(q), kernels.mass_matrix(q)
        v, others = self._velocities(q), [self._velocities(q) for _ in range(2)]
        qdd = self._called("derivative", 2 * n + 2, q, v)[:n]
        force, allowed = kernels.force(q, v), others[0] - others[1]
        sizes = np.abs(mass) @ self._usual(qdd) + np.abs(force)
        works = np.abs(allowed @ (mass @ qdd - force)) <= AGREEMENT * (self._usual(allowed) @ sizes)
        return bool(works) and self._solves(jacobian, v, kernels.nu(q)) and self._solves(jacobian, qdd, kernels.gamma(q, v))

    def _solves(self, jacobian: np.ndarray, x: np.ndarray, right: np.ndarray) -> bool:
        """Whether Φ_q x = b but for rounding."""
        return bool(np.all(np.abs(jacobian @ x - right) <= AGREEMENT * (np.abs(jacobian) @ self._usual(x) + np.abs(right))))

    def _usual(self, x: np.ndarray) -> np.ndarray:
        """Sizes of velocities or accelerations: the largest, in natural sizes."""
        sizes = self.kernels.column_sizes
        return sizes * np.max(np.abs(x) / sizes, initial=0.0)

    def _velocities(self, q: np.ndarray) -> np.ndarray:
        """Velocities that constraints allow."""
        n = self.kernels.n
        qd = self._random.standard_normal(n) * self.kernels.column_sizes
        return self._called("velocities", 2 * n + 2, q, qd)[n : 2 * n]

    def _called(self, name: str, size: int, *arrays: np.ndarray) -> np.ndarray:
        """The output of a function of the motion at the time 0."""
        out, n = np.empty(size), self.kernels.n
        is_forced = name == "derivative" and not self._motion.derivative
        forces = (np.zeros(n),) if is_forced else ()
        arguments = (*arrays, *forces, self.kernels.p0, out)
        function = self._motion.forced if is_forced else getattr(self._motion, name)
        function(0.0, *(pointer(self._ffi, np.ascontiguousarray(a)) for a in arguments))
        return out
