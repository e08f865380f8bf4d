"""Formalisms on all coordinates, run in C by the KKT matrix, an emitted recursion or a recursion over tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ncgen.emit.naming import prefix_of
from ncgen.emit.number_table import FilledSources, table_getter
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.motion_check import serves
from ncgen.mechanism.motion_sources import Seen, filled_motion, motion_source
from ncgen.mechanism.prepared_run import PreparedRun, RunCall
from ncgen.mechanism.properties import is_conservative, is_definite
from ncgen.mechanism.recall import Files, shared
from ncgen.mechanism.run_arguments import InitialState
from ncgen.mechanism.runtime import Dynamics
from ncgen.mechanism.runtime_library import Part, compiling_thread, load_with_headers, runtime_of
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.program.algebra.quasidefinite import Elimination, plan
from ncgen.program.tree.table_layout import TreeTables
from ncgen.toolchain.abi import InC, Interface

MIN_CACHED_UNKNOWNS = 100
"""Unknowns of the matrix from which on the plan by which it is factored is kept in the cache: making it takes longer."""


class ConstrainedDynamics(Dynamics):
    """Formalisms on all coordinates: the matrix [M Φ_qᵀ; Φ_q −E], factored by a plan that is made once for a mechanism.

    samples_of: called for independent coordinates of the positions, and typical positions, where the motion is to be emitted; without it,
    or
        where there are none or no tree of bodies that could be seen in them, it comes from the matrix
    tables: of an open tree, by which it moves where nothing is emitted
    part: of the runtime, compiled while the motion is emitted
    """

    def __init__(
        self,
        kernels: Kernels,
        number: str = "double",
        samples_of: Callable[[], Seen | None] | None = None,
        tables: TreeTables | None = None,
        component: Part = "explicit",
    ) -> None:
        runtime = compiling_thread(number, component)
        runtime.start()
        motion = None if samples_of is None else self._written_out(kernels, number, samples_of)
        runtime.join()
        super().__init__(kernels, number)
        self.singular_mass = singular = not is_definite(kernels)
        self.plan = kernels.remember("elimination", (), lambda: _plan(kernels))
        self._elimination = self._ffi.new("ncgen_elimination *", {"size": self.plan.size, "nonzeros": self.plan.nonzeros})
        self._keep({name: getattr(self.plan, name) for name in Elimination.ARRAYS}, self._elimination, np.intc)
        self._dynamics.elimination = self._elimination
        self._dynamics.singular_mass, self._dynamics.conservative = singular, is_conservative(kernels)
        self._seen = samples_of
        self.is_emitted = motion is not None
        self.recursion = "emitted" if self.is_emitted else "tree" if tables is not None else None
        self.is_recursive = self.recursion is not None
        if motion is not None:
            function, self._motion = motion
            self._dynamics.motion = self._ffi.cast("const ncgen_motion *", function())
        if tables is not None:
            self._tree = self._ffi.new("ncgen_tree *", tables.counts)
            self._keep(tables.indices, self._tree, np.intc)
            self._keep(tables.numbers, self._tree, self.number.dtype)
            self._dynamics.tree = self._tree

    def uses_tangents(self, method: str, options: Mapping[str, InC]) -> bool:
        """Not where a recursion serves instead: `ncgen_is_reduced`."""
        recurs = options.get("formalism") == number_in_c(FORMALISMS["lagrange"]) and not options.get("frequency") and self.is_recursive
        if INTEGRATORS[method].tangents == "unless_recursive" and recurs and not self.has_rolling:
            return False
        return super().uses_tangents(method, options)

    @staticmethod
    def _written_out(kernels: Kernels, number: str, samples_of: Callable[[], Seen | None]) -> tuple[Callable[[], InC], InC] | None:
        """What gives the emitted motion, if there is one, and the library that it lives in."""
        if number != "double":
            loaded = _loaded_motion(kernels, number, FilledSources(motion_source(kernels, samples_of), None))
            return loaded and loaded[1:]
        source = filled_motion(kernels, samples_of)
        loaded = _loaded_motion(kernels, number, source)
        if loaded and not serves(kernels, source, loaded[0], loaded[1]()):
            loaded = _loaded_motion(kernels, number, filled_motion(kernels, samples_of, only_exact=True))
        return loaded and loaded[1:]

    @property
    def _eliminated(self) -> int:
        return 0 if self.is_emitted else super()._eliminated

    @property
    def prepared(self) -> int:
        """How many numbers of the emitted motion depend on parameters alone."""
        return self._dynamics.motion.n_prepared if self.is_emitted else 0

    def with_prepared(self, p: np.ndarray) -> np.ndarray:
        """p and what is prepared of it, as the parts of the emitted motion read it."""
        whole = np.concatenate([p, np.empty(self.prepared)])
        if self.prepared:
            self._dynamics.motion.prepare(*(pointer(self._ffi, a, self.number.array) for a in (whole, whole[len(p) :])))
        return whole

    def source(self, kind: Literal["motion", "tangent", "adjoint"]) -> Files:
        """{file name: text} of the emitted motion, of it along a direction or transposed. Only where `is_emitted`."""
        assert self._seen is not None, "nothing has been written out"
        return motion_source(self.kernels, self._seen, kind)

    @cached_property
    def transposed(self) -> tuple[InC, InC]:
        """The emitted motion's ncgen_seeded_motion, transposed, and the library that it lives in; compiled when first asked for."""
        getter = f"{prefix_of(self.kernels.name)}_adjoint"
        _, home = load_with_headers(self.source("adjoint"), self.number.name, f"const ncgen_seeded_motion *{getter}(void);")
        return self._ffi.cast("const ncgen_seeded_motion *", getattr(home, getter)()), home

    @property
    def interface(self) -> tuple[Interface, InC]:
        """What passes arguments to the runtime, and the runtime with its explicit methods."""
        return self._ffi, runtime_of(self.number.name, "explicit")

    @property
    def adjoint_interface(self) -> tuple[Interface, InC]:
        """What passes arguments to the runtime, and the part of it that goes back over a run."""
        return self._ffi, runtime_of(self.number.name, "adjoint")

    def described(self, rank: int) -> tuple[InC, InC]:
        """The model, and its dynamics, in a struct of their own where rows are redundant; rank: of Φ_q."""
        described = self._ffi.new("ncgen_dynamics *", self._dynamics[0])
        described.n_dependent = rank
        return self.model, described

    def run_by(self, method: str, **options: InC) -> PreparedRun:
        """As of any state derivative."""
        may_fail = INTEGRATORS[method].tangents == "sometimes" and self.number.name == "double"
        return _PreparedTwice(self, method, options) if may_fail else super().run_by(method, **options)


