"""MuJoCo (https://mujoco.org): soft constraints, hardened as far as the step allows, RK4."""

from __future__ import annotations

import time
from importlib import import_module

import numpy as np

mujoco = import_module("mujoco")

NAME = "MuJoCo, RK4, hardened constraints"


def _rods(number: int, count: int) -> str:
    """A standing rod, and the lying one on its top that closes on the top of the next."""
    inertial = '<inertial pos="{}" mass="1" diaginertia="{}"/>'
    rod = inertial.format("0.5 0 0", f"1e-6 {1 / 12} {1 / 12}")
    lying = f'<body name="l{number}" pos="0 0 1"><joint type="hinge" axis="0 -1 0"/>{rod}</body>'
    standing = inertial.format("0 0 0.5", f"{1 / 12} {1 / 12} 1e-6")
    return (
        f'<body name="s{number}" pos="{number} 0 0"><joint type="hinge" axis="0 -1 0"/>{standing}{lying if number < count else ""}</body>'
    )


def _xml(count: int, step: float) -> str:
    rods = "".join(_rods(i, count) for i in range(count + 1))
    hard = f'solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"'
    loops = "".join(f'<connect body1="l{i}" body2="s{i + 1}" anchor="1 0 0" {hard}/>' for i in range(count))
    options = f'<option gravity="0 0 -9.81" integrator="RK4" timestep="{step!r}" tolerance="1e-12" iterations="100"/>'
    return f"<mujoco>{options}<worldbody>{rods}</worldbody><equality>{loops}</equality></mujoco>"


def run(count: int, duration: float, intervals: int, steps: int) -> tuple[float, np.ndarray]:
    """(seconds, B0 (intervals + 1, 2)) of a run with `steps` steps in each of the intervals."""
    model = mujoco.MjModel.from_xml_string(_xml(count, duration / (intervals * steps)))
    data = mujoco.MjData(model)
    data.qvel[:] = [-1.0 if joint % 2 == 0 or joint == 2 * count else 1.0 for joint in range(model.nv)]  # about -y: turning towards +x
    angles = [data.qpos[0]]
    start = time.perf_counter()
    for _ in range(intervals):
        mujoco.mj_step(model, data, steps)
        angles.append(data.qpos[0])
    seconds = time.perf_counter() - start
    angles = -np.array(angles)
    return seconds, np.column_stack([np.sin(angles), np.cos(angles)])
