"""A body as a cloud of point masses: its inertia by sums, its motion by velocities of points.

`Cloud` knows masses and places; `Attached` expresses its points in the body's basis elements,
r_P = Σ w_k e_k with constant weights (natural coordinates, 2.1), and gets energies, forces and the mass matrix
from the points' own velocities and accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Cloud:
    """Point masses (kg), shape (k,), at `places` (m), shape (k, 3), in the body's initial position."""

    masses: np.ndarray
    places: np.ndarray

    @classmethod
    def random(cls, rng, count: int = 8) -> Cloud:
        return cls(rng.uniform(0.5, 2.0, count), rng.normal(size=(count, 3)))

    @classmethod
    def on_line(cls, rng, start, end, count: int = 6) -> Cloud:
        shares = rng.uniform(-0.5, 1.5, (count, 1))
        return cls(rng.uniform(0.5, 2.0, count), start + shares * (end - start))

    @classmethod
    def at(cls, rng, place, count: int = 6) -> Cloud:
        return cls(rng.uniform(0.5, 2.0, count), np.tile(np.asarray(place, dtype=float), (count, 1)))

    @classmethod
    def like(cls, mass, com, inertia) -> Cloud:
        """Six points with given mass, centre and inertia tensor: a pair ±s on each principal axis, 2 (m/6) s² = ∫ρ s²."""
        spread, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
        arms = np.sqrt(3.0 * np.maximum(spread, 0.0) / mass) * axes
        return cls(np.full(6, mass / 6), np.asarray(com) + np.concatenate([arms.T, -arms.T]))

    @property
    def mass(self) -> float:
        return float(self.masses.sum())

    @property
    def com(self) -> np.ndarray:
        return self.masses @ self.places / self.mass

    @property
    def inertia(self) -> np.ndarray:
        """Σ m (d·d 1 − d dᵀ) about the centre of mass."""
        d = self.places - self.com
        squares = np.einsum("ki,ki->k", d, d)
        return np.einsum("k,k,ij->ij", self.masses, squares, np.eye(3)) - np.einsum("k,ki,kj->ij", self.masses, d, d)

    def kinetic(self, velocities) -> float:
        return 0.5 * float(self.masses @ np.einsum("ki,ki->k", velocities, velocities))

    def potential(self, places, gravity) -> float:
        return -float(self.masses @ (places @ gravity))


@dataclass(frozen=True)
class RigidMotion:
    """Where a rigid motion takes points and directions of the initial position, and how fast."""

    rotation: np.ndarray
    shift: np.ndarray
    omega: np.ndarray
    velocity: np.ndarray

    @classmethod
    def random(cls, rng, anchor, free, planar: bool = False) -> RigidMotion:
        """A motion that moves the point `anchor` along its free axes only; `free` holds a 1 or 0 per axis."""
        rotation = _turn(rng.uniform(-3.0, 3.0)) if planar else _rotation(*rng.normal(size=(2, 3)))
        omega = rng.normal(size=3) * (Z if planar else 1.0)
        arm, free = rotation @ anchor, np.asarray(free, dtype=float)
        shift, velocity = free * rng.normal(size=(2, 3))
        return cls(rotation, anchor + shift - arm, omega, velocity - np.cross(omega, arm))

    def place(self, points):
        return points @ self.rotation.T + self.shift

    def velocity_of(self, points):
        return np.cross(self.omega, points @ self.rotation.T) + self.velocity

    def turned(self, directions):
        return directions @ self.rotation.T

    def rate_of(self, directions):
        return np.cross(self.omega, self.turned(directions))


def _turn(angle) -> np.ndarray:
    """The rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation(a, b) -> np.ndarray:
    """The rotation whose axes are a, b and a × b, made orthonormal."""
    x = a / np.linalg.norm(a)
    z = np.cross(x, b) / np.linalg.norm(np.cross(x, b))
    return np.column_stack([x, np.cross(z, x), z])


class Attached:
    """A cloud carried by basis elements: `points` points first, then vectors, shape (k, 3) in the initial position.

    planar: a body of the plane z = const on two points
    """

    def __init__(self, cloud: Cloud, elements, points: int, planar: bool = False):
        self.cloud, self.points, self.planar = cloud, points, planar
        self.count = len(elements)
        full = self._completed(np.asarray(elements, dtype=float))
        is_point = np.arange(len(full)) < points
        target = np.column_stack([cloud.places, np.ones(len(cloud.masses))])
        self.weights = np.linalg.lstsq(np.column_stack([full, is_point]).T, target.T, rcond=None)[0].T
        assert np.allclose(self.place(elements), cloud.places, rtol=0, atol=1e-12), "the basis does not reach all points"

    def _completed(self, e):
        """The elements and the directions that follow from them: (r_j − r_i) × u, or the normal and z × (r_j − r_i)."""
        if self.planar:
            return np.vstack([e, np.cross(Z, e[1] - e[0]), Z])
        return np.vstack([e, np.cross(e[1] - e[0], e[2])]) if len(e) == 3 else e

    def place(self, e):
        """Where the points are when the elements are at e."""
        return self.weights @ self._completed(np.asarray(e, dtype=float))

    def velocity(self, e, de):
        """Their velocities: positions are at most quadratic in e, so a central difference of step 1 is exact."""
        return (self.place(e + de) - self.place(e - de)) / 2

    def drift(self, e, de):
        """Their accelerations while the elements move straight on, ë = 0."""
        return self.place(e + de) - 2 * self.place(e) + self.place(e - de)

    def jacobian(self, e):
        """∂(places)/∂(elements), shape (points of the cloud, 3, 3 k)."""
        steps = np.eye(3 * self.count).reshape(-1, self.count, 3)
        return np.stack([self.velocity(e, step) for step in steps], axis=-1)

    def kinetic(self, e, de) -> float:
        return self.cloud.kinetic(self.velocity(e, de))

    def potential(self, e, gravity) -> float:
        return self.cloud.potential(self.place(e), gravity)

    def mass_matrix(self, e):
        """Σ m CᵀC."""
        C = self.jacobian(e)
        return np.einsum("k,kia,kib->ab", self.cloud.masses, C, C)

    def force(self, e, de, gravity):
        """Σ m Cᵀ(g − drift): d'Alembert's principle point by point."""
        pull = gravity - self.drift(e, de)
        return np.einsum("k,kia,ki->a", self.cloud.masses, self.jacobian(e), pull)
