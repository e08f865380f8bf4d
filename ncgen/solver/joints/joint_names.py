"""The rates of a tree of bodies by their names, and the coordinates that follow them: a hinge's angle, a slider's distance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import AXES, Point, Relative, Spatial
from ncgen.model.pairs import Screw
from ncgen.model.singular_values import least_squares
from ncgen.symbolic.tree import Tree, moving

COEFFICIENT_TOLERANCE = 1e-9
"""By which the share of a joint in a coordinate's rate may differ from 1, −1 or 0 and still be that."""

ROW_TOLERANCE = 1e-6
"""What a rate may leave of a row, over the row's size, that belongs to no loop."""


def followed_by(kernels: Kernels, tree: Tree) -> dict[int, tuple[int, float]]:
    """{relative coordinate: (rate, its share)}, seen in what each screw does to the rows at the start.

    Raises ModelError where a coordinate follows no single joint, or where a row holds joints together.
    """
    where = moving(kernels.programs.equations, tree)
    relative = {kernels.index[e.name] for e in kernels.model.elements.values() if isinstance(e, Relative) and e.name in kernels.index}
    if others := [kernels.coordinates[c] for c in range(kernels.n) if c not in where and c not in relative]:
        raise ModelError(f"{kernels.name}: joint space needs one tree of bodies; {others[0]} belongs to none")
    moved = _columns(kernels, tree, where)
    jacobian = kernels.jacobian(kernels.q0)
    columns = sorted(relative)
    # Rows over relative coordinates and rates: each relative coordinate has one row of its own, the others must vanish.
    over_rates, over_own = jacobian @ moved, jacobian[:, columns]
    shares = -least_squares(over_own, over_rates) if columns else np.zeros((0, moved.shape[1]))
    left = np.abs(over_rates + over_own @ shares) / kernels.row_sizes[:, None]
    if left.size and left.max() > ROW_TOLERANCE:
        row = kernels.rows[int(np.argmax(left.max(axis=1)))]
        raise ModelError(f"{kernels.name}: constraint {row.label} ({row.owner}) closes a loop")
    followed = {}
    for c, coefficients in zip(columns, shares, strict=True):
        k = int(np.argmax(np.abs(coefficients)))
        if np.max(np.abs(np.delete(coefficients, k)), initial=0.0) > COEFFICIENT_TOLERANCE * abs(coefficients[k]):
            raise ModelError(f"{kernels.name}: joint space needs coordinates of single joints; {kernels.coordinates[c]} is that of none")
        is_unit = abs(abs(coefficients[k]) - 1.0) < COEFFICIENT_TOLERANCE
        followed[c] = k, float(np.sign(coefficients[k]) if is_unit else coefficients[k])
    return followed


def _columns(kernels: Kernels, tree: Tree, where: Mapping[int, tuple[Spatial, int]]) -> np.ndarray:
    """What every rate does to the coordinates of elements at the start, shape (n_q, rates)."""
    changes = np.zeros((kernels.n, tree.dof))
    screws = np.reshape([_screw(screw) for link in tree.links for screw in link.screws], (-1, 6))
    paths = [list(path) for path in tree.paths]
    moved = {e: carried(screws[paths[tree.home[e]]], np.array(e.initial), isinstance(e, Point)) for e in {e for e, _ in where.values()}}
    for c, (element, axis) in where.items():
        changes[c, paths[tree.home[element]]] = moved[element][:, axis]
    return changes


def _screw(screw: Screw) -> np.ndarray:
    """(ω, v at the origin) of a joint's freedom at the start."""
    axis = screw.axis.initial
    return np.concatenate([np.zeros(3), axis]) if screw.point is None else np.concatenate([axis, np.cross(screw.point.initial, axis)])


def carried(twist: np.ndarray, vector: np.ndarray, is_point: bool) -> np.ndarray:
    """The velocity of a point or vector that moves with a twist (…, 6)."""
    turned = np.cross(twist[..., :3], vector)
    return twist[..., 3:] + turned if is_point else turned


def names_of(kernels: Kernels, tree: Tree, followed: Mapping[int, tuple[int, float]]) -> tuple[str, ...]:
    """Of all rates: of their coordinate, else of the body with v or w and a global axis, or with the word for what it does."""
    coordinates = {k: kernels.coordinates[c] for c, (k, _) in followed.items()}
    names: list[str] = []
    for link in tree.links:
        for screw in link.screws:
            along = [axis for axis, x in zip(AXES, screw.axis.initial, strict=True) if x == 1.0] if screw.is_constant else []
            letter, word = ("v", "slide") if screw.point is None else ("w", "turn")
            name = coordinates.get(len(names), f"{link.body.name}.{letter + along[0] if along else word}")
            names.append(name)
    return tuple(names)


def refuse_thin(kernels: Kernels, tree: Tree) -> None:
    """Raise ModelError where a body has rotational inertia and no orientation, so that it is not part of the tree."""
    if thin := [body.name for body in tree.loose if body.inertia]:
        raise ModelError(f"{kernels.name}: {thin[0]} does not define its orientation; give the body another vector or point")
