"""Joint space of whole collections of robots beside Pinocchio (URDF) and MuJoCo (MJCF), run by hand:

    python tests/robots/compare_files.py FOLDER …

It prints a line for every file below the folders: rates, coordinates, seconds until ready, operations of an inverse dynamics, and the
largest error over 20 random states of mass matrix, gravity, Coriolis terms, forward dynamics, centroidal momentum (URDF), or of mass
matrix, bias and passive forces (MJCF), and of the Jacobian of a point of the outermost bodies, each over 1 + the largest entry; for up to
12 rates of URDF also of the derivatives of inverse and forward dynamics; or the reason why a file is refused. Joints that mimic others move
by themselves here, as they do in Pinocchio, and what closes loops or couples joints is left out, as it is of MuJoCo's mass matrix. A last
line counts what there was. The packages example-robot-data, gymnasium and dm_control have such folders.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import SUFFIXES, read_robot
from ncgen.exchange.robots.natural import model_of
from ncgen.exchange.robots.robot import Joint, Robot, together
from ncgen.model.names import word
from ncgen.program.ir.cost import cost

STATES, BODIES, SLOPED = 20, 3, 12
"""States; outermost bodies whose Jacobians are looked at; most rates whose derivatives are."""


def main(folders: list[str]) -> None:
    files = sorted(file for folder in folders for suffix in SUFFIXES for file in Path(folder).rglob(f"*{suffix}"))
    found = []
    for file in files:
        found.append(line(file))
        print(f"{file.parent.name}/{file.name}: {found[-1]}", flush=True)
    counts = [sum(text.startswith(word) for text in found) for word in ("refused", "nothing moves")]
    print(f"{len(files)} files, {len(files) - sum(counts)} compared, {counts[0]} refused, {counts[1]} in which nothing moves")


def line(file: Path) -> str:
    """What there is to say of a file."""
    start = time.perf_counter()
    try:
        robot = read_robot(file)
        robot = replace(robot, joints=tuple(replace(joint, mimic=None) for joint in robot.joints), loops=(), rows=())
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
    errors = {".urdf": beside_pinocchio, ".sdf": lambda *_: {}}.get(file.suffix, beside_mujoco)(file, space, robot)
    said = ", ".join(f"{name} {error:.0e}" for name, error in errors.items())
    return f"{space.n} rates, {kernels.n} coordinates, {seconds:.1f} s, {operations} operations; {said}"


class Worst(dict):
    """{what: the largest error}."""

    def look(self, name: str, found: np.ndarray, expected: np.ndarray) -> None:
        size = 1 + np.max(np.abs(expected), initial=0.0)
        self[name] = max(self.get(name, 0.0), float(np.max(np.abs(found - expected), initial=0.0) / size))


def outermost(robot: Robot) -> list[Joint]:
    """Joints of the last links, which all that carries them moves."""
    return list(together(robot).joints)[-BODIES:]


def space_has_mass(space) -> bool:
    return any(link.body.inertia for link in space.tree.links)


def beside_pinocchio(file: Path, space, robot: Robot) -> Worst:
    import pinocchio as pin

    rng, worst = np.random.default_rng(0), Worst()
    try:
        model = pin.buildModelFromUrdf(str(file))
    except ValueError:
        return Worst({"refused by Pinocchio": np.nan})
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
        momentum = pin.computeCentroidalMomentum(model, data, q, v)
        if kept := space_has_mass(space):
            worst.look("momentum", space.momentum(here, v[order]), np.array([*momentum.linear, *momentum.angular]))
        pin.computeJointJacobians(model, data, q)
        for joint in outermost(robot):
            j = model.getJointId(joint.name)
            body = word(joint.child, "link")
            point = space.kernels.model.bodies[body].points[0]
            theirs = pin.getJointJacobian(model, data, j, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)  # one rate: Pinocchio gives (6,)
            theirs[:3] += np.cross(theirs[3:].T, space.element(point, here) - data.oMi[j].translation).T
            worst.look("Jacobian", space.jacobian(point.name, here, body), theirs[:, order])
        if kept and space.n <= SLOPED and np.linalg.cond(mass) < 1e6:
            a = rng.normal(size=model.nv)
            found, theirs = space.inverse_dynamics_derivatives(here, v[order], a[order]), pin.computeRNEADerivatives(model, data, q, v, a)
            for mine, other in zip(found[:2], theirs[:2], strict=True):
                worst.look("slopes of inverse", mine, other[np.ix_(order, order)])
            undamped = space.forward_dynamics_derivatives(here, v[order], forces[order] - space.loads(here, v[order]))
            theirs = pin.computeABADerivatives(model, data, q, v, forces)
            worst.look("slopes of forward", undamped.position, theirs[0][np.ix_(order, order)])
        if np.linalg.cond(mass) < 1e12:
            mine = space.forward_dynamics(here, v[order], forces[order] - space.loads(here, v[order]))
            worst.look("forward", mine, pin.aba(model, data, q, v, forces)[order])
    return worst


def beside_mujoco(file: Path, space, robot: Robot) -> Worst:
    import mujoco

    mujoco.set_mju_user_warning(print)  # else it writes a file where Python happens to run
    model, rng, worst = mujoco.MjModel.from_xml_path(str(file)), np.random.default_rng(0), Worst()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    joints = [j for j in range(model.njnt) if model.jnt_type[j] >= 2]
    names = [word(model.joint(j).name or f"joint{j}", "joint") for j in joints]
    bodies = {model.body(i).name or f"body{i}": i for i in range(1, model.nbody)}
    mine, dofs = [space.rates.index(name) for name in names], [model.jnt_dofadr[j] for j in joints]
    for _ in range(STATES):
        data.qpos[:], values, v = model.qpos0, rng.uniform(-1, 1, len(joints)), np.zeros(space.n)
        data.qpos[[model.jnt_qposadr[j] for j in joints]] += values
        v[mine] = data.qvel[dofs] = rng.normal(size=len(joints))
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        here = space.position(dict(zip(names, data.qpos[[model.jnt_qposadr[j] for j in joints]], strict=True)))
        worst.look("mass", space.mass_matrix(here)[np.ix_(mine, mine)], mass[np.ix_(dofs, dofs)])
        worst.look("bias", space.inverse_dynamics(here, v)[mine], data.qfrc_bias[dofs])
        for joint in outermost(robot):
            body, rows = word(joint.child, "link"), np.zeros((2, 3, model.nv))
            if body not in space.kernels.model.bodies or joint.child not in bodies:
                continue
            point = space.kernels.model.bodies[body].points[0]
            mujoco.mj_jac(model, data, rows[0], rows[1], space.element(point, here), bodies[joint.child])
            worst.look("Jacobian", space.jacobian(point.name, here, body)[:, mine], np.concatenate(rows)[:, dofs])
        worst.look("passive", space.loads(here, v)[mine], data.qfrc_passive[dofs])
    return worst


if __name__ == "__main__":
    main(sys.argv[1:])
