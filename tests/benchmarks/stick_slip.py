"""Dry friction that ends a motion, beside MuJoCo: `python tests/benchmarks/stick_slip.py` prints a table.

Mass 1 kg on a spring of 1 N/m with dry friction of 1 N, from 12 m with 6 m/s. It comes to rest at 1 − (√205 − 14) m after 22.4235563507 s
(Siconos' FrictionOscillator; closed form), and stays there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import import_module

import ncgen

REST = 1 - (math.sqrt(205) - 14)
DURATION = 100.0


def oscillator() -> ncgen.Kernels:
    """It as a model of ncgen."""
    m = ncgen.Model("oscillator")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (12, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=1.0)
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    return ncgen.compile(m)


def in_ncgen(kernels: ncgen.Kernels, rtol: float) -> tuple[int, float, float]:
    """Evaluations of the forces, the position at the end (m), and the velocity there (m/s)."""
    run = ncgen.simulate(kernels, DURATION, qd0={"s": 6.0}, rtol=rtol, points=2)
    return run.statistics.evaluations, float(run["s"][-1]), float(run["rate(s)"][-1])


def in_mujoco(step: float, hard: bool) -> tuple[int, float, float]:
    """The same of MuJoCo with its implicit integrator, one evaluation a step."""
    mujoco = import_module("mujoco")
    solimp = ' solimpfriction="0.99 0.9999 0.001 0.5 2"' if hard else ""
    joint = f'<joint name="s" type="slide" axis="1 0 0" stiffness="1" frictionloss="1"{solimp}/>'
    body = f'<body>{joint}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    option = f'<option gravity="0 0 0" integrator="implicitfast" timestep="{step!r}"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>")
    data, steps = mujoco.MjData(model), round(DURATION / step)
    data.qpos[0], data.qvel[0] = 12.0, 6.0
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return steps, float(data.qpos[0]), float(data.qvel[0])


def rows() -> Iterator[tuple[str, tuple[int, float, float]]]:
    """(program and setting, what it found)."""
    kernels = oscillator()
    for rtol in (1e-4, 1e-6, 1e-10):
        yield f"ncgen, rtol {rtol:g}", in_ncgen(kernels, rtol)
    for hard in (False, True):
        for step in (1e-2, 1e-3):
            yield f"MuJoCo, {'hard ' if hard else ''}frictionloss, step {step:g} s", in_mujoco(step, hard)


if __name__ == "__main__":
    print("| program | evaluations | x(100 s) | error | velocity |\n|---|---|---|---|---|")
    for name, (count, x, v) in rows():
        print(f"| {name} | {count:,} | {x:.9f} m | {abs(x - REST):.1e} m | {abs(v):.0e} m/s |")
