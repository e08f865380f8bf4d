"""Compare Gepetto's parallel robots with Pinocchio: degrees of freedom where loops are closed, and how far they are from closing.

    python tests/robots/compare_parallel_robots.py FOLDER    # a clone of github.com/Gepetto/example-parallel-robots

Prints a line a robot: degrees of freedom by ncgen and by Pinocchio, the gap of the loops in Pinocchio's frames, seconds to load; or why it
is refused, with the least gap that steps by Pinocchio's Jacobians find from many starts, and which loops stay open by themselves.
"""

from __future__ import annotations

import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.closures import with_closures
from ncgen.exchange.robots.joint_values import motion
from ncgen.exchange.robots.parallel_robots import with_yaml

STARTS, STARTS_OF_ALL = 30, 10
"""Starts from which Pinocchio's steps look for positions in which one loop of a refused robot is closed, and all are."""

TURNS = {"X": pin.JointModelRX, "Y": pin.JointModelRY, "Z": pin.JointModelRZ}


def model_of(urdf: Path, kinds: dict[str, str]) -> pin.Model:
    """Pinocchio's model with joints changed as the YAML says, as the collection's own loader does it."""
    old, new = pin.buildModelFromUrdf(str(urdf)), pin.Model()
    for number in range(1, old.njoints):
        name, kind = old.names[number], kinds.get(old.names[number])
        parent, place = new.getJointId(old.names[old.parents[number]]), old.jointPlacements[number]
        if kind and kind.startswith("UJOINT"):
            parent, place = new.addJoint(parent, TURNS[kind[-2]](), place, f"{name}_first"), pin.SE3.Identity()
        turning = TURNS[kind[-1]]() if kind and kind.startswith("UJOINT") else pin.JointModelSpherical() if kind == "SPHERICAL" else None
        added = new.addJoint(parent, turning or old.joints[number], place, name)
        new.appendBodyToJoint(added, old.inertias[number], pin.SE3.Identity())
    for frame in list(old.frames)[1:]:
        new.addFrame(pin.Frame(frame.name, new.getJointId(old.names[frame.parentJoint]), frame.placement, frame.type), False)
    return new


