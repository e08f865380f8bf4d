"""Tooth forces: what a gear's row does as a force at the pitch point, where both wheels turn on one carrier.

The row ties two angles and knows of couples alone: it turns each wheel against its carrier. Wheels push each other where they touch, along
the line that the pressure angle gives, and the pins of both carry what the couple hides. A row is left a couple where angles are not told
between a carrier and wheels on parallel axes apart, each on a point that it shares with the carrier; so are racks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncgen.model.elements import Angle, Point
from ncgen.solver import geometry
from ncgen.solver.loads.between import body_of

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

PARALLEL = 1e-9
"""Sines of angles between axes below this are rounding."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Two wheels on a carrier, by the names of bodies: at `point` (K, 3) in m the second pushes the first with `force` (K, 3) in N."""

    row: str
    first: str
    second: str
    carrier: str
    point: np.ndarray
    force: np.ndarray

    def felt(self, body: str, beside: str) -> float:
        """How many times its force counts in what a body feels of another one, beside what the couple of the row has there."""
        times = {
            (self.first, self.second): 1.0, (self.second, self.first): -1.0, (self.first, self.carrier): -1.0,
            (self.second, self.carrier): 1.0, (self.carrier, self.first): 1.0, (self.carrier, self.second): -1.0,
        }  # fmt: skip
        return times.get((body, beside), 0.0)


@dataclass(frozen=True, eq=False)
class _Wheel:
    """One side of a mesh: its body, a point (K, 3) of its axis, and the axis (K, 3), about which it turns against the carrier."""

    body: str
    centre: np.ndarray
    axis: np.ndarray


def meshes(run: Trajectory, pressure_angle: float) -> tuple[tuple[Mesh, ...], tuple[str, ...]]:
    """All pairs of wheels along a run, and the labels of rows that stay couples; pressure_angle: rad."""
    found, couples = [], []
    for number, row in enumerate(run.kernels.rows):
        if row.owner.kind != "joint" or row.owner.name.partition(" ")[0] not in ("gear", "rack"):
            continue
        mesh = _mesh(run, number, row.label, pressure_angle)
        if mesh is None:
            couples.append(row.label)
        else:
            found.append(mesh)
    return tuple(found), tuple(couples)


def _mesh(run: Trajectory, number: int, label: str, pressure_angle: float) -> Mesh | None:
    kernels = run.kernels
    slopes = kernels.jacobian(run.q[0], float(run.t[0]), kernels.present(float(run.t[0]), run.p))[number]
    tied = [kernels.coordinates[j] for j in np.flatnonzero(slopes)]
    angles = [angle for name in tied if isinstance(angle := run.model.elements.get(name), Angle)]
    if len(tied) != 2 or len(angles) != 2:
        return None
    sides = [(body_of(run.model, angle.start), body_of(run.model, angle.end)) for angle in angles]
    common = set(sides[0]) & set(sides[1])
    carrier = next(iter(common)) if len(common) == 1 else None
    if carrier is None:
        return None
    wheels = [_wheel(run, angle, side, carrier) for angle, side in zip(angles, sides, strict=True)]
    if wheels[0] is None or wheels[1] is None or wheels[0].body == wheels[1].body:
        return None
    r = slopes[[kernels.index[name] for name in tied]]
    force = _force(wheels[0], wheels[1], r, -run.lam[:, number] * r[0], pressure_angle)
    return force and Mesh(label, wheels[0].body, wheels[1].body, carrier, *force)


def _wheel(run: Trajectory, angle: Angle, side: tuple[str | None, str | None], carrier: str) -> _Wheel | None:
    """The wheel of an angle between a carrier and it, None where it has no point on its axis that is the carrier's, too."""
    ground, bodies = run.model.ground.name, run.model.bodies
    body, sign = (side[1], 1.0) if side[0] == carrier else (side[0], -1.0)
    if body is None:
        return None
    points = [point for name in (body, carrier) if name != ground for point in bodies[name].points]
    shared = [p for p in points if all(p.fixed if name == ground else p in bodies[name].points for name in (body, carrier))]
    if not shared:
        return None
    axis = sum(float(weight) * geometry.element(run.kernels, e, run.q, run.p) for weight, e in angle.axis.terms)
    axis = sign * np.asarray(axis) / np.linalg.norm(axis, axis=-1, keepdims=True)
    return _Wheel(body, _at(run, shared[0]), axis)


def _at(run: Trajectory, point: Point) -> np.ndarray:
    return geometry.element(run.kernels, point, run.q, run.p)


def _force(
    first: _Wheel, second: _Wheel, radii: np.ndarray, couple: np.ndarray, pressure_angle: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Pitch point (K, 3) and force on the first wheel (K, 3); radii: r₁, r₂ of r₁ψ₁ + r₂ψ₂ = constant, couple (K,): on the first wheel."""
    n = first.axis
    if np.max(np.abs(np.cross(n, second.axis)), initial=0.0) > PARALLEL:
        return None
    r1, r2 = radii[0], radii[1] * np.sign(n[0] @ second.axis[0])
    between = second.centre - first.centre
    between = between - np.sum(between * n, axis=1, keepdims=True) * n
    distance = np.linalg.norm(between, axis=1, keepdims=True)
    if abs(r1 + r2) <= PARALLEL * abs(r1) or not np.min(distance) > PARALLEL * max(np.max(np.abs(first.centre)), np.max(distance)):
        return None
    e, rho = between / distance, distance * r1 / (r1 + r2)
    tangential = couple[:, None] / rho
    is_convex = r1 * r2 > 0 or abs(r1) < abs(r2)  # else its teeth are those of a ring
    radial = (-1.0 if is_convex else 1.0) * np.sign(rho) * np.abs(tangential) * np.tan(pressure_angle)
    return first.centre + rho * e, tangential * np.cross(n, e) + radial * e
