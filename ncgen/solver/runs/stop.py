"""Where a run ends before its time: a coordinate or a velocity that passes a value."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ncgen.errors import ModelError, one_of, shown
from ncgen.mechanism.conditions_in_c import Conditions
from ncgen.methods.table import is_real
from ncgen.model.elements import coordinate_of
from ncgen.solver.argument_checks import Outline
from ncgen.solver.runs.crossing import SAMPLES, first_crossing

State = TypeVar("State", bound=tuple[Any, ...])
"""A state of a run: q, q̇, and whatever else an engine wants to know of it."""

GAP_ROUNDING = 1000 * float(np.finfo(float).eps)
"""A gap smaller than this, relative to the value and to the largest gap of a step, has no sign."""

DIRECTIONS = {"falling": -1, "either": 0, "rising": 1}


@dataclass(frozen=True)
class StopCondition:
    """coordinate: position in q, or n + position in q̇; direction: 1 rising, −1 falling, 0 either."""

    coordinate: int
    value: float
    direction: int

    def gap(self, q: np.ndarray, qd: np.ndarray) -> float:
        """How far a state is above the value."""
        return float(np.concatenate([q, qd])[self.coordinate]) - self.value

    @property
    def conditions(self) -> Conditions:
        """The same for C."""
        return Conditions(
            coordinates=np.array([self.coordinate]),
            values=np.array([self.value]),
            directions=np.array([self.direction]),
            signs=np.array([0]),
        )

    def find(self, t0: float, t1: float, before: State, after: State, state: Callable[[float], State]) -> tuple[float, State] | None:
        """(time, state) at which it happens for the first time between two states, or None; a run that starts there continues.

        state(t) -> a state inside the step, whose first two members are q and q̇
        """

        def gap(t: float) -> float:
            return self.gap(*state(t)[:2])

        inner = [gap(t0 + float(s) * (t1 - t0)) for s in SAMPLES[1:-1]]
        values = np.array([self.gap(*before[:2]), *inner, self.gap(*after[:2])])
        noise = GAP_ROUNDING * float(max(abs(self.value), np.max(np.abs(values))))
        bracket = first_crossing(values, noise, self.direction)
        if bracket is None:
            return None
        low, high = bracket
        at_low = values[0] if low == 0 else gap(t0 + low * (t1 - t0))
        at_high = values[-1] if high == 1 else gap(t0 + high * (t1 - t0))
        low, high = t0 + low * (t1 - t0), t0 + high * (t1 - t0)
        if at_low * at_high < 0:
            return self._locate(low, high, at_low, at_high, state)
        return high, state(high)  # on the constraints it turns a little beside the interpolant

    def _locate(self, low: float, high: float, at_low: float, at_high: float, state: Callable[[float], State]) -> tuple[float, State]:
        """(time, state) where the gap is zero between two times with gaps of different signs, by the Illinois rule down to rounding."""
        side = 0
        for _ in range(60):
            t = low + (high - low) * at_low / (at_low - at_high)
            state_there = state(t)
            gap = self.gap(*state_there[:2])
            if gap == 0.0 or not low < t < high:
                return t, state_there
            if (gap > 0) == (at_high > 0):
                high, at_high, at_low, side = t, gap, at_low * (0.5 if side > 0 else 1.0), 1
            else:
                low, at_low, at_high, side = t, gap, at_high * (0.5 if side < 0 else 1.0), -1
        return high, state(high)


def stop_at(kernels: Outline, wanted: Mapping[str, Any] | None) -> StopCondition | None:
    """What {"psi": 1.2}, {"rate(psi)": 0.0} or {"psi": (1.2, "rising")} means. Raises ModelError where it means nothing."""
    if wanted is None:
        return None
    if not isinstance(wanted, dict) or len(wanted) != 1:
        raise ModelError(f'stop: {shown(wanted)} given; it is one coordinate and its value, {{"{kernels.coordinates[0]}": 0.0}}')
    ((name, condition),) = wanted.items()
    inner = coordinate_of(name) if isinstance(name, str) else name
    if inner not in kernels.index:
        raise ModelError(f"stop at {name}: {kernels.name} has no free coordinate {inner}; it has {', '.join(kernels.coordinates)}")
    value, direction = condition if isinstance(condition, (tuple, list)) and len(condition) == 2 else (condition, "either")
    one_of(direction, f"stop at {name}: direction", DIRECTIONS)
    if not (is_real(value) and abs(value) <= sys.float_info.max):
        raise ModelError(f'stop at {name}: {shown(value)} given; it must be a number, or a number and a direction, (0.5, "rising")')
    return StopCondition(kernels.index[inner] + (kernels.n if inner != name else 0), float(value), DIRECTIONS[direction])
