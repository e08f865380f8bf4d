"""The routines of LAPACK that the solver calls, for doubles: SciPy's module of them tells their names at run time only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import get_lapack_funcs

Found = tuple[np.ndarray, int]
"""What a routine computes, and where it failed, 0 for nowhere."""

_found = get_lapack_funcs(("getrf", "getrs", "posv", "potrf", "potrs"), dtype=np.float64)

dgetrf: Callable[..., tuple[np.ndarray, np.ndarray, int]] = _found[0]
"""(LU, exchanges, failed) of a matrix."""

dgetrs: Callable[..., Found] = _found[1]
"""(x, failed) of A x = right from LU, exchanges and right; trans=1: of Aᵀ x = right."""

dposv: Callable[..., tuple[np.ndarray, np.ndarray, int]] = _found[2]
"""(factor, x, failed) of A x = right for a positive definite A."""

dpotrf: Callable[..., Found] = _found[3]
"""(factor, failed) of a positive definite matrix."""

dpotrs: Callable[..., Found] = _found[4]
"""(x, failed) of A x = right from that factor and right."""
