"""Joint values that bring a point of a body to a place, and the body to a rotation, by least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, ModelError
from ncgen.model.values import LARGEST
from ncgen.solver.frames import transformation
from ncgen.solver.given import array_of, rotation_of

if TYPE_CHECKING:
    from ncgen.solver.joints.joint_space import JointSpace

STARTS = 8
"""From how many joint values it is begun, within 1 rad or m of the start."""

REACHED = 1e-9
"""What may be left of a place, over the mechanism's size, and of a rotation."""

FAR = 1e3
"""What is left, over the mechanism's size, where loops do not close."""


def values_for(
    space: JointSpace, point: str, place: ArrayLike, rotation: ArrayLike | None, body: str | None, start: np.ndarray
) -> dict[str, float]:
    """As `JointSpace.inverse_kinematics`; start: values of all joints (n,)."""
    target = array_of(place, (3,), "place")
    if np.max(np.abs(target)) > LARGEST:
        raise ModelError(f"place: {np.max(np.abs(target)):g} m given; {LARGEST:g} m is the farthest, check the unit")
    aim = _Aim(space, point, body, target, None if rotation is None else rotation_of(rotation, "rotation"))
    jacobian: Any = aim.slope  # a function may stand there, though its type says a word
    best: Any = None
    for k in range(STARTS):  # from the start itself, then from beside it
        aside = np.cos(k * np.arange(1, space.n + 1)) if k else 0.0
        found = scipy.optimize.least_squares(aim.left, start + aside, jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if best is None or found.cost < best.cost:
            best = found
        if np.max(np.abs(best.fun)) <= REACHED:
            return dict(zip(space.rates, best.x.tolist(), strict=True))
    rest = float(np.max(np.abs(best.fun)))
    what = f"{rest * aim.size:.3g} m" if rotation is None else f"{rest:.3g} of the mechanism's size or of a turn"
    raise ConvergenceError(f"{space.kernels.name}: {point} does not get there, {what} are left; begin elsewhere (start), or nearer")


class _Aim:
    """What is left of a place and of a rotation, without units, and how it changes with the joints."""

    def __init__(self, space: JointSpace, point: str, body: str | None, place: np.ndarray, rotation: np.ndarray | None) -> None:
        self.space, self.point, self.place, self.rotation = space, point, place, rotation
        self.element, self.body = space.point(point), space.tree.links[space.link(point, body)].body.name
        self.size = float(np.max(space.kernels.column_sizes))

    def left(self, x: np.ndarray) -> np.ndarray:
        try:
            q = self.space.placed(x)
        except ConvergenceError:  # loops do not close there: a shorter step is taken
            return np.full(3 if self.rotation is None else 12, FAR)
        off = (self.space.element(self.element, q) - self.place) / self.size
        return off if self.rotation is None else np.concatenate([off, (self._turned(q) - self.rotation).T.ravel()])

    def slope(self, x: np.ndarray) -> np.ndarray:
        try:
            q = self.space.placed(x)
        except ConvergenceError:
            return np.zeros((3 if self.rotation is None else 12, self.space.n))
        jacobian = self.space.jacobian(self.point, q, self.body)
        moved = jacobian[:3] / self.size
        if self.rotation is None:
            return moved
        return np.concatenate([moved, *(np.cross(jacobian[3:].T, column).T for column in self._turned(q).T)])

    def _turned(self, q: np.ndarray) -> np.ndarray:
        return transformation(self.space.kernels, self.body, q, self.space.p)
