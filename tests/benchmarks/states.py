"""Two states that a run could integrate: positions and velocities of all coordinates, as runs do, or positions and joint velocities.

python tests/benchmarks/states.py [JOINTS:SEED ...]

Random arms fall for 1 s by RK4 with steps of 4 ms; errors of the joint angles against a run with a tolerance of 1e-12 (rad). In both
positions are closed at the end of every step, in the second one with the joint angles as they are. Velocities of all coordinates are
brought onto the constraints there, too, by the smallest change in the sense of kinetic energy; joint velocities satisfy them anyway.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

import ncgen
from benchmarks.arms import arm
from ncgen.mechanism.kernels import Kernels

DURATION, STEP = 1.0, 4e-3
"""Of the falls, and of their steps (s)."""

ARMS = "7:0", "7:1", "7:2", "20:0", "20:1"


def angles(kernels: Kernels) -> list[int]:
    """Positions of the joint angles among the coordinates."""
    return [kernels.index[name] for name in kernels.coordinates if name.startswith("psi")]


def by_joint_velocities(kernels: Kernels, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """The joint angles at the end, positions and joint velocities being integrated."""
    joints = angles(kernels)
    others = [c for c in range(kernels.n) if c not in joints]

    def derivative(q: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        jacobian, qd = kernels.jacobian(q), np.zeros(kernels.n)
        qd[joints] = x
        qd[others] = np.linalg.lstsq(jacobian[:, others], -jacobian[:, joints] @ x, rcond=None)[0]
        matrix = np.block([[kernels.mass_matrix(q), jacobian.T], [jacobian, -1e-12 * np.eye(len(jacobian))]])
        found = np.linalg.solve(matrix, np.concatenate([kernels.force(q, qd), kernels.gamma(q, qd)]))
        return qd, found[joints]

    x, h = qd[joints], STEP
    for _ in range(round(DURATION / h)):
        a, b, q0, x0 = *derivative(q, x), q, x
        sums, rates = a.copy(), b.copy()
        for share, weight in ((h / 2, 2), (h / 2, 2), (h, 1)):
            a, b = derivative(q0 + share * a, x0 + share * b)
            sums, rates = sums + weight * a, rates + weight * b
        q, x = q0 + h / 6 * sums, x0 + h / 6 * rates
        for _ in range(3):
            q[others] += np.linalg.lstsq(kernels.jacobian(q)[:, others], -kernels.phi(q), rcond=None)[0]
    return q[joints]


def main(arms: list[str]) -> None:
    warnings.simplefilter("ignore")
    for name in arms or ARMS:
        count, seed = map(int, name.split(":"))
        kernels = ncgen.compile(arm(count, seed), backend="c")
        joints = angles(kernels)
        exact = ncgen.simulate(kernels, DURATION, rtol=1e-12, atol=1e-12, points=2)
        own = ncgen.simulate(kernels, DURATION, formalism="lagrange", integrator="rk4", max_step=STEP, points=2)
        other = by_joint_velocities(kernels, exact.q[0].copy(), exact.qd[0])
        errors = [np.max(np.abs(found - exact.q[-1][joints])) for found in (own.q[-1][joints], other)]
        print(f"{count:3d} joints, seed {seed}: velocities of all coordinates {errors[0]:.1e}, of the joints {errors[1]:.1e}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
