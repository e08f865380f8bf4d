"""Whole simulations in one call of the C runtime, on a state derivative that is emitted or dense.

Dense: the runtime's own elimination with the model's kernels. Nothing is generated or compiled for a choice of
independent coordinates, so it suits single runs and changing choices.
Emitted: the elimination written out for one mechanism and one choice, several times faster, after a compile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property, partial
from threading import Thread
from typing import Literal, TypeAlias

import numpy as np
from cffi import FFI
from numpy.typing import ArrayLike, DTypeLike

from ncgen.emit.c.files import model_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime import (
    EXPLICIT_ONLY,
    HEADERS,
    ORDINARY,
    RUNTIME_HEADERS,
    STIFF,
    adjoint_names,
    explicit_names,
    indifferent,
    ordinary_names,
    runtime_files,
    runtime_names,
    stiff_names,
)
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.callbacks import Choices, ExternalForces
from ncgen.mechanism.conditions import Conditions, Watched
from ncgen.mechanism.driving import Driver, Function, Pieces
from ncgen.mechanism.in_python import in_python, model_of, tangents_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.mechanism.listening import Listener, watch
from ncgen.mechanism.properties import is_conservative, is_definite, uses_tangents
from ncgen.mechanism.recall import Files, shared
from ncgen.mechanism.written import Seen, Written, motion_source
from ncgen.methods.table import AUTO, FORMALISMS, INTEGRATORS, find_integrator, number_in_c
from ncgen.program.algebra.quasidefinite import Elimination, plan
from ncgen.program.programs import Split
from ncgen.program.tree.table_layout import TreeTables
from ncgen.toolchain.abi import NUMBERS, InC, Interface, declared, runtime_abi
from ncgen.toolchain.cache import Sibling, compiled
from ncgen.toolchain.compilers import FLAGS, flags_for
from ncgen.toolchain.loader import load, opened_by
from ncgen.toolchain.once import once

PARTITIONED = number_in_c(FORMALISMS["coordinate-partitioning"])
"""The formalism that a run has where nothing else is said."""

Part: TypeAlias = Literal["ordinary", "stiff", "explicit", "whole", "adjoint"]
"""Of the runtime: what emitted accelerations over all coordinates need of explicit methods, or of Radau's; all explicit methods, all of it,
or what goes back over a run."""

PARTS: dict[Part, tuple[Callable[[], tuple[str, ...]], tuple[str, ...]]] = {
    "ordinary": (ordinary_names, ORDINARY),
    "stiff": (stiff_names, STIFF),
    "explicit": (explicit_names, (EXPLICIT_ONLY,)),
    "whole": (runtime_names, ()),
    "adjoint": (adjoint_names, ()),
}
"""The files of a part, and the macros that choose it."""

RUNS: tuple[Part, ...] = ("whole", "explicit", "ordinary", "stiff")
"""Parts that carry runs out, the one with most objects for others first."""


def _load(files: dict[str, str], number: str, declarations: str) -> tuple[Interface, InC]:
    """A library of these files, which are straight lines, and the headers, and its interface."""
    flags = flags_for(files)
    files = files | shared("headers", lambda: runtime_files(*RUNTIME_HEADERS, *HEADERS))
    return load(files, declarations, runtime_abi(number), (*flags, *NUMBERS[number].flags))


@once
def _interface(number: str) -> Interface:
    """What passes arguments to the runtime."""
    ffi = FFI()
    ffi.include(runtime_abi(number))
    ffi.cdef("".join(declared(file, "functions") for file in ("ncgen_runtime.h", "ncgen_driven.h", "ncgen_differentiated.h")))
    return ffi


@once
def _runtime(number: str, part: Part) -> InC:
    """The runtime, the same for all mechanisms; most runs do without three quarters of it. What parts have in common is compiled once."""
    files, flags = _sources(number, part)

    def siblings() -> list[Sibling]:
        return [Sibling(*_sources(number, other), _shared_sources(part, other)) for other in RUNS if other != part and part in RUNS]

    return opened_by(_interface(number), compiled(files, flags, siblings=siblings).library)


def _shared_sources(part: Part, other: Part) -> tuple[str, ...]:
    """The sources that are compiled alike for both of two parts."""
    (names, macros), (others, defined) = PARTS[part], PARTS[other]
    known = set(others())
    return indifferent([name for name in names() if name in known], set(macros) ^ set(defined))


def _sources(number: str, part: Part) -> tuple[Files, tuple[str, ...]]:
    """The files of a part of the runtime, and the flags that they are compiled with."""
    names, defined = PARTS[part]
    macros = [f"-D{macro}" for macro in defined]
    return shared(f"runtime: {part}", lambda: runtime_files(*names())), (*FLAGS, *NUMBERS[number].flags, *macros)


def part_for(integrator: str, is_emitted: bool = False) -> Part:
    """The part of the runtime that has an integrator; AUTO: whichever is chosen, which seldom is an implicit one.

    is_emitted: whether accelerations over all coordinates are written out
    """
    if integrator == AUTO or find_integrator(integrator).tangents == "never":
        return "ordinary" if is_emitted else "explicit"
    return "stiff" if is_emitted and find_integrator(integrator).tangents == "unless_recursive" else "whole"


@cache
def has_runtime(part: Part) -> bool:
    """True where a part of the runtime is there, or can be compiled; asked once, since a compiler that fails takes its time."""
    try:
        _runtime("double", part)
    except NcgenError:
        return False
    return True


def beside(number: str = "double", part: Part = "explicit") -> Thread:
    """A thread that compiles the runtime, if it is not in the cache, while something else goes on; to be started, and joined before a run.

    What goes wrong there goes wrong again, and is told, where the runtime is needed.
    """

    def compiling() -> None:
        with suppress(NcgenError):
            _runtime(number, part)

    return Thread(target=compiling, daemon=True)


def _model(kernels: Kernels, number: str) -> tuple[InC, Kernels | InC]:
    """The descriptor of a mechanism's kernels in a number type, and the library that it lives in; made once for every type."""
    if number == "double":
        return model_of(kernels), kernels
    return kernels.remember("models", number, lambda: _compiled_model(kernels, number))


