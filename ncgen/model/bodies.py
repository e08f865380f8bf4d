"""Bodies: the elements that move together, and their inertia.

Inertia is given as in Table 6 of the paper: mass, centre of mass and inertia tensor about it, with axes
parallel to the global ones, all in the initial position.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.elements import Point, Spatial, Vector
from ncgen.model.rigid import Frame
from ncgen.model.values import is_number

TRIANGLE = 1e-12
"""Slack, relative to the trace, in the triangle inequalities of an inertia tensor."""


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass (kg), centre of mass (m, global, initial position), inertia tensor about it (kg m², 3×3), and its basis.

    `basis` are the points and vectors whose velocities carry the kinetic energy: one point; two points
    (a bar); two points and a vector; or four elements. The mass may be a parameter, which then scales the
    tensor's part too only if the user writes it so.
    """

    mass: object
    com: np.ndarray
    tensor: np.ndarray
    basis: tuple[Spatial, ...] | None = None


@dataclass(eq=False)
class Body:
    """A rigid body: its points and vectors, and its inertia if it has mass.

    rigid: whether ncgen chooses the rows that keep it together; frame: the base those rows are written in
    """

    name: str
    points: list[Point] = field(default_factory=list)
    vectors: list[Vector] = field(default_factory=list)
    inertia: Inertia | None = None
    rigid: bool = True
    frame: Frame = None

    def __repr__(self):
        return f"body {self.name}"

    def copy(self) -> Body:
        """A body of its own with the same elements."""
        frame = replace(self.frame, directions=list(self.frame.directions))
        return replace(self, points=list(self.points), vectors=list(self.vectors), frame=frame)

    @property
    def elements(self) -> list[Spatial]:
        return self.points + self.vectors

    @property
    def basis(self) -> tuple[Spatial, ...]:
        """The elements that carry the inertia: those chosen, else four independent ones, else what there is."""
        return self.inertia.basis or choose_basis(self)


def check_inertia(name: str, mass, com, tensor) -> np.ndarray:
    """The inertia tensor as a symmetric 3×3 array, or a ModelError that says what makes it impossible.

    One number is the moment about z of a flat body in the plane z = const. A body's planar inertia tensor ½ tr(I) 1 − I = ∫ρ d dᵀ must be positive semidefinite; for the principal
    moments these are the triangle inequalities.
    """
    try:
        tensor = np.asarray(tensor, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"body {name}: the inertia {tensor!r} is not made of numbers; give one number, three, or 3×3") from None
    if tensor.ndim == 0:
        tensor = tensor * np.array([0.5, 0.5, 1.0])
    tensor = np.diag(tensor) if tensor.shape == (3,) else tensor
    if tensor.shape != (3, 3) or np.shape(com) != (3,):
        raise ModelError(
            f"body {name}: the inertia tensor has shape {tensor.shape} and the centre of mass {np.shape(com)}; "
            "give one number (planar), (3,) or (3, 3), and (3,)"
        )
    if not (np.isfinite(tensor).all() and np.isfinite(com).all()):
        raise ModelError(f"body {name}: inertia or centre of mass has an entry that is not a finite number; correct it")
    if is_number(mass) and not (np.isfinite(mass) and mass >= 0):
        raise ModelError(f"body {name}: the mass is {mass:g} kg; give a positive number")
    if not np.allclose(tensor, tensor.T, rtol=1e-12, atol=0):
        raise ModelError(f"body {name}: the inertia tensor is not symmetric; its off-diagonal entries must be equal in pairs")
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -TRIANGLE * abs(moments[2]) or moments[0] + moments[1] < moments[2] * (1 - TRIANGLE):
        low, middle, high = moments
        raise ModelError(
            f"body {name}: no body has principal moments of inertia {low:g}, {middle:g}, {high:g} kg m2: "
            f"the largest exceeds the sum of the others, {low + middle:g}; check units and the point they refer to"
        )
    return tensor


def choose_basis(body: Body) -> tuple[Spatial, ...]:
    """A point and up to three independent directions, in the order in which the body's elements were given."""
    if body.frame.planar:
        return tuple(body.points[:2])  # with the plane's normal, two points carry any planar inertia
    chosen: list[Spatial] = [body.points[0]]
    found: list[np.ndarray] = []
    for least in (0.2, 1e-3):
        for element in body.elements:
            if element in chosen or len(found) == 3:
                continue
            direction = element.initial - (body.points[0].initial if isinstance(element, Point) else 0.0)
            trial = found + [direction / max(np.linalg.norm(direction), 1e-300)]
            if np.linalg.svd(np.array(trial), compute_uv=False)[-1] > least:
                chosen.append(element)
                found = trial
    points = [e for e in chosen if isinstance(e, Point)]
    if len(found) == 2 and len(points) == 1:
        raise ModelError(f"body {body.name}: one point and two vectors cannot carry its inertia; give another point or constant_mass=True")
    return tuple(points + [e for e in chosen if isinstance(e, Vector)])


def check_basis(name: str, basis: tuple[Spatial, ...]) -> None:
    """Refuse a basis that is not one of the supported shapes or is degenerate in the initial position."""
    points = [e for e in basis if isinstance(e, Point)]
    shape = (len(points), len(basis) - len(points))
    if shape not in {(1, 0), (2, 0), (2, 1), (2, 2), (3, 1), (4, 0), (1, 3)}:
        raise ModelError(
            f"body {name}: {shape[0]} points and {shape[1]} vectors are no basis for inertia; give 1 point, 2 points, "
            "2 points and 1 vector, or four elements with at least one point"
        )
    directions = [e.initial - points[0].initial for e in points[1:]] + [e.initial for e in basis if e not in points]
    if not directions:
        return
    unit = [d / (np.linalg.norm(d) or 1.0) for d in directions]
    smallest = np.linalg.svd(np.array(unit), compute_uv=False)[-1]
    if smallest < 1e-6:
        names = ", ".join(e.name for e in basis)
        raise ModelError(f"body {name}: the elements {names} are parallel or coplanar ({smallest:.1e}); choose other ones as basis")
