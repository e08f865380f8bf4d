"""What a mechanism's programs and masses are like, as far as integrators in C must know."""

from __future__ import annotations

import numpy as np
import scipy

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import INTEGRATORS
from ncgen.program.ir.cost import cost

SINGULAR = 1e-9
"""A mass matrix is taken as singular where elimination leaves less than this of an entry of its diagonal."""

MOST_DENSE = 400
"""Coordinates up to which the whole mass matrix is factored, in 3 ms: importing SciPy's sparse matrices would take 0.1 s."""


def is_definite(kernels: Kernels) -> bool:
    """True if every motion of the coordinates has inertia, constraints apart, at the initial position."""
    pattern, values, sizes = kernels.mass_pattern, kernels.values("mass", 0.0, kernels.q0, None, None), kernels.column_sizes
    rows, columns = np.repeat(np.arange(kernels.n), np.diff(pattern.indptr)), np.array(pattern.indices, np.intp)
    values = values * (sizes[rows] * sizes[columns])
    diagonal = np.bincount(rows, values * (rows == columns), kernels.n)
    if not np.all(diagonal > 0):
        return False
    if kernels.n <= MOST_DENSE:
        mass = np.zeros(pattern.shape)
        mass[rows, columns] = values
        try:
            return bool(np.all(np.linalg.cholesky(mass).diagonal() ** 2 > SINGULAR * diagonal))
        except np.linalg.LinAlgError:
            return False
    return _is_definite_sparse(scipy.sparse.csc_array((values, columns, pattern.indptr), pattern.shape))  # it is symmetric


def _is_definite_sparse(mass: scipy.sparse.csc_array) -> bool:
    try:
        factors = scipy.sparse.linalg.splu(mass, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # SuperLU's word for an exactly singular matrix
        return False
    return bool(np.all(factors.U.diagonal() > SINGULAR * mass.diagonal()[np.argsort(factors.perm_c)]))


def is_conservative(kernels: Kernels) -> bool:
    """True if nothing does work but forces with a potential: no drivers, no functions of Python, and a power that is zero by structure."""
    programs = kernels.programs.programs
    return not ("nu" in programs or "power" in programs or kernels.model.callbacks)


def uses_tangents(kernels: Kernels, method: str) -> bool:
    """True if an integrator takes stiffness and damping: rattle where masses are not constant or forces have no potential,
    energy-momentum unless constraints are quadratic, masses and forces constant as well; both with rolling conditions."""
    if INTEGRATORS[method].tangents != "sometimes":
        return INTEGRATORS[method].tangents != "never"
    if len(kernels.holonomic) < kernels.m:
        return True
    programs = kernels.programs.programs
    constant = all(programs[k].is_constant for k in ("mass", "force") if k in programs and (k, method) != ("force", "rattle"))
    phi = programs.get("phi")
    quadratic = phi is None or (all(row.type is not None for row in kernels.rows) and not cost(phi).calls and not phi.angles)
    return not (is_conservative(kernels) and constant and (quadratic or method == "rattle"))
