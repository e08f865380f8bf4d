"""Whole simulations in one call of the C runtime, on a state derivative that is emitted or dense.

Dense: the runtime's own elimination with the model's kernels. Nothing is generated or compiled for a choice of
independent coordinates, so it suits single runs and changing choices.
Emitted: the elimination as straight-line code for one mechanism and one choice, several times faster, after a compile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ncgen.emit.naming import prefix_of
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import Choices, ExternalForces
from ncgen.mechanism.conditions_in_c import Watched
from ncgen.mechanism.driving import Driver
from ncgen.mechanism.in_python import in_python, tangents_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.listening import Listener, watch
from ncgen.mechanism.motion_sources import Written
from ncgen.mechanism.properties import uses_tangents
from ncgen.mechanism.run_arguments import NO_INPUTS, UNWATCHED_RUN, InitialState, Monitor, RunInputs
from ncgen.mechanism.runtime_library import Recursion, interface_of, load_with_headers, model_in, part_for, runtime_of
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.program.programs import Split
from ncgen.toolchain.abi import NUMBERS, InC

PARTITIONED = number_in_c(FORMALISMS["coordinate-partitioning"])
"""The formalism that a run has where nothing else is said."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    t (rows,) in s: their times, those asked for but for movable; q, qd (rows, n); work (rows,); status "ok" or the reason
    reached: time (s) of the state `last` = (q, qd, work); tried: time of the last stage; stiff: how often it was found stiff
    raised: what ended the run from outside, or None; crossed: numbers of the conditions at which it stopped
    next_step (s): what an explicit method with error control would try next
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    status: str
    reached: float
    last: tuple[np.ndarray, np.ndarray, float]
    steps: int
    rejected: int
    repeated: int
    evaluations: int
    newton_steps: int
    factorisations: int = 0
    perturbed: int = 0
    refinements: int = 0
    stopped: bool = False
    largest_projection: float = 0.0
    jacobians: int = 0
    fallbacks: int = 0
    tried: float = 0.0
    stiff: int = 0
    raised: BaseException | None = None
    crossed: tuple[int, ...] = ()
    next_step: float = 0.0

    def completed(self) -> Outcome:
        """This outcome, unless something was raised while the run went on: that is raised now."""
        if self.status == "interrupted":
            raise self.raised or KeyboardInterrupt()
        return self


COUNTS = (
    "steps", "rejected", "repeated", "evaluations", "newton_steps", "factorisations", "perturbed", "refinements", "jacobians", "fallbacks",
    "stiff",
)  # fmt: skip
"""Members that are those of `ncgen_statistics`."""


def _reached(rows: Sequence[np.ndarray], done: int, statistics: InC) -> dict[str, Any]:
    """Members of an outcome that C wrote: so many of the rows of t, q, qd and work, the last state, which has a row of its own; counts."""
    t, q, qd, work = (np.asarray(row[:done], dtype=float) for row in rows)
    reals = {name: float(getattr(statistics, name)) for name in ("next_step", "largest_projection", "tried")}
    return {
        **{name: getattr(statistics, name) for name in COUNTS},
        **reals,
        "reached": float(statistics.t),
        "last": tuple(row[-1].astype(float) for row in rows[1:]),
        "stopped": bool(statistics.stopped),
        "t": t,
        "q": q,
        "qd": qd,
        "work": work,
    }


