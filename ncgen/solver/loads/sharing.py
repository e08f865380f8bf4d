"""Which joint loads are unique, and what shares those that are not.

A body in balance stays so when loads are added to it that balance one another. Those are its internal loads: all that do no work
in its rigid motions, whether the model has rows for them or not (rows between fixed elements vanish, and a length that two bodies
share has one row only). What is added everywhere at once has to cancel on every free coordinate, where bodies meet each other and
the rows that belong to no body (joints, angles, drivers); fixed coordinates take anything. A load is unique if none of this reaches it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import orth
from scipy.sparse.csgraph import connected_components

from ncgen.emit.sources import Sources
from ncgen.mechanism.numpy_module import NumPyKernels
from ncgen.model.bodies import Body
from ncgen.model.elements import AXES, Point, Vector
from ncgen.model.rows import Owner
from ncgen.program.assemble import assemble
from ncgen.solver import geometry
from ncgen.solver.argument_checks import listed_names
from ncgen.solver.positions.rank import RELATIVE_ZERO, null_space, scaled_jacobian, sparse_jacobian
from ncgen.symbolic.equations import Equations, build_equations

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

N_SAMPLES = 9
"""Instants of a motion that are looked at: directions turn, and at one of them a share may just point past a coordinate."""

REACH_TOLERANCE = 1e-7
"""A load is reached where more than this part of loads of size 1 arrives."""

LOAD_ROUNDING = 1e-9
"""Loads below this, relative to a body's largest, are none."""

VARIATION_TOLERANCE = 1e-3
"""Totals that vary less, relatively, are said as one number."""


class Released:
    """Rows, masses and forces of a part of a mechanism, as kernels of their own over fixed coordinates, too."""

    def __init__(self, run: Trajectory, equations: Equations) -> None:
        self.kernels = kernels_of(equations)
        self.coordinates = self.kernels.coordinates
        index = run.kernels.index
        self._free = np.array([k for k, name in enumerate(self.coordinates) if name in index], dtype=int)
        self._from = np.array([index[self.coordinates[k]] for k in self._free], dtype=int)
        fixed = {c.name: c for c in equations.released}
        values = {name: geometry.component(run.kernels, c, run.q[0], run.p) for name, c in fixed.items()}
        self._still = np.array([values.get(name, 0.0) for name in self.coordinates])

    def position(self, q: np.ndarray) -> np.ndarray:
        """A position over the share's coordinates: free ones from q (n,), released ones as they are fixed."""
        position_of_share = self._still.copy()
        position_of_share[self._free] = q[self._from]
        return position_of_share

    def rate(self, qd: np.ndarray) -> np.ndarray:
        """Velocities or accelerations likewise; released coordinates stand still."""
        rate_of_share = np.zeros(len(self.coordinates))
        rate_of_share[self._free] = qd[self._from]
        return rate_of_share


class Share(Released):
    """What one body owns."""

    def __init__(self, run: Trajectory, body: Body) -> None:
        super().__init__(run, build_equations(run.model, Owner("body", body.name)))
        self.body = body

    @property
    def indices(self) -> np.ndarray:
        """Where the components of the body's elements stand, three by three."""
        return np.array([self.kernels.index[c.name] for e in self.body.elements for c in e.components], dtype=int)


def kernels_of(equations: Equations) -> NumPyKernels:
    """Kernels of a part of a mechanism."""
    return NumPyKernels(Sources(assemble(equations, "tabled")))


@dataclass(frozen=True, eq=False)
class Findings:
    """unique: {body: {coordinate of its elements: bool}}; shared: a sentence for every load that several supports share.

    changes: {instant: (loads, k)}: what can be added to all forces (N) and moments (N m), three an element, body after body
    """

    unique: dict[str, dict[str, bool]]
    shared: tuple[str, ...]
    changes: dict[int, np.ndarray]


