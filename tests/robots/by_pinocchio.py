"""What Pinocchio says of crane.urdf: run by hand where it is installed (pip install 'ncgen[peers]'), it writes crane.json beside itself.

Rates of a base that moves are brought to ncgen's: velocity of a point of the base and angular velocity, both in global axes. Pinocchio has
the velocity of the base's origin and the angular velocity in the base's axes, v = X v' with v' ncgen's; then M' = Xᵀ M X, and forces Xᵀ τ.
"""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).parent
POINT = np.array([0.1, 0.0, 0.3])
"""Of the base, by which ncgen says where it is: the point of its first joint."""


def state(model, rng, floating):
    """A random position, joint values by name, and the base's rotation and translation."""
    q, values = pin.neutral(model), {}
    for joint in range(1, model.njoints):
        kind, value = model.joints[joint], float(rng.uniform(-1.2, 1.2))
        if kind.nv == 1:
            values[model.names[joint]] = value
            q[kind.idx_q : kind.idx_q + kind.nq] = [value] if kind.nq == 1 else [np.cos(value), np.sin(value)]
    turn, shift = np.eye(3), np.zeros(3)
    if floating:
        quaternion = pin.Quaternion(pin.exp3(rng.uniform(-1, 1, 3)))
        turn, shift = quaternion.toRotationMatrix(), rng.uniform(-1, 1, 3)
        q[:3], q[3:7] = shift, quaternion.coeffs()
    return q, values, turn, shift


def record(floating, rng):
    file = str(HERE / "crane.urdf")
    model = pin.buildModelFromUrdf(file, pin.JointModelFreeFlyer()) if floating else pin.buildModelFromUrdf(file)
    data = model.createData()
    q, values, turn, shift = state(model, rng, floating)
    X = np.eye(model.nv)
    if floating:
        X[:3, :3], X[3:6, 3:6] = turn.T, turn.T
        X[:3, 3:6] = turn.T @ pin.skew(turn @ POINT)
    v, a, forces = (rng.normal(size=model.nv) for _ in range(3))  # ncgen's
    order = [model.names[j] for j in range(1, model.njoints) if model.joints[j].nv == 1]
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    # dX/dt v' enters the accelerations: v = X v', a = X a' + Ẋ v', by the rotation of the base
    w = X[3:6] @ v if floating else np.zeros(3)
    rate = np.zeros_like(X)
    if floating:
        rate[:3, :3] = rate[3:6, 3:6] = -pin.skew(w) @ turn.T
        rate[:3, 3:6] = -pin.skew(w) @ turn.T @ pin.skew(turn @ POINT) + turn.T @ pin.skew(np.cross(v[3:6], turn @ POINT))
    bias = X.T @ pin.rnea(model, data, q, X @ v, rate @ v)
    pin.forwardKinematics(model, data, q)
    pin.computeJointJacobians(model, data, q)
    hook = model.getJointId("swing")
    momentum = pin.computeCentroidalMomentum(model, data, q, X @ v)
    more = {
        "momentum": [*momentum.linear.tolist(), *momentum.angular.tolist()],
        "centre": pin.centerOfMass(model, data, q, X @ v).tolist(),
        "centre_jacobian": (pin.jacobianCenterOfMass(model, data, q) @ X).tolist(),
        "spatial": (pin.getJointJacobian(model, data, hook, pin.WORLD) @ X).tolist(),
        "kinetic": pin.computeKineticEnergy(model, data, q, X @ v),
        "potential": pin.computePotentialEnergy(model, data, q),
    }
    if not floating:
        slopes = pin.computeRNEADerivatives(model, data, q, v, a)
        more |= {"inverse_slopes": [part.tolist() for part in slopes[:2]]}
        slopes = pin.computeABADerivatives(model, data, q, v, forces)
        more |= {"forward_slopes": [part.tolist() for part in slopes]}
    return more | {
        "floating": floating, "values": values, "turn": turn.tolist(), "shift": shift.tolist(), "joints": order,
        "v": v.tolist(), "a": a.tolist(), "forces": forces.tolist(),
        "mass": (X.T @ M @ X).tolist(),
        "gravity": (X.T @ pin.computeGeneralizedGravity(model, data, q)).tolist(),
        "bias": bias.tolist(),
        "inverse": (X.T @ M @ X @ a + bias).tolist(),
        "forward": np.linalg.solve(X.T @ M @ X, forces - bias).tolist(),
        "jacobian": (pin.getJointJacobian(model, data, hook, pin.LOCAL_WORLD_ALIGNED) @ X).tolist(),
        "place": data.oMi[hook].translation.tolist(),
    }  # fmt: skip


if __name__ == "__main__":
    rng = np.random.default_rng(16)
    records = [record(floating, rng) for floating in (False, False, False, True, True, True)]
    (HERE / "crane.json").write_text(json.dumps({"pinocchio": pin.__version__, "states": records}, separators=(",", ":")) + "\n")