class _PreparedTwice(PreparedRun):
    """Runs whose steps are iterated without tangents, which next to singular positions does not converge: then they are taken with them."""

    def call(self, times: Sequence[float] | np.ndarray, initial: InitialState, **numbers: Any) -> RunCall:
        """As of any prepared run."""
        return super().call(times, initial, fallback=lambda start: self._with_tangents.call(times, start, **numbers), **numbers)

    @cached_property
    def _with_tangents(self) -> PreparedRun:
        return PreparedRun(self.dynamics, self._method, self._given, newton=True)


def _loaded_motion(kernels: Kernels, number: str, source: FilledSources) -> tuple[Interface, Callable[[], InC], InC] | None:
    """The interface of an emitted motion, what gives it, and the library that it lives in; None where there is none."""
    if not source.files:
        return None
    prefix = prefix_of(kernels.name)
    getter = f"{prefix}_recursion"
    declarations = f"const ncgen_motion *{getter}(void);"
    ffi, home = load_with_headers(source.files, number, declarations, table_getter(prefix), source.values)
    return ffi, getattr(home, getter), home


def _plan(kernels: Kernels) -> Elimination:
    """How the matrix is factored; of a large one from the cache, where it serves all models with these patterns, or made now."""

    def made() -> Elimination:
        return plan(kernels.mass_pattern, kernels.phi_q_pattern)

    if kernels.n + kernels.m < MIN_CACHED_UNKNOWNS:
        return made()
    patterns = [vars(pattern)[name] for pattern in (kernels.mass_pattern, kernels.phi_q_pattern) for name in ("shape", "indptr", "indices")]
    members = shared(f"elimination, coordinates without mass last, of {patterns}", lambda: vars(made()))
    arrays: dict[str, Any] = {name: tuple(members[name]) for name in Elimination.ARRAYS}
    return Elimination(**members | arrays)
