"""What one run in C at a time has to itself: its options, workspace and listener, which a later run takes again.

Runs of several threads, and a run that a callback of another one begins, each have their own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.listening import Listener, watch
from ncgen.toolchain.abi import InC, Interface, Number

MAX_KEPT_NUMBERS = 2**17
"""Numbers of a workspace that is kept for later runs, 1 MiB of doubles; a run with more takes so long that new memory costs nothing."""


class SpaceSizes(NamedTuple):
    """Of one state derivative: whole numbers of a workspace, and unknowns that a stage eliminates."""

    n_integers: int
    n_eliminated: int


class RunSpace:
    """Of one state derivative.

    options: an ncgen_options; dynamics: an ncgen_dynamics; rows: an int; inspection: an ncgen_inspection; integers: of the workspace
    listener: whom the options call
    numbers_in_c: stands for the numbers in options and dynamics, None where they are those of one run alone
    """

    numbers_in_c: object = None

    def __init__(self, ffi: Interface, number: Number, sizes: SpaceSizes) -> None:
        self._ffi, self._number = ffi, number
        self.options: InC = ffi.new("ncgen_options *")
        self.dynamics: InC = ffi.new("ncgen_dynamics *")
        self.rows: InC = ffi.new("int *")
        self.inspection: InC = ffi.new("ncgen_inspection *")
        self.listener = Listener(None, sizes.n_eliminated)
        self._context = ffi.new_handle(self.listener)
        self._hear, self._bytes = watch(number.name), ffi.buffer(self.options)
        self.integers = pointer(ffi, np.empty(sizes.n_integers, dtype=np.intc), "int[]")
        self._size, self._numbers = -1, ffi.NULL

    def take_options(self, options: bytes) -> None:
        """Let the ncgen_options be of these bytes, with the listener's members."""
        self._bytes[:] = options
        made = self.options
        made.progress, made.context, made.attempts_left = self._hear, self._context, self.listener.attempts

    def room(self, size: int) -> InC:
        """Return room for so many numbers."""
        if size > self._size:
            self._size, self._numbers = size, pointer(self._ffi, np.empty(size, self._number.dtype), self._number.array)
        return self._numbers

    def clear(self) -> bool:
        """Forget what a run said; whether this may be kept for another one."""
        self.listener.progress = self.listener.raised = None
        return self._size <= MAX_KEPT_NUMBERS


class RunSpaces:
    """Those of one state derivative that no run has at the moment."""

    def __init__(self, ffi: Interface, number: Number, sizes: SpaceSizes) -> None:
        self._arguments, self._free = (ffi, number, sizes), list[RunSpace]()

    def take(self, progress: Callable[[float], None] | None) -> RunSpace:
        """Return one for a run, which is given back after it; progress: as of `Listener`."""
        try:
            space = self._free.pop()
        except IndexError:
            space = RunSpace(*self._arguments)
        space.listener.begin(progress)
        return space

    def give_back(self, space: RunSpace) -> None:
        """Keep a space for later runs, unless it is large."""
        if space.clear():
            self._free.append(space)