def find_shared(run: Trajectory, shares: list[Share], loads: dict[str, np.ndarray]) -> Findings:
    """What is unique along a motion.

    loads: {body: (K, elements, 3)}: forces (N) on points, moments (N m) through vectors
    Positions where more is free to choose than at others are singular and left out, unless the motion stays there.
    """
    instants = np.unique(np.linspace(0, len(run.t) - 1, N_SAMPLES).round().astype(int))
    idle = [_idle_axes(equations.body, loads[equations.body.name]) for equations in shares]
    changes = [_changes(run, shares, idle, run.t[k], run.q[k]) for k in map(int, instants)]
    least = min(change[0].shape[1] for change in changes) if shares else 0
    unique, sentences = {}, []
    for b, equations in enumerate(shares):
        together = sum(np.abs(change[b] @ change[b].T) for change in changes if change[b].shape[1] == least)
        reached = np.diag(together) > REACH_TOLERANCE**2
        names = [c.name for e in equations.body.elements for c in e.components]
        unique[equations.body.name] = dict(zip(names, (~reached).tolist(), strict=True))
        groups = connected_components(together > REACH_TOLERANCE**2, directed=False)[1] if len(names) else []
        for group in dict.fromkeys(np.asarray(groups)[reached].tolist()):
            sentences.append(_sentence(equations.body, (groups == group).reshape(-1, 3), loads[equations.body.name]))
    units = np.concatenate([_units(equations) for equations in shares]) if shares else np.zeros(0)
    kept = zip(map(int, instants), changes, strict=True)
    some = {k: np.vstack(change) for k, change in kept if change and change[0].shape[1] == least}
    added = {k: np.where(np.abs(change) > REACH_TOLERANCE, change, 0.0) / units[:, None] for k, change in some.items()}
    return Findings(unique, tuple(sentences), added)


def _units(equations: Share) -> np.ndarray:
    """How many natural units a load on each component of a body's elements is: a length for forces (m), 1 for moments."""
    return np.array([equations.kernels.length if isinstance(e, Point) else 1.0 for e in equations.body.elements for _ in AXES])


# -- what can be added ----------------------------------------------------------------------------


def _changes(run: Trajectory, shares: list[Share], idle: list[np.ndarray], t: float, q: np.ndarray) -> list[np.ndarray]:
    """For every body what can be added to the loads on its elements, columns of one basis; in natural units (moments)."""
    n, index = run.kernels.n, run.kernels.index
    rows = [_own_rows(equations, q, t, run.p) for equations in shares]
    bases = [
        _internal_loads(equations, q, axes, body_rows, _rows_on(equations, shares, rows))
        for equations, axes, body_rows in zip(shares, idle, rows, strict=True)
    ]
    free = []
    for equations, basis in zip(shares, bases, strict=True):
        columns = np.zeros((n, basis.shape[1]))
        for name, row in zip(equations.coordinates, basis, strict=True):
            if name in index:
                columns[index[name]] = row
        free.append(columns)
    owned = {Owner("body", equations.body.name) for equations in shares}
    others = [i for i, row in enumerate(run.kernels.rows) if row.owner not in owned]
    free.append(scaled_jacobian(run.kernels, q, t, run.p)[others].T)
    chosen = null_space(np.hstack(free))
    ends = np.cumsum([basis.shape[1] for basis in bases], dtype=int)
    parts = np.split(chosen, ends)[: len(bases)]
    return [_felt(equations, basis @ columns, q) for equations, basis, columns in zip(shares, bases, parts, strict=True)]


