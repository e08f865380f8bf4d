"""Compare Gepetto's parallel robots with Pinocchio: degrees of freedom where loops are closed, and how far they are from closing.

    python tests/robots/compare_parallel_robots.py FOLDER    # a clone of github.com/Gepetto/example-parallel-robots

Prints a line a robot: degrees of freedom by ncgen and by Pinocchio, the gap of the loops in Pinocchio's frames, seconds to load; or why it
is refused, with the least gap that Pinocchio's Jacobians find, and which loops stay open by themselves, without all others.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.closures import motion, with_closures
from ncgen.exchange.robots.parallel_robots import with_yaml

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


def least_gap(model: pin.Model, pairs: list[list[str]], types: list[str], fixed: list[int]) -> float:
    """The largest gap where Gauss-Newton steps from the neutral position end."""
    q, damping = pin.neutral(model), 1e-6
    gaps, J = closing(model, pairs, types, q, fixed)
    while damping < 1e6 and np.abs(gaps).max() > 1e-12:
        step = np.zeros(model.nv)
        step[[k for k in range(model.nv) if k not in fixed]] = np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), -J.T @ gaps)
        trial = pin.integrate(model, q, step * min(1.0, 0.5 / np.abs(step).max()))
        new, changed = closing(model, pairs, types, trial, fixed)
        better = new @ new < gaps @ gaps
        q, gaps, J = (trial, new, changed) if better else (q, gaps, J)
        damping = max(damping / 10, 1e-14) if better else damping * 10
    return float(np.abs(gaps).max())


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
        gaps = {pair[0]: least_gap(theirs, [pair], [kind], fixed) for pair, kind in zip(pairs, types, strict=True)}
        alone = ", ".join(f"{name} {gap:.1e}" for name, gap in gaps.items() if gap > 1e-6)
        least = least_gap(theirs, pairs, types, fixed)
        return f"refused: {error}; Pinocchio's least gap {least:.2e}, and of single loops without all others: {alone}"
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
    values = np.linalg.svd(J, compute_uv=False)
    freedom = J.shape[1] - int(np.sum(values > 1e-6 * values[0]))
    return f"{ours} and {freedom} degrees of freedom, gap {np.abs(gaps).max():.1e}, {seconds:.2f} s"


if __name__ == "__main__":
    for found in sorted(Path(sys.argv[1]).rglob("robot.yaml")):
        print(f"{found.parent.name}: {compare(found)}", flush=True)
