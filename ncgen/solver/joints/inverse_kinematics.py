"""Joint values that bring points and frames of bodies to places and rotations, by least squares within limits of joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ncgen.errors import ConvergenceError, ModelError, warn
from ncgen.model.singular_values import svd
from ncgen.model.values import MAX_NUMBER
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import array_of, rotation_of
from ncgen.solver.frames import transformation

if TYPE_CHECKING:
    from ncgen.solver.joints.joint_kinematics import JointKinematics

STARTS = 8
"""From how many joint values it is begun, within 1 rad or m of the start."""

TARGET_TOLERANCE = 1e-9
"""What may be left of a position, over the mechanism's size, and of a rotation."""

ROUNDING = 1e-15
"""What is left, likewise, where a search ends."""

AT_LIMIT = 1e-8
"""How near to its limit a joint is at it (rad or m): as near as targets are reached."""

MOTION_ROUNDING = 1e-12
"""What a joint at rate 1 moves, over the mechanism's size, where that is rounding."""

MAX_STEPS, MAX_JOINT_STEP = 200, 1.0
"""Most steps of a search from one start, and how far a joint goes in one (rad or m)."""

LEAST_GAIN = 1e-8
"""Fraction of the squares of what is left below which a step changes nothing more: the target is out of reach."""

OPEN_LOOP_RESIDUAL = 1e3
"""What is left, over the mechanism's size, where loops do not close."""

SERIES_ANGLE = 1e-4
"""Angle (rad) below which (θ − sin θ)/θ³ is 1/6 to half of the digits, and the quotient would lose as many."""

Target: TypeAlias = "tuple[ArrayLike | None, ArrayLike | None]"
"""Rotation (3, 3) and position (3,) in m, either of which may be None."""


class Carried(Protocol):
    """Something that moves with a body, as a frame of a link does."""

    name: str

    def pose(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]: ...

    def jacobian(self, q: ArrayLike) -> np.ndarray: ...


