"""Closing loops: two frames of bodies meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.model import arithmetic
from ncgen.model.bodies import Body, BodyFrame
from ncgen.model.elements import AXES, Point
from ncgen.model.joints import Joints
from ncgen.model.rows import Owner
from ncgen.model.values import Scalar, as_sympy

CLOSINGS = ("weld", "hinge", "ball", "point")
"""How two frames can meet."""


WELD = [(np.eye(3)[i], np.eye(3)[j]) for i, j in ((0, 1), (1, 2), (2, 0))]
"""Directions of two frames that are perpendicular to each other where the frames are parallel."""


class _End(NamedTuple):
    """Where a loop is closed: a point of a body, and the axes of a frame there as columns (3, 3)."""

    body: Body
    point: Point
    rotation: np.ndarray


def _hinge(axis: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """An axis of one frame, and the two directions of the other that it stays perpendicular to."""
    along = arithmetic.unit(axis)
    first = arithmetic.across(along)
    return [(along, first), (along, np.cross(along, first))]


class LoopClosing(Joints):
    """The part of a model that closes loops."""

    def close(
        self,
        frame_a: Point | BodyFrame | str,
        frame_b: Point | BodyFrame | str,
        kind: str,
        *,
        axis: Sequence[float] = (0.0, 0.0, 1.0),
        name: str = "",
    ) -> None:
        """Close a loop: two frames meet from now on.

        A robot is assembled at once, before anything is added to its model: elements taken from it before are no longer its own, and
        `assembled` lists what moved. Other models begin as they were drawn, and are assembled when they run.

        Parameters
        ----------
        frame_a, frame_b : Point, BodyFrame or str
            Names of frames of a robot's file (`frames`); in other models frames of bodies, or points.
        kind : str
            "weld" (the frames coincide), "hinge" (their origins and the axis do), "ball" or "point" (their origins do).
        axis : sequence of float, shape (3,)
            Of a hinge, the same in both frames.
        name : str
            Name of the joint in messages. Default: the names of both ends.

        Raises
        ------
        ModelError
            For a loop that cannot close, with its gap, and for one that changes nothing.
        """
        if kind not in CLOSINGS:
            raise ModelError(f"close: the kind {shown(kind)} is not known; give {', '.join(CLOSINGS)}")
        ends = frame_a, frame_b
        label = name or "-".join(end.body if isinstance(end, BodyFrame) else getattr(end, "name", str(end)) for end in ends)
        if not arithmetic.norm(np.asarray(axis, dtype=float)) > 0:
            raise ModelError(f"close {label}: its axis is {shown(axis)}; give a direction of three numbers")
        if self.closing is not None:
            vars(self).update(vars(self.closing(self, ends, kind, axis, label)))
            return
        a, b = (self._end(end, label, kind) for end in ends)
        if a.body is b.body or a.point is b.point:
            raise ModelError(f"close {label}: both ends belong to one body, so it changes nothing; leave it out")
        owner, planar = Owner("joint", f"close {label}", (a.body.name, b.body.name), kind), any(e.body.frame.planar for e in (a, b))
        for k in range(2 if planar else 3):
            self.constrain(a.point.components[k].symbol - b.point.components[k].symbol, f"{label}.{AXES[k]}", owner)
        turns = {"hinge": [] if planar else _hinge(np.asarray(axis, dtype=float)), "weld": WELD[:1] if planar else WELD}.get(kind, [])
        for first, second in turns:
            one, other = (self._along(e, d) for e, d in ((a, first), (b, second)))
            self.constrain(sum(x * y for x, y in zip(one, other, strict=True)), f"{label}, directions", owner)

    def _end(self, end: Point | BodyFrame | str, label: str, kind: str) -> _End:
        """A body, its point and its rotation where a loop is closed."""
        frame = self.frames.get(end) if isinstance(end, str) else end
        if isinstance(frame, Point):
            body = next((body for body in (*self.bodies.values(), self.ground) if frame in body.points), None)
            if body is None and frame.fixed:
                body = self.ground
            if body is None or kind not in ("ball", "point"):
                raise ModelError(f"close {label}: point {frame.name} {'has no axes' if body else 'is on no body'}; give a BodyFrame")
            return _End(body, frame, np.eye(3))
        body = None if frame is None else self.ground if frame.body == self.ground.name else self.bodies.get(frame.body)
        if frame is None or body is None:
            raise ModelError(f"close {label}: {shown(end)} is no frame of a body; give a point, or BodyFrame(body, rotation, position)")
        point = self.attach_point(body, self.free_name(f"{body.name}.closing"), np.asarray(frame.position, dtype=float).tolist())
        return _End(body, point, np.asarray(frame.rotation, dtype=float))

    def _along(self, end: _End, direction: np.ndarray) -> list[Scalar]:
        """The components of a direction of an end's frame that moves with its body."""
        now = arithmetic.without_rounding(end.rotation @ direction)
        if end.body is self.ground:
            return [as_sympy(x) for x in now]
        terms = self.direction_of(end.body, now, "across").terms
        return [sum(as_sympy(weight) * element.components[k].symbol for weight, element in terms) for k in range(3)]