def _compiled_model(kernels: Kernels, number: str) -> tuple[InC, InC]:
    getter = f"{prefix_of(kernels.name)}_model"
    _, library = _load(model_files(kernels.programs), number, f"const ncgen_model *{getter}(void);")
    return getattr(library, getter)(), library


def prepare(kernels: Kernels, number: str = "double") -> None:
    """Compile what a run may ask for on its way, so that a limit to its time is a limit to the run."""
    for part in RUNS:
        _runtime(number, part)
    _model(kernels, number)
    kernels.tangents  # noqa: B018


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    t (rows,) in s: their times, those asked for but for looks; q, qd (rows, n); work (rows,); status "ok" or the reason
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


class Dynamics:
    """A state derivative with the runtime around it, in a number type of C.

    is_emitted: whether accelerations over all coordinates are written out
    """

    is_emitted = False

    def __init__(self, kernels: Kernels, number: str) -> None:
        self.kernels, self.number = kernels, NUMBERS[number]
        self._ffi = _interface(number)
        self._dynamics: InC = self._ffi.new("ncgen_dynamics *")
        descriptor, self._model_library = _model(kernels, number)
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
        q: ArrayLike,
        velocities: ArrayLike,
        p: ArrayLike,
        *,
        max_step: float = np.inf,
        conditions: Conditions | None = None,
        newton: bool = False,
        sizes: ArrayLike | None = None,
        looks: np.ndarray | None = None,
        progress: Callable[[float], None] | None = None,
        inputs: Sequence[Pieces | Function | None] = (),
        breaks: ArrayLike = (),
        choose: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
        **options: InC,
    ) -> Outcome:
        """Run over the times (s) of a grid (first one is the start).

        q (n,): where it starts (m, rad); p (n_p,): the parameters
        velocities: independent ones (nz,) with coordinate partitioning, all of them (n,) with other formalisms, in m/s and rad/s
        conditions: at the first of which to stop
        newton: with tangents, also where a method can do without them
        sizes: what atol is multiplied by, one a velocity, position and the work; None for 1
        looks: a mask over the times of rows that may have the end of the step around them, which saves the stages of an interpolant
        progress: called now and then with the time that the run has reached. What it raises, or a handler of a signal such as
            that of Ctrl-C, ends the run; `Outcome.completed` raises it again
        inputs: one an input of the mechanism: a table, a function of time, or None; () where all keep their values in p
        breaks (B, 2): of the laws in time, as `break_times` finds them, those of the inputs' tables among them
        choose: the parameters that follow from a position and those there are, asked at the start of every step; None where none do
        options: the other members of `ncgen_options`, by their names
        """
        ffi, n, dtype, where = self._ffi, self.kernels.n, self.number.dtype, self.kernels.name
        real = partial(pointer, ffi, kind=self.number.array)
        library = _runtime(self.number.name, part_for(method, self.is_emitted))
        times = np.ascontiguousarray(times, dtype=dtype)
        rows_and_last = len(times) + 1
        out_q, out_qd, out_work = (np.empty(shape, dtype) for shape in ((rows_and_last, n), (rows_and_last, n), rows_and_last))
        longest = 0.0 if np.isinf(max_step) else max_step
        filled = {"method": number_in_c(INTEGRATORS[method]), "rtol": 1e-8, "atol": 1e-10, "max_step": longest, **options}
        settings = ffi.new("ncgen_options *", filled)
        if sizes is not None:
            sizes = laid(sizes, dtype, sum(self._state(options.get("formalism", PARTITIONED))) + 1, f"{where}: sizes")
            settings.sizes = real(sizes)
        looked = times
        if looks is not None:
            looks, looked = np.ascontiguousarray(looks, dtype=np.intc), times.copy()
            settings.looks, settings.looked = pointer(ffi, looks, "int[]", len(times), f"{where}: looks"), real(looked)
        listener = Listener(progress, self._eliminated)
        context = ffi.new_handle(listener)
        settings.watch, settings.context, settings.patience = watch(self.number.name), context, listener.patience
        driver = Driver(inputs, self.number, breaks) if any(inputs) or np.size(breaks) else None
        if driver:
            signals = driver.signals(library.ncgen_piecewise_inputs)
            settings.signals = signals
        called = [*self.called, *([Choices(self.kernels, choose)] if choose else [])]
        if choose:
            settings.choose = called[-1].function
        watched = Watched(conditions, ffi, self.number) if conditions else None
        if watched:
            settings.event = watched.struct
        if newton or self._uses_tangents(method, options):
            self._take_tangents()
        else:
            self._dynamics.tangents = ffi.NULL
        work, integers = self._space(library, settings)
        statistics, rows = ffi.new("ncgen_statistics *"), ffi.new("int *")
        start = self._start(p, q, velocities, options.get("formalism", PARTITIONED))
        pointers = [real(a) for a in (*start, times, out_q, out_qd, out_work, work)]
        for each in called:
            each.begin()
        status = library.ncgen_simulate(
            self._model, self._dynamics, settings, *pointers[:3], len(times), *pointers[3:7], rows, statistics, pointers[7],
            pointer(ffi, integers, "int[]"),
        )  # fmt: skip
        done, s = rows[0], statistics
        raised = next((each.raised for each in (listener, driver, *called) if each and each.raised), None)
        return Outcome(
            t=np.asarray(looked[:done], dtype=float),
            q=np.asarray(out_q[:done], dtype=float),
            qd=np.asarray(out_qd[:done], dtype=float),
            work=np.asarray(out_work[:done], dtype=float),
            status="interrupted" if raised else STATUS[status],
            reached=float(s.t),
            last=(out_q[-1].astype(float), out_qd[-1].astype(float), out_work[-1].astype(float)),
            stopped=bool(s.stopped),
            crossed=watched.crossed if watched else (),
            next_step=float(s.next_step),
            largest_projection=float(s.largest_projection),
            tried=float(s.tried),
            raised=raised,
            **{name: getattr(s, name) for name in COUNTS},
        )

    def jacobian(
        self, t: float, q: ArrayLike, velocities: ArrayLike, p: ArrayLike, formalism: str = "coordinate-partitioning", **options: InC
    ) -> np.ndarray:
        """How the accelerations change with velocities and positions: ∂z̈/∂[ż; z] (k, 2 k) with coordinate partitioning, where
        rolling conditions leave more positions than velocities ∂[z̈; ż]/∂[ż; z], ∂q̈/∂[q̇; q] (n, 2 n) with other formalisms.
        Arguments as for `simulate`."""
        ffi, library = self._ffi, _runtime(self.number.name, "whole")
        self._take_tangents()
        settings = ffi.new("ncgen_options *", {"formalism": number_in_c(FORMALISMS[formalism]), "tolerance": 1e-12, **options})
        work, integers = self._space(library, settings)
        inputs = self._start(p, q, velocities, number_in_c(FORMALISMS[formalism]))
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

    def _start(self, p: ArrayLike, q: ArrayLike, velocities: ArrayLike, formalism: int) -> list[np.ndarray]:
        """Parameters, position and velocities as C reads them."""
        kernels = self.kernels
        counts = {"p": (p, len(kernels.p0)), "q": (q, kernels.n), "velocities": (velocities, self._state(formalism)[0])}
        return [laid(given, self.number.dtype, count, f"{kernels.name}: {name}") for name, (given, count) in counts.items()]

    @property
    def _eliminated(self) -> int:
        """How many unknowns a stage may have to eliminate; 0 where all that is written out."""
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


