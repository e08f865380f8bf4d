"""Files of MJCF made by setting words of MuJoCo's own schema (`drawn_mjcf.py`), and their motion next to MuJoCo's.

What `model.left_out` lists, and that alone, is switched off in MuJoCo; then accelerations of all bodies agree, keyframes are named
starts by value, and outputs are MuJoCo's readings of its sensors at the same states; or a word was ignored.
"""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from by_mujoco import Beside, lagrange, name_of_actuator, without_other_actuators
from drawn_mjcf import BASES, Draws
from vocabulary_of_sdf import printed

from ncgen.errors import NcgenError
from ncgen.exchange.robots import mjcf, read_robot
from ncgen.exchange.robots.accounting import parted
from ncgen.exchange.robots.mjcf_fields import AT_JOINT, BALL, SCALAR, is_ball_in_world
from ncgen.exchange.robots.motors import AWAY_FROM_ZERO
from ncgen.exchange.robots.robot import Robot
from ncgen.exchange.robots.sensors import SENSORS
from ncgen.exchange.robots.stops import left
from ncgen.solver.motions.step_preparation import outputs_at

WITHIN = 1e-9
"""Largest error of an acceleration over 1 + the largest acceleration."""

STATES = 2
"""States at which accelerations are compared."""

SWITCHED_OFF = {
    "limits of joints": "jnt_limited", "friction of joints": "dof_frictionloss", "springs that yield": "jnt_springyield",
    "tendons": "tendon_stiffness tendon_stiffnesspoly tendon_damping tendon_dampingpoly tendon_armature tendon_frictionloss tendon_limited",
    AWAY_FROM_ZERO: "jnt_actfrclimited",
    "compensation of weight by motors that have limits, or are switched off": "jnt_actgravcomp",
}  # fmt: skip
"""{words of what is left out: fields of MuJoCo that it comes from}."""


def switch_off(m: Any, listed: set[str], robot: Robot) -> None:
    """What is listed as left out, in a model of MuJoCo's."""
    import mujoco

    for words, names in SWITCHED_OFF.items():
        for name in names.split() if words in listed else ():
            getattr(m, name)[:] = 0
    if listed & {"collision shapes", "contact pairs", "flexible bodies"}:
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    if "forces of a fluid" in listed:
        m.opt.density = m.opt.viscosity = 0.0
    if "armature of free bodies and of balls between moving ones" in listed:
        left = [j for j in range(m.njnt) if m.jnt_type[j] < SCALAR and not is_ball_in_world(m, j)]
        m.dof_armature[np.isin(m.dof_jntid, left)] = 0.0
        for k in range(m.nactuator):
            if m.actuator_trntype[k] in AT_JOINT and m.actuator_trnid[k][0] in left:
                m.actuator_armature[k] = 0.0
    if "dampers and armatures of actuators over tendons" in listed:
        for name in ("armature", "damping", "dampingpoly"):
            getattr(m, f"actuator_{name}")[np.asarray(m.actuator_trntype) == mujoco.mjtTrn.mjTRN_TENDON] = 0.0
    if "actuators" in listed:
        without_other_actuators(m, robot)


