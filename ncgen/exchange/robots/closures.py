"""Joint values at which a robot's loops are closed, found before there is a model.

Loops are closed by Levenberg's and Marquardt's damped Gauss-Newton steps over the motions of the joints (Nocedal & Wright, Numerical
Optimization, 2006, section 10.3), beginning where all joints are at 0, so joints move as little as they need to. Joints that mimic others
follow them on the way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.joint_values import TURNS, added, motion, moved, rotation_vector, screws
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Robot, refused
from ncgen.model.singular_values import svd

GAP_ROUNDING = 1e-12
"""Gaps below this, over the robot's size or in rad, are rounding."""

DIGITS = 1e-4
"""Gaps up to this, over the robot's size or in rad, are the last digits of a file: they stay where nothing closes better."""

STEPS, STARTS = 300, 24
"""Most steps from one start, and starts: the first at 0, others at random joint values, the same ones every time."""

N_EQUAL_STARTS = 2
"""Starts that end with the same gap as another one, after which it is the least."""

MIN_DECREASE = 1e-9
"""A step that takes less than this fraction off the sum of squares is the last one: a least gap has been reached."""

TRIALS, IDLE = 3, 1e-9
"""Random joint values at which a loop is looked at, and the gap, over the robot's size or in rad, below which it is closed there."""

MAX_JOINT_STEP = 0.5
"""Largest step of a joint (rad or m)."""

HEIGHTS = {"spherical": 3}
"""Equations of kinds of loops, where there are not six."""

Frames: TypeAlias = dict[str, tuple[np.ndarray, np.ndarray]]
"""{link: rotation (3, 3) and position (3,) in m, in the root's frame}."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Closure:
    """A loop: a frame of a link that stands where a frame of another link is.

    kind: "fixed" (frames coincide), "spherical" (their origins do), "revolute" (origins and axes do), "prismatic" (axes of both lie on one
        line, without turning); axis (3,): in both frames
    """

    name: str
    kind: str
    parent: str
    child: str
    on_parent: Placement
    on_child: Placement
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    where: str = ""


def closures_of(robot: Robot) -> list[Closure]:
    """The robot's own loops, which are closed where all joints are at 0. Joints must be ordered."""
    frames = robot.frames(Placement())
    return [
        Closure(
            name=loop.name,
            kind=loop.kind,
            parent=loop.parent,
            child=loop.child,
            on_parent=frames[loop.parent].inverse() @ loop.placement,
            on_child=frames[loop.child].inverse() @ loop.placement,
            axis=loop.axis,
            where=loop.where,
        )
        for loop in robot.loops
    ]


def with_closures(robot: Robot, closures: Sequence[Closure]) -> Robot:
    """The robot with these loops in place of its own, where they are closed. Joints must be ordered.

    Raises ModelError naming the loop that stays open, with its gap.
    """
    assembly = _Assembly(robot, closures).solved()
    frames = assembly.frames(Placement())
    loops = []
    for number, each in enumerate(closures):
        new = Joint(name=each.name, kind=each.kind, parent=each.parent, child=each.child, axis=each.axis, where=each.where)
        loop = robot.loops[number] if number < len(robot.loops) else new
        has_moved = assembly.joints != robot.joints or loop is new
        loops.append(replace(loop, placement=frames[each.parent] @ each.on_parent) if has_moved else loop)
    return replace(assembly, loops=tuple(loops))


def refuse_idle(robot: Robot) -> None:
    """Raise ModelError naming a loop of a robot that is closed wherever the joints are. Joints must be ordered."""
    if robot.loops:
        _Assembly(robot, closures_of(robot)).refuse_idle()


def report(robot: Robot, values: Mapping[str, np.ndarray]) -> list[tuple[str, float, str]]:
    """(joint, how far it was moved, rad or m) of values by joints' names, without those that stayed."""
    moved = []
    for joint in robot.joints:
        x = values.get(joint.name, np.zeros(0))
        match joint.kind:
            case "spherical":
                motions = [(float(np.linalg.norm(x)), "rad")]
            case "floating":
                motions = [(float(np.linalg.norm(x[:3])), "m"), (float(np.linalg.norm(x[3:])), "rad")]
            case kind:
                motions = [(float(each), "m" if kind == "prismatic" else "rad") for each in x]
        moved += [(joint.name, amount, unit) for amount, unit in motions if abs(amount) > GAP_ROUNDING]
    return moved


