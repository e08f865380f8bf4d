"""Keyframes of MJCF as named starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ncgen.exchange.robots.mjcf_actuators import controls
from ncgen.exchange.robots.mjcf_compiled import Compiled
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import RobotState

FREE, BALL = 0, 1
"""MuJoCo's numbers of joints with several degrees of freedom."""


def keyframes(model: Compiled, joints: Sequence[str]) -> dict[str, RobotState]:
    """{name: start} of all keyframes; joints: names by MuJoCo's numbers."""
    starts = {}
    for k in range(model.nkey):
        start = start_of(model, np.array(model.key_qpos[k]), np.array(model.key_qvel[k]), joints)
        starts[model.key(k).name or f"key{k}"] = replace(start, inputs=controls(model, k), time=float(model.key_time[k]))
    return starts


def start_of(m: Compiled, qpos: np.ndarray, qvel: np.ndarray, joints: Sequence[str]) -> RobotState:
    """A state of MuJoCo's, qpos (nq,) and qvel (nv,)."""
    values, rates = dict[str, float](), dict[str, float]()
    turned = dict[str, tuple[np.ndarray, np.ndarray]]()
    free = dict[str, tuple[Placement, np.ndarray, np.ndarray]]()
    for j, name in enumerate(joints):
        at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
        if m.jnt_type[j] == FREE:
            free[name] = Placement.of_quaternion(qpos[at : at + 3], qpos[at + 3 : at + 7]), qvel[dof : dof + 3], qvel[dof + 3 : dof + 6]
        elif m.jnt_type[j] == BALL:
            turned[name] = Placement.of_quaternion(np.zeros(3), qpos[at : at + 4]).rotation, qvel[dof : dof + 3]
        else:
            values[name], rates[name] = float(qpos[at]), float(qvel[dof])
    return RobotState(values=values, rates=rates, turned=turned, free=free)
