"""Actuators of MJCF: those over joints and fixed tendons whose force is affine in control, length and rate, without states of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ncgen.exchange.robots.mjcf_compiled import Compiled
from ncgen.exchange.robots.mjcf_fields import AT_JOINT, NO_ACTUATION, NO_CLAMPS, OVER_JOINT, OVER_TENDON, SCALAR, is_disabled, off
from ncgen.exchange.robots.robot import Actuator

FIXED, AFFINE = 0, 1
"""MuJoCo's numbers of gains and biases: a constant (a bias: none), and one that is affine in length and rate."""


def actuators(model: Compiled, joints: Sequence[str]) -> tuple[Actuator, ...]:
    """Those that are modelled; joints: names by MuJoCo's numbers. All others are counted as left out."""
    m = model
    if off(m, NO_ACTUATION):
        return ()
    kept_actuators = []
    for k in range(m.nactuator):
        shares = shares_of(m, "actuator", k, joints)
        if shares is not None and _is_affine(m, k) and not is_disabled(m, k) and not _is_bounded(m, k):
            kept_actuators.append(_actuator(m, k, shares))
    return tuple(kept_actuators)


def _is_affine(m: Compiled, k: int) -> bool:
    """Whether the force is affine, of one control, and now."""
    plain = m.actuator_dyntype[k] == 0 and m.actuator_plugin[k] < 0 and m.actuator_delay[k] == 0 and m.actuator_ctrlnum[k] == 1
    return bool(plain and m.actuator_gaintype[k] in (FIXED, AFFINE) and m.actuator_biastype[k] in (FIXED, AFFINE))


def shares_of(m: Compiled, whose: str, number: int, joints: Sequence[str]) -> dict[str, float] | None:
    """Shares of joints in the length of a "joint", "tendon" or "actuator"; None where that is no sum of coordinates."""
    if whose == "joint":
        return {joints[number]: 1.0} if m.jnt_type[number] >= SCALAR else None
    if whose == "actuator":
        kind, target = int(m.actuator_trntype[number]), int(m.actuator_trnid[number][0])
        gear = float(m.actuator_gear[m.actuator_outadr[number]][0])
        inner = shares_of(m, "joint" if kind in AT_JOINT else "tendon", target, joints) if kind in (*AT_JOINT, OVER_TENDON) else None
        return None if inner is None else {joint: gear * coefficient for joint, coefficient in inner.items()}
    shares = dict[str, float]()
    for w in range(m.tendon_adr[number], m.tendon_adr[number] + m.tendon_num[number]):
        if int(m.wrap_type[w]) != OVER_JOINT:
            return None
        joint = joints[int(m.wrap_objid[w])]
        shares[joint] = shares.get(joint, 0.0) + float(m.wrap_prm[w])
    return shares


def _is_bounded(m: Compiled, k: int) -> bool:
    """Whether the forces of all actuators of a tendon are bounded together."""
    return int(m.actuator_trntype[k]) == OVER_TENDON and bool(m.tendon_actfrclimited[m.actuator_trnid[k][0]])


def _actuator(m: Compiled, k: int, shares: dict[str, float]) -> Actuator:
    gain = _factors(m.actuator_gainprm[k], m.actuator_gaintype[k] == AFFINE)
    bias = _factors(m.actuator_biasprm[k], True) if m.actuator_biastype[k] == AFFINE else (0.0, 0.0, 0.0)
    control = int(m.actuator_ctrladr[k])
    return Actuator(
        name=m.actuator(k).name or f"actuator{k}",
        shares=shares,
        gain=gain,
        bias=bias,
        control=_range(m.actuator_ctrlrange[control]) if m.actuator_ctrllimited[control] and not off(m, NO_CLAMPS) else None,
        force=_range(m.actuator_forcerange[k]) if m.actuator_forcelimited[k] else None,
    )


def _factors(prm: np.ndarray, is_affine: bool) -> tuple[float, float, float]:
    a, b, c = map(float, prm[:3])
    return (a, b, c) if is_affine else (a, 0.0, 0.0)


def _range(limits: np.ndarray) -> tuple[float, float]:
    low, high = map(float, limits)
    return low, high


def controls(m: Compiled, k: int) -> dict[str, float]:
    """{actuator: its control} in a keyframe, of those with one control."""
    single = (i for i in range(m.nactuator) if m.actuator_ctrlnum[i] == 1)
    return {m.actuator(i).name or f"actuator{i}": float(m.key_ctrl[k][int(m.actuator_ctrladr[i])]) for i in single}
