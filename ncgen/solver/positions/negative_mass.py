"""Positions at which the mass matrix is not positive definite: bodies have moments of inertia there that no body has."""

from __future__ import annotations

import numpy as np

from ncgen.errors import ConvergenceError, DomainError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.bodies import Body
from ncgen.model.singular_values import pseudoinverse
from ncgen.solver import geometry
from ncgen.solver.positions.position import solve_position
from ncgen.solver.positions.rank import null_space, scaled_jacobian

ROUNDING = 1e-12
"""Eigenvalues of the mass matrix above minus this, relative to the largest, are rounding."""

N_SAMPLES = 20
"""Instants of a motion that are looked at."""

N_POSITIONS_AHEAD = 33
"""Positions that are looked at where a motion ends."""


def doubtful(kernels: Kernels) -> list[Body]:
    """Bodies whose moments of inertia were taken as given, although no body has them."""

    def found() -> list[Body]:
        return [body for body in kernels.model.bodies.values() if body.inertia is not None and not body.inertia.is_judged]

    return kernels.remember("bodies with doubtful inertia", (), found)


def refuse_negative(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> None:
    """Raise SingularError naming the body that makes the mass matrix at q not positive definite, if it is not."""
    bodies = doubtful(kernels)
    if bodies and (body := _culprit(kernels, bodies, q, t, p)):
        raise SingularError(f"{kernels.name}: {_sentence(body, t)}")


def refuse_negative_ahead(kernels: Kernels, q: np.ndarray, qd: np.ndarray, t: float, dt: float, p: np.ndarray) -> None:
    """Do the same for positions up to two intervals dt (s) after the last one of a motion that could not go on, reached with rates qd."""
    if not doubtful(kernels):
        return
    for time in np.linspace(0.0, 2 * dt, N_POSITIONS_AHEAD).tolist():
        try:
            position = solve_position(kernels, q + time * qd, t + time, p).q
        except (ConvergenceError, DomainError):
            return
        refuse_negative(kernels, position, t + time, p)


def negative_instant(kernels: Kernels, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> str | None:
    """What to say of the first of some instants t (K,) of a motion q (K, n) where the mass matrix is not positive definite, else None."""
    bodies = doubtful(kernels)
    if not bodies:
        return None
    rows = np.unique(np.linspace(0, len(t) - 1, N_SAMPLES).astype(int)).tolist()
    instants = ((float(t[k]), q[k]) for k in rows)
    return next((_sentence(body, t) for t, q in instants if (body := _culprit(kernels, bodies, q, t, p))), None)


def _sentence(body: Body, t: float) -> str:
    return (
        f"at t = {t:.6g} s the mass matrix is not positive definite by body {body.name}, whose moments of inertia no body has; "
        'correct them, or load the robot with inertias="balanced"'
    )


def _culprit(kernels: Kernels, bodies: list[Body], q: np.ndarray, t: float, p: np.ndarray) -> Body | None:
    """The body with the least kinetic energy in a motion that has a negative one; None where there is no such motion."""
    values, motions, _ = principal_motions(kernels, q, t, p)
    if not len(values) or values[0] >= -ROUNDING * values[-1]:
        return None
    return min(bodies, key=lambda body: _kinetic_energy(kernels, body, motions[:, 0], p))


def principal_motions(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The motions that the constraints allow at q, by their kinetic energy.

    Returns the eigenvalues (k,) of the mass matrix on them in natural sizes, ascending, their velocities (n, k) and the mass matrix (n, n).
    """
    motions = null_space(scaled_jacobian(kernels, q, t, p)) * kernels.column_sizes[:, None]
    M = kernels.mass_matrix(q, t, p)
    values, vectors = np.linalg.eigh(motions.T @ M @ motions)
    return values, motions @ vectors, M


def _kinetic_energy(kernels: Kernels, body: Body, qd: np.ndarray, p: np.ndarray) -> float:
    """J, of a body that moves with rates qd: ½ m v² + ½ tr(Ȧ (½ tr(I) 1 − I) Ȧᵀ), Ȧ the rate of its rotation since the start.

    Source: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody Systems (1994), section 4.2.
    """
    mass, com, tensor = body.own_inertia.at(geometry.parameters_at(kernels, p))
    first = body.points[0]
    start = geometry.element_rate(kernels, first, qd)
    before = [e.initial - first.initial for e in body.points[1:]] + [e.initial for e in body.vectors]
    rates = [geometry.element_rate(kernels, e, qd) - start for e in body.points[1:]] + [
        geometry.element_rate(kernels, e, qd) for e in body.vectors
    ]
    if not before:
        return 0.5 * mass * float(start @ start)
    turning = np.array(rates).T @ pseudoinverse(np.array(before).T, 1e-15)
    velocity = start + turning @ (com - first.initial)
    return 0.5 * float(mass * velocity @ velocity + np.trace(turning @ (np.trace(tensor) / 2 * np.eye(3) - tensor) @ turning.T))
