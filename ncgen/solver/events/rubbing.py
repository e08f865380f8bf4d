"""Contacts that slide with friction: whether their loads are determined.

With the response A of the gaps' accelerations to their loads N, of which each brings a friction −μ N along its direction of sliding, the
accelerations are A N + b. For every b there is exactly one 0 ≤ N ⊥ A N + b ≥ 0 if and only if all principal minors of A are positive.
Otherwise there may be no N or several, which Painlevé noticed on a rod (Sur les lois du frottement de glissement, 1895).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, combinations

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.expressions import symbols_in
from ncgen.model.values import Scalar
from ncgen.program.motions.sliding import Sliding
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.modes import Held, sliding_of
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.instant import instant
from ncgen.solver.formalisms.kkt import KKT

MOST_SLIDING = 12
"""Contacts that slide at one time whose 2¹² minors are all computed; of more only the single ones and pairs."""

POSITIVE = 1e-9
"""A minor is positive that is above this share of that without friction."""


def check_determined(functions: EventFunctions, kernels: Kernels, held: tuple[Held, ...], at: State) -> None:
    """Raise ConvergenceError where the loads of the contacts that slide in a mode are not determined. kernels: of the mode"""
    sliding = sliding_of(kernels, held)
    if not sliding:
        return
    A, plain = _responses(functions, kernels, sliding, at)
    count = len(sliding)
    sizes = range(1, (count if count <= MOST_SLIDING else 2) + 1)
    for chosen in chain.from_iterable(combinations(range(count), size) for size in sizes):
        part = np.ix_(chosen, chosen)
        if not np.linalg.det(A[part]) > POSITIVE * abs(np.linalg.det(plain[part])):
            raise undetermined(functions, [sliding[k] for k in chosen], at)


def _responses(functions: EventFunctions, kernels: Kernels, sliding: Sequence[Sliding], at: State) -> tuple[np.ndarray, np.ndarray]:
    """A (k, k), and the same without friction: accelerations of gaps, all else that is held staying so, for loads of 1 N."""
    now = instant(kernels, at.q, at.qd, at.t, at.p)
    matrix = KKT(now.mass, now.jacobian, kernels)
    rows = [each.row for each in sliding]
    forces = np.column_stack([_friction(functions, each, at) for each in sliding])
    units = np.zeros((kernels.m, len(rows)))
    units[rows, range(len(rows))] = 1 / kernels.row_sizes[rows]
    scale = now.unit / kernels.row_sizes[rows, None]
    zero = np.zeros_like
    by_motion = -scale * matrix.solve(zero(forces), units)[1][rows]  # loads for an acceleration of 1 m/s² of each gap
    by_friction = -scale * matrix.solve(kernels.column_sizes[:, None] * forces / now.unit, zero(units))[1][rows]
    plain = np.linalg.inv(by_motion)
    return plain @ (np.eye(len(rows)) - by_friction), plain


def is_prevented(functions: EventFunctions, kernels: Kernels, k: int, at: State) -> bool:
    """Whether a contact cannot slide whatever acts on it, since others stick. kernels: of the mode"""
    now, slopes = instant(kernels, at.q, at.qd, at.t, at.p), functions.sliding(at)[k][1] * kernels.column_sizes
    motion, _ = KKT(now.mass, now.jacobian, kernels).solve(slopes.T, np.zeros((kernels.m, len(slopes))))
    return bool(np.max(np.abs(slopes @ motion)) <= POSITIVE * np.max(np.sum(slopes**2, axis=1)))


def _friction(functions: EventFunctions, sliding: Sliding, at: State) -> np.ndarray:
    """Generalised friction (n,) of a contact for a load of 1 N."""
    k = next(k for k, contact in functions.contacts.items() if contact.name == sliding.name)
    velocity, slopes = functions.sliding(at)[k]
    direction = at.p[[functions.kernels.parameters.index(name) for name in sliding.slip]]
    if velocity @ direction > 0:
        direction = velocity
    direction = direction / (np.linalg.norm(direction) or 1.0)
    return -functions.friction(k, at) * (slopes.T @ direction)


def undetermined(functions: EventFunctions, sliding: Sequence[Sliding], at: State) -> ConvergenceError:
    """The refusal, with names, friction and place."""
    contacts = []
    for k, contact in functions.contacts.items():
        if any(each.name == contact.name for each in sliding):
            place = ", ".join(f"{_number(functions, x, at):.6g}" for x in contact.place)
            where = f" at ({place}) m" if place else ""
            contacts.append(f"{contact.name} with friction {functions.friction(k, at):g}{where}")
    return ConvergenceError(
        f"{functions.kernels.name}: at t = {at.t:.6g} s the load of contact {', '.join(contacts)} is not determined, "
        "its friction is too large "
        "for the direction in which it slides (Painlevé); take less friction, or a compliant contact"
    )


def _number(functions: EventFunctions, expression: Scalar, at: State) -> float:
    """An expression of positions and parameters at a state."""
    import sympy

    kernels = functions.kernels
    known = dict(zip(kernels.coordinates, at.q, strict=True)) | dict(zip(kernels.parameters, at.p, strict=True))
    formula = sympy.Add(expression)
    return float(formula.subs({s: known[s.name] for s in symbols_in(formula)}))
