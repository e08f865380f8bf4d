"""Tooth forces: what the row of a gear or a rack does as a force at the pitch point, where both sides are held by one carrier.

The row ties two coordinates: it turns each wheel against its carrier, and pushes a rack along its slide. Wheels and racks push each other
where they touch, along the line that the pressure angle gives, and the carrier feels what pins and guides pass on. A row is left a couple

- where its coordinates are not measured between one carrier and both sides,
- where a wheel shares no point with the carrier,
- where axes are not parallel, or a slide is not perpendicular to the axis of its pinion,
- where the bodies can move as no teeth allow (a rack that is free to turn): tooth forces would have another power than the row.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncgen.model.elements import Angle, Combination, Length, Point, Spatial
from ncgen.model.singular_values import least_squares
from ncgen.solver import geometry
from ncgen.solver.loads.between import body_of
from ncgen.solver.positions.rank import null_space, scaled_jacobian

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

PARALLEL = 1e-9
"""Sines of angles between axes below this are rounding."""

SAME_WORK = 1e-6
"""Powers that differ by less than this part of velocities are the same: positions are closed to 1e-9."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ToothMesh:
    """Two sides on a carrier, by the names of bodies: at `point` (K, 3) in m the second pushes the first with `force` (K, 3) in N.

    row: the label of the gear's or the rack's row; slide: that of the row of the rack's coordinate, "" for two wheels
    """

    row: str
    first: str
    second: str
    carrier: str
    point: np.ndarray
    force: np.ndarray
    slide: str = ""

    def felt(self, body: str, neighbour: str) -> float:
        """How many times its force counts in what a body feels of another one, in addition to what the row has there."""
        times = {
            (self.first, self.second): 1.0, (self.second, self.first): -1.0, (self.first, self.carrier): -1.0,
            (self.second, self.carrier): 1.0, (self.carrier, self.first): 1.0, (self.carrier, self.second): -1.0,
        }  # fmt: skip
        return times.get((body, neighbour), 0.0)


@dataclass(frozen=True, eq=False)
class _Wheel:
    """One side of a mesh: its body, a point (K, 3) of its axis, and the axis (K, 3), about which it turns against the carrier."""

    body: str
    centre: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class _Contact:
    """Where teeth touch: the pitch point (K, 3), the force on the first side for −λ = 1 (K, 3), the way of its radial part (K, 3)."""

    first: str
    second: str
    carrier: str
    point: np.ndarray
    tangent: np.ndarray
    radial: np.ndarray
    slide: str = ""


def meshes(run: Trajectory, pressure_angle: float) -> tuple[tuple[ToothMesh, ...], tuple[str, ...]]:
    """All pairs of sides along a run, and the labels of rows that stay couples; pressure_angle: rad."""
    tooth_meshes, couples = [], []
    for number, row in enumerate(run.kernels.rows):
        if row.owner.joint not in ("gear", "rack"):
            continue
        contacts = list(_contacts(run, number))
        if len(contacts) != 1:
            couples.append(row.label)
            continue
        at = contacts[0]
        load = -run.lam[:, number, None]
        size = np.abs(load) * np.linalg.norm(at.tangent, axis=1, keepdims=True)
        force = load * at.tangent + np.tan(pressure_angle) * size * at.radial
        tooth_meshes.append(
            ToothMesh(row=row.label, first=at.first, second=at.second, carrier=at.carrier, point=at.point, force=force, slide=at.slide)
        )
    return tuple(tooth_meshes), tuple(couples)


def _contacts(run: Trajectory, number: int) -> Iterator[_Contact]:
    """All ways in which a row is two sides that touch; one that teeth can have has one."""
    kernels, t = run.kernels, float(run.t[0])
    derivatives = kernels.jacobian(run.q[0], t, kernels.present(t, run.p))[number]
    tied = [(run.model.elements.get(kernels.coordinates[j]), float(derivatives[j])) for j in np.flatnonzero(derivatives)]
    angles = [(coordinate, derivative) for coordinate, derivative in tied if isinstance(coordinate, Angle)]
    lengths = [(coordinate, derivative) for coordinate, derivative in tied if isinstance(coordinate, Length)]
    if len(tied) != 2 or len(angles) + len(lengths) != 2 or len(angles) == 0:
        return
    ways = _racks(run, *lengths[0], *angles[0]) if lengths else _pairs(run, [a for a, _ in angles], [r for _, r in angles])
    for contact in ways:
        if contact is not None and _does_its_work(run, number, contact):
            yield contact


# -- two wheels -----------------------------------------------------------------------------------


def _pairs(run: Trajectory, angles: list[Angle], radii: list[float]) -> Iterator[_Contact | None]:
    """Two wheels on the carrier that both angles have; radii: r₁, r₂ of r₁ψ₁ + r₂ψ₂ = constant."""
    sides = [_sides(run, angle) for angle in angles]
    common = set(sides[0]) & set(sides[1])
    carrier = next(iter(common)) if len(common) == 1 else None
    if carrier is None:
        return
    first, second = (_wheel(run, angle, side, carrier) for angle, side in zip(angles, sides, strict=True))
    if first is not None and second is not None and first.body != second.body:
        yield _between_wheels(first, second, carrier, radii)


def _between_wheels(first: _Wheel, second: _Wheel, carrier: str, radii: list[float]) -> _Contact | None:
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
    is_convex = r1 * r2 > 0 or abs(r1) < abs(r2)  # else its teeth are those of a ring
    radial = (-1.0 if is_convex else 1.0) * np.sign(rho) * e
    return _Contact(
        first=first.body,
        second=second.body,
        carrier=carrier,
        point=first.centre + rho * e,
        tangent=r1 / rho * np.cross(n, e),
        radial=radial,
    )