class Fuzzed(Beside):
    """A file in ncgen and in MuJoCo, without what ncgen lists as left out, and with controls."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, motors=True, sensors=True)
        self.theirs.opt.disableflags = self.mujoco.MjModel.from_xml_path(str(path)).opt.disableflags
        self.listed, self.contradicts, self.values = kinds(self.model.left_out), False, 0
        if self._has_inexact_rates():
            self.known[:] = False
            self.known[[self.kernels.index[c.name] for e in self.relative.values() for c in e.components if not c.fixed]] = True
        switch_off(self.theirs, self.listed, self.robot)

    def _has_inexact_rates(self) -> bool:
        """Whether a slider comes after a ball of its body: `mj_jacDot` is off there, the accelerations of joints are not."""
        m = self.theirs
        after = [j for j in range(1, m.njnt) if m.jnt_type[j] == BALL + 1 and m.jnt_bodyid[j] == m.jnt_bodyid[j - 1]]
        return any(m.jnt_type[k] == BALL and m.jnt_bodyid[k] == m.jnt_bodyid[j] for j in after for k in range(j))

    def drive(self, rng: np.random.Generator) -> None:
        """Controls, and the inputs that they are."""
        numbers = {name_of_actuator(self.theirs, k): k for k in range(self.theirs.nactuator)}
        for actuator, own in zip(self.robot.actuators or (), self.model.inputs, strict=True):
            value = rng.normal()
            self.data.ctrl[self.theirs.actuator_ctrladr[numbers[actuator.name]]] = value
            self.p[list(self.model.numbers).index(own)] = value

    def worst(self, rng: np.random.Generator) -> float:
        """The largest error at some states."""
        self.drive(rng)
        if not np.any(self.theirs.eq_active0):
            return self.error(rng, STATES)
        worst = 0.0
        for _ in range(STATES):
            q, qd = self.close(*self.random(rng, 0.3))
            sizes = np.linalg.svd(self.data.efc_J.reshape(self.data.nefc, -1), compute_uv=False)
            nearly = (sizes > 1e-12) & (sizes < 1e-4)  # accelerations beside a singular position are not determined to 1e-9
            if np.max(np.abs(self.data.efc_pos), initial=0.0) > 1e-10 or np.any(nearly):
                self.contradicts = True
                return worst
            worst = max(worst, self.miss(q, qd))
        return worst

    def keyframes_apart(self) -> Iterator[str]:
        """What of the named starts is not what MuJoCo's keyframes are."""
        m = self.theirs
        inputs = dict(zip((each.name for each in self.robot.actuators or ()), self.model.inputs, strict=True))
        for number in range(m.nkey):
            name = m.key(number).name or f"key{number}"
            q, qd = self.state(m.key_qpos[number], m.key_qvel[number])
            start = self.model.starts[name]
            found = [[start[kind].get(c, 0.0) if kind in start else 0.0 for c in self.kernels.coordinates] for kind in ("q0", "qd0")]
            numbers = {name_of_actuator(m, k): m.actuator_ctrladr[k] for k in range(m.nactuator)}
            controls = {own: m.key_ctrl[number][numbers[each]] for each, own in inputs.items()}
            self.values += 2 * int(np.sum(self.known)) + len(controls) + 1
            right = [are_equal(mine[self.known], theirs[self.known]) for mine, theirs in zip(np.array(found), (q, qd), strict=True)]
            right += [start.get("inputs", {}) == controls, start.get("t0", 0.0) == m.key_time[number]]
            if not all(right):
                yield f"keyframe {name}: position, velocity, inputs, time are right: {right}"

    def sensors_apart(self, rng: np.random.Generator) -> Iterator[str]:
        """Outputs that are not MuJoCo's readings, and whether those that are left out are as many as is said."""
        mujoco, m, d, labels = self.mujoco, self.theirs, self.data, list(self.model.outputs)
        names = {m.sensor(s).name or f"sensor{s}": s for s in range(m.nsensor)}
        with_axes = {name: [f"{name}.{axis}" for axis in "xyz"] if m.sensor_dim[s] == 3 else [name] for name, s in names.items()}
        modelled = {name: s for name, s in names.items() if with_axes[name][0] in labels}
        said = next((parted(each)[1] for each in self.model.left_out if parted(each)[0] == SENSORS), 0)
        if said != m.nsensor - len(modelled):
            yield f"{said} sensors left out, of {m.nsensor} {len(modelled)} are modelled"
        for _ in range(STATES if modelled else 0):
            q, qd = (self.close if np.any(m.eq_active0) else self.state)(*self.random(rng, 0.3))
            mine = outputs_at(self.kernels, 0.0, q, qd, lagrange(self.kernels, q, qd, 0.0, self.p), self.p)
            d.flg_rnepost = 0
            for step in (mujoco.mj_sensorPos, mujoco.mj_sensorVel, mujoco.mj_sensorAcc):
                step(m, d)
            for name, s in modelled.items():
                found = np.array([mine[labels.index(label)] for label in with_axes[name]])
                reading = d.sensordata[m.sensor_adr[s] : m.sensor_adr[s] + m.sensor_dim[s]]
                self.values += len(found)
                if not are_equal(found, reading):
                    yield f"sensor {name}: {found} for {reading}"


