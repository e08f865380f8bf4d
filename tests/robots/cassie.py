"""Cassie with its loops beside Pinocchio's constrained dynamics and MuJoCo's equality constraints, run by hand:

    pip install 'ncgen[peers,robots]' example-robot-data
    python tests/robots/cassie.py FOLDER/cassie_description/robots/cassie_v2.sdf

It prints freedoms and operations, the largest difference of accelerations at 20 consistent states, how far a fall of 0.2 s with springs and
dampers goes apart (base, hinges), what each loses of its energy without dampers, and how long accelerations take. Pinocchio's joints are
added depth first: in another order its constrained dynamics are wrong without a word. Its loops are points that coincide, two on the axis
of a hinge, so some of its rows are redundant; MuJoCo's equalities give way, by as much as their impedance and time constant say, so it is a
check of four digits at best.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import ncgen
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.mjcf_written import text_of
from ncgen.exchange.robots.natural import model_of
from ncgen.exchange.robots.robot import Joint, Robot, together
from ncgen.model.names import word
from ncgen.program.ir.cost import cost
from ncgen.report.clock import measure, repeated
from ncgen.report.repeat import KernelCall, runner
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.frames import angular_velocity, transformation

STATES, FALL = 20, 0.2

CUT = 1e-5
"""Singular values of the rows below this share of the largest are 0."""


def main(file: str) -> None:
    robot = parallel(together(read_robot(Path(file))))
    kernels = ncgen.compile(model_of(robot), "c")
    space = ncgen.joint_space(kernels)
    operations = cost(space.made("basics")["joint_inverse"]).total
    print(f"{space.n} freedoms, {kernels.n} coordinates, {space.tree.dof} rates of the tree, {operations} operations of inverse dynamics")
    peer = Pinocchio(robot)
    rng, worst, off = np.random.default_rng(0), 0.0, 0.0
    for _ in range(STATES):
        q = turned(space, rng)
        v = rng.normal(size=space.n)
        state = peer.state(kernels, q, space.velocities(q, v))
        found, open_by = peer.accelerations_of_independent_rows(*state)
        mine = space.forward_dynamics(q, v, -space.loads(q, v))
        places = [k for k, name in enumerate(space.rates) if name in peer.place]
        theirs = np.array([found[peer.place[space.rates[k]]] for k in places])
        worst, off = max(worst, np.max(np.abs(mine[places] - theirs)) / (1 + np.max(np.abs(theirs)))), max(off, open_by)
    print(f"accelerations beside Pinocchio: {worst:.0e} of the largest; its loops are open by {off:.0e} m there")
    print("rank of its rows {}, its least singular value {:.0e} of the largest, what is cut {:.0e}".format(*peer.rows))
    times(kernels, space, peer)
    fall(kernels, peer)
    beside_mujoco(robot, kernels, space)


def parallel(robot: Robot) -> Robot:
    """The robot with hinges exactly parallel that are so but for the file's last digits, as ncgen takes them: their loops would lock."""
    frames, known = {robot.root: robot.base}, []

    def straightened(joint: Joint, frame) -> Joint:
        if joint.kind != "revolute":
            return joint
        axis = frame.along(joint.axis)
        found = next((other for other in known if np.linalg.norm(np.cross(axis, other)) < 1e-5), None)
        if found is None:
            known.append(axis)
            return joint
        return replace(joint, axis=frame.rotation.T @ (found * np.sign(found @ axis)))

    joints = []
    for joint in robot.joints:
        frames[joint.child] = frames[joint.parent] @ joint.placement
        joints.append(straightened(joint, frames[joint.child]))
    loops = tuple(straightened(loop, robot.base @ loop.placement) for loop in robot.loops)
    return replace(robot, joints=tuple(joints), loops=loops)


def turned(space, rng) -> np.ndarray:
    """A consistent position near the start, with the base turned."""
    from scipy.spatial.transform import Rotation

    start = space.values(space.kernels.q0)
    hinges = {name: start[space.rates.index(name)] + rng.uniform(-0.15, 0.15) for name in space.coordinates}
    return space.position(hinges, (Rotation.from_rotvec(rng.uniform(-1, 1, 3)).as_matrix(), rng.uniform(-1, 1, 3)))


