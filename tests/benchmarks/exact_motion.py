"""Accelerations with 50 digits.

Any: a number of mpmath, whose module makes its types at run time.
"""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

from ncgen.comparisons.rivals.exact import DIGITS, MPMATH
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions.dynamics import DynamicsPrograms


def exact_motion(programs: DynamicsPrograms, q: list[Any], zd: list[Any], p: np.ndarray) -> list[Any]:
    """What the program of accelerations gives at t = 0, after q, numbers of mpmath, has closed in its place."""
    given: dict[str, Any] = {"t": mpmath.mpf(0), "q": q, "p": [mpmath.mpf(float(x)) for x in p]}
    for _ in range(100):
        steps = programs.close(q, evaluate(programs.newton, given, MPMATH, mpmath.mpf))
        if max(map(abs, steps), default=0) < mpmath.mpf(10) ** (5 - DIGITS):
            break
    return evaluate(programs.acceleration, given | {"zd": zd}, MPMATH, mpmath.mpf)
