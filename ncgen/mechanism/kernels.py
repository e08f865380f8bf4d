"""Kernels ready to be called: what the solver and the user hold in their hands.

`KernelData` has the names and sizes of a mechanism, `KernelCalls` its kernels, `Kernels` their derivatives and those of many states.
Its two children evaluate the same programs through a compiled library or through NumPy.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ncgen.mechanism.kernel_batch import Batch
from ncgen.mechanism.kernel_calls import ARGUMENTS, KernelCalls, is_plain
from ncgen.mechanism.shared_docstrings import shares
from ncgen.mechanism.tangents import Tangents
from ncgen.program.ir.blocks import Pattern

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@shares(**ARGUMENTS)
class Kernels(KernelCalls):
    """The kernels of one mechanism.

    q, qd: free coordinates (m, rad) and velocities, shape (n,), in the order of `coordinates`; t: time (s)
    p: parameters (n_p,) in the order of `parameters`, of which the last ones are the `inputs`; None means their defaults
    Kernels that the mechanism does not need return zeros.
    q0, p0, row_sizes, column_sizes and holonomic are the mechanism's own; copy them to change them.
    """

    _batch: type[Batch]
    _tangents: type[Tangents]

    # -- many states ---------------------------------------------------------------------------

    @cached_property
    def batch(self) -> Batch:
        """The kernels of many states in one call; compiled when first asked for (ncgen.mechanism.kernel_batch)."""
        return self._batch(self)

    # -- tangents ------------------------------------------------------------------------------

    @cached_property
    def tangents(self) -> Tangents:
        """The tangent kernels, generated and compiled when first asked for (ncgen.program.differentiation.tangent_programs)."""
        return self._tangents.by_state(self.programs)

    @cached_property
    def parameter_tangents(self) -> Tangents:
        """Derivatives by the parameters, generated and compiled when first asked for."""
        return self._tangents.by_parameters(self.programs)

    def stiffness(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, lam: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> csr_array:
        """Evaluate ∂(M q̈ + Φ_qᵀ λ − Q)/∂q.

        Forces of Python functions are not included.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n).
        """
        return self._tangent("stiffness", t=t, q=q, qd=qd, qdd=qdd, lam=lam, p=p)

    def damping(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate −∂Q/∂q̇.

        Forces of Python functions are not included.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n).
        """
        return self._tangent("damping", t=t, q=q, qd=qd, p=p)

    def phidd_q(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̈ − γ)/∂q.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._tangent("phidd_q", t=t, q=q, qd=qd, qdd=qdd, p=p)

    def phidd_qd(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate −∂γ/∂q̇.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._tangent("phidd_qd", t=t, q=q, qd=qd, p=p)

    def phi_p(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂Φ/∂p.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phi_p", t=t, q=q, p=p)

    def phid_p(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̇ − ν)/∂p.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phid_p", t=t, q=q, qd=qd, p=p)

    def phidd_p(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̈ − γ)/∂p.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phidd_p", t=t, q=q, qd=qd, qdd=qdd, p=p)

    def balance_p(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, lam: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> csr_array:
        """Evaluate ∂(M q̈ + Φ_qᵀ λ − Q)/∂p.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n_p).
        """
        return self._tangent("balance_p", t=t, q=q, qd=qd, qdd=qdd, lam=lam, p=p)

    def dense_tangent(self, name: str, **arguments: ArrayLike | None) -> np.ndarray:
        """Evaluate a tangent kernel as a dense array.

        For small mechanisms this is faster than the sparse matrix.

        Parameters
        ----------
        name : str
            One of stiffness, damping, phidd_q, phidd_qd, phi_p, phid_p, phidd_p and balance_p.
        **arguments : array_like
            Arguments of that kernel by name: t, q, qd, qdd, lam, p.

        Returns
        -------
        numpy.ndarray
            The matrix.
        """
        pattern, values = self._tangent_values(name, arguments)
        return pattern.dense(values)

    def _tangent(self, name: str, **arguments: ArrayLike | None) -> csr_array:
        return self._sparse(*self._tangent_values(name, arguments))

    def _tangent_values(self, name: str, arguments: dict[str, Any]) -> tuple[Pattern, np.ndarray]:
        sizes = {"q": self.n, "qd": self.n, "qdd": self.n, "lam": self.m, "p": len(self.p0)}
        arguments["p"] = self.p0 if arguments["p"] is None else arguments["p"]
        if not isinstance(arguments.get("t", 0.0), float):
            arguments["t"] = self._instant(arguments["t"], name)
        for array, size in sizes.items():
            if array in arguments and not is_plain(arguments[array], size):
                arguments[array] = self._checked(arguments[array], size, name, array, "of them")
        if self._drive is not None:
            arguments["p"] = self._drive(arguments["t"], arguments["p"])
        tangents = self.parameter_tangents if name.endswith("_p") else self.tangents
        return tangents.programs.patterns[name], tangents.values(name, arguments)
