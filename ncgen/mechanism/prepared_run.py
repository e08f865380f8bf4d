"""A run in C but for its numbers: the runtime, its options as C reads them, and how much workspace it takes, found once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import Choices
from ncgen.mechanism.conditions_in_c import Conditions, Watched
from ncgen.mechanism.driving import Driver
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.run_arguments import NO_INPUTS, UNWATCHED_RUN, InitialState, Monitor, RunInputs
from ncgen.mechanism.run_rows import Outcome, RunRows
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
        self._dynamics, self._method, self._given = dynamics, method, options
        number, kernels, sizes = dynamics.number, dynamics.kernels, options.get("sizes")
        self._ffi, self._n = interface_of(number.name), kernels.n
        self._library = runtime_of(number.name, part_for(method, dynamics.recursion))
        self._takes_tangents = newton or dynamics.uses_tangents(method, options)
        velocities, positions = dynamics.state_counts(options)
        self._counts = ("p", len(kernels.p0)), ("q", kernels.n), ("velocities", velocities)
        settings: InC = self._ffi.new("ncgen_options *", {"rtol": 1e-8, "atol": 1e-10})
        for name, value in (options | {"method": number_in_c(INTEGRATORS[method]), "sizes": self._ffi.NULL}).items():
            setattr(settings, name, value)
        if sizes is not None:
            sizes = laid(sizes, number.dtype, velocities + positions + 1, f"{kernels.name}: sizes")
            self._natural_sizes = settings.sizes = pointer(self._ffi, np.array(sizes), number.array)
        self._options, self._workspaces = bytes(self._ffi.buffer(settings)), dict[int | None, int]()

    def simulate(
        self,
        times: Sequence[float] | np.ndarray,
        initial: InitialState,
        *,
        inputs: RunInputs = NO_INPUTS,
        monitor: Monitor = UNWATCHED_RUN,
        movable: np.ndarray | None = None,
        rank: int | None = None,
        errors: tuple[float, float, float] | None = None,
    ) -> Outcome:
        """Run over the times (s) of a grid (first one is the start).

        movable: a mask over the times of rows that may have the end of the step around them, which saves the stages of an interpolant
        rank: of Φ_q, where rows are redundant; errors: `rtol`, `atol` and `span` of the options, if others than those that were prepared
        """
        ffi, number, library, where = self._ffi, self._dynamics.number, self._library, self._dynamics
        rows, start, count = RunRows(ffi, number, times, self._n), self._laid(initial), len(times)
        influences = _Influences(where, library, inputs, monitor.conditions)
        space = where.spaces.take(monitor.progress)
        try:
            options, dynamics = space.with_options(self._options), space.dynamics
            space.put(*start)
            where.describe(dynamics, self._takes_tangents)
            if rank is not None:
                dynamics.n_dependent = rank
            if errors is not None:
                options.rtol, options.atol, options.span = errors
            if movable is not None:
                movable = np.ascontiguousarray(movable, dtype=np.intc)
                options.movable = pointer(ffi, movable, "int[]", count, f"{where.kernels.name}: movable")
                options.row_times = rows.t_in_c
            size = self._size(dynamics, options, rank, influences.put(options))
            statistics = ffi.new("ncgen_statistics *")
            status = library.ncgen_simulate(
                where.model, dynamics, options, *space.start, count, rows.asked_in_c, *rows.in_c, space.rows,
                statistics, space.numbers(size), space.integers,
            )  # fmt: skip
            raised = space.listener.raised or influences.raised
            return Outcome(rows, space.rows[0], "interrupted" if raised else STATUS[status], statistics, raised, influences.crossed)
        finally:
            where.spaces.give_back(space)

    def _size(self, dynamics: InC, options: InC, rank: int | None, is_influenced: bool) -> int:
        """How many numbers a run needs as workspace."""
        if is_influenced:
            return self._library.ncgen_workspace(self._dynamics.model, dynamics, options)
        if rank not in self._workspaces:
            self._workspaces[rank] = self._library.ncgen_workspace(self._dynamics.model, dynamics, options)
        return self._workspaces[rank]

    def _laid(self, state: InitialState) -> list[np.ndarray]:
        """Parameters, position and velocities as doubles or of C's type. Raises NcgenError for others."""
        dtype, name_of = self._dynamics.number.dtype, self._dynamics.kernels.name
        return [
            array if type(array) is np.ndarray and array.dtype == float and array.shape == (count,)
            else laid(array, dtype, count, f"{name_of}: {name}")
            for (name, count), array in zip(self._counts, (state.p, state.q, state.velocities), strict=True)
        ]  # fmt: skip


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

    def put(self, options: InC) -> bool:
        """Into the options of a run that begins; whether there were any."""
        if self._driver:
            options.signals = self._driver.signals(self._function)
        if self._choices:
            options.parameter_rule = self._choices.function
        if self._watched:
            options.event = self._watched.struct
        for each in self._called:
            each.begin()
        return bool(self._driver or self._choices or self._watched)

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
