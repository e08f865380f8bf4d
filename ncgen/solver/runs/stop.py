"""Where a run ends before its time: a coordinate or a velocity that passes a value."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.methods.table import is_real
from ncgen.model.elements import coordinate_of
from ncgen.solver.given import Outline

State = TypeVar("State", bound=tuple[Any, ...])
"""A state of a run: q, q̇, and whatever else an engine wants to know of it."""

DIRECTIONS = {"falling": -1, "either": 0, "rising": 1}


@dataclass(frozen=True)
class Stop:
    """coordinate: position in q, or n + position in q̇; direction: 1 rising, −1 falling, 0 either."""

    coordinate: int
    value: float
    direction: int

    def gap(self, q: np.ndarray, qd: np.ndarray) -> float:
        """How far a state is above the value."""
        return float(np.concatenate([q, qd])[self.coordinate]) - self.value

    def is_passed(self, before: float, after: float) -> bool:
        """True if the gap went through zero, or ends there; a run that starts there goes on."""
        rises, falls = before < 0 <= after, before > 0 >= after
        return (rises and self.direction >= 0) or (falls and self.direction <= 0)

    def locate(self, t0: float, t1: float, before: float, after: float, state: Callable[[float], State]) -> tuple[float, State]:
        """(time, state) at which it happens between two times with these gaps, by the Illinois rule down to rounding.

        state(t) -> a state inside the step, whose first two members are q and q̇
        """
        low, high, at_low, at_high, side = t0, t1, before, after, 0
        for _ in range(60):
            t = low + (high - low) * at_low / (at_low - at_high)
            there = state(t)
            gap = self.gap(*there[:2])
            if gap == 0.0 or not low < t < high:
                return t, there
            if (gap > 0) == (after > 0):
                high, at_high, at_low, side = t, gap, at_low * (0.5 if side > 0 else 1.0), 1
            else:
                low, at_low, at_high, side = t, gap, at_high * (0.5 if side < 0 else 1.0), -1
        return high, state(high)


def stop_at(kernels: Outline, wanted: Mapping[str, Any] | None) -> Stop | None:
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
    if direction not in DIRECTIONS:
        raise ModelError(f"stop at {name}: direction {direction!r} is unknown; choose one of {', '.join(DIRECTIONS)}")
    if not (is_real(value) and abs(value) <= sys.float_info.max):
        raise ModelError(f'stop at {name}: {shown(value)} given; it must be a number, or a number and a direction, (0.5, "rising")')
    return Stop(kernels.index[inner] + (kernels.n if inner != name else 0), float(value), DIRECTIONS[direction])
