"""How velocities after impacts change with the state before them.

The impulses Λ along the rows W of gaps and of sliding velocities, and μ of the constraints, follow from M (q̇⁺ − q̇) + Φ_qᵀ μ = Wᵀ Λ,
Φ_q q̇⁺ = ν and a law for every row (ncgen_impulses.h): a gap that is hit has u⁺ + e u⁻ = 0, a contact that sticks w⁺ + e_t w⁻ = 0, and one
that slides P = −μ Λ d with the direction d of w⁺ + e_t w⁻. What each does is held, and its law differentiated. With Poisson's law
compression comes first, and what restitution adds has the least impulse e Λ along the gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.impacts_in_c import LAWS, Blow, impact
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import least_squares
from ncgen.model.values import Value, is_number
from ncgen.solver.derivatives.event_equations import along, impulses_to, no_derivative, reactions, solved
from ncgen.solver.events.condition_jacobians import EventTangents
from ncgen.solver.events.conditions import changes_of
from ncgen.solver.events.impacts import rows_of
from ncgen.solver.events.instants import gaps_of
from ncgen.solver.events.mobility import response
from ncgen.solver.events.state import Done

AT_LIMIT = 1e-7
"""A contact is at the limit of its friction if it sticks with less reserve, or slides more slowly, relative to what impulses change."""

RESTITUTION_ROUNDING = 1e-9
"""An impulse of restitution is the least one of Poisson's law if it is longer by less than this share."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Gap:
    """A gap that is hit, with how its coefficients change, (N,) each."""

    name: str
    blow: Blow
    restitution: np.ndarray
    friction: np.ndarray
    tangential: np.ndarray

    @property
    def across(self) -> slice:
        """The rows at which it slides."""
        return slice(self.blow.gap + 1, self.blow.gap + 1 + self.blow.directions)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rows:
    """W (r, n) of gaps that are hit together, responses of velocities (n, r) and of the rows G (r, r), and velocities u (r,) before."""

    W: np.ndarray
    responses: np.ndarray
    G: np.ndarray
    u: np.ndarray
    gaps: list[_Gap]


@dataclass(frozen=True, eq=False)
class _Pushed:
    """Impulses (r,), and how they change, (r, N)."""

    impulses: np.ndarray
    by: np.ndarray


