"""Functions that a library of another language calls back: what they raise is kept until the library has returned."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


class Caught:
    """Keeps the first exception of what is called through it. Exceptions must not pass through C or Fortran, which would go on calling.

    What raised gives nan, so that the library's step fails; what follows from that says less and is forgotten.
    """

    def __init__(self) -> None:
        self._problem: Exception | None = None

    def call(self, function: Callable[[float, np.ndarray], np.ndarray], t: float, y: np.ndarray) -> np.ndarray | float:
        try:
            return function(t, y.copy())
        except Exception as problem:
            self._problem = self._problem or problem
            return np.nan

    def tell(self) -> None:
        """Raise what was kept, once."""
        problem, self._problem = self._problem, None
        if problem is not None:
            raise problem