class Dynamics:
    """A state derivative with the runtime around it, in a number type of C.

    recursion: what gives accelerations over all coordinates
    is_emitted: whether they are emitted
    """

    recursion: Recursion = None
    is_emitted = False

    def __init__(self, kernels: Kernels, number: str) -> None:
        self.kernels, self.number = kernels, NUMBERS[number]
        self._ffi = interface_of(number)
        self._dynamics: InC = self._ffi.new("ncgen_dynamics *")
        descriptor, self._model_library = model_in(kernels, number)
        self._model = self._ffi.cast("const ncgen_model *", descriptor)
        self._arrays: list[np.ndarray] = []
        self._keep({"column_sizes": kernels.column_sizes, "row_sizes": kernels.row_sizes}, self._dynamics, self.number.dtype)
        self._external = kernels.remember("external forces", (), lambda: ExternalForces(kernels)) if kernels.model.callbacks else None
        if self._external:
            self._dynamics.external = self._external.function
        self.called = [each for each in (self._external, in_python(kernels)) if each]
        self.has_rolling = len(kernels.holonomic) < kernels.m
        if self.has_rolling:
            rolling = np.ones(kernels.m)
            rolling[kernels.holonomic] = 0
            self._keep({"rolling": rolling}, self._dynamics, np.intc)

    def _keep(self, arrays: Mapping[str, Sequence[float] | np.ndarray], struct: InC, dtype: DTypeLike) -> None:
        """Let members of a struct point to arrays, which live as long as this object."""
        for name, values in arrays.items():
            array = np.array(values if len(values) else (0,), dtype=dtype)
            kind = "int[]" if dtype == np.intc else self.number.array
            self._arrays.append(array)
            setattr(struct, name, pointer(self._ffi, array, kind))

    def _describe(self, split: Split, struct: InC) -> None:
        """Let a struct say a choice of independent coordinates."""
        struct.n_independent, struct.n_dependent = len(split.independent), len(split.dependent)
        self._keep({"independent": split.independent, "dependent": split.dependent, "rows": split.rows}, struct, np.intc)

    def simulate(
        self,
        method: str,
        times: ArrayLike,
        initial: InitialState,
        *,
        inputs: RunInputs = NO_INPUTS,
        monitor: Monitor = UNWATCHED_RUN,
        movable: np.ndarray | None = None,
        newton: bool = False,
        **options: InC,
    ) -> Outcome:
        """Run over the times (s) of a grid (first one is the start).

        movable: a mask over the times of rows that may have the end of the step around them, which saves the stages of an interpolant
        newton: with tangents, also where a method can do without them
        options: the other members of `ncgen_options`, by their names; sizes is an array, or None for 1
        """
        ffi, n, dtype, where = self._ffi, self.kernels.n, self.number.dtype, self.kernels.name
        real = partial(pointer, ffi, kind=self.number.array)
        library = runtime_of(self.number.name, part_for(method, self.recursion))
        times = np.ascontiguousarray(times, dtype=dtype)
        rows_and_last = len(times) + 1
        out_q, out_qd, out_work = (np.empty(shape, dtype) for shape in ((rows_and_last, n), (rows_and_last, n), rows_and_last))
        sizes = options.pop("sizes", None)
        settings = ffi.new("ncgen_options *", {"method": number_in_c(INTEGRATORS[method]), "rtol": 1e-8, "atol": 1e-10, **options})
        if sizes is not None:
            sizes = laid(sizes, dtype, sum(self._state(options.get("formalism", PARTITIONED))) + 1, f"{where}: sizes")
            settings.sizes = real(sizes)
        row_times = times
        if movable is not None:
            movable, row_times = np.ascontiguousarray(movable, dtype=np.intc), times.copy()
            settings.movable, settings.row_times = pointer(ffi, movable, "int[]", len(times), f"{where}: movable"), real(row_times)
        listener = Listener(monitor.progress, self._eliminated)
        context = ffi.new_handle(listener)
        settings.progress, settings.context, settings.attempts_left = watch(self.number.name), context, listener.attempts
        driver = Driver(inputs.signals, self.number, inputs.breaks) if any(inputs.signals) or np.size(inputs.breaks) else None
        if driver:
            signals = driver.signals(library.ncgen_piecewise_inputs)
            settings.signals = signals
        called = [*self.called, *([Choices(self.kernels, inputs.rule)] if inputs.rule else [])]
        if inputs.rule:
            settings.parameter_rule = called[-1].function
        watched = Watched(monitor.conditions, ffi, self.number) if monitor.conditions else None
        if watched:
            settings.event = watched.struct
        if newton or self._uses_tangents(method, options):
            self._take_tangents()
        else:
            self._dynamics.tangents = ffi.NULL
        work, integers = self._space(library, settings)
        statistics, rows = ffi.new("ncgen_statistics *"), ffi.new("int *")
        start = self._start(initial, options.get("formalism", PARTITIONED))
        pointers = [real(a) for a in (*start, times, out_q, out_qd, out_work, work)]
        for each in called:
            each.begin()
        status = library.ncgen_simulate(
            self._model, self._dynamics, settings, *pointers[:3], len(times), *pointers[3:7], rows, statistics, pointers[7],
            pointer(ffi, integers, "int[]"),
        )  # fmt: skip
        if watched:
            watched.report()
        raised = next((each.raised for each in (listener, driver, *called) if each and each.raised), None)
        return Outcome(
            status="interrupted" if raised else STATUS[status],
            crossed=watched.crossed if watched else (),
            raised=raised,
            **_reached((row_times, out_q, out_qd, out_work), rows[0], statistics),
        )

    def jacobian(
        self, t: float, q: ArrayLike, velocities: ArrayLike, p: ArrayLike, formalism: str = "coordinate-partitioning", **options: InC
    ) -> np.ndarray:
        """How the accelerations change with velocities and positions: ∂z̈/∂[ż; z] (k, 2 k) with coordinate partitioning, where
        rolling conditions leave more positions than velocities ∂[z̈; ż]/∂[ż; z], ∂q̈/∂[q̇; q] (n, 2 n) with other formalisms.
        q, velocities, p: as of `InitialState`; options: as for `simulate`."""
        ffi, library = self._ffi, runtime_of(self.number.name, "whole")
        self._take_tangents()
        settings = ffi.new("ncgen_options *", {"formalism": number_in_c(FORMALISMS[formalism]), "tolerance": 1e-12, **options})
        work, integers = self._space(library, settings)
        inputs = self._start(InitialState(q, velocities, p), number_in_c(FORMALISMS[formalism]))
        count = len(inputs[2])
        out = np.empty(self._jacobian_shape(count) if formalism == "coordinate-partitioning" else (count, 2 * count), self.number.dtype)
        pointers = [pointer(ffi, a, self.number.array) for a in (*inputs, out, work)]
        status = library.ncgen_dynamics_jacobian(self._model, self._dynamics, settings, t, *pointers, pointer(ffi, integers, "int[]"))
        if status:
            raise NcgenError(f"{self.kernels.name}: the Jacobian at t = {t:g} s ended with “{STATUS[status]}”")
        return out

    def _state(self, formalism: int) -> tuple[int, int]:
        """How many velocities and positions are integrated."""
        n, chosen = self.kernels.n, self._dynamics.n_independent
        return (chosen, self._positions or chosen) if formalism == PARTITIONED else (n, n)

    _positions = 0
    """Independent coordinates of the positions, where they are others than those of the velocities."""

    def _start(self, state: InitialState, formalism: int) -> list[np.ndarray]:
        """Parameters, position and velocities as C reads them."""
        kernels = self.kernels
        counts = {"p": len(kernels.p0), "q": kernels.n, "velocities": self._state(formalism)[0]}
        return [laid(getattr(state, name), self.number.dtype, count, f"{kernels.name}: {name}") for name, count in counts.items()]

    @property
    def _eliminated(self) -> int:
        """How many unknowns a stage may have to eliminate; 0 where all that is emitted."""
        return self.kernels.n + self.kernels.m

    def _uses_tangents(self, method: str, options: Mapping[str, InC]) -> bool:
        """True if a method takes stiffness and damping; options: as of `simulate`."""
        return uses_tangents(self.kernels, method)

    def _space(self, library: InC, settings: InC) -> tuple[np.ndarray, np.ndarray]:
        """Workspace: numbers and integers."""
        numbers = library.ncgen_workspace(self._model, self._dynamics, settings)
        integers = 7 * self.kernels.n + 3 * self.kernels.m
        return np.empty(numbers, self.number.dtype), np.empty(integers, dtype=np.intc)

    def _jacobian_shape(self, velocities: int) -> tuple[int, int]:
        """With coordinate partitioning."""
        return velocities, 2 * velocities

    def _take_tangents(self) -> None:
        """Tangent kernels are compiled when an implicit method first asks for them."""
        tangents = self._external.tangents if self._external else tangents_of(self.kernels)
        self._dynamics.tangents = self._ffi.cast("ncgen_tangents *", tangents)


