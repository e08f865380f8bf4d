"""Accelerations by Newton's and Euler's equations of free bodies: six numbers each, and multipliers that hold joints together.

What a joint is comes from what the builder was told, by name; of ncgen's equations nothing is used. Unknowns are the accelerations α and a
of every body, a of its centre of mass; constraints are second derivatives of what stays together. For the joints of the example `tree`.
"""

from __future__ import annotations

import numpy as np

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Spatial

GRAVITY = {True: (0.0, -9.81, 0.0), False: (0.0, 0.0, -9.81)}
WORST = 1e5
"""Condition of the constraints from which their rounding is seen."""


class Near(Exception):
    """The position is near a singular one."""


class FreeBodies:
    """A model in its initial position, moving with these velocities of elements: {element: its rate (3,)}."""

    def __init__(self, model: Model, rates: dict[Spatial, np.ndarray], flat: bool) -> None:
        self.model, self.flat = model, flat
        self.bodies = list(model.bodies.values())
        self.told = {f.arguments["name"]: f.arguments for f in model.facts if f.word == "body"}
        self.centre = {b: np.mean([whole(p.initial) for p in self.told[b.name]["points"]], axis=0) for b in self.bodies}
        self.twist = {b: self._twist(b, rates) for b in self.bodies}
        self.rows: list[tuple[np.ndarray, np.ndarray]] = []

    def _twist(self, body: Body, rates: dict[Spatial, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """ω, and the velocity of the centre."""
        left = np.vstack([self._velocity_rows(body, e) for e in body.elements])
        right = np.concatenate([rates.get(e, np.zeros(3)) for e in body.elements])
        found = np.linalg.lstsq(left, right, rcond=None)[0]
        assert np.allclose(left @ found, right, atol=1e-9 * max(1.0, float(np.max(np.abs(right))))), "a body that does not move rigidly"
        return found[:3], found[3:]

    def _velocity_rows(self, body: Body, element: Spatial) -> np.ndarray:
        """(3, 6) of (α or ω, a or v): how an element of a body moves."""
        is_point = isinstance(element, Point)
        arm = whole(element.initial) - (self.centre[body] if is_point else 0.0)
        return np.hstack([-skew(arm), np.eye(3) * is_point])

    # -- what an element does, of a body or at rest ------------------------------------------------

    def columns(self, body: Body | None, element: Spatial) -> np.ndarray:
        """(3, unknowns): how its acceleration follows from those of the bodies."""
        found = np.zeros((3, 6 * len(self.bodies)))
        if body is not None:
            place = 6 * self.bodies.index(body)
            found[:, place : place + 6] = self._velocity_rows(body, element)
        return found

    def velocity(self, body: Body | None, element: Spatial) -> np.ndarray:
        return np.zeros(3) if body is None else self._velocity_rows(body, element) @ np.concatenate(self.twist[body])

    def bias(self, body: Body | None, element: Spatial) -> np.ndarray:
        """Its acceleration where bodies have none."""
        if body is None:
            return np.zeros(3)
        omega, arm = self.twist[body][0], whole(element.initial) - (self.centre[body] if isinstance(element, Point) else 0.0)
        return np.cross(omega, np.cross(omega, arm))

    def owner(self, element: Spatial) -> Body | None:
        """A body that it belongs to; None for what rests."""
        return None if element.fixed else next(b for b in self.bodies if element in b.elements)

    # -- what stays together -------------------------------------------------------------------

    def hold(self) -> None:
        """The rows of all joints."""
        for element in self.model.elements.values():
            if not isinstance(element, Spatial):
                continue
            first = self.owner(element) if element.fixed or any(element in b.elements for b in self.bodies) else None
            for other in (b for b in self.bodies if element in b.elements and b is not first):
                self.same(first, other, element)
        for fact in self.model.facts:
            getattr(self, f"_{fact.word}", lambda **_: None)(**fact.arguments)
        if self.flat:
            for k in range(len(self.bodies)):
                for out in (0, 1, 5):
                    self.row(np.eye(6 * len(self.bodies))[6 * k + out], 0.0)

    def row(self, left: np.ndarray, right: float) -> None:
        self.rows.append((left, np.array(right)))

    def same(self, first: Body | None, second: Body | None, element: Spatial) -> None:
        left = self.columns(first, element) - self.columns(second, element)
        for row, right in zip(left, self.bias(second, element) - self.bias(first, element), strict=True):
            self.row(row, float(right))

    def product(self, d: tuple[np.ndarray, ...], u: tuple[np.ndarray, ...], right: float = 0.0) -> None:
        """d·u has this second derivative; both are (value, rate, columns, bias)."""
        left = u[0] @ d[2] + d[0] @ u[2]
        self.row(left, right - float(u[0] @ d[3] + d[0] @ u[3] + 2 * d[1] @ u[1]))

    def moving(self, element: Spatial) -> tuple[np.ndarray, ...]:
        body = self.owner(element)
        return whole(element.initial), self.velocity(body, element), self.columns(body, element), self.bias(body, element)

    def between(self, start: Point, end: Point) -> tuple[np.ndarray, ...]:
        return tuple(b - a for a, b in zip(self.moving(start), self.moving(end), strict=True))

    def _universal(self, u: Spatial, v: Spatial, **_: object) -> None:
        self.product(self.moving(u), self.moving(v))

    def _planar(self, start: Point, end: Point, normal: Spatial, **_: object) -> None:
        self.product(self.between(start, end), self.moving(normal))

    def _distance(self, start: Point, end: Point, **_: object) -> None:
        d = self.between(start, end)
        self.product(d, d)

    def _cylindrical(self, start: Point, end: Point, axis: Spatial, **_: object) -> None:
        """d × u stays 0."""
        d, u = self.between(start, end), self.moving(axis)
        left = skew(d[0]) @ u[2] - skew(u[0]) @ d[2]
        right = -(np.cross(d[0], u[3]) + np.cross(d[3], u[0]) + 2 * np.cross(d[1], u[1]))
        for row, number in zip(left, right, strict=True):
            self.row(row, float(number))

    def _turning(self, a: Body, b: Body) -> np.ndarray:
        """(3, unknowns): α of b less that of a."""
        found = np.zeros((3, 6 * len(self.bodies)))
        for body, sign in ((b, 1.0), (a, -1.0)):
            if body in self.bodies:
                place = 6 * self.bodies.index(body)
                found[:, place : place + 3] = sign * np.eye(3)
        return found

    def _prismatic(self, a: Body, b: Body, start: Point, end: Point, axis: Spatial) -> None:
        self._cylindrical(start, end, axis)
        for row in self._turning(a, b):
            self.row(row, 0.0)

    def _screw(self, a: Body, b: Body, start: Point, end: Point, axis: Spatial, pitch: float, **_: object) -> None:
        """d·u goes on as the bodies turn; the rate of turning is along u, and stays so."""
        self._cylindrical(start, end, axis)
        d, u = self.between(start, end), self.moving(axis)
        left = u[0] @ d[2] + d[0] @ u[2] - pitch / (2 * np.pi) * u[0] @ self._turning(a, b)
        self.row(left, -float(u[0] @ d[3] + d[0] @ u[3] + 2 * d[1] @ u[1]))

    # -- the answer ----------------------------------------------------------------------------

    def accelerations(self) -> dict[Spatial, np.ndarray]:
        """{element: its acceleration (3,)} of all that bodies have. Raises Near beside a singular position."""
        self.hold()
        count = 6 * len(self.bodies)
        left = np.array([row for row, _ in self.rows]).reshape(-1, count)
        right = np.array([float(number) for _, number in self.rows])
        values = np.linalg.svd(left, compute_uv=False)
        if np.any((values < values[0] / WORST) & (values > 1e-12 * values[0])):
            raise Near
        mass, force = np.zeros((count, count)), np.zeros(count)
        for k, body in enumerate(self.bodies):
            own = self.told[body.name]
            tensor = np.diag([0.0, 0.0, own["inertia"]]) if self.flat else np.array(own["inertia"], dtype=float)
            turning, omega = slice(6 * k, 6 * k + 3), self.twist[body][0]
            mass[turning, turning] = tensor
            mass[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = own["mass"] * np.eye(3)
            force[turning] = -np.cross(omega, tensor @ omega)
            force[6 * k + 3 : 6 * k + 6] = own["mass"] * np.array(GRAVITY[self.flat])
        found = refined(np.block([[mass, left.T], [left, np.zeros((len(left), len(left)))]]), np.concatenate([force, right]))[:count]
        return {e: self.columns(b, e) @ found + self.bias(b, e) for b in self.bodies for e in b.elements if not e.fixed}


def refined(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """A solution of consistent equations, with residuals of more digits."""
    inverse = np.linalg.pinv(matrix, rcond=1e-13)
    x, exact = np.zeros(len(right), dtype=np.longdouble), matrix.astype(np.longdouble)
    for _ in range(4):
        x += inverse @ (right - exact @ x).astype(float)
    return x.astype(float)


def whole(place: np.ndarray) -> np.ndarray:
    """Three numbers of a place or direction, of two in the plane."""
    return np.concatenate([place, np.zeros(3 - len(place))])


def skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
