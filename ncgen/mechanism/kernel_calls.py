"""The kernels of a mechanism as functions of checked arguments, with the forces of Python functions that act on it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, TypeGuard, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ncgen.errors import DomainError, ModelError, NcgenError, shown
from ncgen.mechanism.arguments import numbers
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.mechanism.shared_docstrings import shares
from ncgen.model.forces import Callback
from ncgen.program.ir.blocks import Pattern

if TYPE_CHECKING:
    from scipy.sparse import csr_array

from ncgen.mechanism.kernel_data import KernelData

FLOAT = np.dtype(float)


ARGUMENTS = {
    "q": "array_like\nPosition, shape (n,), in m and rad.",
    "qd": "array_like\nVelocity, shape (n,).",
    "qdd": "array_like\nAcceleration, shape (n,).",
    "lam": "array_like\nLagrange multipliers, shape (m,).",
    "t": "array_like\nTime (s).",
    "p": "array_like\nParameters, shape (n_p,); None for the defaults.",
}
"""What the arguments of kernels are, of methods that do not say otherwise."""


@shares(**ARGUMENTS)
class KernelCalls(KernelData):
    """Φ, Φ_q, ν, γ, M, Q and energies of one mechanism."""

    def phi(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate the constraint equations Φ(q, t).

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("phi", t, q, None, p)

    def phi_q(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate the Jacobian Φ_q.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._sparse(self.phi_q_pattern, self.values("phi_q", t, q, None, p))

    def nu(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate ν = −Φ_t, so that Φ_q q̇ = ν.

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("nu", t, q, None, p)

    def gamma(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate γ, so that Φ_q q̈ = γ.

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("gamma", t, q, qd, p)

    def constraints(
        self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> tuple[np.ndarray, csr_array, np.ndarray]:
        """Evaluate Φ, Φ_q and γ in one call.

        This is faster than three calls, since they have much in common.

        Returns
        -------
        tuple
            Values Φ (m,), matrix Φ_q (m, n), sparse, and γ (m,).
        """
        if "constraints" not in self.programs.programs:  # no row has a coordinate in it, or they are long (MOST_FUSED)
            return self.phi(q, t, p), self.phi_q(q, t, p), self.gamma(q, qd, t, p)
        values = self.values("constraints", t, q, qd, p)
        phi_q = self._sparse(self.phi_q_pattern, values[self.m : len(values) - self.m])
        return values[: self.m], phi_q, values[len(values) - self.m :]

    def mass(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate the mass matrix M.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n), symmetric and positive semidefinite.
        """
        return self._sparse(self.mass_pattern, self.values("mass", t, q, None, p))

    def force(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate the generalised forces Q.

        Returns
        -------
        numpy.ndarray
            Applied forces and velocity-dependent inertia, shape (n,).
        """
        force = self.values("force", t, q, qd, p)
        return force + self._finite_external(t, q, qd, p) if self.model.callbacks else force

    def energy(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate energies and the power of forces without a potential.

        Returns
        -------
        numpy.ndarray
            Kinetic and potential energy (J) and power (W), shape (3,).
        """
        energy = self.values("energy", t, q, qd, p)
        if self.model.callbacks:
            energy[..., 2] += self._finite_external(t, q, qd, p) @ qd
        return energy

    def energies(self, q: np.ndarray, qd: np.ndarray, t: np.ndarray, p: np.ndarray, rows: list[int] | None = None) -> np.ndarray:
        """Evaluate `energy` at many times.

        Parameters
        ----------
        q : numpy.ndarray
            Positions, shape (K, n).
        qd : numpy.ndarray
            Velocities, shape (K, n).
        t : numpy.ndarray
            Times (s), shape (K,).
        p : numpy.ndarray
            Parameters, shape (n_p,), the same at all times.
        rows : list of int, optional
            Numbers of the K times that are meant. Default: all.

        Returns
        -------
        numpy.ndarray
            Energies, shape (K, 3).
        """
        program = self.programs.programs.get("energy")
        if self._drive is not None or self.model.callbacks or program is None or "qd" not in program.inputs:
            return np.array([self.energy(q[i], qd[i], t[i], p) for i in (range(len(t)) if rows is None else rows)])
        return self._called_at("energy", (t, q, qd), p, rows)

    def _called_at(
        self, kernel: str, instants: tuple[np.ndarray, np.ndarray, np.ndarray], p: np.ndarray, rows: list[int] | None
    ) -> np.ndarray:
        """A kernel of velocities at K rows of t, q and qd, or at all of them, shape (K, size)."""
        (t, q, qd), size = instants, self.programs.programs[kernel].size
        return np.array([self._call(kernel, t[i], q[i], qd[i], p, size) for i in (range(len(t)) if rows is None else rows)])

    def external_force(self, t: ArrayLike, q: ArrayLike, qd: ArrayLike, p: np.ndarray) -> np.ndarray:
        """Evaluate the forces of the model's Python functions.

        Parameters
        ----------
        p : numpy.ndarray
            Parameters with the inputs at t, shape (n_p,).

        Returns
        -------
        numpy.ndarray
            Generalised forces, shape (n,), finite or not.

        Raises
        ------
        ModelError
            If a function returns anything but forces; the message names it.
        """
        total, shape = None, (self.n,)
        for function in self.model.callbacks:
            is_compiled = isinstance(function, ReactiveForce)
            value = function.at(cast("float", t), np.asarray(q), np.asarray(qd), p) if is_compiled else function(t, q, qd, self)
            force = np.asarray(value, dtype=float)
            if force.shape != shape:
                raise ModelError(self._refused(function, t))
            total = force if total is None else total + force
        return np.zeros(shape) if total is None else total

    def _finite_external(self, t: ArrayLike, q: ArrayLike, qd: ArrayLike, p: ArrayLike | None) -> np.ndarray:
        """The same; DomainError naming a function that returns NaN or an infinite number."""
        total = self.external_force(t, q, qd, self.present(cast("float", t), self.p0 if p is None else np.asarray(p)))
        if not np.all(np.isfinite(total)):
            culprit = next((f for f in self.model.callbacks if not np.all(np.isfinite(f(t, q, qd, self)))), self.model.callbacks[0])
            raise DomainError(self._refused(culprit, t))
        return total

    def _refused(self, function: Callback, t: ArrayLike) -> str:
        name = getattr(function, "__name__", "callback")
        return f"callback {name}: it must return {self.n} finite numbers, one a free coordinate, at t = {t:g}"

    def jacobian(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate Φ_q as a dense array, for linear algebra on small mechanisms.

        Returns
        -------
        numpy.ndarray
            Matrix, shape (m, n).
        """
        return self.phi_q_pattern.dense(self.values("phi_q", t, q, None, p))

    def mass_matrix(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate M as a dense array.

        Returns
        -------
        numpy.ndarray
            Matrix, shape (n, n).
        """
        return self.mass_pattern.dense(self.values("mass", t, q, None, p))

    def values(self, kernel: str, t: ArrayLike, q: ArrayLike, qd: ArrayLike | None, p: ArrayLike | None) -> np.ndarray:
        """Evaluate a kernel without giving its output a shape.

        Parameters
        ----------
        kernel : str
            Name of the kernel, such as phi_q.

        Returns
        -------
        numpy.ndarray
            The output; of matrices their nonzeros.
        """
        program = self.programs.programs.get(kernel)
        n, reads_qd = len(self.coordinates), program is not None and "qd" in program.inputs
        if not is_plain(q, n):
            q = self._checked(q, n, kernel, "q", "free coordinates")
        if not is_plain(qd, n) and (reads_qd or qd is not None):
            qd = self._checked(qd, n, kernel, "qd", "free coordinates")
        if p is None:
            p = self.p0
        elif not is_plain(p, len(self.p0)):
            p = self._checked(p, len(self.p0), kernel, "p", "parameters")
        if not isinstance(t, float):
            t = self._instant(t, kernel)
        if program is None:
            size = {"force": self.n, "energy": 3, "mass": 0, "phi_q": 0}.get(kernel, self.m)
            return np.zeros((*q.shape[:-1], size))
        qd = qd if reads_qd else None
        if self._drive is not None:
            p = self._drive(t, p)
        return self._call(kernel, t, q, qd, p, program.size)

    @abstractmethod
    def _call(self, kernel: str, t: ArrayLike, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, size: int) -> np.ndarray:
        """The output of a kernel, `size` numbers a state, for arguments that were looked at."""

    def _checked(self, array: ArrayLike | None, size: int, kernel: str, name: str, noun: str) -> np.ndarray:
        array = numbers(array, f"{self.name}.{kernel}: {name}", complex_too=self.batches)
        if not self.batches and array.ndim > 1 and array.shape[-1] == size:
            raise NcgenError(
                f"{self.name}.{kernel}: {name} is a batch; compiled kernels take one state, kernels.batch takes many, and so does "
                "backend='numpy'"
            )
        if array.shape[-1:] != (size,):
            raise NcgenError(f"{self.name}.{kernel}: {name} has shape {array.shape}; the model has {size} {noun}")
        return array

    def _instant(self, t: ArrayLike, kernel: str) -> float | complex | np.ndarray:
        """A time, or many for kernels that take batches. Raises NcgenError for others."""
        try:
            value = numbers(t, f"{self.name}.{kernel}: t", complex_too=self.batches)
        except NcgenError:
            value = None
        if value is None or (value.ndim and not self.batches):
            wanted = "numbers are needed" if self.batches else "compiled kernels take one real number"
            raise NcgenError(f"{self.name}.{kernel}: t is {shown(t)}; {wanted}")
        return value if value.ndim else value.item()

    @staticmethod
    def _sparse(pattern: Pattern, values: np.ndarray) -> csr_array:
        """Raises NcgenError for many states, which have no sparse matrix in common."""
        if values.ndim != 1:
            raise NcgenError("a batch has no sparse matrix; take kernels.batch for nonzeros, kernels.jacobian or kernels.mass_matrix")
        return scipy.sparse.csr_array((values, pattern.indices, pattern.indptr), shape=pattern.shape)


def is_plain(array: object, size: int) -> TypeGuard[np.ndarray]:
    """True for what needs no look: a real vector of the right length. Most calls are of this kind, and looking costs time."""
    return type(array) is np.ndarray and array.dtype is FLOAT and array.shape == (size,)
