"""What values must satisfy, such as a mass that is not negative: numbers when a model is made, parameters wherever p is given.

A condition says the same of both, so a model that depends on parameters refuses what one that is made with numbers refuses.
"""

from __future__ import annotations

import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.values import Value, is_number

TRIANGLE = 1e-12
"""Slack, relative to the largest moment, in the triangle inequalities of an inertia tensor: rounding of its principal moments."""

PARALLEL = 1e-6
"""Rows 1002 and 1003 are refused within this angle (rad) of 0 and pi: their gradient repeats the unit norm's."""

UNIT_LENGTH = 1e-9
"""How far a unit vector's length may be from 1, and by how much rounding may lift a cosine above 1."""

RELATIONS = {">": operator.gt, ">=": operator.ge, "!=": operator.ne, "<": operator.lt, "<=": operator.le}


class Condition(ABC):
    """What some values must satisfy together."""

    @property
    @abstractmethod
    def values(self) -> tuple[Value, ...]:
        """The k values."""

    @abstractmethod
    def holds(self, numbers: np.ndarray) -> np.ndarray:
        """Whether it holds for the numbers (…, k) of the values, shape (…); False for NaN."""

    @abstractmethod
    def sentence(self, numbers: np.ndarray) -> str:
        """What is wrong with numbers (k,) for which it does not hold, and what to do."""

    @property
    def is_parametric(self) -> bool:
        """True if a parameter has a say in it."""
        return not all(map(is_number, self.values))

    def check(self, numbers: Sequence[float] | np.ndarray) -> None:
        """Raise ModelError where it does not hold for the numbers (k,)."""
        array = np.array(numbers, dtype=float)
        if not self.holds(array):
            raise ModelError(self.sentence(array))


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound(Condition):
    """A value above zero, not below it, or other than zero.

    wording: what stands before the number in the message; relation: ">", ">=" or "!="; unit ("" for none), remedy: what stands behind it
    """

    wording: str
    value: Value
    relation: str
    unit: str
    remedy: str

    @property
    def values(self) -> tuple[Value, ...]:
        return (self.value,)

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        x = numbers[..., 0]
        return RELATIONS[self.relation](x, 0.0) & np.isfinite(x)

    def sentence(self, numbers: np.ndarray) -> str:
        number = f"{self.wording} {numbers[0]:g} {self.unit}".rstrip()
        return f"{number}; {self.remedy}"


@dataclass(frozen=True, eq=False)
class Between(Condition):
    """A value from one number to another. wording: what stands before the number in the message"""

    wording: str
    value: Value
    lowest: float
    highest: float

    @property
    def values(self) -> tuple[Value, ...]:
        return (self.value,)

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        return (self.lowest <= numbers[..., 0]) & (numbers[..., 0] <= self.highest)

    def sentence(self, numbers: np.ndarray) -> str:
        return f"{self.wording} {numbers[0]:g}; give a number from {self.lowest:g} to {self.highest:g}"


@dataclass(frozen=True, eq=False)
class Ordered(Condition):
    """Two values, the first of which is less than the second, or not more.

    relation: "<" or "<="; wording: the message, in which {0} and {1} are the numbers
    """

    lower: Value
    relation: str
    upper: Value
    wording: str

    @property
    def values(self) -> tuple[Value, ...]:
        return (self.lower, self.upper)

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        return RELATIONS[self.relation](numbers[..., 0], numbers[..., 1])

    def sentence(self, numbers: np.ndarray) -> str:
        return self.wording.format(f"{numbers[0]:g}", f"{numbers[1]:g}")


@dataclass(frozen=True, eq=False)
class Cosine(Condition):
    """A value that is the cosine of an angle other than 0 and π."""

    where: str
    value: Value

    @property
    def values(self) -> tuple[Value, ...]:
        return (self.value,)

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        return np.abs(numbers[..., 0]) <= math.cos(PARALLEL)

    def sentence(self, numbers: np.ndarray) -> str:
        cosine = float(numbers[0])
        if not abs(cosine) <= 1 + UNIT_LENGTH:
            return f"{self.where}: the cosine is {cosine:.12g}; give a number between -1 and 1"
        angle = "0" if cosine > 0 else "pi"
        return (
            f"{self.where}: the cosine is {cosine:.12g}, an angle of {angle}, where this constraint says no more than the unit length; "
            "share the vector, or use a parallel row"
        )


@dataclass(frozen=True, eq=False)
class Moments(Condition):
    """The nine entries of a symmetric inertia tensor (kg m²) whose principal moments a body can have.

    The planar inertia tensor ½ tr(I) 1 − I = ∫ρ d dᵀ must be positive semidefinite; for the principal moments these are the triangle
    inequalities.
    """

    name: str
    tensor: np.ndarray

    @property
    def values(self) -> tuple[Value, ...]:
        return tuple(self.tensor.flat)

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        low, middle, high = np.moveaxis(_principal(numbers), -1, 0)
        return (low >= -TRIANGLE * np.abs(high)) & (low + middle >= high * (1 - TRIANGLE))

    def sentence(self, numbers: np.ndarray) -> str:
        low, middle, high = _principal(numbers)
        return (
            f"body {self.name}: no body has principal moments of inertia {low:g}, {middle:g}, {high:g} kg m2: "
            f"the largest exceeds the sum of the others, {low + middle:g}; check units and the point they refer to"
        )


def _principal(numbers: np.ndarray) -> np.ndarray:
    """Principal moments (…, 3), increasing, of tensors (…, 9); NaN where an entry is not finite."""
    tensors = numbers.reshape(*numbers.shape[:-1], 3, 3)
    finite = np.asarray(np.isfinite(tensors).all(axis=(-2, -1), keepdims=True))
    moments = np.linalg.eigvalsh(np.where(finite, (tensors + tensors.swapaxes(-1, -2)) / 2, 0.0))
    return np.where(finite[..., 0], moments, np.nan)
