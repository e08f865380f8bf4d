"""The routines of LAPACK that the solver calls, for doubles, with types: SciPy's module of them tells their names at run time only."""

from __future__ import annotations

import sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from typing import Any, TypeAlias

import numpy as np
import scipy

from ncgen.toolchain.once import once

Found: TypeAlias = tuple[np.ndarray, int]
"""What a routine computes, and where it failed, 0 for nowhere."""


@once
def _routines() -> Any:
    """Return SciPy's module of the routines without `scipy.linalg` around it, whose import takes longer than most runs."""
    folders = [f"{folder}/linalg" for folder in scipy.__path__]
    spec = None if "scipy.linalg" in sys.modules else PathFinder.find_spec("scipy.linalg._flapack", folders)
    if spec is None or spec.loader is None:
        return scipy.linalg.lapack
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def dgetrf(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """(LU, exchanges, failed) of a matrix."""
    return _routines().dgetrf(matrix)


def dgetrs(lu: np.ndarray, exchanges: np.ndarray, right: np.ndarray, trans: int = 0) -> Found:
    """(x, failed) of A x = right from LU, exchanges and right; trans=1: of Aᵀ x = right."""
    return _routines().dgetrs(lu, exchanges, right, trans=trans)


def dposv(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """(factor, x, failed) of A x = right for a positive definite A."""
    return _routines().dposv(matrix, right)


def dpotrf(matrix: np.ndarray) -> Found:
    """(factor, failed) of a positive definite matrix."""
    return _routines().dpotrf(matrix)


def dpotrs(factor: np.ndarray, right: np.ndarray) -> Found:
    """(x, failed) of A x = right from that factor and right."""
    return _routines().dpotrs(factor, right)
