"""Orientation and angular velocity of bodies from natural coordinates (the paper's eqs 6-8).

X = [x₁ x₂ x₃] holds three directions of a body; A = X X₀⁻¹ is its rotation since the initial position, and
ω = ½ Σ xᵏ × ẋ_k with the reciprocal basis xᵏ. A body with two directions gets the third by a cross product.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import Element, Point, Spatial
from ncgen.model.rigid import NORMAL
from ncgen.model.singular_values import singular_values
from ncgen.solver.geometry import element, element_rate

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Direction: TypeAlias = tuple[Spatial, Point | None]
"""A vector, or a point and the one that the direction begins at."""

Evaluation: TypeAlias = Callable[[Element], np.ndarray]
"""What an element is at some positions, (…, 3)."""


def transformation(kernels: Kernels, body: str, q: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """A at positions q (…, n) in m and rad and parameters p (n_p,), shape (…, 3, 3); orthogonal as far as Φ = 0."""
    basis = _basis(kernels, body)
    initial = _columns(basis, lambda e: element(kernels, e, kernels.start(p), p))
    return _columns(basis, lambda e: element(kernels, e, q, p)) @ np.linalg.inv(initial)


def rotation(kernels: Kernels, body: str, q: ArrayLike, p: np.ndarray | None = None) -> Rotation:
    """The same as a scipy Rotation (the nearest orthogonal matrix)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(transformation(kernels, body, q, p))


def angular_velocity(kernels: Kernels, body: str, q: ArrayLike, qd: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """ω (rad/s) in global axes, shape (…, 3), at q (…, n) in m and rad, qd (…, n) in the same per second and parameters p (n_p,)."""
    basis = _basis(kernels, body)
    X = _columns(basis, lambda e: element(kernels, e, q, p))
    rate = _column_rates(basis, lambda e: element(kernels, e, q, p), lambda e: element_rate(kernels, e, qd))
    reciprocal = np.swapaxes(np.linalg.inv(X), -1, -2)
    return 0.5 * np.sum(np.cross(reciprocal, rate, axisa=-2, axisb=-2), axis=-2)


def _basis(kernels: Kernels, name: str) -> list[Direction]:
    """Directions of a body as (element, base point or None); the best three, or two where there are no more."""
    if name not in kernels.model.bodies:
        raise ModelError(f"{kernels.name} has no body {name}; it has {', '.join(kernels.model.bodies)}")
    body = kernels.model.bodies[name]
    points, vectors = body.points, body.vectors
    directions = [(p, points[0]) for p in points[1:]] + [(v, None) for v in vectors]
    initial = {d: _initial(d) for d in directions}
    if body.frame.planar and directions:
        # In the plane one direction is enough: the normal is the second, and it stands still.
        return [directions[0], (NORMAL, None)]
    for count in (3, 2):
        best = max(combinations(directions, count), key=lambda c: _volume([initial[d] for d in c]), default=None)
        if best and _volume([initial[d] for d in best]) > 1e-6:
            return list(best)
    raise ModelError(f"body {name}: one direction or none does not fix an orientation; give the body another point or vector")


def _initial(direction: Direction) -> np.ndarray:
    element, base = direction
    return element.initial - (base.initial if base else 0.0)


def _volume(directions: list[np.ndarray]) -> float:
    unit = [d / max(np.linalg.norm(d), 1e-300) for d in directions]
    return float(singular_values(np.array(unit))[-1])


def _directions(basis: list[Direction], value: Evaluation) -> list[np.ndarray]:
    return [value(element) - (value(base) if isinstance(base, Point) else 0.0) for element, base in basis]


def _columns(basis: list[Direction], position: Evaluation) -> np.ndarray:
    x = _directions(basis, position)
    if len(x) == 2:
        x.append(np.cross(x[0], x[1]))
    return np.stack(x, axis=-1)


def _column_rates(basis: list[Direction], position: Evaluation, rate: Evaluation) -> np.ndarray:
    x, v = _directions(basis, position), _directions(basis, rate)
    if len(v) == 2:
        v.append(np.cross(v[0], x[1]) + np.cross(x[0], v[1]))
    return np.stack(v, axis=-1)
