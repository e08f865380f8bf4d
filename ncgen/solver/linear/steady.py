"""Steady motions: those that a symmetry of the mechanism carries along, as a wheel that rolls or a top that precesses.

Near such a motion y(t) the derivative f_y of the state changes with time in coordinates that take part in the motion, and its
eigenvalues mean nothing. But let X be the field of velocities of a symmetry (y moves along X to a state that behaves alike) that
agrees with f at y. In a frame that moves along X the state stands still, and small motions there obey the constant matrix
(f − X)_y, whose eigenvalues are the same in any coordinates, since f − X vanishes.

X is looked for among the fields in `candidates`. All that is asked of it is linear: at y that X = f, and at states nearby that it
keeps the rows and commutes with f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import ConvergenceError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import Element, Point, Relative, Vector
from ncgen.model.singular_values import least_squares, svd
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import Motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import acceleration_changes, independent_motions, rate_slope
from ncgen.solver.geometry import component
from ncgen.solver.positions.partition import Partitions
from ncgen.solver.positions.position import solve_position
from ncgen.solver.positions.rank import null_space

SYMMETRY_TOLERANCE = 1e-6
"""How far a motion may be from that of a symmetry, relative to its own rates, to be steady."""

NULL_TOLERANCE = 1e-7
"""Singular values below this, relative to the largest, belong to fields that are symmetries."""

ROUNDING = 1e-9
"""Share of the acting forces up to which what is left of them at rest is rounding."""

NEIGHBOURS = 3
DISTANCE = 0.1
"""How many states nearby tell symmetries from other fields, and how far off they are in natural sizes."""


@dataclass(frozen=True, eq=False)
class Shift:
    """Some components change at constant rates, shape (N,) over all components, whatever the position."""

    rates: np.ndarray
    turns_all = False

    def along(self, x: np.ndarray, y: np.ndarray, order: int) -> np.ndarray:
        return self.rates if order == 0 else np.zeros(x.shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class Turn:
    """Points and vectors turn about an axis: a constant direction or a linear map of the components, as is the centre.

    axis (3, N) with the direction `constant` added to it; centre (3, N), zero for the origin; moved: (places (3,), is a point)
    """

    axis: np.ndarray
    constant: np.ndarray
    centre: np.ndarray
    moved: tuple[tuple[np.ndarray, bool], ...]
    turns_all: bool = False

    def along(self, x: np.ndarray, y: np.ndarray, order: int) -> np.ndarray:
        """axis(x) × arm(y), bilinear in components (…, N); order: of the derivative that this is a part of."""
        result = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        axis = x @ self.axis.T + (self.constant if order == 0 else 0.0)
        for columns, is_point in self.moved:
            arm = y[..., columns] - (y @ self.centre.T if is_point else 0.0)
            result[..., columns] = np.cross(axis, arm)
        return result


def drift(kernels: Kernels, partitions: Partitions, now: Motion, matrix: np.ndarray, p: np.ndarray | None = None) -> np.ndarray | None:
    """X_y over [ż; z] for the steady motion `now`, zero for an equilibrium; None where the motion is not steady.

    matrix: f_y over [ż; z], which tells how fast the mechanism would be without its motion
    """
    sizes = kernels.column_sizes
    velocities, positions = partitions.velocity.independent, partitions.position.independent
    count = len(velocities)
    stiffness = np.max(np.abs(matrix[:count, count:] * sizes[positions] / sizes[velocities, None]), initial=0.0)
    rate = float(np.max(np.abs(now.qd / sizes), initial=0.0))
    if rate <= SYMMETRY_TOLERANCE * np.sqrt(stiffness):
        return np.zeros(matrix.shape) if _is_balanced(kernels, now, stiffness, p) else None
    search = _Search(kernels, partitions, now, rate, p)
    symmetry = search.find()
    return None if symmetry is None else search.slope(symmetry)


def _is_balanced(kernels: Kernels, now: Motion, stiffness: float, p: np.ndarray | None) -> bool:
    """Whether a position of rest is an equilibrium, but for rounding of its place or of the forces that balance there."""
    sizes = kernels.column_sizes
    left = np.max(np.abs(sizes * (kernels.mass_matrix(now.q, now.t, p) @ now.qdd)), initial=0.0)
    acting = np.max(np.abs(sizes * kernels.force(now.q, now.qd, now.t, p)), initial=0.0)
    return bool(left <= ROUNDING * acting or np.max(np.abs(now.qdd / sizes), initial=0.0) <= SYMMETRY_TOLERANCE * stiffness)


class _Search:
    """Fields as arrays over all components: free ones first, in the order of q, then fixed ones, which must stand still.

    In addition to the fields there is time, as the last column: it continues at its own rate, and with it what drivers prescribe.
    """

    def __init__(self, kernels: Kernels, partitions: Partitions, now: Motion, rate: float, p: np.ndarray | None) -> None:
        self.kernels, self.partitions, self.now, self.rate, self.p = kernels, partitions, now, rate, p
        components = {c.name: c for e in kernels.model.elements.values() for c in e.components}
        fixed = [c for name, c in components.items() if name not in kernels.index]
        self.values = np.array([float(component(kernels, c, now.q, p)) for c in fixed])
        self.places = dict(kernels.index) | {c.name: kernels.n + i for i, c in enumerate(fixed)}
        self.sizes = np.concatenate([kernels.column_sizes, np.ones(len(fixed))])
        self.fields = candidates(kernels, self.places)

    def find(self) -> np.ndarray | None:
        """Weights of the fields whose sum is the symmetry, or None. What turns by itself is preferred to turning everything."""
        kept = np.vstack([self._changes(state) for state in (self.now, *self._neighbours())])
        field_values, wanted = self._at_start()
        for allowed in ([i for i, field in enumerate(self.fields) if not field.turns_all], list(range(len(self.fields)))):
            columns = [*allowed, len(self.fields)]
            norms = np.linalg.norm(field_values[:, columns], axis=0)
            norms[norms == 0.0] = 1.0
            basis = _null_space(kept[:, columns] / norms) / norms[:, None]
            weights = basis @ least_squares(field_values[:, columns] @ basis, wanted, NULL_TOLERANCE)
            if np.max(np.abs(field_values[:, columns] @ weights - wanted)) <= SYMMETRY_TOLERANCE:
                result = np.zeros(len(self.fields))
                result[allowed] = weights[:-1]
                return result
        return None

    def slope(self, weights: np.ndarray) -> np.ndarray:
        """X_y over [ż; z]."""
        velocities, positions = self.partitions.velocity.independent, self.partitions.position.independent
        count, fixed = len(velocities), len(self.values)
        q_by_z, qd_by_zd, qd_by_z = independent_motions(self.kernels, self.partitions, self.now, self.p)
        dq = np.hstack([np.zeros_like(qd_by_zd), q_by_z])
        dqd = np.hstack([qd_by_zd, qd_by_z])
        dq, dqd = (np.vstack([x, np.zeros((fixed, x.shape[1]))]).T for x in (dq, dqd))
        at, rates = self._all(self.now.q, 0), self._all(self.now.qd, 1)
        result = np.zeros((count + len(positions),) * 2)
        for weight, field in zip(weights, self.fields, strict=True):
            by_position = field.along(dq, at, 1) + _arms(field, at, dq)
            by_velocity = field.along(dqd, at, 1) + _arms(field, at, dqd) + field.along(rates, dq, 1) + field.along(dq, rates, 1)
            result[:count] += weight * by_velocity.T[velocities]
            result[count:] += weight * by_position.T[positions]
        return result

    def _all(self, x: np.ndarray, order: int) -> np.ndarray:
        """Free and fixed components, of position (order 0) or of a derivative."""
        return np.concatenate([x, self.values if order == 0 else 0.0 * self.values])

    def _jets(self, now: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Every field at a motion as columns, and its first and second derivative along it."""
        q, qd, qdd = (self._all(x, order) for order, x in enumerate((now.q, now.qd, now.qdd)))
        values, rates, changes = [], [], []
        for field in self.fields:
            values.append(field.along(q, q, 0))
            rates.append(field.along(qd, q, 1) + _arms(field, q, qd))
            changes.append(field.along(qdd, q, 1) + 2 * field.along(qd, qd, 1) + _arms(field, q, qdd))
        first, second, third = (np.array(x).reshape(len(self.fields), -1).T for x in (values, rates, changes))
        return first, second, third

    def _at_start(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows that say X = f there, without units."""
        values, rates, _ = self._jets(self.now)
        rows = np.vstack([values / self.sizes[:, None] / self.rate, rates / self.sizes[:, None] / self.rate**2])
        wanted = np.concatenate([self._all(x, 1) / self.sizes / self.rate**k for k, x in enumerate((self.now.qd, self.now.qdd), 1)])
        matrix = np.zeros((len(rows) + 1, len(self.fields) + 1))
        matrix[:-1, :-1], matrix[-1, -1] = rows, 1.0
        return matrix, np.append(wanted, 1.0)

    def _changes(self, now: Motion) -> np.ndarray:
        """What is zero of a symmetry at a state: its motion of fixed components, changes of rows, and [X, f]; without units."""
        kernels, p, n, rate, rows = self.kernels, self.p, self.kernels.n, self.rate, self.partitions.velocity.rows
        values, rates, changes = self._jets(now)
        jacobian, holonomic = kernels.jacobian(now.q, now.t, p), kernels.holonomic
        rolling = np.setdiff1d(np.arange(kernels.m), holonomic)
        nu, rolled, accelerations = self._by_time(now)
        closed = np.column_stack([jacobian @ values[:n], -nu])[holonomic]
        slipping = np.column_stack([rate_slope(kernels, now, p) @ values[:n] + jacobian @ rates[:n], rolled])[rolling]
        along = acceleration_changes(kernels, now, (values[:n], rates[:n]), p, rows)
        commuting = np.column_stack([along - changes[:n], accelerations])
        still = np.column_stack([values[n:], np.zeros(len(self.values))])
        scaled = (
            still / rate,
            closed / kernels.row_sizes[holonomic, None] / rate,
            slipping / kernels.row_sizes[rolling, None] / rate**2,
            commuting / self.sizes[:n, None] / rate**3,
        )
        return np.vstack(scaled)

    def _by_time(self, now: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """ν, and how Φ_q q̇ − ν and q̈ of a state change with time alone, by differences."""
        kernels, p, rows = self.kernels, self.p, self.partitions.velocity.rows
        lagrange, step = accelerations_by("lagrange"), 1e-3 / self.rate
        slips, accelerations = [], []
        for k in (-2, -1, 1, 2):
            t = now.t + k * step
            slips.append(kernels.jacobian(now.q, t, p) @ now.qd - kernels.nu(now.q, t, p))
            accelerations.append(lagrange.motion(kernels, now.q, now.qd, t, p, {}, rows).qdd)
        slipping, speeding = ((x[0] - x[3] + 8 * (x[2] - x[1])) / (12 * step) for x in (slips, accelerations))
        return kernels.nu(now.q, now.t, p), slipping, speeding

    def _neighbours(self) -> list[Motion]:
        """Consistent states near the motion, always the same ones."""
        kernels, p, now = self.kernels, self.p, self.now
        generator = np.random.default_rng(0)
        sizes, holonomic, velocity = kernels.column_sizes, kernels.holonomic, self.partitions.velocity
        free = null_space(kernels.jacobian(now.q, now.t, p)[holonomic] * sizes / kernels.row_sizes[holonomic, None])
        neighbours, distance = [], DISTANCE
        while len(neighbours) < NEIGHBOURS and distance > DISTANCE / 100:
            step = free @ generator.standard_normal(free.shape[1])
            noise = self.rate * sizes[velocity.independent] * generator.standard_normal(len(velocity.independent))
            try:
                q = solve_position(kernels, now.q + distance * sizes * step / max(np.max(np.abs(step), initial=0.0), 1.0), now.t, p).q
                neighbours.append(motion_at(kernels, velocity, now.t, q, now.qd[velocity.independent] + noise, p))
            except (ConvergenceError, SingularError):
                distance /= 2  # too far for this mechanism
        return neighbours


def _arms(field: Shift | Turn, at: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The part of a field's derivative along a change of components that comes from its arms."""
    return np.zeros(change.shape) if isinstance(field, Shift) else field.along(at, change, 0)


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """An orthonormal basis of what a matrix takes to zero, columns."""
    _, values, right = svd(matrix, full=True)
    rank = int(np.sum(values > NULL_TOLERANCE * max(values[0], 1.0))) if len(values) else 0
    return right[rank:].T


def candidates(kernels: Kernels, indices: dict[str, int]) -> list[Shift | Turn]:
    """Fields that may be symmetries of some mechanism: all that moves is moved, or turned about the origin; a relative coordinate
    grows; what belongs to one body alone turns about an axis of its own.

    indices: of all components in the arrays of components
    """
    model = kernels.model
    count = len(indices)
    unit = np.eye(count)

    def where(element: Element) -> np.ndarray:
        return np.array([indices[c.name] for c in element.components])

    def pick(element: Element) -> np.ndarray:
        return unit[where(element)]

    points = [e for e in model.elements.values() if isinstance(e, Point) and not e.fixed]
    vectors = [e for e in model.elements.values() if isinstance(e, Vector) and not e.fixed]
    moved = tuple((where(e), isinstance(e, Point)) for e in (*points, *vectors))
    nothing = np.zeros((3, count))
    fields: list[Shift | Turn] = []
    for axis in np.eye(3):
        fields.append(Shift(sum((axis @ pick(e) for e in points), np.zeros(count))))
        fields.append(Turn(axis=nothing, constant=axis, centre=nothing, moved=moved, turns_all=True))
    fields += [Shift(pick(e)[0]) for e in model.elements.values() if isinstance(e, Relative) and not e.fixed]
    bodies = [*model.bodies.values()]
    for body in bodies:
        shared = {e for other in (*bodies, model.ground) if other is not body for e in other.elements}
        elements = [e for e in body.elements if e not in shared and not e.fixed]
        held = [e for e in body.points if e not in elements] or body.points
        axes = [(pick(u), np.zeros(3)) for u in body.vectors]
        axes += [(pick(b) - pick(a), np.zeros(3)) for a, b in zip(held, held[1:])]
        axes += [(nothing, axis) for axis in np.eye(3)] if not body.vectors else []
        for axis, constant in axes:
            turned = tuple((where(e), isinstance(e, Point)) for e in elements)
            fields += [Turn(axis=axis, constant=constant, centre=pick(c), moved=turned) for c in held[:1] if turned]
    return fields
