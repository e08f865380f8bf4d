"""Motions of MJCF beside MuJoCo's: natural coordinates where its bodies are, and their accelerations, from those of its joints.

Every element of a body in ncgen's model is a point or a direction of one of MuJoCo's bodies, if these have one joint each: where the
model begins its place in that body's frame is measured, and at any other state MuJoCo's frames, Jacobians and their rates say position,
velocity and acceleration.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import block_array, csr_array
from scipy.sparse.csgraph import connected_components

import ncgen
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.closures import closures_of, with_closures
from ncgen.exchange.robots.mjcf_keyframes import start_of
from ncgen.exchange.robots.robot import Robot, together
from ncgen.exchange.robots.starts import named_start, positions_in_links
from ncgen.model.elements import Point, Spatial
from ncgen.model.names import word

UNUSED_GROUP = 30
"""A group of actuators that no file here has."""


class Beside:
    """A file in ncgen and in MuJoCo, without contacts and limits."""

    def __init__(self, path: Path, largest: int | None = None, **options) -> None:
        """largest: a model of more coordinates is loaded and no more"""
        import mujoco

        self.mujoco = mujoco
        robot = read_robot(path)
        robot = with_closures(robot, closures_of(robot)) if robot.follows_from_start else robot
        self.model, self.robot = ncgen.load(path, **options), together(robot)
        self.kernels = None
        if largest and len(self.model.components) > largest:
            return
        self.kernels = ncgen.compile(self.model, "numpy")
        self.p = np.array(self.kernels.p0)
        self.theirs = mujoco.MjModel.from_xml_path(str(path))
        flags = mujoco.mjtDisableBit
        self.theirs.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
        self.theirs.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.theirs)
        self.joints = {}
        for j in range(self.theirs.njnt):
            if self.theirs.jnt_type[j] >= 2:
                name = word(self.theirs.joint(j).name or f"joint{j}", "joint")
                if name in self.model.elements:
                    self.joints[name] = j
        self._place()

    def _place(self) -> None:
        """{element: (number of MuJoCo's body, its place there)}."""
        mujoco, m, d = self.mujoco, self.theirs, self.data
        for name, j in self.joints.items():  # loops may have been closed by moving joints
            d.qpos[m.jnt_qposadr[j]] = self.kernels.q0[self.kernels.index[name]]
        frames = self.robot.frames(self.robot.base)
        for j in np.flatnonzero(m.jnt_type == 0).tolist():
            frame, at = frames[m.body(m.jnt_bodyid[j]).name or f"body{m.jnt_bodyid[j]}"], m.jnt_qposadr[j]
            d.qpos[at : at + 7] = [*frame.position, *frame.quaternion]
        mujoco.mj_kinematics(m, d)
        numbers = {word(m.body(i).name or f"body{i}", "link"): i for i in range(1, m.nbody)}
        self.at = {}
        for name, body in self.model.bodies.items():
            for element in body.elements:
                if not element.fixed and name in numbers:
                    i = numbers[name]
                    away = element.initial - d.xpos[i] if isinstance(element, Point) else element.initial
                    self.at[element] = i, d.xmat[i].reshape(3, 3).T @ away
        links = {word(name, "link"): name for name in frames}
        bodies = self.model.bodies.values()
        members = {links[body.name]: [e for e in body.elements if isinstance(e, Spatial)] for body in bodies}
        self.places = positions_in_links(members, frames)
        self.frames = frames
        self.names = [m.joint(j).name or f"joint{j}" for j in range(m.njnt)]
        self.relative = {name: self.model.elements[word(name, "joint")] for name in self.names if word(name, "joint") in self.joints}
        self.known = np.zeros(self.kernels.n, dtype=bool)
        for component in (c for element in (*self.at, *self.relative.values()) for c in element.components if not c.fixed):
            self.known[self.kernels.index[component.name]] = True

    def only_what_is_modelled(self) -> None:
        """Switch off what ncgen leaves out of a file, in MuJoCo: actuators and tendons that are not modelled, and fluids."""
        m = self.theirs
        m.opt.density = m.opt.viscosity = 0.0
        for name in ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature", "frictionloss"):
            getattr(m, f"tendon_{name}")[:] = 0.0
        without_other_actuators(m, self.robot)

    def state(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Natural coordinates and their rates at one of MuJoCo's states, which is set."""
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        self.mujoco.mj_forward(self.theirs, self.data)
        q, qd, _ = self._natural()
        if not self.known.all():  # elements of bodies between two joints of one
            start = named_start(start_of(self.theirs, qpos, qvel, self.names), self.robot, self.frames, self.places, self.relative)
            for c in np.flatnonzero(~self.known):
                name = self.kernels.coordinates[c]
                q[c], qd[c] = start["q0"].get(name, q[c]), start.get("qd0", {}).get(name, 0.0)
        return q, qd

    def accelerations(self) -> np.ndarray:
        """Those of natural coordinates where MuJoCo's state is set."""
        return self._natural()[2]

    def _natural(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mujoco, m, d = self.mujoco, self.theirs, self.data
        index = self.kernels.index
        found = np.zeros((3, self.kernels.n))
        jacobians = np.zeros((2, 3, m.nv)), np.zeros((2, 3, m.nv))
        for element, (i, place) in self.at.items():
            arm = d.xmat[i].reshape(3, 3) @ place
            point = d.xpos[i] + arm if isinstance(element, Point) else d.xpos[i]
            (jp, jr), (dp, dr) = jacobians
            mujoco.mj_jac(m, d, jp, jr, point, i)
            mujoco.mj_jacDot(m, d, dp, dr, point, i)
            turning, more = jr @ d.qvel, jr @ d.qacc + dr @ d.qvel
            if isinstance(element, Point):
                values = point, jp @ d.qvel, jp @ d.qacc + dp @ d.qvel
            else:
                values = arm, np.cross(turning, arm), np.cross(more, arm) + np.cross(turning, np.cross(turning, arm))
            for axis, component in enumerate(element.components):
                if not component.fixed:
                    found[:, index[component.name]] = [value[axis] for value in values]
        for name, j in self.joints.items():
            dof = m.jnt_dofadr[j]
            found[:, index[name]] = d.qpos[m.jnt_qposadr[j]], d.qvel[dof], d.qacc[dof]
        return found[0], found[1], found[2]

    def random(self, rng: np.random.Generator, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """A state of MuJoCo's, joints away from where they begin."""
        m, qpos = self.theirs, self.theirs.qpos0.copy()
        self.mujoco.mj_integratePos(m, qpos, rng.uniform(-size, size, m.nv), 1.0)
        return qpos, rng.normal(size=m.nv) * size

    # -- equalities ----------------------------------------------------------------------------

    def _rows(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What equalities miss at a state of MuJoCo's, which is set, and their Jacobian (rows, nv)."""
        d = self.data
        d.qpos[:], d.qvel[:] = qpos, qvel
        self.mujoco.mj_forward(self.theirs, d)
        return d.efc_pos.copy(), d.efc_J.reshape(d.nefc, self.theirs.nv).copy()

    def _moved(self, qpos: np.ndarray, step: np.ndarray) -> np.ndarray:
        moved = qpos.copy()
        self.mujoco.mj_integratePos(self.theirs, moved, step, 1.0)
        return moved

    def close(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A state nearby in which MuJoCo's equalities hold, and their accelerations without their softness: Newton's method, and KKT."""
        m, d = self.theirs, self.data
        for _ in range(50):
            miss, rows = self._rows(qpos, qvel)
            if np.max(np.abs(miss), initial=0.0) < 1e-13:
                break
            qpos = self._moved(qpos, -np.linalg.lstsq(rows, miss, rcond=1e-9)[0])
        qvel = qvel - np.linalg.lstsq(rows, rows @ qvel, rcond=1e-9)[0]
        h = 1e-3
        beside = {k: self._rows(self._moved(qpos, k * h * qvel), qvel)[1] @ qvel for k in (-2, -1, 1, 2)}
        change = (8 * (beside[1] - beside[-1]) - (beside[2] - beside[-2])) / (12 * h)
        q, qd = self.state(qpos, qvel)
        mass = np.zeros((m.nv, m.nv))
        self.mujoco.mj_fullM(m, d, mass)
        right = np.concatenate([d.qfrc_passive + d.qfrc_actuator - d.qfrc_bias, -change])
        system = np.block([[mass, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        d.qacc[:] = np.linalg.lstsq(system, right, rcond=1e-12)[0][: m.nv]
        return q, qd

    def closed_error(self, rng: np.random.Generator, states: int = 4, size: float = 0.3) -> float:
        """The largest error at states in which equalities hold."""
        return max(self.miss(*self.close(*self.random(rng, size))) for _ in range(states))

    def error(self, rng: np.random.Generator, states: int = 5, size: float = 1.0, t: float = 0.0) -> float:
        """The largest error of an acceleration, over 1 + the largest one, at random states of a tree."""
        worst = 0.0
        for _ in range(states):
            q, qd = self.state(*self.random(rng, size))
            worst = max(worst, self.miss(q, qd, t))
        return worst

    def miss(self, q: np.ndarray, qd: np.ndarray, t: float = 0.0) -> float:
        """The error at one state, which MuJoCo is in."""
        expected, k = self.accelerations(), self.kernels
        closed = np.max(np.abs(k.phi(q, t, self.p)), initial=0.0)
        assert closed < 1e-9, f"positions do not close: {closed:.1e}"
        found = lagrange(k, q, qd, t, self.p)
        return float(np.max(np.abs(found - expected)[self.known]) / (1 + np.max(np.abs(expected)[self.known])))


def name_of_actuator(m, number: int) -> str:
    """The name of one of MuJoCo's actuators, as ncgen says it."""
    return m.actuator(number).name or f"actuator{number}"


def without_other_actuators(m, robot: Robot) -> None:
    """Switch off actuators of MuJoCo's model that are not modelled; those of plugins act whatever their group is."""
    modelled = {actuator.name for actuator in robot.actuators or ()}
    for k in range(m.nactuator):
        if name_of_actuator(m, k) not in modelled:
            m.actuator_group[k], m.actuator_forcelimited[k] = UNUSED_GROUP, 0
            if m.actuator_plugin[k] >= 0:
                m.actuator_gear[m.actuator_outadr[k]] = 0.0
    m.opt.disableactuator |= 1 << UNUSED_GROUP


def lagrange(k, q: np.ndarray, qd: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """q̈ from M q̈ + Φ_qᵀ λ = Q and Φ_q q̈ = γ, by least squares with NumPy, so that redundant rows do no harm.

    Masses, and forces with them, are in units of the largest one: those of a playing card are 1e-7 of rows of unit vectors.
    """
    mass, rows = csr_array(k.mass_matrix(q, t, p)), csr_array(k.phi_q(q, t, p))
    unit = abs(mass).max() if mass.nnz else 1.0
    right = np.concatenate([k.force(q, qd, t, p) / unit, k.gamma(q, qd, t, p)])
    system = block_array([[mass / unit, rows.T], [rows, None]], format="csr")
    found = np.zeros(len(right))
    count, part = connected_components(system, directed=False)
    for each in (np.flatnonzero(part == number) for number in range(count)):  # what moves by itself
        found[each] = np.linalg.lstsq(system[each][:, each].toarray(), right[each], rcond=1e-13)[0]
    return found[: k.n]