class ConstrainedDynamics(Dynamics):
    """Formalisms on all coordinates: the matrix [M Φ_qᵀ; Φ_q −E], factored by a plan that is made once for a mechanism.

    seen: called for independent coordinates of the positions, and typical positions, where the motion is to be written out; without it, or
        where there are none or no tree of bodies that could be seen in them, it comes from the matrix
    tables: of an open tree, by which it moves where nothing is written out
    part: of the runtime, compiled while the motion is written out
    """

    def __init__(
        self,
        kernels: Kernels,
        number: str = "double",
        samples_of: Callable[[], Seen | None] | None = None,
        tables: TreeTables | None = None,
        part: Part = "explicit",
    ) -> None:
        runtime = beside(number, part)
        runtime.start()
        motion = None if samples_of is None else self._written_out(kernels, number, samples_of)
        runtime.join()
        super().__init__(kernels, number)
        self.singular_mass = singular = not is_definite(kernels)
        patterns = kernels.mass_pattern, kernels.phi_q_pattern
        self.plan = kernels.remember("elimination", (), lambda: plan(*patterns, rows_first=singular))
        self._elimination = self._ffi.new("ncgen_elimination *", {"size": self.plan.size, "nonzeros": self.plan.nonzeros})
        self._keep({name: getattr(self.plan, name) for name in Elimination.ARRAYS}, self._elimination, np.intc)
        self._dynamics.elimination = self._elimination
        self._dynamics.singular_mass, self._dynamics.conservative = singular, is_conservative(kernels)
        self._seen = samples_of
        self.is_emitted = motion is not None
        self.is_recursive = self.is_emitted or tables is not None
        if motion is not None:
            function, self._motion = motion
            self._dynamics.motion = self._ffi.cast("const ncgen_motion *", function())
        if tables is not None:
            self._tree = self._ffi.new("ncgen_tree *", tables.counts)
            self._keep(tables.indices, self._tree, np.intc)
            self._keep(tables.numbers, self._tree, self.number.dtype)
            self._dynamics.tree = self._tree

    def _uses_tangents(self, method: str, options: Mapping[str, InC]) -> bool:
        """Not where a recursion serves instead: `ncgen_is_reduced`."""
        recurs = options["formalism"] == number_in_c(FORMALISMS["lagrange"]) and not options.get("frequency") and self.is_recursive
        if INTEGRATORS[method].tangents == "unless_recursive" and recurs and not self.has_rolling:
            return False
        return super()._uses_tangents(method, options)

    @staticmethod
    def _written_out(kernels: Kernels, number: str, samples_of: Callable[[], Seen | None]) -> tuple[Callable[[], InC], InC] | None:
        """What gives the emitted motion, if there is one, and the library that it lives in."""
        files = motion_source(kernels, samples_of)
        if not files:
            return None
        getter = f"{prefix_of(kernels.name)}_recursion"
        _, home = _load(files, number, f"const ncgen_motion *{getter}(void);")
        return getattr(home, getter), home

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
        _, home = _load(self.source("adjoint"), self.number.name, f"const ncgen_seeded_motion *{getter}(void);")
        return self._ffi.cast("const ncgen_seeded_motion *", getattr(home, getter)()), home

    @property
    def interface(self) -> tuple[Interface, InC]:
        """What passes arguments to the runtime, and the runtime with its explicit methods."""
        return self._ffi, _runtime(self.number.name, "explicit")

    @property
    def adjoint_interface(self) -> tuple[Interface, InC]:
        """What passes arguments to the runtime, and the part of it that goes back over a run."""
        return self._ffi, _runtime(self.number.name, "adjoint")

    def described(self, rank: int) -> tuple[InC, InC]:
        """The model, and its dynamics, in a struct of their own where rows are redundant; rank: of Φ_q."""
        described = self._ffi.new("ncgen_dynamics *", self._dynamics[0])
        described.n_dependent = rank
        return self._model, described

    def simulate(
        self, method: str, times: ArrayLike, q: ArrayLike, velocities: ArrayLike, p: ArrayLike, *, rank: int = 0, **options: InC
    ) -> Outcome:
        """As `Dynamics.simulate`; rank: of Φ_q, where rows are redundant."""
        self._dynamics.n_dependent = rank
        done = super().simulate(method, times, q, velocities, p, **options)
        if done.status == "not converged" and INTEGRATORS[method].tangents == "sometimes" and self.number.name == "double":
            # Without tangents the equations of a step are iterated, which next to singular positions does not converge.
            done = super().simulate(method, times, q, velocities, p, newton=True, **options)
        return done


class EmittedDynamics(Dynamics):
    """The state derivative written out and compiled for one choice of independent coordinates."""

    @property
    def _eliminated(self) -> int:
        return 0

    def __init__(self, written: Written, number: str = "double") -> None:
        kernels = written.kernels
        super().__init__(kernels, number)
        self.written = written
        getter = f"{prefix_of(kernels.name)}_dynamics"
        _, self._emitted = _load(written.files, number, f"const ncgen_dynamics *{getter}(void);")
        emitted = getattr(self._emitted, getter)()
        for name in ("newton", "acceleration"):
            setattr(self._dynamics, name, self._ffi.cast("void *", getattr(emitted, name)))
        self._dynamics.closes = emitted.closes
        self._describe(written.split, self._dynamics)  # what to fall back upon
