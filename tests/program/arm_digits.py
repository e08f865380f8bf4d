"""Where an arm's digits go: `python tests/program/arm_digits.py [JOINTS ...]`.

Errors of the joints' accelerations in a random posture, relative to the largest, against 50 digits at the position that closes to as many:
of the rounded position alone, in exact arithmetic; of the factored matrix in doubles; of the recursion that is written out, in doubles.
"""

from __future__ import annotations

import sys

import mpmath
import numpy as np
from benchmarks.arms import Posture, own, posture

from ncgen.comparisons.rivals import relative_error
from ncgen.comparisons.rivals.exact import DIGITS, MPMATH
from ncgen.program.ir.evaluate import evaluate
from ncgen.solver.formalisms import accelerations_by


def errors(place: Posture) -> tuple[float, float, float]:
    kernels, n = place.kernels, place.kernels.n
    given = {"t": [0.0], "p": kernels.p0, "q": place.q, "zd": place.rates}
    with mpmath.workdps(DIGITS):
        exact = {name: [mpmath.mpf(float(x)) for x in values] for name, values in given.items()}
        program = place.emitted.written.programs.acceleration
        found = evaluate(program, {**exact, "t": exact["t"][0]}, MPMATH, mpmath.mpf)
        values = np.array([float(x) for x in found])
    matrix = accelerations_by("lagrange").motion(kernels, place.q, values[:n], 0.0, kernels.p0, {}).qdd[list(place.split.independent)]
    written = next(own(place))
    written.run(1)
    return tuple(relative_error(x, place.expected) for x in (values[n:-2], matrix, written.values()))  # type: ignore[return-value]


if __name__ == "__main__":
    print("joints   rounded position    matrix    recursion")
    for count in map(int, sys.argv[1:] or ("7", "20", "50")):
        print(f"{count:6d}", *(f"{error:14.1e}" for error in errors(posture(count))))
