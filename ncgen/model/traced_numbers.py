"""Numbers that know how they were computed from those of a model, so that code which was generated once serves other numbers, too.

A `Traced` is a float. Arithmetic on it gives another one, which equals it only if it is computed alike, and what it is compared with is
recorded. Code that was generated for a model holds for other numbers in the same positions where every comparison has the same outcome.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, SupportsFloat, TypeAlias

GIVEN, CONSTANT = "given", "constant"
"""Codes of the operations without operands: a number of the model, by its position, and any other one."""

BINARY: dict[str, Callable[[float, float], float]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "truediv": operator.truediv,
}  # fmt: skip
COMPARED: dict[str, Callable[[float, float], bool]] = {
    "lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge, "eq": operator.eq, "ne": operator.ne,
}  # fmt: skip

NEUTRAL = {"add": 0.0, "sub": 0.0, "mul": 1.0, "truediv": 1.0}
"""What changes nothing on the right of an operator."""

Operation: TypeAlias = tuple[str, tuple[Any, ...]]
"""Code and operands: the numbers of other operations, or what an operation without operands is made of."""


class TracedComparison(NamedTuple):
    """Two operations that were compared: the operator's name, and the outcome."""

    name: str
    left: int
    right: int
    outcome: bool


class Trace:
    """How numbers were computed from the numbers of a model, and what they were compared with."""

    def __init__(self, operations: Sequence[Operation] = ()) -> None:
        self.operations: list[Operation] = list(operations)
        self._outcomes: dict[tuple[str, int, int], bool] = {}

    @cached_property
    def _known(self) -> dict[Operation, int]:
        """{operation: its number}; what is only recalled has no need of it."""
        return {operation: k for k, operation in enumerate(self.operations)}

    @property
    def comparisons(self) -> list[TracedComparison]:
        return [TracedComparison(*compared, outcome) for compared, outcome in self._outcomes.items()]

    def given(self, value: float, position: int) -> Traced:
        """A number of the model."""
        return Traced(value, self, self._number_of((GIVEN, (position,))))

    def operation(self, value: float) -> int:
        """The operation that gives a number."""
        return value.operation if isinstance(value, Traced) else self._number_of((CONSTANT, (float(value),)))

    def made(self, code: str, value: float, *operands: float) -> Traced:
        """A number that was computed from others."""
        return Traced(value, self, self._number_of((code, tuple(map(self.operation, operands)))))

    def compare(self, name: str, outcome: bool, left: float, right: float) -> bool:
        """Record the outcome of a comparison."""
        self._outcomes[name, self.operation(left), self.operation(right)] = outcome
        return outcome

    def _number_of(self, operation: Operation) -> int:
        if operation not in self._known:
            self._known[operation] = len(self.operations)
            self.operations.append(operation)
        return self._known[operation]


def computed(
    operations: Sequence[Operation], comparisons: Sequence[TracedComparison], numbers: Sequence[float], functions: Mapping[str, Any]
) -> list[float] | None:
    """The results of a trace's operations for other numbers of a model; None where a comparison has another outcome or a result is not
    finite.

    functions: {code: function of floats} of all other codes
    """
    table = {**functions, **BINARY, "neg": operator.neg, "abs": operator.abs}
    values: list[float] = []
    try:
        for code, operands in operations:
            if code == GIVEN:
                values.append(numbers[operands[0]])
            elif code == CONSTANT:
                values.append(operands[0])
            else:
                values.append(table[code](*[values[k] for k in operands]))
    except (ArithmeticError, ValueError):
        return None
    same = all(COMPARED[name](values[a], values[b]) == outcome for name, a, b, outcome in comparisons)
    return values if same and all(map(math.isfinite, values)) else None


ROUNDING = 4 * sys.float_info.epsilon
"""By which a number that was computed may miss 1 or −1."""


def unit_near(number: float) -> float | None:
    """0 where a number is 0, 1 or −1 where it is that but for rounding, else None."""
    if number == 0.0:
        return 0.0
    return math.copysign(1.0, number) if abs(abs(number) - 1.0) <= ROUNDING else None


def folded(value: SupportsFloat) -> float:
    """A number, or 0, 1 or −1 where it is that and simplifies what it meets; of a traced number the comparison is recorded, and 1 is what
    differs from it by rounding."""
    unit = unit_near(float(value))
    if unit is None or not isinstance(value, Traced):
        return value if isinstance(value, Traced) else float(value)
    is_unit = abs(value - unit) <= ROUNDING if unit else value == 0.0
    return unit if is_unit else value


class Traced(float):
    """A number, the trace that it belongs to, and the operation that gives it."""

    __slots__ = ("operation", "trace")

    def __new__(cls, value: float, trace: Trace, operation: int) -> Traced:
        made = super().__new__(cls, value)
        made.trace, made.operation = trace, operation
        return made

    def __reduce__(self) -> tuple[type[Traced], tuple[float, Trace, int]]:
        return Traced, (float(self), self.trace, self.operation)

    def hex(self) -> str:
        """What tells it from other numbers: how it is computed, and not that its value happens to be that of another one."""
        return f"{self.operation} of a trace"

    def __neg__(self) -> Traced:
        return self.trace.made("neg", -float(self), self)

    def __abs__(self) -> Traced:
        return self.trace.made("abs", abs(float(self)), self)

    __hash__ = float.__hash__


def _has_arithmetic(code: str, function: Callable[[float, float], float]) -> None:
    """Give traced numbers an operator of arithmetic, on both sides."""

    def left(self: Traced, other: object) -> Any:
        if not isinstance(other, (float, int)):
            return NotImplemented
        return self if _is_plain(other, NEUTRAL[code]) else self.trace.made(code, function(float(self), float(other)), self, other)

    def right(self: Traced, other: object) -> Any:
        if not isinstance(other, (float, int)):
            return NotImplemented
        is_same = code in ("add", "mul") and _is_plain(other, NEUTRAL[code])
        return self if is_same else self.trace.made(code, function(float(other), float(self)), other, self)

    setattr(Traced, f"__{code}__", left)
    setattr(Traced, f"__r{code}__", right)


def _is_plain(value: float, number: float) -> bool:
    return not isinstance(value, Traced) and value == number


def _is_compared(name: str, function: Callable[[float, float], bool]) -> None:
    """Let traced numbers record a comparison."""

    def compared(self: Traced, other: object) -> Any:
        if not isinstance(other, (float, int)):
            return NotImplemented
        if isinstance(other, Traced) and name in ("eq", "ne"):
            return function(self.operation, other.operation)  # that two numbers happen to be equal says nothing of others
        return self.trace.compare(name, function(float(self), float(other)), self, other)

    setattr(Traced, f"__{name}__", compared)


for _code, _function in BINARY.items():
    _has_arithmetic(_code, _function)
for _name, _test in COMPARED.items():
    _is_compared(_name, _test)


def called(name: str, function: Callable[..., float], arguments: Sequence[float]) -> float:
    """A function of numbers, which has this name in a trace."""
    value = function(*map(float, arguments))
    trace = next((argument.trace for argument in arguments if isinstance(argument, Traced)), None)
    return value if trace is None else trace.made(name, value, *arguments)
