"""Contacts and joints that slide with friction of their loads: whether these are determined.

With the response A of the gaps' accelerations to their loads N, of which each brings a friction −μ N along its direction of sliding, the
accelerations are A N + b. For every b there is exactly one 0 ≤ N ⊥ A N + b ≥ 0 if and only if all principal minors of A are positive.
Otherwise there may be no N or several, which Painlevé noticed on a rod (Sur les lois du frottement de glissement, 1895).

The constraint that presses a joint always holds and may push and pull, and its friction is −μ s N with the sign s of N. So it belongs to
all minors, which have to be positive for both signs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.sliding_in_c import is_positive, parts
from ncgen.model.expressions import symbols_in
from ncgen.model.values import Scalar
from ncgen.program.motions.sliding import BEGINNING, Sliding
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.holdables import Holdable
from ncgen.solver.events.modes import sliding_of
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.instant import instant
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.positions.rank import null_space, scaled_jacobian

SHARED = 1e-6
"""A constraint shares its load with others if it takes more than this part in loads that cancel each other."""


def check_determined(functions: EventFunctions, kernels: Kernels, held: tuple[Holdable, ...], at: State) -> None:
    """Raise ConvergenceError where loads that friction follows in a mode are not determined. kernels: of the mode"""
    if functions.loaded:
        _check_unshared(functions, kernels, at)
    sliding = sliding_of(kernels, held, functions.loaded)
    if not sliding:
        return
    if sliding[0].across is not None:
        return _check_root(functions, kernels, sliding, at)
    by_friction, plain = _responses(functions, kernels, sliding, at)
    joints = [k for k, each in enumerate(sliding) if each.is_joint]
    contacts = [k for k, each in enumerate(sliding) if not each.is_joint]
    signs = [*product(*[(1.0, -1.0) if each.is_joint else (1.0,) for each in sliding])]
    for closed in (*([()] if joints else []), *parts(len(contacts))):
        chosen = [*(contacts[k] for k in closed), *joints]
        block = np.ix_(chosen, chosen)
        whole = float(np.linalg.det(plain[block]))
        if not all(is_positive(np.linalg.det((plain @ (np.eye(len(sliding)) - by_friction * each))[block]), whole) for each in signs):
            raise undetermined(functions, [sliding[k] for k in chosen], at)


def _check_root(functions: EventFunctions, kernels: Kernels, sliding: Sequence[Sliding], at: State) -> None:
    """Raise ConvergenceError where the load of a joint that two constraints press is not determined: where the friction of a load of 1 N
    makes a load of 1 N or more."""
    now, rows = instant(kernels, at.q, at.qd, at.t, at.p), [sliding[0].row, sliding[0].across]
    forces = _friction(functions, sliding[0], at)[:, None] * kernels.column_sizes[:, None] / now.unit
    made = KKT(now.mass, now.jacobian, kernels).solve(forces, np.zeros((kernels.m, 1)))[1][rows, 0]
    if not is_positive(1 - np.sum((now.unit / kernels.row_sizes[rows] * made) ** 2)):
        raise undetermined(functions, sliding, at)


def _check_unshared(functions: EventFunctions, kernels: Kernels, at: State) -> None:
    """Raise ConvergenceError where a constraint that presses a joint shares its load with others."""
    cancelling = null_space(scaled_jacobian(kernels, at.q, at.t, at.p).T)
    for name, load in [(each.name, load) for each in functions.loaded for load in each.pressed]:
        if cancelling.size and np.max(np.abs(cancelling[load])) > SHARED:
            raise ConvergenceError(
                f"{functions.kernels.name}: at t = {at.t:.6g} s the load of friction {name}, constraint "
                f"{kernels.rows[load].label}, is shared with redundant constraints; leave these out"
            )


def _responses(functions: EventFunctions, kernels: Kernels, sliding: Sequence[Sliding], at: State) -> tuple[np.ndarray, np.ndarray]:
    """Loads (k, k) that friction brings about for loads of 1 N, and accelerations (k, k) of gaps for loads of 1 N without friction, all
    else that is held staying so."""
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
    return by_friction, np.linalg.inv(by_motion)


def _friction(functions: EventFunctions, sliding: Sliding, at: State) -> np.ndarray:
    """Generalised friction (n,) of a contact or joint for a load of 1 N."""
    if sliding.is_joint:
        k = next(k for k, friction in functions.frictions.items() if friction.name == sliding.name)
        return -functions.static(k, at) * functions.rate_slopes(at)[k] * at.p[functions.kernels.parameters.index(sliding.slip[0])]
    k = next(k for k, contact in functions.contacts.items() if contact.name == sliding.name)
    velocity, slopes = functions.sliding(at)[k]
    direction = at.p[[functions.kernels.parameters.index(name) for name in sliding.slip]]
    if len(direction) > 1:
        direction = np.sign(velocity @ direction) * velocity + BEGINNING * direction
    direction = direction / (np.linalg.norm(direction) or 1.0)
    return -functions.friction(k, at) * (slopes.T @ direction)


def undetermined(functions: EventFunctions, sliding: Sequence[Sliding], at: State) -> ConvergenceError:
    """The refusal, with names, friction and place."""
    names, rubbing = {each.words for each in sliding}, []
    for k, contact in functions.contacts.items():
        if f"contact {contact.name}" in names:
            coordinates = ", ".join(f"{_number(functions, x, at):.6g}" for x in contact.position)
            where = f" at ({coordinates}) m" if coordinates else ""
            rubbing.append(f"contact {contact.name} with friction {functions.friction(k, at):g}{where}")
    for k, friction in functions.frictions.items():
        if f"friction {friction.name}" in names:
            rubbing.append(f"friction {friction.name} with coefficient {functions.static(k, at):g}")
    compliant = "" if any(each.is_joint for each in sliding) else ", or a compliant contact"
    return ConvergenceError(
        f"{functions.kernels.name}: at t = {at.t:.6g} s the load of {', '.join(rubbing)} is not determined, "
        f"its friction is too large for the direction in which it slides (Painlevé); take less friction{compliant}"
    )


def _number(functions: EventFunctions, expression: Scalar, at: State) -> float:
    """An expression of positions and parameters at a state."""
    import sympy

    kernels = functions.kernels
    known = dict(zip(kernels.coordinates, at.q, strict=True)) | dict(zip(kernels.parameters, at.p, strict=True))
    formula = sympy.Add(expression)
    return float(formula.subs({s: known[s.name] for s in symbols_in(formula)}))