class _Assembly:
    """Closures as equations of joint values x. Balls have rotation vectors, multiplied on at every step, free bodies a place and one."""

    def __init__(self, robot: Robot, closures: Sequence[Closure]) -> None:
        self.robot, self.closures = robot, closures
        self.begins = {joint.name: joint.start for joint in robot.joints}
        self.free = [joint for joint in robot.joints if TURNS[joint.kind] and not joint.mimic and joint.kind not in ("planar", "screw")]
        self.followers = [
            joint for joint in robot.joints if joint.mimic and joint.mimic.joint in self.begins and joint.kind in ("revolute", "prismatic")
        ]
        counts = [TURNS[joint.kind] for joint in self.free]
        self.starts = dict(zip((joint.name for joint in self.free), np.cumsum([0, *counts[:-1]]), strict=True)) if counts else {}
        self.n = sum(counts)
        self.paths_to_parent = [self._path(each.parent) for each in closures]
        self.paths_to_child = [self._path(each.child) for each in closures]
        origins = np.array([frame.position for frame in robot.frames(Placement()).values()])
        self.size = float(np.ptp(origins, axis=0).max()) or 1.0

    def solved(self) -> Robot:
        """The robot with its loops closed. Raises ModelError naming the loop that stays open, with its gap."""
        gap, values = self.least()
        if not gap < DIGITS:
            raise self._open(values)
        turns = {joint.name for joint in self.free if joint.kind == "revolute"}
        least = {
            name: np.remainder(x + np.pi, 2 * np.pi) - np.pi if name in turns and abs(x[0]) > np.pi else x for name, x in values.items()
        }
        self.refuse_idle(values)
        return replace(moved(self.robot, least), assembled=(*self.robot.assembled, *report(self.robot, least)))

    def least(self) -> tuple[float, dict[str, np.ndarray]]:
        """The least gap, over the robot's size or in rad, that was found from several starts, and the values of joints there."""
        generator, best, values, same = np.random.default_rng(1), math.inf, dict[str, np.ndarray](), 0
        for start in range(STARTS):
            scale = 0.3 * (1 + start // 4) if start else 0.0
            gap, changes = self._descend(self._begin(generator.standard_normal(self.n) * scale))
            same += abs(gap - best) < 1e-6 * gap
            if gap < best * (1 - 1e-6) - GAP_ROUNDING:
                best, values = gap, changes
            if best < DIGITS or same == N_EQUAL_STARTS:
                break
        return best, values

    def refuse_idle(self, values: Mapping[str, np.ndarray] | None = None) -> None:
        """Raise ModelError naming a loop that is closed wherever the joints are: it changes nothing."""
        if not self.n:
            return
        generator = np.random.default_rng(2)
        gaps = np.zeros(len(self.closures))
        for _ in range(TRIALS):
            step = generator.standard_normal(self.n)
            frames = self._frames(self._begin(step) if values is None else self._stepped(values, step))
            gaps = np.maximum(gaps, [float(np.max(np.abs(self._gap(each, frames)))) for each in self.closures])
        moves = {joint.name for joint in self.robot.joints if TURNS[joint.kind]}
        for each, gap, *ends in zip(self.closures, gaps, self.paths_to_parent, self.paths_to_child, strict=True):
            if gap < IDLE and moves & (ends[0] ^ ends[1]):  # links that are fixed to each other are told so later
                raise refused(each.where, f"joint {each.name} changes nothing: its links meet wherever the joints are; leave it out")

    def _begin(self, x: np.ndarray) -> dict[str, np.ndarray]:
        values = {joint.name: np.zeros(TURNS[joint.kind]) for joint in self.free}
        return self._stepped(values, x)

    def _stepped(self, values: Mapping[str, np.ndarray], step: np.ndarray) -> dict[str, np.ndarray]:
        """Values after a step, those of followers with them."""
        changes = {}
        for joint in self.free:
            start = self.starts[joint.name]
            change, old = step[start : start + TURNS[joint.kind]], values[joint.name]
            changes[joint.name] = added(joint, old, change)
        for joint in self._in_order_of_following():
            assert joint.mimic is not None
            moved_by = changes.get(joint.mimic.joint, np.zeros(1))
            changes[joint.name] = joint.mimic.factor * (self.begins[joint.mimic.joint] + moved_by) + joint.mimic.offset - joint.start
        return changes

    def _in_order_of_following(self) -> Iterable[Joint]:
        """Followers after those that they follow; those in a circle last."""
        waiting, known = list(self.followers), set(self.starts)
        while waiting:
            ready = [joint for joint in waiting if joint.mimic and joint.mimic.joint in known] or waiting
            known |= {joint.name for joint in ready}
            yield from ready
            waiting = [joint for joint in waiting if joint not in ready]

    def _descend(self, values: dict[str, np.ndarray]) -> tuple[float, dict[str, np.ndarray]]:
        """The gap, over the robot's size, and the values where the steps end."""
        damping, frames = 1e-6, self._frames(values)
        residual, is_flat = self._residual(frames), False
        for _ in range(STEPS):
            if np.max(np.abs(residual), initial=0.0) < GAP_ROUNDING or damping > 1e6 or is_flat:
                break
            left, singular, right = svd(self._jacobian(frames))
            while damping <= 1e6:
                scaled = singular / (singular**2 + damping * max(singular.max(initial=0.0), 1e-30) ** 2)
                step = -right.T @ (scaled * (left.T @ residual))
                trial = self._stepped(values, step * min(1.0, MAX_JOINT_STEP / max(np.abs(step).max(initial=0.0), 1e-30)))
                moved_frames = self._frames(trial)
                new = self._residual(moved_frames)
                if new @ new < residual @ residual:
                    is_flat = bool(new @ new > (1 - MIN_DECREASE) * (residual @ residual))
                    values, frames, residual, damping = trial, moved_frames, new, max(damping / 10, 1e-15)
                    break
                damping *= 10
        return float(np.max(np.abs(residual), initial=0.0)), values

    def _frames(self, values: Mapping[str, np.ndarray]) -> Frames:
        """Rotation and position of every link in the root's frame."""
        frames: Frames = {self.robot.root: (np.eye(3), np.zeros(3))}
        for joint in self.robot.joints:
            x = values.get(joint.name)
            frame = _after(frames[joint.parent], joint.placement)
            frames[joint.child] = frame if x is None else _after(frame, motion(joint, x))
        return frames

    def _residual(self, frames: Frames) -> np.ndarray:
        return np.concatenate([np.zeros(0), *(self._gap(each, frames) for each in self.closures)])

    def _gap(self, each: Closure, frames: Frames) -> np.ndarray:
        """How far a closure is open: metres over the robot's size, and rad; in the frame of the parent."""
        turn, shift = _between(each, frames)
        distance = shift / self.size
        match each.kind:
            case "spherical":
                return distance
            case "revolute":
                return np.concatenate([distance, np.cross(each.axis, turn @ each.axis)])
            case "prismatic":
                return np.concatenate([distance - (distance @ each.axis) * each.axis, rotation_vector(turn)])
            case _:
                return np.concatenate([distance, rotation_vector(turn)])

    def _jacobian(self, frames: Frames) -> np.ndarray:
        """How the residual changes with a step, but for the curvature of rotations that are still open."""
        J = np.zeros((len(self._residual(frames)), self.n))
        for joint in self.free:
            for k, (axis, origin) in enumerate(screws(joint, frames[joint.child])):
                self._add_column(J[:, self.starts[joint.name] + k], joint, axis, origin, frames)
        for follower in self._in_order_of_following():
            if (leader := self._leader(follower)) is not None:
                ((axis, origin),) = screws(follower, frames[follower.child])
                column = np.zeros(len(J))
                self._add_column(column, follower, axis, origin, frames)
                J[:, self.starts[leader[0]]] += leader[1] * column
        return J

    def _leader(self, follower: Joint) -> tuple[str, float] | None:
        """The free joint that a follower depends on, and its factor; None in a circle, or where that is no hinge or slider."""
        by_name, factor, joint = {each.name: each for each in self.robot.joints}, 1.0, follower
        for _ in range(len(by_name)):
            if joint.mimic is None:
                return (joint.name, factor) if joint.kind in ("revolute", "prismatic") else None
            if joint.mimic.joint not in by_name:
                return None
            factor, joint = factor * joint.mimic.factor, by_name[joint.mimic.joint]
        return None

    def _add_column(self, column: np.ndarray, joint: Joint, axis: np.ndarray, origin: np.ndarray | None, frames: Frames) -> None:
        """Add the change of all gaps where a joint turns about an axis through a point, or slides along it (no point)."""
        row = 0
        for each, on_a, on_b in zip(self.closures, self.paths_to_parent, self.paths_to_child, strict=True):
            height = HEIGHTS.get(each.kind, 6)
            if (joint.name in on_a) != (joint.name in on_b):
                sign = 1.0 if joint.name in on_b else -1.0
                across, _ = _after(frames[each.parent], each.on_parent)
                _, end = _after(frames[each.child], each.on_child)
                distance = across.T @ (axis if origin is None else np.cross(axis, end - origin)) * (sign / self.size)
                turn = np.zeros(3) if origin is None else sign * (across.T @ axis)
                if each.kind == "revolute":
                    turn = np.cross(each.axis, np.cross(turn, _between(each, frames)[0] @ each.axis))
                elif each.kind == "prismatic":
                    distance = distance - (distance @ each.axis) * each.axis
                column[row : row + height] += np.concatenate([distance, turn])[:height]
            row += height

    def _path(self, link: str) -> frozenset[str]:
        """Names of joints that carry a link."""
        above, carriers = {joint.child: joint for joint in self.robot.joints}, set()
        while (joint := above.get(link)) is not None:
            carriers.add(joint.name)
            link = joint.parent
        return frozenset(carriers)

    def _open(self, values: Mapping[str, np.ndarray]) -> ModelError:
        """The refusal: with the loop that stays open most without all others, or with them where each closes by itself."""
        alone = [self._alone(each) for each in self.closures] if len(self.closures) > 1 else []
        least = [(*other.least(), other) for other in alone]
        gap, joint_values, other = max(least, key=lambda each: each[0], default=(0.0, values, self))
        return self._refusal(values) if gap < DIGITS else other._refusal(joint_values, ", even without the other loops")

    def _alone(self, each: Closure) -> _Assembly:
        """One of the loops, over the joints that carry its ends and those that they follow."""
        carrying, known = self._path(each.parent) | self._path(each.child), frozenset[str]()
        children = {joint.name: joint.child for joint in self.robot.joints}
        while carrying != known:
            known = carrying
            followed = {joint.mimic.joint for joint in self.followers if joint.name in known and joint.mimic}
            carrying = known.union(*(self._path(children[name]) for name in followed))
        joints = tuple(joint for joint in self.robot.joints if joint.name in known)
        held = {self.robot.root, *(joint.child for joint in joints)}
        links = {name: link for name, link in self.robot.links.items() if name in held}
        assembly = _Assembly(replace(self.robot, links=links, joints=joints), [each])
        assembly.size = self.size
        return assembly

    def _refusal(self, values: Mapping[str, np.ndarray], which: str = "") -> ModelError:
        """With the loop that stays open most at values of the joints."""
        frames = self._frames(values)
        worst = max(self.closures, key=lambda each: float(np.max(np.abs(self._gap(each, frames)))))
        turn, shift = _between(worst, frames)
        distance, turned = (
            float(np.linalg.norm(shift)),
            "" if worst.kind == "spherical" else f" and {np.linalg.norm(rotation_vector(turn)):.3g} rad",
        )
        gap = f"{distance:.3g} m" if distance >= 1 else f"{1e3 * distance:.3g} mm"
        return refused(
            worst.where,
            f"loop {worst.name} cannot close{which}: its frames stay {gap}{turned} apart, wherever the joints are; "
            "correct a length, or close it by a ball",
        )


def _after(frame: tuple[np.ndarray, np.ndarray], placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """A placement in a frame, in plain floating point: the assembled robot is placed by `Placement` again."""
    turn, shift = frame
    return turn @ placement.rotation, shift + turn @ placement.position


def _between(each: Closure, frames: Frames) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and position of the child's frame in the parent's."""
    (turn, start), (other, end) = _after(frames[each.parent], each.on_parent), _after(frames[each.child], each.on_child)
    return turn.T @ other, turn.T @ (end - start)