class Pinocchio:
    """The robot there. place: {hinge: number of its rate}"""

    def __init__(self, robot: Robot) -> None:
        import pinocchio as pin

        self.pin, self.robot, self.model = pin, robot, pin.Model()
        self.model.gravity.linear = np.array(robot.gravity)
        number = {robot.root: self.model.addJoint(0, pin.JointModelFreeFlyer(), self.se3(robot.base), "root")}
        self._add(robot.root, number[robot.root])
        kinds = {"spherical": lambda _: pin.JointModelSpherical(), "revolute": lambda joint: pin.JointModelRevoluteUnaligned(joint.axis)}
        frames = {robot.root: robot.base.inverse() @ robot.base}
        for joint in robot.joints:  # which `Robot.ordered` has put depth first
            frames[joint.child] = frames[joint.parent] @ joint.placement
            kind = kinds[joint.kind](joint)
            number[joint.child] = self.model.addJoint(number[joint.parent], kind, self.se3(joint.placement), joint.name)
            self._add(joint.child, number[joint.child])
        self.number = number
        self.place = {word(j.name, "joint"): self.model.joints[number[j.child]].idx_v for j in robot.joints if j.kind == "revolute"}
        self.ends: list[list[int]] = []
        self.contacts = pin.StdVec_RigidConstraintModel()
        for loop in robot.loops:
            for along in (0.0, 0.1) if loop.kind == "revolute" else (0.0,):
                place = loop.placement.at(along * loop.axis)
                ends = [pin.SE3(np.eye(3), frames[name].inverse().at(place)) for name in (loop.parent, loop.child)]
                first, second = number[loop.parent], number[loop.child]
                self.contacts.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, self.model, first, ends[0], second, ends[1]))
                named = zip((first, second), ends, strict=True)
                kind, count = pin.FrameType.OP_FRAME, len(self.contacts)
                self.ends.append([self.model.addFrame(pin.Frame(f"{count}.{j}", j, 0, end, kind)) for j, end in named])
        self.data = self.model.createData()
        self.contact_data = pin.StdVec_RigidConstraintData()
        self.contact_data.extend(contact.createData() for contact in self.contacts)
        pin.initConstraintDynamics(self.model, self.data, self.contacts, self.contact_data)
        self.settings = pin.ProximalSettings(1e-14, 1e-14, 1e-10, 200)

    def se3(self, placement):
        return self.pin.SE3(placement.rotation, placement.position)

    def _add(self, name: str, joint: int) -> None:
        mass = self.robot.links[name].mass
        if mass is not None:
            self.model.appendBodyToJoint(joint, self.pin.Inertia(mass.mass, mass.com, mass.tensor), self.pin.SE3.Identity())

    def state(self, kernels, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity there, of ncgen's."""
        pin, x, v = self.pin, self.pin.neutral(self.model), np.zeros(self.model.nv)
        frames = {self.robot.root: self.robot.base}
        for joint in self.robot.joints:
            frames[joint.child] = frames[joint.parent] @ joint.placement
        turn = {name: transformation(kernels, word(name, "link"), q) @ frame.rotation for name, frame in frames.items()}
        spin = {name: angular_velocity(kernels, word(name, "link"), q, qd) for name in frames}
        point = kernels.model.bodies[word(self.robot.root, "link")].points[0]
        place = np.array([q[kernels.index[c.name]] for c in point.components])
        moved = np.array([qd[kernels.index[c.name]] for c in point.components])
        arm = turn[self.robot.root] @ (frames[self.robot.root].inverse().at(point.initial))
        root = self.model.joints[self.number[self.robot.root]]
        x[:3], x[3:7] = place - arm, pin.Quaternion(turn[self.robot.root]).coeffs()
        back = turn[self.robot.root].T
        v[:3], v[3:6] = back @ (moved - np.cross(spin[self.robot.root], arm)), back @ spin[self.robot.root]
        assert root.idx_q == 0
        for joint in self.robot.joints:
            kind, name = self.model.joints[self.number[joint.child]], word(joint.name, "joint")
            if joint.kind == "revolute":
                value = q[kernels.index[name]]
                x[kind.idx_q : kind.idx_q + kind.nq] = [value] if kind.nq == 1 else [np.cos(value), np.sin(value)]
                v[kind.idx_v] = qd[kernels.index[name]]
            else:
                beside = (turn[joint.parent] @ joint.placement.rotation).T @ turn[joint.child]
                x[kind.idx_q : kind.idx_q + 4] = pin.Quaternion(beside).coeffs()
                v[kind.idx_v : kind.idx_v + 3] = turn[joint.child].T @ (spin[joint.child] - spin[joint.parent])
        return x, v

    def forces(self, x: np.ndarray, v: np.ndarray, dampers: bool = True) -> np.ndarray:
        """Of springs and dampers."""
        forces = np.zeros(self.model.nv)
        for joint in self.robot.joints:
            if joint.kind == "revolute" and (joint.damping or joint.stiffness):
                kind = self.model.joints[self.number[joint.child]]
                forces[kind.idx_v] = -joint.damping * dampers * v[kind.idx_v] - joint.stiffness * (x[kind.idx_q] - joint.rest)
        return forces

    def accelerations(self, x: np.ndarray, v: np.ndarray, springs: bool = True, dampers: bool = True) -> tuple[np.ndarray, float]:
        """And by how much loops are open (m)."""
        forces = self.forces(x, v, dampers) if springs else np.zeros(self.model.nv)
        found = self.pin.constraintDynamics(self.model, self.data, x, v, forces, self.contacts, self.contact_data, self.settings)
        ends = ((self.data.oMi[c.joint1_id] * c.joint1_placement, self.data.oMi[c.joint2_id] * c.joint2_placement) for c in self.contacts)
        return found.copy(), max(float(np.linalg.norm(a.translation - b.translation)) for a, b in ends)

    def accelerations_of_independent_rows(self, x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float]:
        """The same under weight alone, from Pinocchio's matrices, by the null space of its rows: redundant ones that rounding makes
        independent by 1e-8 are taken half for rows that hold by its proximal solver."""
        pin, model, data = self.pin, self.model, self.data
        mass, aligned = pin.crba(model, data, x), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.nonLinearEffects(model, data, x, v).copy()
        pin.forwardKinematics(model, data, x, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, x)
        pin.updateFramePlacements(model, data)
        rows, right, off = [], [], 0.0
        for a, b in self.ends:
            rows.append((pin.getFrameJacobian(model, data, a, aligned) - pin.getFrameJacobian(model, data, b, aligned))[:3])
            far = [pin.getFrameClassicalAcceleration(model, data, frame, aligned).linear for frame in (a, b)]
            right.append(far[1] - far[0])
            off = max(off, float(np.linalg.norm(data.oMf[a].translation - data.oMf[b].translation)))
        left, sizes, turned = np.linalg.svd(np.concatenate(rows))
        rank = int(np.sum(sizes > CUT * sizes[0]))
        free = turned[rank:].T
        known = turned[:rank].T @ ((left.T @ np.concatenate(right))[:rank] / sizes[:rank])
        found = known + free @ np.linalg.solve(free.T @ mass @ free, free.T @ (-bias - mass @ known))
        self.rows = rank, sizes[rank - 1] / sizes[0], float(np.max(sizes[rank:], initial=0.0)) / sizes[0]
        return found, off

    def energy(self, x: np.ndarray, v: np.ndarray) -> float:
        stored = 0.0
        for joint in self.robot.joints:
            if joint.kind == "revolute":
                stored += joint.stiffness / 2 * (x[self.model.joints[self.number[joint.child]].idx_q] - joint.rest) ** 2
        pin = self.pin
        return pin.computeKineticEnergy(self.model, self.data, x, v) + pin.computePotentialEnergy(self.model, self.data, x) + stored

    def fallen(self, x: np.ndarray, v: np.ndarray, dampers: bool = True):
        """The state after the fall, by Runge-Kutta steps on the position's own manifold."""
        pin, n = self.pin, self.model.nv

        def rates(_, y):  # y: displacement from x in the tangent space at x, and velocity
            here = pin.integrate(self.model, x, y[:n])
            inner = pin.dIntegrate(self.model, x, y[:n], pin.ArgumentPosition.ARG1)
            return np.concatenate([np.linalg.solve(inner, y[n:]), self.accelerations(here, y[n:], dampers=dampers)[0]])

        y = solve_ivp(rates, (0, FALL), np.concatenate([np.zeros(n), v]), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        return pin.integrate(self.model, x, y[:n]), y[n:]


def times(kernels, space, peer: Pinocchio) -> None:
    """Microseconds of all accelerations with springs and dampers, samples of both in turns, and how far the hinges' are apart, relative
    to the largest. ncgen's are a stage of a default run, with the velocities of all coordinates; Pinocchio's, of its joints alone, by the
    quickest of some settings, are called from Python, which takes about as long as the last line says, of an arm with one joint."""
    pin, rng, made = peer.pin, np.random.default_rng(1), all_coordinates(kernels, form="emitted")
    q, v = turned(space, rng), rng.normal(size=space.n)
    qd = space.velocities(q, v)
    x, xd = peer.state(kernels, q, qd)
    stage = KernelCall(made._dynamics.motion.derivative, 2 * kernels.n + 2, made)
    runs = {"ncgen": runner(0.0, q, qd, made.with_prepared(kernels.p0), [], stage)}
    settings = {
        f"Pinocchio, mu {mu:.0e}, accuracy {close:.0e}": (close, close, mu, 50) for mu in (1e-4, 1e-6, 1e-8) for close in (1e-6, 1e-10)
    }
    found = {}
    for name, values in settings.items():
        given = peer.model, peer.data, x, xd, peer.forces(x, xd), peer.contacts, peer.contact_data, pin.ProximalSettings(*values)
        found[name] = pin.constraintDynamics(*given).copy()
        runs[name] = repeated(lambda given=given: pin.constraintDynamics(*given))
    small, none = pin.Model(), np.zeros(1)
    small.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    data = small.createData()
    spent = measure(runs | {"a call from Python": repeated(lambda: pin.aba(small, data, none, none, none))})
    mine = {name: stage.out[kernels.index[name]] for name in peer.place}
    for name, spread in spent.items():
        apart = max((abs(found[name][peer.place[hinge]] - value) for hinge, value in mine.items()), default=0) if name in found else 0
        share = f", {apart / max(map(abs, mine.values())):.0e} apart" if name in found else ""
        print(f"{name:38s} {spread.least * 1e6:6.2f} µs, {spread.least / spent['ncgen'].least:5.2f}{share}")


def fall(kernels, peer: Pinocchio) -> None:
    space = ncgen.joint_space(kernels)
    begin = {"q0": kernels.q0, "qd0": space.velocities(kernels.q0, 2 * np.cos(np.arange(space.n)))}
    run = ncgen.simulate(kernels, FALL, rtol=1e-11, points=2, **begin)
    state = peer.state(kernels, run.q[0], run.qd[0])
    x, _ = peer.fallen(*state)
    mine, _ = peer.state(kernels, run.q[-1], run.qd[-1])
    apart = np.minimum(np.abs(x - mine), np.abs(x + mine))  # of quaternions both signs are one rotation
    hinges = [peer.model.joints[j].idx_q for j in range(2, peer.model.njoints) if peer.model.joints[j].nq == 1]
    far = np.max(np.abs(mine - state[0])[hinges])
    print(f"fall of {FALL} s beside Pinocchio: hinges turn by up to {far:.2f} rad, {np.max(apart):.0e} apart")
    free = replace(peer.robot, joints=tuple(replace(joint, damping=0.0) for joint in peer.robot.joints))
    undamped = ncgen.compile(model_of(free), "c")
    run = ncgen.simulate(undamped, FALL, rtol=1e-11, points=2, **begin)
    energies = [undamped.energy(q, qd)[:2] for q, qd in zip(run.q, run.qd, strict=True)]
    kept = abs(sum(energies[1]) - sum(energies[0])) / energies[1][0]
    x, v = peer.fallen(*state, dampers=False)
    theirs = abs(peer.energy(x, v) - peer.energy(*state)) / energies[1][0]
    print(f"energy without dampers, over the kinetic one: ncgen {kept:.0e}, Pinocchio {theirs:.0e}")


def beside_mujoco(robot: Robot, kernels, space) -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_string(text_of(robot))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.solver, model.opt.iterations, model.opt.tolerance = mujoco.mjtSolver.mjSOL_NEWTON, 200, 1e-16
    model.eq_solimp[:] = (0.9999, 0.9999, 0.001, 0.5, 2)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mine = space.forward_dynamics(kernels.q0)
    names = {word(model.joint(j).name, "joint"): model.jnt_dofadr[j] for j in range(model.njnt) if model.jnt_type[j] >= 2}
    places = [k for k, name in enumerate(space.rates) if name in names]
    theirs = np.array([data.qacc[names[space.rates[k]]] for k in places])
    apart = np.max(np.abs(mine[places] - theirs)) / (1 + np.max(np.abs(theirs)))
    print(f"accelerations from rest beside MuJoCo: {apart:.0e} of the largest")


if __name__ == "__main__":
    main(*sys.argv[1:])
