"""The rules of events at one instant in C (ncgen_chain.h): which happen, what they bring about, and where conditions go on."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.listening import called
from ncgen.mechanism.runtime_library import interface_of, runtime_of
from ncgen.toolchain.abi import InC


class Chain:
    """The events at one instant, the first ones of some conditions.

    directions (C,): of the events; look: values and scales of conditions in the present state, (C,) each or more
    due, happened (C,): marks of what is due, and of what has happened
    """

    def __init__(self, directions: np.ndarray, look: Callable[[], tuple[np.ndarray, np.ndarray]]) -> None:
        self._ffi, self._library = interface_of("double"), runtime_of("double", "events")
        self._count = len(directions)
        integers = {name: np.zeros(self._count, dtype=np.intc) for name in ("due", "done", "happened")}
        numbers = {name: np.zeros(2 * self._count) for name in ("pairs", "before")} | {"scales": np.zeros(self._count)}
        self.due, self._done, self.happened = integers.values()
        self._pairs, self._before, self._scales = numbers.values()
        self._directions, self._read, self._raised = np.array(directions, dtype=np.intc), look, list[BaseException]()
        self._struct: InC = self._ffi.new(
            "ncgen_chain *", {"count": self._count, "directions": pointer(self._ffi, self._directions, "int[]")}
        )
        for name, array in integers.items():
            setattr(self._struct, name, pointer(self._ffi, array, "int[]"))
        for name, array in numbers.items():
            setattr(self._struct, name, pointer(self._ffi, array))
        self.look()

    def look(self) -> None:
        """See where conditions are now."""
        for target, array in zip((self._pairs[::2], self._scales), self._read(), strict=True):
            target[:] = array[: self._count]

    def follow(self, due: Iterable[int], act: Callable[[tuple[int, ...]], None]) -> bool:
        """What is due happens, and what that brings about; act does what events of some numbers do.

        Returns False where that has no end, the last ones being due. Raises what act and look raise.
        """
        self.due[:] = 0
        self.due[list(due)] = 1
        look = self._called(self.look)
        do = self._called(lambda: act(tuple(np.flatnonzero(self.due).tolist())))
        self._struct.look, self._struct.act = look, do
        status = self._library.ncgen_follow_chain(self._struct)
        if self._raised:
            raise self._raised[0]
        return bool(status != self._library.NCGEN_ENDLESS)

    def turned(self, before: np.ndarray) -> tuple[int, ...]:
        """Events whose conditions are clearly on another side of zero than before (C,), in their directions."""
        self._before[::2] = before[: self._count]
        self._library.ncgen_find_turned(self._struct)
        return tuple(np.flatnonzero(self.due).tolist())

    def first(self, rates: np.ndarray, gaps: np.ndarray, keeps: np.ndarray, signs: np.ndarray) -> int:
        """Mark what is due at the start, where conditions change at rates (C,). Returns the first gap that is below zero, or −1.

        gaps, keeps (C,): whether an event has an impact, and whether its gap does not change; signs (C,): where conditions go on
        """
        condition_rates = np.ascontiguousarray(rates[: self._count])
        masks = [np.array(mask, dtype=np.intc) for mask in (gaps, keeps, signs[: self._count])]
        arguments = [pointer(self._ffi, mask, "int[]") for mask in masks]
        first = self._library.ncgen_find_first(self._struct, pointer(self._ffi, condition_rates), *arguments)
        signs[: self._count] = masks[-1]
        return int(first)

    def set_sides(self, above: np.ndarray, signs: np.ndarray) -> None:
        """Write where conditions go on into signs (C,) or more; above (C,): whether a gap closes if it falls from here on."""
        marks, sides = (np.array(each[: self._count], dtype=np.intc) for each in (above, signs))
        self._library.ncgen_set_sides(self._struct, pointer(self._ffi, marks, "int[]"), pointer(self._ffi, sides, "int[]"))
        signs[: self._count] = sides

    def _called(self, function: Callable[[], None]) -> InC:
        def call(_: InC) -> int:
            function()
            return 0

        return called(self._ffi, "int(*)(void *)", call, self._raised.append)


def is_zero(value: float, scale: float) -> bool:
    """Whether a condition is zero, but for rounding of states."""
    return bool(runtime_of("double", "events").ncgen_is_zero(value, scale))


def is_at_rest(value: float, scale: float, rate: float, acceleration: float, noise: float) -> bool:
    """Whether the next bounce of a gap cannot be told from none; noise: share of a scale that has no sign."""
    return bool(runtime_of("double", "events").ncgen_is_at_rest(value, scale, rate, acceleration, noise))


def time_of_bounces(rate: float, acceleration: float, restitution: float) -> float:
    """The time (s) in which all bounces of a gap at rest end."""
    return float(runtime_of("double", "events").ncgen_time_of_bounces(rate, acceleration, restitution))
