"""Joint space of whole collections of robots beside Pinocchio (URDF) and MuJoCo (MJCF), run by hand:

    python tests/robots/compare_files.py FOLDER …

It prints a line for every file below the folders: rates, coordinates, seconds until ready, operations of an inverse dynamics, and the
largest error over 20 random states of mass matrix, gravity, Coriolis terms and forward dynamics (URDF), or of mass matrix, bias and
passive forces (MJCF), each over 1 + the largest entry; or the reason why a file is refused. Joints that mimic others move by themselves
here, as they do in Pinocchio. The packages example-robot-data, gymnasium and dm_control have such folders.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import SUFFIXES, read_robot
from ncgen.exchange.robots.natural import model_of, word
from ncgen.program.cost import cost

STATES = 20


def main(folders: list[str]) -> None:
    files = sorted(file for folder in folders for suffix in SUFFIXES for file in Path(folder).rglob(f"*{suffix}"))
    for file in files:
        print(f"{file.parent.name}/{file.name}: {line(file)}", flush=True)


def line(file: Path) -> str:
    """What there is to say of a file."""
    start = time.perf_counter()
    try:
        robot = read_robot(file)
        robot = replace(robot, joints=tuple(replace(joint, mimic=None) for joint in robot.joints))
        model = model_of(robot)
        if not model.bodies:
            return "nothing moves"
        kernels = ncgen.compile(model, "numpy")
        space = ncgen.joint_space(kernels)
        space.mass_matrix(kernels.q0)
    except NcgenError as error:
        return f"refused: {error}"
    seconds = time.perf_counter() - start
    operations = cost(space.made("basics")["joint_inverse"]).total
    errors = {".urdf": beside_pinocchio, ".sdf": lambda *_: {}}.get(file.suffix, beside_mujoco)(file, space)
    said = ", ".join(f"{name} {error:.0e}" for name, error in errors.items())
    return f"{space.n} rates, {kernels.n} coordinates, {seconds:.1f} s, {operations} operations; {said}"


class Worst(dict):
    """{what: the largest error}."""

    def look(self, name: str, found: np.ndarray, expected: np.ndarray) -> None:
        size = 1 + np.max(np.abs(expected), initial=0.0)
        self[name] = max(self.get(name, 0.0), float(np.max(np.abs(found - expected), initial=0.0) / size))


def beside_pinocchio(file: Path, space) -> Worst:
    import pinocchio as pin

    model, rng, worst = pin.buildModelFromUrdf(str(file)), np.random.default_rng(0), Worst()
    data = model.createData()
    names = [word(model.names[j], "joint") for j in range(1, model.njoints)]
    if sorted(names) != sorted(space.rates):
        return Worst()
    order = np.array([names.index(name) for name in space.rates])
    for _ in range(STATES):
        q, values = pin.neutral(model), rng.uniform(-1.5, 1.5, model.nv)
        for joint, value in zip((model.joints[j] for j in range(1, model.njoints)), values, strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        v, forces = rng.normal(size=(2, model.nv))
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        gravity, bias = pin.computeGeneralizedGravity(model, data, q).copy(), pin.nonLinearEffects(model, data, q, v).copy()
        here = space.position(dict(zip(names, values, strict=True)))
        worst.look("mass", space.mass_matrix(here), mass[np.ix_(order, order)])
        worst.look("gravity", space.gravity(here), gravity[order])
        worst.look("Coriolis", space.coriolis(here, v[order]), (bias - gravity)[order])
        if np.linalg.cond(mass) < 1e12:
            mine = space.forward_dynamics(here, v[order], forces[order] - space.loads(here, v[order]))
            worst.look("forward", mine, pin.aba(model, data, q, v, forces)[order])
    return worst


def beside_mujoco(file: Path, space) -> Worst:
    import mujoco

    mujoco.set_mju_user_warning(print)  # else it writes a file where Python happens to run
    model, rng, worst = mujoco.MjModel.from_xml_path(str(file)), np.random.default_rng(0), Worst()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    joints = [j for j in range(model.njnt) if model.jnt_type[j] >= 2]
    names = [word(model.joint(j).name or f"joint{j}", "joint") for j in joints]
    mine, dofs = [space.rates.index(name) for name in names], [model.jnt_dofadr[j] for j in joints]
    for _ in range(STATES):
        data.qpos[:], values, v = model.qpos0, rng.uniform(-1, 1, len(joints)), np.zeros(space.n)
        data.qpos[[model.jnt_qposadr[j] for j in joints]] += values
        v[mine] = data.qvel[dofs] = rng.normal(size=len(joints))
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        here = space.position(dict(zip(names, values, strict=True)))
        worst.look("mass", space.mass_matrix(here)[np.ix_(mine, mine)], mass[np.ix_(dofs, dofs)])
        worst.look("bias", space.inverse_dynamics(here, v)[mine], data.qfrc_bias[dofs])
        worst.look("passive", space.loads(here, v)[mine], data.qfrc_passive[dofs])
    return worst


if __name__ == "__main__":
    main(sys.argv[1:])