def closing(model: pin.Model, pairs: list[list[str]], types: list[str], q: np.ndarray, fixed: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Gaps of the loops, and their Jacobian without the columns of joints that are fixed."""
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    gaps, rows = [], []
    for (first, second), kind in zip(pairs, types, strict=True):
        a, b = model.getFrameId(first), model.getFrameId(second)
        jacobian = pin.getFrameJacobian(model, data, b, pin.LOCAL_WORLD_ALIGNED) - pin.getFrameJacobian(
            model, data, a, pin.LOCAL_WORLD_ALIGNED
        )
        gaps.append(data.oMf[b].translation - data.oMf[a].translation)
        if kind.lower() == "6d":
            gaps.append(pin.log3(data.oMf[b].rotation @ data.oMf[a].rotation.T))
        rows.append(jacobian if kind.lower() == "6d" else jacobian[:3])
    return np.concatenate(gaps), np.delete(np.concatenate(rows), fixed, axis=1)


def least_gap(model: pin.Model, pairs: list[list[str]], types: list[str], fixed: list[int], starts: int) -> np.ndarray:
    """What gaps are left at the least sum of squares, by Levenberg's and Marquardt's steps from the neutral position and others around it,
    over the joints that move these frames."""
    rng, best = np.random.default_rng(0), np.array([np.inf])
    moving = np.any(closing(model, pairs, types, pin.randomConfiguration(model), [])[1], axis=0)
    moving[fixed] = False
    others = np.flatnonzero(~moving).tolist()
    for start in range(starts):
        away = rng.uniform(-2, 2, model.nv) * moving if start else np.zeros(model.nv)
        q, damping, relative = pin.integrate(model, pin.neutral(model), away), 1e-3, 1.0
        gaps, J = closing(model, pairs, types, q, others)
        while damping < 1e8 and np.abs(gaps).max() > 1e-12 and relative > 1e-10:
            step = np.zeros(model.nv)
            step[moving] = np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), -J.T @ gaps)
            trial = pin.integrate(model, q, step * min(1.0, 0.5 / np.abs(step).max()))
            new, changed = closing(model, pairs, types, trial, others)
            if new @ new < gaps @ gaps:
                relative = 1 - (new @ new) / (gaps @ gaps)
                q, gaps, J, damping = trial, new, changed, max(damping / 5, 1e-14)
            else:
                damping *= 4
        best = gaps if gaps @ gaps < best @ best else best
    return best


def following(model: pin.Model, urdf: Path) -> np.ndarray:
    """A row for each joint that mimics another one, over Pinocchio's joint velocities."""
    rows = []
    for joint in ET.parse(urdf).iter("joint"):
        if (mimic := joint.find("mimic")) is not None:
            own, other = (model.joints[model.getJointId(name)].idx_v for name in (joint.get("name", ""), mimic.get("joint", "")))
            row = np.zeros(model.nv)
            row[own], row[other] = 1.0, -float(mimic.get("multiplier", "1"))
            rows.append(row)
    return np.reshape(rows, (-1, model.nv))


def compare(table: Path) -> str:
    """The line of a robot."""
    import yaml

    urdf, says = next(table.parent.glob("*.urdf")), yaml.safe_load(table.read_text())
    kinds = dict(zip(says.get("joint_name", []), says.get("joint_type", []), strict=True))
    pairs, types = says["closed_loop"], says["type"]
    theirs = model_of(urdf, kinds)
    fixed = [theirs.joints[theirs.getJointId(name)].idx_v for name, kind in kinds.items() if kind == "FIXED"]
    begun = time.process_time()
    try:
        loaded = ncgen.load(urdf, loops=table)
    except ModelError as error:
        least = np.linalg.norm(least_gap(theirs, pairs, types, fixed, STARTS_OF_ALL))
        gaps = {pair[0]: least_gap(theirs, [pair], [kind], fixed, STARTS) for pair, kind in zip(pairs, types, strict=True)}
        alone = ", ".join(f"{name} {1e3 * np.linalg.norm(gap[:3]):.3g} mm" for name, gap in gaps.items() if np.abs(gap).max() > 1e-6)
        return f"refused: {error}; Pinocchio's least root of squares (m, rad) {least:.4f}, and of single loops without all others: {alone}"
    seconds = time.process_time() - begun
    ours = ncgen.freedom(ncgen.compile(loaded, "numpy")).dof
    q = pin.neutral(theirs)
    plain, loops = with_yaml(read_robot(urdf), table)
    for joint, old in zip(with_closures(plain, loops).joints, plain.joints, strict=True):
        if not theirs.existJointName(joint.name):
            continue
        model, turn = theirs.joints[theirs.getJointId(joint.name)], old.placement.rotation.T @ joint.placement.rotation
        if joint.kind == "spherical":
            q[model.idx_q : model.idx_q + 4] = pin.Quaternion(turn).coeffs()
        elif joint.kind == "universal":
            assert old.second is not None
            first = theirs.joints[theirs.getJointId(f"{joint.name}_first")]
            moved = turn @ old.second
            third = np.cross(old.axis, old.second)
            q[first.idx_q] = np.arctan2(moved @ third, moved @ old.second)
            rest = motion(old, np.array([q[first.idx_q], 0.0])).rotation.T @ turn
            q[model.idx_q] = np.arctan2(-(third @ rest @ old.axis), old.axis @ rest @ old.axis)
        elif model.nq == 2:
            q[model.idx_q : model.idx_q + 2] = np.cos(joint.start), np.sin(joint.start)
        elif model.nq == 1:
            q[model.idx_q] = joint.start
    gaps, J = closing(theirs, pairs, types, q, fixed)
    J = np.concatenate([J, np.delete(following(theirs, urdf), fixed, axis=1)])
    values = np.linalg.svd(J, compute_uv=False)
    freedom = J.shape[1] - int(np.sum(values > 1e-6 * values[0]))
    return f"{ours} and {freedom} degrees of freedom, gap {np.abs(gaps).max():.1e}, {seconds:.2f} s"


if __name__ == "__main__":
    for found in sorted(Path(sys.argv[1]).rglob("robot.yaml")):
        print(f"{found.parent.name}: {compare(found)}", flush=True)