def _own_rows(equations: Share, q: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    """The rows of Φ_q that a body owns and that do not vanish, over its share's coordinates, in natural sizes."""
    rows = sparse_jacobian(equations.kernels, equations.position(q), t, p)
    return rows[np.unique(rows.nonzero()[0])].toarray()


def _internal_loads(equations: Share, q: np.ndarray, idle: np.ndarray, own_rows: np.ndarray, rows_on: np.ndarray) -> np.ndarray:
    """An orthonormal basis of a body's internal loads over its share's coordinates.

    A body whose rows the user wrote is rigid only as far as these rows say; between its fixed elements it is in any case.
    """
    motions, indices = _rigid_motions(equations, q, idle), equations.indices
    held = (
        np.ones(len(indices), dtype=bool)
        if equations.body.rigid
        else np.array([c.fixed for e in equations.body.elements for c in e.components], dtype=bool)
    )
    balanced = np.zeros((len(equations.coordinates), held.sum()))
    balanced[indices[held]] = np.eye(held.sum())
    balanced = balanced @ null_space(motions[held].T)
    return orth(np.hstack([balanced, own_rows.T, rows_on]), rcond=RELATIVE_ZERO)


def _rigid_motions(equations: Share, q: np.ndarray, idle: np.ndarray) -> np.ndarray:
    """Velocities of a body's elements in natural units, columns: three translations, three rotations; along idle axes any."""
    elements, x = equations.body.elements, equations.position(q)[equations.indices].reshape(-1, 3)
    is_point = np.array([isinstance(e, Point) for e in elements], dtype=float)[:, None]
    size = equations.kernels.length
    arms = np.where(is_point, (x - x[:1]) / size, x)
    columns = [is_point * axis for axis in np.eye(3)] + [np.cross(axis, arms) for axis in np.eye(3)]
    free_loads = np.eye(3 * len(elements))[np.tile(idle, len(elements))]
    return np.vstack([np.reshape(columns, (6, 3 * len(elements))), free_loads]).T


def _rows_on(equations: Share, shares: list[Share], rows: list[np.ndarray]) -> np.ndarray:
    """Rows that other bodies own between elements of this one, columns; a rigid body needs none of them."""
    index, columns = {equations.coordinates[k]: k for k in equations.indices}, []
    for other, matrix in zip(shares, rows, strict=True):
        if equations.body.rigid or other is equations:
            continue
        for row in matrix:
            touched = [other.coordinates[k] for k in np.flatnonzero(row)]
            if all(name in index for name in touched):
                column = np.zeros(len(equations.coordinates))
                column[[index[name] for name in touched]] = row[row != 0]
                columns.append(column)
    return np.array(columns).reshape(-1, len(equations.coordinates)).T


def _felt(equations: Share, change: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Changes (3 · elements, k) of forces on points and of moments through vectors."""
    felt, x = change[equations.indices], equations.position(q)[equations.indices].reshape(-1, 3)
    for i, element in enumerate(equations.body.elements):
        if isinstance(element, Vector):
            felt[3 * i : 3 * i + 3] = np.cross(x[i], felt[3 * i : 3 * i + 3], axisb=0, axisc=0)
    return felt


def _idle_axes(body: Body, loads: np.ndarray) -> np.ndarray:
    """Axes along which no element of a body moves and no force acts (3,): across a plane mechanism there is nothing to share."""
    points = [e for e in body.elements if isinstance(e, Point)]
    across = np.array([all(e.components[k].fixed for e in body.elements) for k in range(3)])
    forces = np.max(np.abs(loads[:, : len(points)]), axis=(0, 1), initial=0.0)
    return across & (forces <= LOAD_ROUNDING * np.max(np.abs(loads), initial=0.0))


# -- in words -------------------------------------------------------------------------------------


def _sentence(body: Body, group: np.ndarray, loads: np.ndarray) -> str:
    """Who shares, and how much it is together: of loads that balance one another the sum does not depend on the share."""
    is_point = np.array([isinstance(e, Point) for e in body.elements])
    names = []
    for element, point, members in zip(body.elements, is_point, group, strict=True):
        name = element.name if point else f"the moment through {element.name}"
        if members.all():
            names.append(name)
        elif point:
            names += [f"{name}.{axis}" for axis, member in zip(AXES, members, strict=True) if member]
        elif members.any():
            names.append(f"{name} about {' and '.join(axis for axis, member in zip(AXES, members, strict=True) if member)}")
    forces, moments = is_point & group.any(axis=1), ~is_point & group.any(axis=1)
    total = _total(group[forces] * loads[:, forces], "N") if forces.any() else _total(group[moments] * loads[:, moments], "N m")
    listed = f"{', '.join(names[:-1])} and {names[-1]}" if len(", ".join(names)) < 150 else listed_names(names)
    return f"{body.name}: {listed} share {total}{' and a moment' if forces.any() and moments.any() else ''}"


def _total(loads: np.ndarray, unit: str) -> str:
    sizes, largest = np.linalg.norm(loads.sum(axis=1), axis=-1), np.max(np.abs(loads), initial=0.0)
    if sizes.max() <= LOAD_ROUNDING * largest:
        return f"0 {unit}"
    return f"{'up to ' if np.ptp(sizes) > VARIATION_TOLERANCE * sizes.max() else ''}{sizes.max():.3g} {unit}"
