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

PARTS = 10
"""Newton's method comes to a posture in so many parts: from the start of an arm of 50 joints to one in which all are turned it diverges."""


def moved(programs: DynamicsPrograms, q: list[Any], chosen: list[int], moves: list[Any], p: np.ndarray) -> list[Any]:
    """A closed position, numbers of mpmath, whose chosen coordinates have moved."""
    q = list(q)
    for _ in range(PARTS):
        for i, move in zip(chosen, moves, strict=True):
            q[i] += move / PARTS
        close(programs, q, _given(q, p))
    return q


def exact_motion(programs: DynamicsPrograms, q: list[Any], zd: list[Any], p: np.ndarray) -> list[Any]:
    """What the program of accelerations gives at t = 0, after q, numbers of mpmath, has closed in its place."""
    given = _given(q, p)
    close(programs, q, given)
    return evaluate(programs.acceleration, given | {"zd": zd}, MPMATH, mpmath.mpf)


def close(programs: DynamicsPrograms, q: list[Any], given: dict[str, Any]) -> None:
    """Newton's steps of q, in its place. Raises ArithmeticError where they do not converge."""
    for _ in range(100):
        steps = programs.close(q, evaluate(programs.newton, given, MPMATH, mpmath.mpf))
        if max(map(abs, steps), default=0) < mpmath.mpf(10) ** (5 - DIGITS):
            return
    raise ArithmeticError("Newton's method does not come to a closed position")


def _given(q: list[Any], p: np.ndarray) -> dict[str, Any]:
    return {"t": mpmath.mpf(0), "q": q, "p": [mpmath.mpf(float(x)) for x in p]}
