"""How velocities after impacts change with the state before them.

The impulses Λ along the rows W of gaps and of sliding velocities, and μ of the constraints, follow from M (q̇⁺ − q̇) + Φ_qᵀ μ = Wᵀ Λ,
Φ_q q̇⁺ = ν and a law for every row (`ncgen.solver.events.blows`): a gap that is hit has u⁺ + e u⁻ = 0, a contact that sticks
w⁺ + e_t w⁻ = 0, and one that slides P = −μ Λ d with the direction d of w⁺ + e_t w⁻. What each does is held, and its law differentiated.
With Poisson's law compression comes first, and what restitution adds has the least impulse e Λ along the gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.model.values import Scalar, is_number
from ncgen.solver.derivatives.event_equations import along, impulses, no_derivative, reactions, solved
from ncgen.solver.events.blows import Blow, Phase, manner_of, phases
from ncgen.solver.events.condition_jacobians import EventTangents
from ncgen.solver.events.conditions import changes_of
from ncgen.solver.events.impacts import Gaps
from ncgen.solver.events.instants import gaps_of
from ncgen.solver.events.state import Done

MIN_SLIDING = 1e-7
"""A contact is at the limit of its friction whose sliding velocity after an impact is a smaller share of what impulses change it by."""


@dataclass(frozen=True, eq=False)
class _Gap:
    """A gap that is hit: its name, blow and velocity before the impact, and how its coefficients change, (N,) each."""

    name: str
    blow: Blow
    restitution: np.ndarray
    friction: np.ndarray
    tangential: np.ndarray


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
        functions, at = self._functions, done.before
        gaps, mode = gaps_of(functions, at, done.events), functions.mode(at)
        values = along(self._tangents.values(at), time, change)
        hit = [self._gap(k, blow, values) for k, blow in zip(done.events, gaps.blows(range(len(gaps.gaps))), strict=True)]
        total, by_total, by_velocity = np.zeros(len(gaps.W)), np.zeros((len(gaps.W), len(time))), np.zeros((len(at.q), len(time)))
        for phase in self._phases(gaps, hit, mode, done):
            laws = partial(_laws, gaps=gaps, hit=hit, phase=phase, before=(total, by_total), at=f"at t = {at.t:.9g} s", kernels=mode)
            total = total + phase.impulses
            after = at.qd + gaps.response @ total
            push = np.zeros(self._tangents.row_count)
            places = [place for k in done.events for place in self._tangents.places(k)]
            push[places] = total
            found = self._tangents.impact(mode, at, after, reactions(mode, at, after, gaps.W.T @ total), push)
            balance, constraints, before_by, after_by = (along(each, time, change) for each in found)
            x, _ = solved(mode, at, np.zeros((0, mode.n)), -balance, -constraints)
            matrix, right = laws(before_by=before_by[places], after_by=after_by[places] + gaps.W @ x)
            by_total = np.linalg.lstsq(matrix, right, rcond=None)[0]
            by_velocity = x + gaps.response @ by_total
        return by_velocity

    def _gap(self, k: int, blow: Blow, values: np.ndarray) -> _Gap:
        functions = self._functions
        contact = next((functions.contacts[number] for number, gap in functions.gaps.items() if gap == k), None)
        event = functions.events[k] if k < len(functions.events) else None

        def changes(words: str, value: Scalar) -> np.ndarray:
            return np.zeros(values.shape[1]) if is_number(value) else self.element(words, values)

        name = event.name if event else functions.ratchets[k].name
        return _Gap(
            name,
            blow,
            changes(f"event {name}", event.impact.restitution if event and event.impact else 0.0),
            changes(f"contact {name}, friction", contact.friction if contact else 0.0),
            changes(f"contact {name}, tangential", contact.tangential if contact else 0.0),
        )

    def _phases(self, gaps: Gaps, hit: list[_Gap], mode: Kernels, done: Done) -> tuple[Phase, ...]:
        """Of an impact in which all these gaps are hit."""
        u = gaps.velocities(done.before.qd)
        if any(len(gap.rubs) for gap in gaps.gaps):
            found = phases(gaps.G, u, [each.blow for each in hit])
            assert found is not None, "the run found impulses"
            return found
        needed = u * (1 + np.array([gap.restitution for gap in gaps.gaps]))
        return (Phase(needed, np.full(len(u), -1.0), -impulses(mode, done.before, done.after.qd, gaps.W)[1]),)


def _laws(
    gaps: Gaps, hit: list[_Gap], phase: Phase, before: tuple[np.ndarray, np.ndarray], at: str, kernels: Kernels, before_by: np.ndarray,
    after_by: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Equations (r, r), (r, N) of how all impulses change that there are after a phase.

    before: impulses (r,) before it and how they change; before_by, after_by (r, N): how the velocities of the rows before the impact, and
    after it at held impulses, change
    """
    count = len(gaps.W)
    (former, by_former), G = before, gaps.G
    matrix, right, velocity = np.eye(count), by_former.copy(), G @ phase.impulses + phase.bias
    sizes, start = np.abs(G) @ np.abs(phase.impulses) + np.abs(phase.bias), gaps.start
    for each in hit:
        blow, gap, across = each.blow, each.blow.places[0], each.blow.places[1:]
        is_closed, direction = manner_of(velocity, phase.impulses, blow, phase.least)
        if is_closed:
            e, by_e = (0.0, 0.0 * each.restitution) if blow.is_poisson else (blow.restitution, each.restitution)
            matrix[gap], right[gap] = G[gap], -(after_by[gap] + e * before_by[gap] + by_e * start[gap])
        elif blow.is_poisson:
            right[gap] += each.restitution * former[gap] + blow.restitution * by_former[gap]
        if not len(across):
            continue
        rest = after_by[across] + blow.tangential * before_by[across] + np.outer(start[across], each.tangential)
        limit, speed = blow.friction * phase.impulses[gap], float(np.linalg.norm(velocity[across]))
        if limit and (is_closed or phase.least[gap]) and _is_at_limit(phase, blow, speed, float(np.max(sizes[across])), direction):
            raise no_derivative(kernels, each.name, f"{at} is at the limit between sticking and sliding", "take other friction")
        if direction is None and (is_closed or phase.least[gap]):
            matrix[across], right[across] = G[across], -rest
        elif direction is not None:
            turning = limit / speed * (np.eye(len(across)) - np.outer(direction, direction))
            matrix[across] += turning @ G[across]
            matrix[across, gap] += blow.friction * direction
            right[across] += np.outer(direction, blow.friction * by_former[gap] - each.friction * phase.impulses[gap]) - turning @ rest
    return matrix, right


def _is_at_limit(phase: Phase, blow: Blow, speed: float, size: float, direction: np.ndarray | None) -> bool:
    """Whether other friction would change what a contact does."""
    if direction is not None:
        return speed <= MIN_SLIDING * size
    limit, push = blow.friction * phase.impulses[blow.places[0]], float(np.linalg.norm(phase.impulses[blow.places[1:]]))
    return push >= limit * (1 - MIN_SLIDING)
