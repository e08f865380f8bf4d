"""What the solver asks of kernels: any object with these members will do.

The compiled library and the generated NumPy module (ncgen.build.kernels) both have them.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ncgen.model import Model


class Kernels(Protocol):
    model: Model
    name: str
    n: int
    m: int
    coordinates: tuple[str, ...]
    parameters: tuple[str, ...]
    rows: tuple
    index: dict[str, int]
    q0: np.ndarray
    p0: np.ndarray
    row_sizes: np.ndarray
    column_sizes: np.ndarray
    length: float
    holonomic: np.ndarray

    def start(self, p=None) -> np.ndarray: ...
    def phi(self, q, t=0.0, p=None) -> np.ndarray: ...
    def jacobian(self, q, t=0.0, p=None) -> np.ndarray: ...
    def phi_q(self, q, t=0.0, p=None): ...
    def nu(self, q, t=0.0, p=None) -> np.ndarray: ...
    def gamma(self, q, qd, t=0.0, p=None) -> np.ndarray: ...
    def mass_matrix(self, q, t=0.0, p=None) -> np.ndarray: ...
    def force(self, q, qd, t=0.0, p=None) -> np.ndarray: ...
    def energy(self, q, qd, t=0.0, p=None) -> np.ndarray: ...
