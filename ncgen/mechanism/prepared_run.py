"""A run in C but for its numbers: the runtime, its options as C reads them, and how much workspace it takes, found once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import Choices
from ncgen.mechanism.conditions_in_c import Conditions, Watched
from ncgen.mechanism.driving import Driver
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.run_arguments import NO_INPUTS, UNWATCHED_RUN, InitialState, Monitor, RunInputs
from ncgen.mechanism.run_rows import Inspection, Outcome, RunRows
from ncgen.mechanism.run_space import RunSpace
from ncgen.mechanism.runtime_library import interface_of, part_for, runtime_of
from ncgen.methods.table import INTEGRATORS, number_in_c
from ncgen.toolchain.abi import InC

if TYPE_CHECKING:
    from ncgen.mechanism.runtime import Dynamics


class PreparedRun:
    """Of one state derivative by one method. May be used by several threads at a time.

    options: the members of `ncgen_options` besides the method, by their names; sizes is an array, or None for 1
    newton: with tangents, also where the method can do without them
    """

    def __init__(self, dynamics: Dynamics, method: str, options: dict[str, InC], newton: bool = False) -> None:
        self.dynamics, self._method, self._given = dynamics, method, options
        number, kernels, sizes = dynamics.number, dynamics.kernels, options.get("sizes")
        self.ffi, self.n = interface_of(number.name), kernels.n
        self.library = runtime_of(number.name, part_for(method, dynamics.recursion))
        self._takes_tangents = newton or dynamics.uses_tangents(method, options)
        velocities, positions = dynamics.state_counts(options)
        self._counts = ("p", len(kernels.p0)), ("q", kernels.n), ("velocities", velocities)
        settings: InC = self.ffi.new("ncgen_options *", {"rtol": 1e-8, "atol": 1e-10})
        for name, value in (options | {"method": number_in_c(INTEGRATORS[method]), "sizes": self.ffi.NULL}).items():
            setattr(settings, name, value)
        if sizes is not None:
            sizes = laid(sizes, number.dtype, velocities + positions + 1, f"{kernels.name}: sizes")
            self._natural_sizes = settings.sizes = pointer(self.ffi, np.array(sizes), number.array)
        self._options, self._workspaces = bytes(self.ffi.buffer(settings)), dict[tuple[int | None, bool] | None, int]()

    def simulate(
        self, times: Sequence[float] | np.ndarray, initial: InitialState, *, monitor: Monitor = UNWATCHED_RUN, **numbers: Any
    ) -> Outcome:
        """Run over the times (s) of a grid (first one is the start); numbers: arguments of `RunCall`."""
        return self.call(times, initial, conditions=monitor.conditions, **numbers).simulate(monitor.progress)

    def call(self, times: Sequence[float] | np.ndarray, initial: InitialState, **numbers: Any) -> RunCall:
        """A run over the times (s) of a grid (first one is the start), which may be called again; numbers: arguments of `RunCall`."""
        return RunCall(run=self, times=times, initial=initial, **numbers)

    def laid(self, state: InitialState) -> list[InC]:
        """Parameters, position and velocities as C reads them. Raises NcgenError for others."""
        number, name_of = self.dynamics.number, self.dynamics.kernels.name
        return [
            pointer(self.ffi, laid(array, number.dtype, count, f"{name_of}: {name}"), number.array, count)
            for (name, count), array in zip(self._counts, (state.p, state.q, state.velocities), strict=True)
        ]

    def put(self, space: RunSpace, rank: int | None) -> None:
        """Into a space, with the rank of Φ_q if that is to be known."""
        space.take_options(self._options)
        self.dynamics.describe(space.dynamics, self._takes_tangents)
        if rank is not None:
            space.dynamics.n_dependent = rank

    def size(self, space: RunSpace, key: tuple[int | None, bool] | None) -> int:
        """How many numbers a run in a space needs as workspace; key: what it depends on, None where that is not known."""
        if key in self._workspaces:
            return self._workspaces[key]
        size: int = self.library.ncgen_workspace(self.dynamics.model, space.dynamics, space.options)
        if key is not None:
            self._workspaces[key] = size
        return size


@dataclass(eq=False, kw_only=True)
class RunCall:
    """A prepared run with its numbers: all that C is called with, but for where it writes. May be used by several threads at a time.

    times (s) of a grid; inputs, conditions: what changes parameters on the way, and may end the run
    movable: a mask over the times of rows that may have the end of the step around them, which saves the stages of an interpolant
    rank: of Φ_q, where rows are redundant; errors: `rtol`, `atol` and `span` of the options, if others than those that were prepared
    inspected: ascending numbers of rows at which a run is inspected that comes to its end; None for no inspection
    fallback: the same call, from a start, where Newton's steps do not converge
    The arrays of the start stay as they are for as long as it is used.
    """

    run: PreparedRun
    times: Sequence[float] | np.ndarray
    initial: InitialState
    inputs: RunInputs = NO_INPUTS
    conditions: Conditions | None = None
    movable: np.ndarray | None = None
    rank: int | None = None
    errors: tuple[float, float, float] | None = None
    inspected: np.ndarray | None = None
    fallback: Callable[[InitialState], RunCall] | None = None

    def __post_init__(self) -> None:
        run, where = self.run, self.run.dynamics.kernels.name
        ffi, number = run.ffi, run.dynamics.number
        self._times, self._count = np.array(self.times, number.dtype), len(self.times)
        self._start, self._asked = run.laid(self.initial), pointer(ffi, self._times, number.array)
        self._movable = self._inspected = None
        if self.movable is not None:
            movable = np.ascontiguousarray(self.movable, dtype=np.intc)
            self._movable = pointer(ffi, movable, "int[]", self._count, f"{where}: movable")
        if self.inspected is not None:
            if not 0 <= self.inspected[0] <= self.inspected[-1] < self._count:
                raise NcgenError(f"{where}: rows {self.inspected} of {self._count} are no rows to inspect")
            self._inspected = pointer(ffi, np.array(self.inspected, dtype=np.intc), "int[]")
        self._is_influenced = bool(self.inputs is not NO_INPUTS or self.conditions or run.dynamics.called)
        self._size_key = None if self._is_influenced else (self.rank, self.inspected is not None)
        self._numbers = object()

    def with_velocities(self, velocities: np.ndarray) -> RunCall:
        """The same call from a start with other velocities, which are as of `InitialState`."""
        other = copy(self)
        other.initial = replace(self.initial, velocities=velocities)
        other._start = [*self._start[:2], *self.run.laid(other.initial)[2:]]
        return other

    def simulate(self, progress: Callable[[float], None] | None) -> Outcome:
        """Run; progress: as of `Monitor`."""
        run, where = self.run, self.run.dynamics
        rows, influences = RunRows(run.ffi, where.number, self._times, run.n), self._influences() if self._is_influenced else None
        space = where.spaces.take(progress)
        try:
            if space.numbers_in_c is not self._numbers:
                self._put(space)
            options = space.options
            if self._movable is not None:
                options.row_times = rows.t_in_c
            if influences:
                space.numbers_in_c = None
                influences.put(options)
            statistics = run.ffi.new("ncgen_statistics *")
            status = run.library.ncgen_simulate(
                where.model, space.dynamics, options, *self._start, self._count, self._asked, *rows.in_c, space.rows,
                statistics, space.room(run.size(space, self._size_key)), space.integers,
            )  # fmt: skip
            done = Outcome(rows, space.rows[0], STATUS[status], statistics)
            if raised := space.listener.raised or (influences and influences.raised):
                done.status, done.raised = "interrupted", raised
            if influences:
                done.crossed = influences.crossed
            if self._inspected is not None and (seen := space.inspection).is_known:
                done.inspection = Inspection(seen.energy, seen.change, seen.kinetic, seen.remainder)
        finally:
            where.spaces.give_back(space)
        return self.fallback(self.initial).simulate(progress) if self.fallback and done.status == "not converged" else done

    def _influences(self) -> _Influences:
        return _Influences(self.run.dynamics, self.run.library, self.inputs, self.conditions)

    def _put(self, space: RunSpace) -> None:
        """The numbers into a space that had others."""
        space.numbers_in_c, options = None, space.options
        self.run.put(space, self.rank)
        if self.errors is not None:
            options.rtol, options.atol, options.span = self.errors
        if self._movable is not None:
            options.movable = self._movable
        if self._inspected is not None:
            space.inspection.rows, space.inspection.count = self._inspected, len(self._inspected)
            options.inspection = space.inspection
        space.numbers_in_c = self._numbers


class _Influences:
    """What acts on one run from outside, or may end it."""

    def __init__(self, dynamics: Dynamics, library: InC, inputs: RunInputs, conditions: Conditions | None) -> None:
        self._driver = self._watched = self._choices = None
        self._called = dynamics.called
        if inputs is not NO_INPUTS and (any(inputs.signals) or len(inputs.breaks)):
            self._driver, self._function = Driver(inputs.signals, dynamics.number, inputs.breaks), library.ncgen_piecewise_inputs
        if inputs.rule:
            self._choices = Choices(dynamics.kernels, inputs.rule)
            self._called = [*self._called, self._choices]
        if conditions:
            self._watched = Watched(conditions, interface_of(dynamics.number.name), dynamics.number)

    def put(self, options: InC) -> None:
        """Into the options of a run that begins."""
        if self._driver:
            options.signals = self._driver.signals(self._function)
        if self._choices:
            options.parameter_rule = self._choices.function
        if self._watched:
            options.event = self._watched.struct
        for each in self._called:
            each.begin()

    @property
    def raised(self) -> BaseException | None:
        """What a function of Python raised, if one did."""
        for each in (self._driver, *self._called):
            if each and each.raised:
                return each.raised
        return None

    @property
    def crossed(self) -> tuple[int, ...]:
        """Numbers of the conditions at which the run stopped; notes which were sampled."""
        if not self._watched:
            return ()
        self._watched.report()
        return self._watched.crossed
