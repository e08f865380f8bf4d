"""Equalities of MJCF: connections and welds of bodies or sites close loops, those of joints and of sums of joints are rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, NoReturn

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.mjcf_compiled import Compiled
from ncgen.exchange.robots.mjcf_fields import NO_EQUALITIES, OVER_JOINT, without_constraints
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Coupling, Joint, Mimic

CONNECT, WELD, JOINTS, TENDONS = 0, 1, 2, 3
"""MuJoCo's numbers of equalities; all others are of flexible bodies, which are left out."""

BODY = 1
"""MuJoCo's number of bodies among objects; what else connections join are sites."""

FRAME_TOLERANCE = 1e-6
"""How far apart two frames may stand that are one (m and rad): more than files and compiler round. Else joints move until they are."""


class Equalities(NamedTuple):
    """Joints that close loops, placed in the world; who follows whom; rows over joints; joints whose frames are apart."""

    loops: tuple[Joint, ...]
    followers: Mapping[str, Mimic]
    rows: tuple[Coupling, ...]
    apart: tuple[Apart, ...]


class Apart(NamedTuple):
    """A joint that closes a loop, placed at its parent's frame, and the frame of its child that shall be there, both in the world."""

    joint: Joint
    child: Placement


def equalities(
    model: Compiled, bodies: Sequence[str], joints: Sequence[str], placements: Mapping[str, Placement], where: str
) -> Equalities:
    """What a file's equalities are. bodies, joints: names by MuJoCo's numbers; placements: {body: its frame in the world}"""
    reader = _Reader(model, bodies, joints, placements, where)
    if not without_constraints(model, NO_EQUALITIES):
        for e in np.flatnonzero(model.eq_active0).tolist():
            reader.read(e)
    return Equalities(tuple(reader.loops), reader.followers, tuple(reader.rows), tuple(reader.apart))


class _Reader:
    def __init__(
        self, model: Compiled, bodies: Sequence[str], joints: Sequence[str], placements: Mapping[str, Placement], where: str
    ) -> None:
        self.m, self.bodies, self.joints, self.placements, self.where = model, bodies, joints, placements, where
        self.loops: list[Joint] = []
        self.apart: list[Apart] = []
        self.followers: dict[str, Mimic] = {}
        self.rows: list[Coupling] = []

    def read(self, e: int) -> None:
        m, kind = self.m, int(self.m.eq_type[e])
        name = m.equality(e).name or f"equality{e}"
        first, second = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        data = [float(x) for x in m.eq_data[e]]
        if kind in (CONNECT, WELD):
            self._join(e, name, kind)
        elif kind in (JOINTS, TENDONS):
            shares = self._over_joint if kind == JOINTS else self._over_tendon
            self._couple(name, shares(first, name), shares(second, name) if second >= 0 else {}, data[:5])

    # -- of joints -----------------------------------------------------------------------------

    def _over_joint(self, joint: int, name: str) -> dict[str, float]:
        return {self.joints[joint]: 1.0}

    def _over_tendon(self, tendon: int, name: str) -> dict[str, float]:
        """Shares of joints in a tendon's length."""
        m, shares = self.m, dict[str, float]()
        for k in range(m.tendon_adr[tendon], m.tendon_adr[tendon] + m.tendon_num[tendon]):
            if int(m.wrap_type[k]) != OVER_JOINT:
                self._refuse(f"equality {name} couples tendons through points; only those over joints are read")
            joint = self.joints[int(m.wrap_objid[k])]
            shares[joint] = shares.get(joint, 0.0) + float(m.wrap_prm[k])
        return shares

    def _couple(self, name: str, first: dict[str, float], other: dict[str, float], factors: list[float]) -> None:
        """One length is a polynomial of another, both from where they begin."""
        offset, *powers = factors
        if not any(powers[1:]):  # one sum is enough
            for joint, coefficient in other.items():
                first[joint] = first.get(joint, 0.0) - powers[0] * coefficient
            other, powers = {}, []
            if len(first) == 2 and self._follows(first, offset):
                return
        zeros = {joint: self._begins(joint) for joint in (*first, *other)}
        self.rows.append(
            Coupling(
                name=name, shares=first, offset=offset, where=self.where, others=other, zeros=zeros, powers=tuple(powers) if other else ()
            )
        )

    def _follows(self, shares: dict[str, float], offset: float) -> bool:
        """Whether the first of two joints, whose sum is an offset from where they begin, now follows the other one."""
        (follower, coefficient), (followed, other) = shares.items()
        if not coefficient or follower in self.followers:
            return False
        factor = -other / coefficient
        begins = self._begins(follower) - factor * self._begins(followed)
        self.followers[follower] = Mimic(followed, factor, offset / coefficient + begins)
        return True

    def _begins(self, joint: str) -> float:
        """The value of a joint where the model begins."""
        return float(self.m.qpos0[self.m.jnt_qposadr[self.joints.index(joint)]])

    # -- of bodies -----------------------------------------------------------------------------

    def _join(self, e: int, name: str, kind: int) -> None:
        """A ball or a weld between two frames; where the model begins they may be apart."""
        (first, one), (second, other) = self._frames(e, kind)
        joint = Joint(name=name, kind="fixed" if kind == WELD else "spherical", parent=first, child=second, placement=one, where=self.where)
        gap = float(np.linalg.norm(one.position - other.position))
        turned = float(np.linalg.norm(one.rotation - other.rotation)) if kind == WELD else 0.0
        if max(gap, turned) > FRAME_TOLERANCE:
            self.apart.append(Apart(joint, other))
        else:
            self.loops.append(joint)

    def _frames(self, e: int, kind: int) -> tuple[tuple[str, Placement], tuple[str, Placement]]:
        """Two bodies and the frames on them, in the world, that an equality holds together."""
        m, first, second, data = self.m, int(self.m.eq_obj1id[e]), int(self.m.eq_obj2id[e]), self.m.eq_data[e]
        if int(m.eq_objtype[e]) != BODY:
            return self._site(first), self._site(second)
        one, other = self.bodies[first], self.bodies[second]
        if kind == CONNECT:
            frame, opposite = Placement(position=np.array(data[:3])), Placement(position=np.array(data[3:6]))
        else:
            frame = Placement.of_quaternion(data[3:6], data[6:10])
            opposite = Placement(position=np.array(data[:3]))
        return (one, self.placements[one] @ frame), (other, self.placements[other] @ opposite)

    def _site(self, site: int) -> tuple[str, Placement]:
        body = self.bodies[int(self.m.site_bodyid[site])]
        return body, self.placements[body] @ Placement.of_quaternion(self.m.site_pos[site], self.m.site_quat[site])

    def _refuse(self, problem: str) -> NoReturn:
        raise ModelError(f"{self.where}: {problem}")