class _PointOfBody:
    """A point with the rotation of its body since the initial position."""

    def __init__(self, space: JointKinematics, name: str, body: str | None) -> None:
        self.space, self.name, self.body = space, name, body
        self._element, self._turns = space.point(name), space.tree.links[space.link(name, body)].body.name

    def pose(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        q = np.asarray(q)
        return transformation(self.space.kernels, self._turns, q, self.space.p), self.space.element(self._element, q)

    def jacobian(self, q: ArrayLike) -> np.ndarray:
        return self.space.jacobian(self.name, q, self.body)


@dataclass(frozen=True, eq=False)
class Aim:
    """What is to be where. rotation (3, 3), position (3,) in m: as it shall be, None for any"""

    carried: Carried
    rotation: np.ndarray | None
    position: np.ndarray | None


def aims_of(
    space: JointKinematics, point: str | Mapping[str, Target], position: ArrayLike | None, rotation: ArrayLike | None, body: str | None
) -> list[Aim]:
    """As `JointSpace.inverse_kinematics` takes them. Raises ModelError for what is no point or frame, no position or no rotation."""
    if isinstance(point, Mapping):
        if not (position is None and rotation is None and body is None):
            raise ModelError("position, rotation and body are those of a point; of frames give {frame: (rotation, position)} alone")
        return _aims_of_frames(space, point)
    if isinstance(point, str) and point not in space.kernels.model.elements and point in space.kernels.model.frames and body is None:
        return _aims_of_frames(space, {point: (rotation, position)})
    target, carried = _target_position(position, "position"), _PointOfBody(space, point, body)
    return [Aim(carried, None if rotation is None else rotation_of(rotation, "rotation"), target)]


def _aims_of_frames(space: JointKinematics, targets: Mapping[str, Target]) -> list[Aim]:
    """Raises ModelError for what is no frame, or no target of one."""
    aims = []
    for name, target in targets.items():
        frame, label = space.frame(name), f"frame {argument_checks.echo(name)}"
        if not (isinstance(target, (tuple, list)) and len(target) == 2 and any(half is not None for half in target)):
            raise ModelError(
                f"{label}: give (rotation (3, 3), position (3,) in m), one of which may be None, and not {argument_checks.echo(target)}"
            )
        turn, position = target
        rotation = None if turn is None else rotation_of(turn, f"{label}: rotation")
        aims.append(Aim(frame, rotation, None if position is None else _target_position(position, f"{label}: position")))
    if not aims:
        raise ModelError(f"{space.kernels.name}: nothing to reach; give a point and a position, or {{frame: (rotation, position)}}")
    return aims


def _target_position(argument: ArrayLike | None, label: str) -> np.ndarray:
    position = array_of([] if argument is None else argument, (3,), label)
    if np.max(np.abs(position)) > MAX_NUMBER:
        raise ModelError(f"{label}: {np.max(np.abs(position)):g} m given; {MAX_NUMBER:g} m is the farthest, check the unit")
    return position


def values_for(space: JointKinematics, aims: Sequence[Aim], start: np.ndarray, limits: bool = True) -> dict[str, float]:
    """Values of the joints by name that reach all aims. start: values of all joints (n,); limits: of joints are kept.

    Warns of joints that are at a limit. Raises ConvergenceError with what is left of the aim that is missed most, and such joints.
    """
    search = _Search(space, aims, limits)
    best: tuple[float, np.ndarray] | None = None
    beyond = ""
    for k in range(STARTS):  # from the start itself, then from beside it
        offsets = np.cos(k * np.arange(1, space.n + 1)) if k else 0.0
        x, left = search.descended(start + offsets)
        if np.max(np.abs(left)) <= TARGET_TOLERANCE:
            if beyond := search.beyond(x):
                continue
            if held := search.held(x):
                warn(f"{space.kernels.name}: {held}")
            return dict(zip(space.rates, x.tolist(), strict=True))
        if best is None or left @ left < best[0]:
            best = float(left @ left), x
    if beyond or best is None:
        raise ConvergenceError(f"{space.kernels.name}: {beyond}; begin elsewhere (start), or ignore limits (limits=False)")
    held = search.held(best[1])
    more = f", and {held}; begin elsewhere (start), or ignore limits (limits=False)" if held else "; begin elsewhere (start), or nearer"
    raise ConvergenceError(f"{space.kernels.name}: {search.missed(best[1])}{more}")


def _balls(space: JointKinematics) -> Iterator[tuple[list[int], list[int]]]:
    """Of every joint that turns about all axes, and whose values are all independent: their numbers, and the tree's rates of the parent."""
    from ncgen.solver.joints.joint_loops import JointsInLoops

    free = space.free.tolist() if isinstance(space, JointsInLoops) else list(range(space.n))
    for link, rates in zip(space.tree.links, space.tree.rates, strict=True):
        turning = [k for screw, k in zip(link.screws, rates, strict=True) if screw.point is not None]
        if len(turning) == 3 and set(turning) <= set(free):
            yield [free.index(k) for k in turning], [] if link.parent is None else list(space.tree.paths[link.parent])


class _Search:
    """What is left of all aims, without units, and how it changes with the joints. limits: of joints are kept"""

    def __init__(self, space: JointKinematics, aims: Sequence[Aim], limits: bool = False) -> None:
        self.space, self.aims = space, aims
        self.limits = dict(space.kernels.model.limits) if limits else {}
        for name, (low, high) in self.limits.items():
            if low > high:
                raise ModelError(f"joint {name}: its lower limit {low:g} is beyond the upper one {high:g}; say limits=False")
        ends = [self.limits.get(name, (-np.inf, np.inf)) for name in space.rates]
        self.low, self.high = (np.array(each, dtype=float) for each in zip(*ends, strict=True))
        self.size = float(np.max(space.kernels.column_sizes))
        self.count = sum((0 if aim.position is None else 3) + (0 if aim.rotation is None else 9) for aim in aims)
        self._balls = list(_balls(space))
        self._known: tuple[np.ndarray, np.ndarray | None] = np.full(space.n, np.nan), None

    def _placed(self, x: np.ndarray) -> np.ndarray | None:
        """Natural coordinates; None where loops do not close."""
        if not np.array_equal(self._known[0], x):
            try:
                self._known = x.copy(), self.space.placed(x)
            except ConvergenceError:
                self._known = x.copy(), None
        return self._known[1]

    def descended(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values of the joints (n,) and what is left there (count,), where damped Gauss-Newton steps from x end.

        Joints at a limit that would go beyond it are held; all others go on (Nocedal & Wright, Numerical Optimization, 2006, sections 10.3
        and 16.7).
        """
        x = np.clip(x, self.low, self.high)
        left, damping = self.left(x), 1e-3
        for _ in range(MAX_STEPS):
            derivative = self.slope(x)
            uphill = derivative.T @ left
            free = ~((x <= self.low) & (uphill > 0) | (x >= self.high) & (uphill < 0))
            if np.max(np.abs(left)) <= ROUNDING or not np.any(free):
                break
            across, sizes, along = svd(derivative[:, free])
            downhill, most = across.T @ left, float(np.max(sizes, initial=0.0))
            while damping <= 1e6:
                step = np.zeros_like(x)
                step[free] = -along.T @ (sizes / (sizes**2 + damping * most**2 + np.finfo(float).tiny) * downhill)
                trial = np.clip(x + step * min(1.0, MAX_JOINT_STEP / max(float(np.max(np.abs(step))), 1e-30)), self.low, self.high)
                new = self.left(trial)
                if new @ new < left @ left:
                    break
                damping *= 10
            else:
                break
            gain, x, left, damping = 1 - (new @ new) / (left @ left), trial, new, max(damping / 10, 1e-15)
            if gain < LEAST_GAIN and np.max(np.abs(left)) > TARGET_TOLERANCE:
                break
        return x, left

    def held(self, x: np.ndarray) -> str:
        """Which of the joints that move what is to be moved are at a limit; empty where there is none."""
        sizes = np.max(np.abs(self.slope(x)), axis=0)
        at_limits = [
            f"joint {name} is at its {'lower' if value - low < high - value else 'upper'} limit {value:.6g}"
            for name, value, low, high, size in zip(self.space.rates, x, self.low, self.high, sizes, strict=True)
            if low < high and size > MOTION_ROUNDING and not low + AT_LIMIT < value < high - AT_LIMIT
        ]
        return ", ".join(at_limits[:3]) + (f" and {len(at_limits) - 3} more are at theirs" if len(at_limits) > 3 else "")

    def beyond(self, x: np.ndarray) -> str:
        """The first joint that others determine and that is beyond a limit."""
        q = self._placed(x)
        for name, (low, high) in self.limits.items():
            value = low if q is None or name in self.space.rates else float(q[self.space.kernels.index[name]])
            if not low - TARGET_TOLERANCE <= value <= high + TARGET_TOLERANCE:
                return f"joint {name}, which others determine, is at {value:.6g} and has the limits {low:.6g} and {high:.6g}"
        return ""

    def left(self, x: np.ndarray) -> np.ndarray:
        """Shape (count,): of positions over the mechanism's size, of rotations as they are."""
        if (q := self._placed(x)) is None:  # a shorter step is taken
            return np.full(self.count, OPEN_LOOP_RESIDUAL)
        parts = []
        for aim in self.aims:
            turn, position = aim.carried.pose(q)
            parts += [] if aim.position is None else [(position - aim.position) / self.size]
            parts += [] if aim.rotation is None else [(turn - aim.rotation).T.ravel()]
        return np.concatenate(parts)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Shape (count, n)."""
        if (q := self._placed(x)) is None:
            return np.zeros((self.count, self.space.n))
        parts = []
        for aim in self.aims:
            jacobian = aim.carried.jacobian(q)
            parts += [] if aim.position is None else [jacobian[:3] / self.size]
            if aim.rotation is not None:
                parts += [np.cross(jacobian[3:].T, column).T for column in aim.carried.pose(q)[0].T]
        rows = np.concatenate(parts)
        return rows @ self._rates(x, q) if self._balls else rows

    def _rates(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Rates of the joints where values x change by 1 (n, n): those of balls and free bodies are rotation vectors θ.

        Such a joint turns what it carries by exp θ next to its parent, in global axes: ω = J θ̇ + (exp θ − 1) ω_parent, with the left
        Jacobian J = 1 + (1 − cos |θ|)/|θ|² θ× + (|θ| − sin |θ|)/|θ|³ θ×θ×.
        """
        space, independent, others = self.space, np.eye(len(x)), np.zeros((len(x), len(x)))
        for where, path in self._balls:
            vector = x[where]
            angle, across = float(np.linalg.norm(vector)), np.cross(vector, np.eye(3)).T
            third = (angle - np.sin(angle)) / angle**3 if angle > SERIES_ANGLE else 1 / 6
            independent[np.ix_(where, where)] = np.eye(3) + np.sinc(angle / (2 * np.pi)) ** 2 / 2 * across + third * across @ across
            if path:
                turning = space.screws(q)[path, :3].T @ space._spread(q)[0][path]
                others[where] = (Rotation.from_rotvec(vector).as_matrix() - np.eye(3)) @ turning
        return np.linalg.solve(np.eye(len(x)) - others, independent)

    def missed(self, x: np.ndarray) -> str:
        """Who does not get there, and what is left: metres and rad."""
        left, misses = self.left(x).tolist(), []
        for aim in self.aims:
            position, left = (left[:3], left[3:]) if aim.position is not None else ([], left)
            turn, left = (left[:9], left[9:]) if aim.rotation is not None else ([], left)
            angle = 2 * np.arcsin(min(1.0, np.linalg.norm(turn) / np.sqrt(8)))  # |A − B|² = 8 sin²(θ/2) of rotations that are θ apart
            remainders = [f"{np.linalg.norm(position) * self.size:.3g} m"] * bool(position) + [f"{angle:.3g} rad"] * bool(turn)
            misses.append((max(map(abs, position + turn)), f"{aim.carried.name} does not get there, {' and '.join(remainders)} are left"))
        return max(misses)[1]
