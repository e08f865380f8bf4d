"""An instant of a run with events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class State:
    """t (s), q and qd (n,) in m, rad and per second, p (n_p,) without what drives inputs, and names of the locks that are closed."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    locked: tuple[str, ...] = ()
