"""Whole simulations in one call of the C runtime, on a state derivative that is emitted or dense.

Dense: the runtime's own elimination with the model's kernels. Nothing is generated or compiled for a choice of
independent coordinates, so it suits single runs and changing choices.
Emitted: the elimination as straight-line code for one mechanism and one choice, several times faster, after a compile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ncgen.emit.naming import prefix_of
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import Choices, ExternalForces
from ncgen.mechanism.conditions_in_c import Conditions, Watched
from ncgen.mechanism.driving import Driver
from ncgen.mechanism.in_python import in_python, tangents_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.motion_sources import Written
from ncgen.mechanism.properties import uses_tangents
from ncgen.mechanism.run_arguments import NO_INPUTS, UNWATCHED_RUN, InitialState, Monitor, RunInputs
from ncgen.mechanism.run_rows import Outcome, Rows
from ncgen.mechanism.run_space import RunSpaces, Sizes
from ncgen.mechanism.runtime_library import Recursion, interface_of, load_with_headers, model_in, part_for, runtime_of
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.program.programs import Split
from ncgen.toolchain.abi import NUMBERS, InC

PARTITIONED = number_in_c(FORMALISMS["coordinate-partitioning"])
"""The formalism that a run has where nothing else is said."""


class _Way(NamedTuple):
    """What runs by one method have in common: the runtime, the method's number there, whether it takes tangents, how many velocities are
    integrated, and how many sizes such a state has."""

    library: InC
    method: int
    takes_tangents: bool
    n_velocities: int
    n_sizes: int


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
        self._ways: dict[tuple[str, bool, int, bool], _Way] = {}
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
        ffi, number, rank, sizes = self._ffi, self.number, options.pop("rank", None), options.pop("sizes", None)
        way = self._way(method, newton, options)
        if way.takes_tangents:
            self._take_tangents()
        (p, q, velocities), sizes = self._laid(initial, way.n_velocities), self._sizes(sizes, way.n_sizes)
        times = np.ascontiguousarray(times, dtype=number.dtype)
        rows = Rows(ffi, number, times, self.kernels.n)
        influences = _Influences(self, way.library, inputs, monitor.conditions)
        space = self._spaces.take(monitor.progress)
        try:
            settings, dynamics = space.options, space.dynamics
            space.put(p, q, velocities)
            dynamics[0] = self._dynamics[0]
            if not way.takes_tangents:
                dynamics.tangents = ffi.NULL
            if rank is not None:
                dynamics.n_dependent = rank
            settings.method, settings.rtol, settings.atol, settings.sizes = way.method, 1e-8, 1e-10, sizes
            if movable is not None:
                movable = np.ascontiguousarray(movable, dtype=np.intc)
                settings.movable = pointer(ffi, movable, "int[]", len(times), f"{self.kernels.name}: movable")
                settings.row_times = rows.t_in_c
            for name, value in options.items():
                setattr(settings, name, value)
            influences.put(settings)
            statistics = ffi.new("ncgen_statistics *")
            status = way.library.ncgen_simulate(
                self._model, dynamics, settings, *space.start, len(times), pointer(ffi, times, number.array), *rows.in_c, space.rows,
                statistics, space.numbers(way.library.ncgen_workspace(self._model, dynamics, settings)), space.integers,
            )  # fmt: skip
            raised = space.listener.raised or influences.raised
            return rows.outcome(space.rows[0], "interrupted" if raised else STATUS[status], statistics, raised, influences.crossed)
        finally:
            self._spaces.give_back(space)

    def _way(self, method: str, newton: bool, options: Mapping[str, InC]) -> _Way:
        """What runs by a method have in common, found once; arguments as of `simulate`."""
        formalism, frequency = options.get("formalism", PARTITIONED), options.get("frequency", 0.0)
        key = method, newton, formalism, frequency > 0.0
        if key not in self._ways:
            counts, library = self._state(formalism), runtime_of(self.number.name, part_for(method, self.recursion))
            takes_tangents = newton or self._uses_tangents(method, {"formalism": formalism, "frequency": frequency})
            self._ways[key] = _Way(library, number_in_c(INTEGRATORS[method]), takes_tangents, counts[0], sum(counts) + 1)
        return self._ways[key]

    def jacobian(
        self, t: float, q: ArrayLike, velocities: ArrayLike, p: ArrayLike, formalism: str = "coordinate-partitioning", **options: InC
    ) -> np.ndarray:
        """How the accelerations change with velocities and positions: ∂z̈/∂[ż; z] (k, 2 k) with coordinate partitioning, where
        rolling conditions leave more positions than velocities ∂[z̈; ż]/∂[ż; z], ∂q̈/∂[q̇; q] (n, 2 n) with other formalisms.
        q, velocities, p: as of `InitialState`; options: as for `simulate`."""
        ffi, library = self._ffi, runtime_of(self.number.name, "whole")
        self._take_tangents()
        settings = ffi.new("ncgen_options *", {"formalism": number_in_c(FORMALISMS[formalism]), "tolerance": 1e-12, **options})
        count = self._state(number_in_c(FORMALISMS[formalism]))[0]
        inputs = [np.ascontiguousarray(each, dtype=self.number.dtype) for each in self._laid(InitialState(q, velocities, p), count)]
        out = np.empty(self._jacobian_shape(count) if formalism == "coordinate-partitioning" else (count, 2 * count), self.number.dtype)
        work = np.empty(library.ncgen_workspace(self._model, self._dynamics, settings), self.number.dtype)
        pointers = [pointer(ffi, a, self.number.array) for a in (*inputs, out, work)]
        integers = pointer(ffi, np.empty(self._n_integers, dtype=np.intc), "int[]")
        status = library.ncgen_dynamics_jacobian(self._model, self._dynamics, settings, t, *pointers, integers)
        if status:
            raise NcgenError(f"{self.kernels.name}: the Jacobian at t = {t:g} s ended with “{STATUS[status]}”")
        return out

    def _state(self, formalism: int) -> tuple[int, int]:
        """How many velocities and positions are integrated."""
        n, chosen = self.kernels.n, self._dynamics.n_independent
        return (chosen, self._positions or chosen) if formalism == PARTITIONED else (n, n)

    _positions = 0
    """Independent coordinates of the positions, where they are others than those of the velocities."""

    def _laid(self, state: InitialState, n_velocities: int) -> list[np.ndarray]:
        """Parameters, position and velocities, of C's type. Raises NcgenError for others."""
        kernels, dtype, arrays = self.kernels, self.number.dtype, (state.p, state.q, state.velocities)
        counts = zip(("p", "q", "velocities"), (len(kernels.p0), len(kernels.coordinates), n_velocities), arrays, strict=True)
        return [
            array if type(array) is np.ndarray and array.dtype == float and array.shape == (count,)
            else laid(array, dtype, count, f"{kernels.name}: {name}")
            for name, count, array in counts
        ]  # fmt: skip

    def _sizes(self, sizes: ArrayLike | None, count: int) -> InC:
        """`sizes` of `ncgen_options`; of arrays that nobody writes to the last one is kept."""
        if sizes is None:
            return self._ffi.NULL
        known, address = self._known_sizes
        if known is not sizes:
            address = pointer(self._ffi, laid(sizes, self.number.dtype, count, f"{self.kernels.name}: sizes"), self.number.array)
            if isinstance(sizes, np.ndarray) and not sizes.flags.writeable:
                self._known_sizes = sizes, address
        return address

    _known_sizes: tuple[ArrayLike | None, InC] = None, None

    @property
    def _eliminated(self) -> int:
        """How many unknowns a stage may have to eliminate; 0 where all that is emitted."""
        return self.kernels.n + self.kernels.m

    def _uses_tangents(self, method: str, options: Mapping[str, InC]) -> bool:
        """True if a method takes stiffness and damping; options: as of `simulate`."""
        return uses_tangents(self.kernels, method)

    @cached_property
    def _spaces(self) -> RunSpaces:
        sizes = Sizes(len(self.kernels.p0), self.kernels.n, self._n_integers, self._eliminated)
        return RunSpaces(self._ffi, self.number, sizes)

    @property
    def _n_integers(self) -> int:
        """Of a workspace."""
        return 7 * self.kernels.n + 3 * self.kernels.m

    def _jacobian_shape(self, velocities: int) -> tuple[int, int]:
        """With coordinate partitioning."""
        return velocities, 2 * velocities

    def _take_tangents(self) -> None:
        """Tangent kernels are compiled when an implicit method first asks for them."""
        tangents = self._external.tangents if self._external else tangents_of(self.kernels)
        self._dynamics.tangents = self._ffi.cast("ncgen_tangents *", tangents)


class _Influences:
    """What acts on one run from outside, or may end it."""

    def __init__(self, dynamics: Dynamics, library: InC, inputs: RunInputs, conditions: Conditions | None) -> None:
        self._driver = self._watched = self._choices = None
        self._called = dynamics.called
        if any(inputs.signals) or len(inputs.breaks):
            self._driver, self._function = Driver(inputs.signals, dynamics.number, inputs.breaks), library.ncgen_piecewise_inputs
        if inputs.rule:
            self._choices = Choices(dynamics.kernels, inputs.rule)
            self._called = [*self._called, self._choices]
        if conditions:
            self._watched = Watched(conditions, interface_of(dynamics.number.name), dynamics.number)

    def put(self, settings: InC) -> None:
        """Into the options of a run that begins."""
        if self._driver:
            settings.signals = self._driver.signals(self._function)
        if self._choices:
            settings.parameter_rule = self._choices.function
        if self._watched:
            settings.event = self._watched.struct
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
