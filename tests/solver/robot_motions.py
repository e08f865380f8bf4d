"""Numbers that several tests of the robot's motion share: tolerances, initial rates, and motors."""

from __future__ import annotations

import numpy as np
from robot_tree import ANGLES

TIGHT = {"rtol": 1e-10, "atol": 1e-12}

SPATIAL = dict(zip(ANGLES, (1.0, -0.5, 0.8, 1.8, -1.0, 2.0)))
"""Initial rates (rad/s) of all six angles: nothing of the motion is planar."""

MOTORS = {
    "psi1": lambda t, psi, rate, sin: 60.0 * sin(5.0 * t),
    "psi2": lambda t, psi, rate, sin: -800.0 + 200.0 * psi,
    "psi3": lambda t, psi, rate, sin: 500.0 * sin(3.0 * t) - 20.0 * rate,
    "psi4": lambda t, psi, rate, sin: 10.0 - 5.0 * rate,
    "psi5": lambda t, psi, rate, sin: -60.0 * sin(psi),
    "psi6": lambda t, psi, rate, sin: 0.2 * sin(10.0 * t) + 0.1,
}
"""Motor torques (N m) on the robot's angles, of time, angle and rate; `sin` is NumPy's or sympy's."""


def six_angles(run):
    """(t, ψ, ψ̇, ψ̈) at every instant of a run of the robot, in the order ψ1 … ψ6."""
    where = [run.coordinates.index(name) for name in ANGLES]
    return list(zip(run.t, run.q[:, where], run.qd[:, where], run.qdd[:, where], strict=True))


def torques_along(run):
    """What the motors exert at every instant of a run, shape (K, 6)."""
    laws = list(MOTORS.values())
    return np.array([[law(t, psi[i], rate[i], np.sin) for i, law in enumerate(laws)] for t, psi, rate, _ in six_angles(run)])