class DenseDynamics(Dynamics):
    """The runtime's dense elimination on the model's kernels, for one choice of independent coordinates.

    positions: the choice for positions, where it is not that for velocities
    """

    def __init__(self, kernels: Kernels, split: Split, number: str = "double", positions: Split | None = None) -> None:
        super().__init__(kernels, number)
        self.positions = positions
        self._describe(split, self._dynamics)
        if positions is not None:
            self._positions = len(positions.independent)
            self._partition = self._ffi.new("ncgen_partition *")
            self._describe(positions, self._partition)
            self._dynamics.positions = self._partition

    def _jacobian_shape(self, velocities: int) -> tuple[int, int]:
        if self.positions is None:
            return super()._jacobian_shape(velocities)
        size = velocities + len(self.positions.independent)
        return size, size


class EmittedDynamics(Dynamics):
    """The state derivative emitted and compiled for one choice of independent coordinates."""

    @property
    def _eliminated(self) -> int:
        return 0

    def __init__(self, written: Written, number: str = "double") -> None:
        kernels = written.kernels
        super().__init__(kernels, number)
        self.written = written
        getter = f"{prefix_of(kernels.name)}_dynamics"
        _, self._emitted = load_with_headers(written.files, number, f"const ncgen_dynamics *{getter}(void);")
        emitted = getattr(self._emitted, getter)()
        for name in ("newton", "acceleration"):
            setattr(self._dynamics, name, self._ffi.cast("void *", getattr(emitted, name)))
        self._dynamics.closed_form = emitted.closed_form
        self._describe(written.split, self._dynamics)  # what to fall back upon
