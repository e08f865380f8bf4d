"""The stages from a model to kernels that can be called, each timed, and nothing else.

0. model      what the user said (ncgen.model)
1. symbolic   rows, masses and forces as templates bound to places (ncgen.symbolic)
2. program    straight-line code and loops, folded and counted (ncgen.program)
3. emit       C and NumPy source (ncgen.emit)
4. toolchain  a compiled library from the cache or the compiler (ncgen.toolchain), in what one calls (ncgen.mechanism)
5. load       kernels

What stages 1 to 3 made of a model is kept next to the compiled libraries (ncgen.mechanism.recall). sympy is imported by stage 1
only, so importing ncgen stays quick.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, ParamSpec, TypeVar, overload

from ncgen.errors import CompileError, one_of
from ncgen.model import Model
from ncgen.model.model import checked_model
from ncgen.program.programs import EMISSIONS
from ncgen.toolchain.undisturbed import undisturbed

if TYPE_CHECKING:
    from ncgen.emit.sources import Sources
    from ncgen.mechanism.kernels import Kernels
    from ncgen.mechanism.library import CompiledKernels
    from ncgen.mechanism.numbered import Structured
    from ncgen.mechanism.numpy_module import NumPyKernels
    from ncgen.program.programs import Programs

BACKENDS = ("auto", "c", "numpy")
EFFORTS = ("auto", "most")

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


@dataclass
class Timings:
    """Seconds per stage, in the order in which they ran."""

    seconds: dict[str, float] = field(default_factory=dict)

    def stage(self, name: str, function: Callable[Parameters, Result], *arguments: Parameters.args, **named: Parameters.kwargs) -> Result:
        start = time.perf_counter()
        result = function(*arguments, **named)
        self.seconds[name] = time.perf_counter() - start
        return result

    @property
    def total(self) -> float:
        return sum(self.seconds.values())


def check_words(backend: str, emission: str) -> None:
    """Raise ModelError for a backend or an emission that does not exist."""
    for name, value, known in (("backend", backend, BACKENDS), ("emission", emission, tuple(EMISSIONS))):
        one_of(value, name, known)


def generate(model: Model, emission: str = "auto", timings: Timings | None = None) -> Sources:
    """Generate the sources of a mechanism; a file is printed when it is asked for.

    Parameters
    ----------
    model : Model
        Mechanism.
    emission : str
        "unrolled" (straight-line code), "tabled" (loops over index tables) or "auto".
    timings : Timings, optional
        Takes the time of every stage.

    Returns
    -------
    Sources
        Files by name.

    Raises
    ------
    ModelError
        Where the model cannot be generated.
    """
    from ncgen.emit.sources import Sources

    return Sources(_programs(checked_model(model), emission, timings or Timings()))


def _programs(model: Model, emission: str, timings: Timings, structure: Structured | None = None) -> Programs:
    """The programs of a mechanism; with a structure, their numbers are traced."""
    timings.stage("import", _import_generator)
    from ncgen.program.assemble import assemble
    from ncgen.symbolic.equations import build_equations

    with undisturbed():
        equations = timings.stage("symbolic", lambda: structure.terms if structure else build_equations(model))
        return timings.stage("program", assemble, equations, emission)


@overload
def compile(
    model: Model | Sources, backend: Literal["c"], emission: str = "auto", timings: Timings | None = None, effort: str = "auto"
) -> CompiledKernels: ...


@overload
def compile(
    model: Model | Sources, backend: Literal["numpy"], emission: str = "auto", timings: Timings | None = None, effort: str = "auto"
) -> NumPyKernels: ...


@overload
def compile(
    model: Model | Sources, backend: str = "auto", emission: str = "auto", timings: Timings | None = None, effort: str = "auto"
) -> Kernels: ...


def compile(
    model: Model | Sources, backend: str = "auto", emission: str = "auto", timings: Timings | None = None, effort: str = "auto"
) -> Kernels:
    """Compile a mechanism.

    Parameters
    ----------
    model : Model or Sources
        Mechanism, or its sources from `generate`.
    backend : str
        "c", "numpy", or "auto": C where a compiler works, otherwise NumPy with a warning that says why.
    emission : str
        As of `generate`.
    timings : Timings, optional
        Takes the time of every stage.
    effort : str
        How much of a motion is compiled at its first run. "auto": what takes a few seconds; trees of bodies with more than 20 joint
        velocities move in loops over tables. "most": all trees, which run two to three times as fast after up to half a minute.

    Returns
    -------
    Kernels
        Compiled functions of the mechanism: Φ, Φ_q, M, forces, energies.

    Raises
    ------
    CompileError
        If C was asked for and no compiler works.
    """
    check_words(backend, emission)
    one_of(effort, "effort", EFFORTS)
    timings = timings or Timings()
    with undisturbed():
        from ncgen.mechanism.library import CompiledKernels
        from ncgen.mechanism.numpy_module import NumPyKernels
        from ncgen.toolchain.cache import compiled
        from ncgen.toolchain.compilers import flags_for

        sources = sources_of(model, emission, timings, cached=backend != "numpy")
    if backend != "numpy":
        try:
            source = timings.stage("emit", lambda: sources.compiled)
            built = timings.stage("build", compiled, source.files, flags_for(source.files))
            kernels = timings.stage("load", CompiledKernels, sources.programs, built.library, source.values)
            kernels.effort = effort
            return kernels
        except CompileError as error:
            if backend == "c":
                raise
            warnings.warn(f"{str(error)[:240]}; the NumPy backend is used, which is slower", stacklevel=2)
    return timings.stage("load", NumPyKernels, sources)


def sources_of(model: Model | Sources, emission: str, timings: Timings, cached: bool = True) -> Sources:
    """Sources of a model, generated or, where they may be, as they were kept from before."""
    from ncgen.emit.sources import Sources

    if isinstance(model, Sources):
        return model
    model = checked_model(model)
    if not cached:
        return generate(model, emission, timings)
    from ncgen.mechanism import numbered, recall

    structure = timings.stage("key", numbered.structured, model, emission)
    if structure is not None:
        return _of_structure(structure, model, timings)
    key = timings.stage("key", recall.key, model, emission)
    if key is None:
        return generate(model, emission, timings)
    sources = timings.stage("recall", recall.recall, model, emission, key)
    if sources is None:
        sources = generate(model, emission, timings)
        timings.stage("keep", recall.remember, key, sources)
    return sources


def _of_structure(structure: Structured, model: Model, timings: Timings) -> Sources:
    """Sources whose numbers are data, as they were kept or generated."""
    from ncgen.mechanism.structured_kernels import kept_sources, remembered_sources

    sources = timings.stage("recall", kept_sources, structure, model)
    if sources is None:
        programs = _programs(model, structure.emission, timings, structure)
        sources = timings.stage("keep", remembered_sources, structure, model, programs)
    return sources


def _import_generator() -> None:
    import ncgen.emit.c.files
    import ncgen.emit.sources  # noqa: F401
