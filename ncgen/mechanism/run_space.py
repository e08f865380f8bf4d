"""What one run in C at a time has to itself: its options, workspace and listener, which a later run takes again.

Runs of several threads, and a run that a callback of another one begins, each have their own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.listening import Listener, watch
from ncgen.toolchain.abi import InC, Interface, Number

MAX_KEPT_NUMBERS = 2**17
"""Numbers of a workspace that is kept for later runs, 1 MiB of doubles; a run with more takes so long that new memory costs nothing."""


class RunSpace:
    """Of one state derivative.

    options: an ncgen_options; dynamics: an ncgen_dynamics; rows: an int; listener: whom the options call; integers: of the workspace
    """

    def __init__(self, ffi: Interface, number: Number, n_integers: int, size: int) -> None:
        self._ffi, self._number = ffi, number
        self.options: InC = ffi.new("ncgen_options *")
        self.dynamics: InC = ffi.new("ncgen_dynamics *")
        self.rows: InC = ffi.new("int *")
        self.listener = Listener(None, size)
        self._context = ffi.new_handle(self.listener)
        self.options.progress, self.options.context = watch(number.name), self._context
        self._plain, self._bytes = bytes(ffi.buffer(self.options)), ffi.buffer(self.options)
        self.integers = pointer(ffi, np.empty(n_integers, dtype=np.intc), "int[]")
        self._size, self._numbers = -1, ffi.NULL

    def begin(self, progress: Callable[[float], None] | None) -> None:
        """All options are zero then, but those of the listener."""
        self.listener.begin(progress)
        self._bytes[:] = self._plain
        self.options.attempts_left = self.listener.attempts

    def end(self) -> None:
        """Keep nothing of a run alive."""
        self.listener.begin(None)

    def numbers(self, size: int) -> InC:
        """Return room for so many numbers."""
        if size > self._size:
            self._size, self._numbers = size, pointer(self._ffi, np.empty(size, self._number.dtype), self._number.array)
        return self._numbers

    @property
    def is_small(self) -> bool:
        """Whether it may be kept."""
        return self._size <= MAX_KEPT_NUMBERS


class RunSpaces:
    """Those of one state derivative that no run has at the moment; size: unknowns that a stage of a run eliminates, as of `Listener`."""

    def __init__(self, ffi: Interface, number: Number, n_integers: int, size: int) -> None:
        self._arguments, self._free = (ffi, number, n_integers, size), list[RunSpace]()

    def take(self, progress: Callable[[float], None] | None) -> RunSpace:
        """Return one for a run, which is given back after it; progress: as of `Listener`."""
        try:
            space = self._free.pop()
        except IndexError:
            space = RunSpace(*self._arguments)
        space.begin(progress)
        return space

    def give_back(self, space: RunSpace) -> None:
        """Keep a space for later runs, unless it is large."""
        space.end()
        if space.is_small:
            self._free.append(space)
