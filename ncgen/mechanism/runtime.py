"""Whole simulations in one call of the C runtime, on a state derivative that is emitted or dense.

Dense: the runtime's own elimination with the model's kernels. Nothing is generated or compiled for a choice of
independent coordinates, so it suits single runs and changing choices.
Emitted: the elimination as straight-line code for one mechanism and one choice, several times faster, after a compile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ncgen.emit.naming import prefix_of
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import ExternalForces
from ncgen.mechanism.in_python import in_python, tangents_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.motion_sources import Written
from ncgen.mechanism.prepared_run import PreparedRun
from ncgen.mechanism.properties import uses_tangents
from ncgen.mechanism.run_arguments import InitialState
from ncgen.mechanism.run_rows import Outcome
from ncgen.mechanism.run_space import RunSpaces, SpaceSizes
from ncgen.mechanism.runtime_library import Recursion, interface_of, load_with_headers, model_in, runtime_of
from ncgen.methods.table import FORMALISMS, number_in_c
from ncgen.program.programs import Split
from ncgen.toolchain.abi import NUMBERS, InC

PARTITIONED = number_in_c(FORMALISMS["coordinate-partitioning"])
"""The formalism that a run has where nothing else is said."""


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
        self.model = self._ffi.cast("const ncgen_model *", descriptor)
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

    def simulate(self, method: str, times: Sequence[float] | np.ndarray, initial: InitialState, **options: Any) -> Outcome:
        """Run over the times (s) of a grid (first one is the start).

        options: arguments of `PreparedRun.simulate`, and members of `ncgen_options` by their names; sizes is an array, or None for 1
        """
        numbers = {name: options.pop(name) for name in ("inputs", "monitor", "movable", "rank") if name in options}
        return self.run_by(method, **options).simulate(times, initial, **numbers)

    def run_by(self, method: str, **options: InC) -> PreparedRun:
        """Runs by a method with these options, of which what depends on a run's numbers is left open."""
        return PreparedRun(self, method, options)

    def jacobian(
        self, t: float, q: ArrayLike, velocities: ArrayLike, p: ArrayLike, formalism: str = "coordinate-partitioning", **options: InC
    ) -> np.ndarray:
        """How the accelerations change with velocities and positions: ∂z̈/∂[ż; z] (k, 2 k) with coordinate partitioning, where
        rolling conditions leave more positions than velocities ∂[z̈; ż]/∂[ż; z], ∂q̈/∂[q̇; q] (n, 2 n) with other formalisms.
        q, velocities, p: as of `InitialState`; options: as for `simulate`."""
        ffi, library = self._ffi, runtime_of(self.number.name, "whole")
        self._take_tangents()
        options = {"formalism": number_in_c(FORMALISMS[formalism]), "tolerance": 1e-12, **options}
        settings, count, where = ffi.new("ncgen_options *", options), self.state_counts(options)[0], self.kernels.name
        counts = {"p": (p, len(self.kernels.p0)), "q": (q, self.kernels.n), "velocities": (velocities, count)}
        inputs = [laid(array, self.number.dtype, count, f"{where}: {name}") for name, (array, count) in counts.items()]
        out = np.empty(self._jacobian_shape(count) if formalism == "coordinate-partitioning" else (count, 2 * count), self.number.dtype)
        work = np.empty(library.ncgen_workspace(self.model, self._dynamics, settings), self.number.dtype)
        pointers = [pointer(ffi, a, self.number.array) for a in (*inputs, out, work)]
        integers = pointer(ffi, np.empty(self._n_integers, dtype=np.intc), "int[]")
        status = library.ncgen_dynamics_jacobian(self.model, self._dynamics, settings, t, *pointers, integers)
        if status:
            raise NcgenError(f"{self.kernels.name}: the Jacobian at t = {t:g} s ended with “{STATUS[status]}”")
        return out

    def state_counts(self, options: Mapping[str, InC]) -> tuple[int, int]:
        """How many velocities and positions are integrated; options: as of `simulate`."""
        n, chosen = self.kernels.n, self._dynamics.n_independent
        return (chosen, self._positions or chosen) if options.get("formalism", PARTITIONED) == PARTITIONED else (n, n)

    _positions = 0
    """Independent coordinates of the positions, where they are others than those of the velocities."""

    def describe(self, struct: InC, with_tangents: bool) -> None:
        """Let an ncgen_dynamics be that of a run which takes tangents, or of one that does not."""
        if with_tangents:
            self._take_tangents()
        struct[0] = self._dynamics[0]
        if not with_tangents:
            struct.tangents = self._ffi.NULL

    @property
    def _eliminated(self) -> int:
        """How many unknowns a stage may have to eliminate; 0 where all that is emitted."""
        return self.kernels.n + self.kernels.m

    def uses_tangents(self, method: str, options: Mapping[str, InC]) -> bool:
        """True if a method takes stiffness and damping; options: as of `simulate`."""
        return uses_tangents(self.kernels, method)

    @cached_property
    def spaces(self) -> RunSpaces:
        """What runs that go on at the same time have to themselves."""
        sizes = SpaceSizes(self._n_integers, self._eliminated)
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