# -- a wheel and a rack ---------------------------------------------------------------------------


def _racks(run: Trajectory, slide: Length, a: float, angle: Angle, b: float) -> Iterator[_Contact | None]:
    """A wheel and a rack of a s + b ψ = constant, on a carrier of the angle that has one end of the slide."""
    row = next((row for row in run.model.rows if row.owner.name == slide.name and row.type and row.type.key == "slide"), None)
    if row is None:
        return  # the distance of two points goes along with no guide
    ends = [(e, float(weight)) for weight, e in row.direction("a").terms]
    axis, side = row.direction("n"), _sides(run, angle)
    for carrier in side:
        wheel = carrier and _wheel(run, angle, side, carrier)
        if not carrier or not wheel:
            continue
        for (held, _), (moving, sense) in ((ends[0], ends[1]), (ends[1], ends[0])):
            for rack in _having(run, (moving,)) - {carrier, wheel.body}:
                if carrier in _having(run, (held,)) and {carrier, rack} & _having(run, axis.elements):
                    yield _contact_with_rack(wheel, rack, carrier, sense * _along(run, axis), a, b, row.label)


def _contact_with_rack(wheel: _Wheel, rack: str, carrier: str, e: np.ndarray, a: float, b: float, label: str) -> _Contact | None:
    """e: where the rack moves against the carrier as s grows (K, 3)."""
    if np.max(np.abs(np.sum(e * wheel.axis, axis=1)), initial=0.0) > PARALLEL:
        return None
    across, radius = np.cross(e, wheel.axis), -b / a
    return _Contact(
        first=wheel.body,
        second=rack,
        carrier=carrier,
        point=wheel.centre + radius * across,
        tangent=-a * e,
        radial=-np.sign(radius) * across,
        slide=label,
    )


# -- bodies and directions ------------------------------------------------------------------------


def _sides(run: Trajectory, angle: Angle) -> tuple[str | None, str | None]:
    return body_of(run.model, angle.start), body_of(run.model, angle.end)


def _having(run: Trajectory, elements: tuple[Spatial, ...]) -> set[str]:
    """The bodies that have all of some elements, the ground among them where all are fixed."""
    ground = {run.model.ground.name} if all(e.fixed for e in elements) else set()
    return ground | {name for name, body in run.model.bodies.items() if all(e in body.elements for e in elements)}


def _along(run: Trajectory, direction: Combination) -> np.ndarray:
    """A direction's unit vector (K, 3)."""
    unit_vectors = np.asarray(geometry.direction(run.kernels, direction, run.q, run.p))
    unit_vectors = np.broadcast_to(unit_vectors, (len(run.t), 3))
    return unit_vectors / np.linalg.norm(unit_vectors, axis=-1, keepdims=True)


def _wheel(run: Trajectory, angle: Angle, side: tuple[str | None, str | None], carrier: str) -> _Wheel | None:
    """The wheel of an angle between a carrier and it, None where it has no point on its axis that is the carrier's, too."""
    ground, bodies = run.model.ground.name, run.model.bodies
    body, sign = (side[1], 1.0) if side[0] == carrier else (side[0], -1.0)
    if body is None or body == carrier:
        return None
    points = [point for name in (body, carrier) if name != ground for point in bodies[name].points]
    shared = [p for p in points if all(p.fixed if name == ground else p in bodies[name].points for name in (body, carrier))]
    if not shared:
        return None
    return _Wheel(body, geometry.element(run.kernels, shared[0], run.q, run.p), sign * _along(run, angle.axis))


# -- what teeth allow -----------------------------------------------------------------------------


def _does_its_work(run: Trajectory, number: int, contact: _Contact) -> bool:
    """Whether the tangential force has the row's power, and the radial one none, whatever the other rows allow at the start."""
    kernels, t, q = run.kernels, float(run.t[0]), run.q[0]
    p = kernels.present(t, run.p)
    others = [i for i, row in enumerate(kernels.rows) if i != number and row.owner.kind != "driver"]
    motions = kernels.column_sizes[:, None] * null_space(scaled_jacobian(kernels, q, t, p)[others])
    rates = [_velocities(run, name, contact.point[0], motions) for name in (contact.first, contact.second)]
    slip = rates[0] - rates[1]
    largest = max(kernels.length, *(float(np.max(np.abs(rate), initial=0.0)) for rate in rates))
    powers = contact.tangent[0] @ slip - kernels.jacobian(q, t, p)[number] @ motions
    limit = SAME_WORK * largest
    return bool(np.all(np.abs(contact.radial[0] @ slip) <= limit) and np.all(np.abs(powers) <= limit * np.linalg.norm(contact.tangent[0])))


def _velocities(run: Trajectory, body: str, position: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Velocities (3, k) of a body's material at a place, for velocities (n, k) of the coordinates."""
    if body == run.model.ground.name:
        return np.zeros((3, motions.shape[1]))
    twists, rates = [], []
    for e in run.model.bodies[body].elements:
        at = geometry.element(run.kernels, e, run.q[0], run.p)
        arm, moves = (at - position, np.eye(3)) if isinstance(e, Point) else (at, np.zeros((3, 3)))
        twists.append(np.hstack([moves, -np.cross(np.eye(3), arm)]))
        rates.append(geometry.element_rate(run.kernels, e, motions.T).T)
    return least_squares(np.vstack(twists), np.vstack(rates))[:3]
