"""The refusal of a mechanism that can move without inertia, with the names of what moves so."""

from __future__ import annotations

import numpy as np

from ncgen.errors import SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.bodies import LARGEST_BASIS, Body
from ncgen.model.singular_values import svd
from ncgen.solver.positions.negative_mass import principal_motions, refuse_negative

NULL_TOLERANCE = 1e-9
"""Singular values below this, relative to the largest, belong to motions without inertia."""

CANCELLED = 1e-13
"""A motion has no kinetic energy where its terms leave less than this fraction of the sum of their absolute values."""

ROUNDING = 1e-12
"""A moment of inertia below this fraction of the body's largest one is rounding."""

DIGITS = 3
"""Of how far coordinates move, relative to the farthest."""

MAX_NAMED_THINGS = 4
"""How many coordinates or bodies a message names."""


def massless(kernels: Kernels, resistance: np.ndarray, basis: np.ndarray | None = None) -> SingularError:
    """The error for a matrix (k, n) that no motion without inertia resists, or (k, z) on motions `basis` (n, z); without units."""
    _, values, right = svd(resistance, full=True)
    count = right.shape[0] - int(np.sum(values > NULL_TOLERANCE * np.max(values, initial=0.0)))
    motions = right[-max(count, 1) :].T
    # What the rows of an orthonormal basis measure does not depend on the basis.
    return _error(kernels, np.linalg.norm(motions if basis is None else np.linalg.qr(basis @ motions)[0], axis=1))


def check_mass(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> None:
    """Raise SingularError where the mass matrix at q leaves a motion without kinetic energy or with a negative one, with names.

    A motion without any is looked for where a body has no moment of inertia about an axis; elsewhere the formalisms find it.
    """
    refuse_negative(kernels, q, t, p)
    if point_like(kernels):
        refuse_massless(kernels, q, t, p)


def refuse_massless(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> None:
    """Raise SingularError with the names of what can move at q without kinetic energy, if anything can."""

    def found() -> np.ndarray | None:
        values, motions, M = principal_motions(kernels, q, t, p)
        energies, terms = np.abs(np.sum(motions * (M @ motions), axis=0)), np.sum(np.abs(motions) * (np.abs(M) @ np.abs(motions)), axis=0)
        largest = values[-1] if len(values) else 0.0
        is_massless = (energies <= CANCELLED * terms) | (energies <= CANCELLED**2 * largest)  # rounding of a motion counts by its square
        return np.linalg.norm(motions[:, is_massless] / kernels.column_sizes[:, None], axis=1) if np.any(is_massless) else None

    moved = kernels.remember("motions without kinetic energy", (q.tobytes(), t, p.tobytes()), found, most=1)
    if moved is not None:
        raise _error(kernels, moved)


def point_like(kernels: Kernels) -> list[Body]:
    """Bodies in space that can turn about an axis through their centre of mass about which they have no moment of inertia."""

    def found() -> list[Body]:
        parameters = kernels.model.parameters
        bodies = [body for body in kernels.model.bodies.values() if body.inertia and _is_point_like(body.inertia.numbers(parameters)[2])]
        return [body for body in bodies if len(body.basis) == LARGEST_BASIS]

    return kernels.remember("bodies without a moment of inertia", (), found)


def _is_point_like(tensor: np.ndarray) -> bool:
    moments = np.linalg.eigvalsh(tensor)
    return bool(moments[0] <= ROUNDING * moments[-1])


def _error(kernels: Kernels, moved: np.ndarray) -> SingularError:
    """The error, from how far coordinates move (n,), without units: joints are named first, and bodies that lack inertia."""
    moved = np.round(moved / np.max(moved), DIGITS)  # equals stay in the order of the coordinates
    names = [kernels.coordinates[i] for i in np.argsort(-moved, kind="stable") if moved[i] > 0]
    joints = [name for name in names if "." not in name]
    problem = f"{kernels.name}: a motion of the mechanism has no inertia: {_first(joints or names)} can move without any"
    return SingularError(f"{problem}; give {_remedy(kernels, {name.partition('.')[0] for name in names})}")


def _remedy(kernels: Kernels, moving: set[str]) -> str:
    """What to give to whom, from the names of the elements that move."""
    light = [body for body in kernels.model.bodies.values() if body.inertia is None] + point_like(kernels)
    names = [body.name for body in light if moving & {element.name for element in (*body.points, *body.vectors)}]
    if not names:
        return "the bodies that move mass"
    return f"{_first(names)} " + ("moments of inertia" if kernels.model.bodies[names[0]].inertia else "a mass and moments of inertia")


def _first(names: list[str]) -> str:
    more = f" and {len(names) - MAX_NAMED_THINGS} more" if len(names) > MAX_NAMED_THINGS else ""
    return ", ".join(names[:MAX_NAMED_THINGS]) + more