def are_equal(mine: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether numbers agree, over 1 + the largest one."""
    return bool(np.all(np.abs(mine - theirs) <= WITHIN * (1 + np.max(np.abs(theirs), initial=0.0))))


def kinds(said: Iterable[str]) -> set[str]:
    """What is left out, without how often."""
    return {parted(each)[0] for each in said}


def motion(model: Any) -> np.ndarray:
    """Accelerations of MuJoCo's model at some states."""
    import mujoco

    data, rng, found = mujoco.MjData(model), np.random.default_rng(0), []
    for _ in range(STATES):
        mujoco.mj_resetData(model, data)
        mujoco.mj_integratePos(model, data.qpos, rng.normal(size=100)[: model.nv] * 0.1, 1.0)
        data.qvel[:], data.ctrl[:] = rng.normal(size=100)[: model.nv], rng.normal(size=100)[: model.nu]
        mujoco.mj_forward(model, data)
        found += data.qacc.tolist()
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Base:
    """What files are made from: its robot, its inputs, what is left out of it, and its accelerations without that.

    values: keyframes and sensors
    """

    robot: object
    values: object
    inputs: int
    listed: set[str]
    motion: np.ndarray

    @classmethod
    def of(cls, path: Path) -> Base:
        both, robot = Fuzzed(path), read_robot(path)
        return cls(what_moves(robot), values_of(robot), len(both.model.inputs), both.listed, motion(both.theirs))

    def is_motion(self, other: np.ndarray) -> bool:
        """Whether accelerations are the same."""
        return other.shape == self.motion.shape and are_equal(other, self.motion)


def what_moves(robot: Robot) -> object:
    """A robot without what does not move it, as something that can be compared."""
    return printed(replace(robot, name="", omitted=(), starts={}, sensors=()))


def values_of(robot: Robot) -> object:
    """Keyframes and sensors of a robot, as something that can be compared."""
    return printed((robot.starts, robot.sensors))


def judged(path: Path, base: Base, counts: Counter[str]) -> tuple[str, str]:
    """What became of a file, and why. counts: of values of keyframes and sensors that were compared, which are added to"""
    import mujoco

    try:
        robot = read_robot(path)
        if what_moves(robot) == base.robot and values_of(robot) == base.values:  # nothing to compile
            theirs = mujoco.MjModel.from_xml_path(str(path))
            listed = kinds(left(left(robot.omitted, "actuators", base.inputs), "sensors", len(robot.sensors)))
            switch_off(theirs, listed, robot)
            moves, error = motion(theirs), 0.0
            right = base.is_motion(moves)
        else:
            both = Fuzzed(path)
            moves, listed = motion(both.theirs), both.listed
            error = both.worst(np.random.default_rng(1)) if both.theirs.nv else 0.0
            if both.contradicts:
                return "of equalities that contradict each other, or are singular", ""
            right = error < WITHIN
            if both.theirs.nv and (apart := [*both.keyframes_apart(), *both.sensors_apart(np.random.default_rng(2))]):
                return "ignored", "; ".join(apart)
            counts["values of keyframes and sensors"] += both.values
    except NcgenError as refusal:
        return "refused", str(refusal)
    if not right:
        return "ignored", f"error {error:.0e}; left out: {', '.join(sorted(listed))}"
    if listed - base.listed:
        return "listed, and the rest checked", ""
    return ("without effect on the motion, checked" if base.is_motion(moves) else "modelled and checked"), ""


def drawn(count: int, seed: int, folder: Path, counts: Counter[str]) -> Iterator[tuple[str, str, str]]:
    """Draw files: what became of each, why, and its words. counts: of words and files, which are added to"""
    import mujoco

    apart, mjcf.compiled = mjcf.compiled, lambda path, text=None, files=(): mujoco.MjModel.from_xml_path(str(path))  # no process for each
    path = folder / "m.xml"
    draws = Draws(seed, counts, path)
    try:
        bases: dict[int, Base] = {}
        for _ in range(count):
            which, tree, said = draws.file()
            if which not in bases:
                path.write_text(BASES[which], encoding="utf-8")
                bases[which] = Base.of(path)
            path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
            counts["words"] += len(said)
            yield *judged(path, bases[which], counts), f"{'; '.join(said)} of file {which}"
    finally:
        mjcf.compiled = apart


def ignored_of_mjcf(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw files of MJCF: how many became what, and those in which a word was ignored."""
    counts, nothing = Counter[str](), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for word, why, said in drawn(count, seed, folder, counts):
            counts[word] += 1
            counts["files"] += 1
            if word == "ignored":
                nothing.append(f"{said}: {why}")
    return counts, nothing
