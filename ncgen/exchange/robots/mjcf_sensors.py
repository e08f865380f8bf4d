"""Sensors of MJCF: those of frames in the world, of joints, fixed tendons and actuators over them; all others are counted as left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ncgen.exchange.robots.mjcf_actuators import shares_of
from ncgen.exchange.robots.mjcf_compiled import Compiled
from ncgen.exchange.robots.mjcf_fields import NO_SENSORS, off
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Sensor

KINDS = {
    1: "accelerometer", 2: "velocimeter", 3: "gyro", 6: "magnetometer", 26: "position", 28: "x axis", 29: "y axis", 30: "z axis",
    31: "velocity", 32: "angular velocity", 33: "acceleration", 34: "angular acceleration", 45: "clock",
}  # fmt: skip
"""{MuJoCo's number of a sensor in a frame, or of time: kind}."""

LENGTHS = {9: ("joint", "length"), 10: ("joint", "rate"), 11: ("tendon", "length"), 12: ("tendon", "rate"), 13: ("actuator", "length"),
           14: ("actuator", "rate")}  # fmt: skip
"""{MuJoCo's number: whose length, and whether it is the length or its rate}."""

KINDS_WITHOUT_CUTOFF = ("x axis", "y axis", "z axis")
"""Kinds whose readings have no cutoff."""

BODY, LINK, GEOM, SITE, CAMERA = 1, 2, 5, 6, 7
"""MuJoCo's numbers of objects that have a frame: of a body's inertia, of the body itself, and of what is on it."""


def sensors(model: Compiled, joints: Sequence[str]) -> tuple[Sensor, ...]:
    """Those that are modelled, where the file does not switch all of them off; joints: names by MuJoCo's numbers."""
    if off(model, NO_SENSORS):
        return ()
    return tuple(filter(None, (_sensor(model, s, joints) for s in range(model.nsensor))))


def _sensor(m: Compiled, s: int, joints: Sequence[str]) -> Sensor | None:
    kind, name, cutoff = int(m.sensor_type[s]), m.sensor(s).name or f"sensor{s}", float(m.sensor_cutoff[s])
    if m.sensor_delay[s] != 0 or np.any(m.sensor_interval[s]) or m.sensor_reftype[s] != 0:
        return None
    if kind in LENGTHS:
        whose, quantity = LENGTHS[kind]
        shares = shares_of(m, whose, int(m.sensor_objid[s]), joints)
        return None if shares is None else Sensor(name=name, kind=quantity, of=shares, cutoff=cutoff)
    if kind not in KINDS:
        return None
    x, y, z = map(float, m.opt.magnetic)
    return Sensor(
        name=name, kind=KINDS[kind], of=_key(m, s), cutoff=0.0 if KINDS[kind] in KINDS_WITHOUT_CUTOFF else cutoff, field=(x, y, z)
    )


def _key(m: Compiled, s: int) -> str:
    """The name of a sensor's frame."""
    return f"{int(m.sensor_objtype[s])} {int(m.sensor_objid[s])}"


def frames_of(m: Compiled) -> dict[int, dict[str, Placement]]:
    """{body: {name of a sensor's frame: where it is in the body}}."""
    frames: dict[int, dict[str, Placement]] = {}
    for s in range(m.nsensor):
        if int(m.sensor_type[s]) in KINDS:
            for body, frame in _frame(m, int(m.sensor_objtype[s]), int(m.sensor_objid[s])):
                frames.setdefault(body, {})[_key(m, s)] = frame
    return frames


def sites_of(m: Compiled) -> dict[int, dict[str, Placement]]:
    """{body: {name of a site: where it is in the body}}."""
    sites: dict[int, dict[str, Placement]] = {}
    for number in range(m.nsite):
        if name := m.site(number).name:
            for body, frame in _frame(m, SITE, number):
                sites.setdefault(body, {})[name] = frame
    return sites


def _frame(m: Compiled, kind: int, number: int) -> Iterator[tuple[int, Placement]]:
    """The body of an object and its frame there, if it has one."""
    if kind == BODY:
        yield number, Placement.of_quaternion(m.body_ipos[number], m.body_iquat[number])
    elif kind == LINK:
        yield number, Placement()
    elif kind in (GEOM, SITE, CAMERA):
        prefix = {GEOM: "geom", SITE: "site", CAMERA: "cam"}[kind]
        position, turn, body = (getattr(m, f"{prefix}_{field}")[number] for field in ("pos", "quat", "bodyid"))
        yield int(body), Placement.of_quaternion(position, turn)
