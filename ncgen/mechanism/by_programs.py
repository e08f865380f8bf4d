"""What is found once for the programs of a mechanism, and again if its model has grown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar
from weakref import finalize

from ncgen.program.programs import Programs

Result = TypeVar("Result")


class ByPrograms(Generic[Result]):
    """A function of programs whose results are remembered as long as these are there."""

    def __init__(self, find: Callable[[Programs], Result]) -> None:
        self._find = find
        self._results: dict[int, tuple[Result, int]] = {}

    def __call__(self, programs: Programs) -> Result:
        known = self._results.get(id(programs))
        if known is None or known[1] != len(programs.equations.model.facts):
            return self.note(programs, self._find(programs))
        return known[0]

    def note(self, programs: Programs, result: Result) -> Result:
        """Let this be the result, which it is given back."""
        if id(programs) not in self._results:
            finalize(programs, self._results.pop, id(programs), None)
        self._results[id(programs)] = result, len(programs.equations.model.facts)
        return result