class ImpactJacobians:
    """Those of a mechanism."""

    def __init__(self, tangents: EventTangents) -> None:
        self._tangents, self._functions = tangents, tangents.functions

    def element(self, words: str, values: np.ndarray) -> np.ndarray:
        """How the value of an element changes, (N,), of those of all values."""
        functions = self._functions
        names = [where for where, _ in functions.named_values[len(changes_of(functions.events)) :]]
        return values[len(values) - len(names) + names.index(words)]

    def __call__(self, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Of the velocities after an impact, (n, N). time, change: as of `along`, before it"""
        at, mode, nothing = done.before, self._functions.mode(done.before), np.zeros((0, len(done.before.q)))
        values = along(self._tangents.values(at), time, change)
        W, drift, blows = rows_of(gaps_of(self._functions, at, done.events, done.restores))
        responses = response(mode, at, W)
        gaps = [self._gap(k, blow, values, done.restores) for k, blow in zip(done.events, blows, strict=True)]
        rows = _Rows(W=W, responses=responses, G=W @ responses, u=W @ at.qd + drift, gaps=gaps)
        positions = [position for k in done.events for position in self._tangents.places(k)]
        pushed, by_velocity = _Pushed(np.zeros(len(W)), np.zeros((len(W), len(time)))), np.zeros((len(at.q), len(time)))
        for total in _phases(rows, impulses_to(mode, at, done.after.qd, W)[1]):
            after, push = at.qd + responses @ total, np.zeros(self._tangents.row_count)
            push[positions] = total
            jacobians = self._tangents.impact(mode, at, after, reactions(mode, at, after, W.T @ total), push)
            balance, constraints, before_by, after_by = (along(each, time, change) for each in jacobians)
            x, _ = solved(mode, at, nothing, -balance, -constraints)
            matrix, right = _laws(rows, pushed, total, before_by[positions], after_by[positions] + W @ x, (mode, at.t))
            pushed = _Pushed(total, least_squares(matrix, right))
            by_velocity = x + responses @ pushed.by
        return by_velocity

    def _gap(self, k: int, blow: Blow, values: np.ndarray, restores: bool) -> _Gap:
        functions = self._functions
        contact = next((functions.contacts[number] for number, gap in functions.gaps.items() if gap == k), None)
        event = functions.events[k] if k < len(functions.events) else None

        def changes(words: str, value: Value) -> np.ndarray:
            return np.zeros(values.shape[1]) if is_number(value) else self.element(words, values)

        name = event.name if event else functions.ratchets[k].name
        return _Gap(
            name=name,
            blow=blow,
            restitution=changes(f"event {name}", event.impact.restitution if event and event.impact and restores else 0.0),
            friction=changes(f"contact {name}, friction", contact.friction if contact else 0.0),
            tangential=changes(f"contact {name}, tangential", contact.tangential if contact and restores else 0.0),
        )


def _phases(rows: _Rows, push: np.ndarray) -> list[np.ndarray]:
    """All impulses (r,) that there are at the end of each phase. push (r,): those of the run, where there is no friction"""
    blows = [gap.blow for gap in rows.gaps]
    if not any(blow.directions for blow in blows):
        return [-push]

    def of(blows: list[Blow]) -> np.ndarray:
        return impact(rows.G, rows.u, blows, LAWS["simultaneous"], np.zeros(len(rows.u)), np.inf).impulses

    if not any(blow.is_poisson and blow.restitution for blow in blows):
        return [of(blows)]
    return [of([blow._replace(restitution=0.0) if blow.is_poisson else blow for blow in blows]), of(blows)]


def _laws(
    rows: _Rows, former: _Pushed, total: np.ndarray, before_by: np.ndarray, after_by: np.ndarray, where: tuple[Kernels, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Equations (r, r), (r, N) of how all impulses change that there are after a phase.

    former: those before it; before_by, after_by (r, N): how velocities before the impact change, and after it at held impulses
    """
    G, more, rubs = rows.G, total - former.impulses, any(each.blow.directions for each in rows.gaps)
    matrix, right, velocity = np.eye(len(G)), former.by.copy(), rows.u + G @ total
    for each in rows.gaps:
        blow, gap, across = each.blow, each.blow.gap, each.across
        least = blow.restitution * former.impulses[gap] if blow.is_poisson else 0.0
        is_closed = not rubs or more[gap] > least * (1 + RESTITUTION_ROUNDING)
        if is_closed:
            e, by_e = (0.0, 0.0 * each.restitution) if blow.is_poisson else (blow.restitution, each.restitution)
            matrix[gap], right[gap] = G[gap], -(after_by[gap] + e * before_by[gap] + by_e * rows.u[gap])
        elif blow.is_poisson:
            right[gap] += each.restitution * former.impulses[gap] + blow.restitution * former.by[gap]
        if not blow.directions or not (is_closed or least):
            continue
        left = velocity[across] + blow.tangential * rows.u[across]
        rest = after_by[across] + blow.tangential * before_by[across] + np.outer(rows.u[across], each.tangential)
        speed, limit = float(np.linalg.norm(left)), blow.friction * more[gap]
        size = float(np.max(np.abs(G[across]) @ np.abs(total) + np.abs(rows.u[across])))
        if speed > AT_LIMIT * size:
            d = left / speed
            turning = limit / speed * (np.eye(len(d)) - np.outer(d, d))
            matrix[across] += turning @ G[across]
            matrix[across, gap] += blow.friction * d
            right[across] += np.outer(d, blow.friction * former.by[gap] - each.friction * more[gap]) - turning @ rest
        elif float(np.linalg.norm(more[across])) < limit * (1 - AT_LIMIT):
            matrix[across], right[across] = G[across], -rest
        else:
            kernels, t = where
            why = f"at t = {t:.9g} s is at the limit between sticking and sliding"
            raise no_derivative(kernels, each.name, why, "take other friction")
    return matrix, right
