"""The C runtime as a library, compiled in parts for what a run needs, and how libraries of emitted code are loaded next to it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from threading import Thread
from typing import Literal, TypeAlias

from ncgen.emit.c.files import model_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import (
    EXPLICIT_ONLY,
    HEADERS,
    OMITTED_FOR_EXPLICIT,
    OMITTED_FOR_RADAU,
    ORDINARY_TREE,
    RUNTIME_HEADERS,
    STIFF_TREE,
    adjoint_names,
    event_names,
    event_run_names,
    explicit_names,
    formula_names,
    indifferent,
    ordinary_names,
    runtime_files,
    runtime_names,
    stiff_names,
)
from ncgen.errors import NcgenError
from ncgen.mechanism.in_python import model_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.recall import Files, shared
from ncgen.methods.table import AUTO, find_integrator
from ncgen.toolchain.abi import NUMBERS, InC, declared, runtime_abi
from ncgen.toolchain.cache import Sibling, compiled
from ncgen.toolchain.compilers import FLAGS, flags_for
from ncgen.toolchain.interfaces import Interface, interface
from ncgen.toolchain.loader import load, opened_by
from ncgen.toolchain.once import once

Part: TypeAlias = Literal["ordinary", "stiff", "ordinary tree", "stiff tree", "explicit", "whole", "adjoint", "events", "event runs"]
"""Of the runtime: what emitted accelerations over all coordinates need of explicit methods, or of Radau's; what those in loops over tables
need; all explicit methods, all of it; what goes back over a run, what happens at an instant of events, or what carries
many motions through their events."""

PARTS: dict[Part, tuple[Callable[[], tuple[str, ...]], tuple[str, ...]]] = {
    "ordinary": (ordinary_names, OMITTED_FOR_EXPLICIT),
    "stiff": (stiff_names, OMITTED_FOR_RADAU),
    "ordinary tree": (partial(ordinary_names, ORDINARY_TREE), ORDINARY_TREE),
    "stiff tree": (partial(stiff_names, STIFF_TREE), STIFF_TREE),
    "explicit": (explicit_names, (EXPLICIT_ONLY,)),
    "whole": (runtime_names, ()),
    "adjoint": (adjoint_names, ()),
    "events": (event_names, ()),
    "event runs": (event_run_names, (EXPLICIT_ONLY,)),
}
"""The files of a part, and the macros that choose it."""

Recursion: TypeAlias = Literal["emitted", "tree"] | None
"""What gives accelerations over all coordinates: straight lines, loops over the tables of a tree, or None for the matrix."""

EXPLICIT: dict[Recursion, Part] = {None: "explicit", "emitted": "ordinary", "tree": "ordinary tree"}
IMPLICIT: dict[Recursion, Part] = {None: "whole", "emitted": "stiff", "tree": "stiff tree"}
"""The parts for explicit methods and for Radau's."""

HEADERS_OF_FUNCTIONS = (
    "ncgen_runtime.h",
    "ncgen_driven.h",
    "ncgen_differentiated.h",
    "ncgen_impulses.h",
    "ncgen_chain.h",
    "ncgen_active.h",
    "ncgen_rates.h",
    "ncgen_sliding.h",
)
"""What declares the functions that Python calls."""

RUNS: tuple[Part, ...] = ("whole", "explicit", "ordinary", "stiff", "ordinary tree", "stiff tree")
"""Parts that carry runs out, the one with most objects for others first."""


def load_with_headers(files: dict[str, str], number: str, declarations: str) -> tuple[Interface, InC]:
    """A library of these files, which are straight lines, and the headers, and its interface."""
    flags = flags_for(files)
    files = files | shared("headers", lambda: runtime_files(*RUNTIME_HEADERS, *HEADERS))
    return load(files, declarations, runtime_abi(number), (*flags, *NUMBERS[number].flags))


@once
def interface_of(number: str) -> Interface:
    """What passes arguments to the runtime."""
    return interface("".join(declared(file, "functions") for file in HEADERS_OF_FUNCTIONS), runtime_abi(number))


@once
def runtime_of(number: str, component: Part) -> InC:
    """The runtime, the same for all mechanisms; most runs do without three quarters of it. What parts have in common is compiled once."""
    return opened_by(interface_of(number), _library(number, component))


@once
def event_runtime() -> tuple[Interface, InC]:
    """What carries many motions through their events, and what passes arguments to it."""
    types = declared("ncgen_event_table.h", "table") + declared("ncgen_event_runs.h")
    functions = [declared(file, "functions") for file in ("ncgen_runtime.h", "ncgen_driven.h", "ncgen_event_runs.h")]
    ffi = interface("".join([types, *functions]), runtime_abi("double"))
    return ffi, opened_by(ffi, _library("double", "event runs"))


def _library(number: str, component: Part) -> Path:
    files, flags = _sources(number, component)

    def siblings() -> list[Sibling]:
        others: list[Part] = [other for other in RUNS if other != component and component in (*RUNS, "event runs")]
        return [Sibling(*_sources(number, other), _shared_sources(component, other)) for other in others]

    return compiled(files, flags, siblings=siblings).library


@once
def formula_walker(number: str) -> int:
    """The address of `ncgen_walk_formula`, in a library of its own, which few models need."""
    ffi = interface("ncgen_formula_walker ncgen_walk_formula;", runtime_abi(number))
    files = shared("formulas", lambda: runtime_files(*formula_names()))
    library = opened_by(ffi, compiled(files, (*FLAGS, *NUMBERS[number].flags)).library)
    _walkers.append(library)
    return int(ffi.cast("uintptr_t", library.ncgen_walk_formula))


_walkers: list[InC] = []
"""Libraries that stay open."""


def _shared_sources(component: Part, other: Part) -> tuple[str, ...]:
    """The sources that are compiled alike for both of two parts."""
    (names, macros), (others, defined) = PARTS[component], PARTS[other]
    known = set(others())
    return indifferent([name for name in names() if name in known], set(macros) ^ set(defined))


def _sources(number: str, component: Part) -> tuple[Files, tuple[str, ...]]:
    """The files of a part of the runtime, and the flags that they are compiled with."""
    names, defined = PARTS[component]
    macros = [f"-D{macro}" for macro in defined]
    return shared(f"runtime: {component}", lambda: runtime_files(*names())), (*FLAGS, *NUMBERS[number].flags, *macros)


def part_for(integrator: str, recursion: Recursion = None) -> Part:
    """The part of the runtime that has an integrator; AUTO: whichever is chosen, which seldom is an implicit one.

    recursion: that gives accelerations over all coordinates
    """
    if integrator == AUTO or find_integrator(integrator).tangents == "never":
        return EXPLICIT[recursion]
    return IMPLICIT[recursion] if find_integrator(integrator).tangents == "unless_recursive" else "whole"


@cache
def has_runtime(component: Part) -> bool:
    """True where a part of the runtime is there, or can be compiled; asked once, since a compiler that fails takes its time."""
    try:
        runtime_of("double", component)
    except NcgenError:
        return False
    return True


def compiling_thread(number: str = "double", component: Part = "explicit") -> Thread:
    """A thread that compiles the runtime, if it is not in the cache, while something else runs; to be started, and joined before a run.

    What goes wrong there goes wrong again, and is reported, where the runtime is needed.
    """

    def compiling() -> None:
        with suppress(NcgenError):
            runtime_of(number, component)

    return Thread(target=compiling, daemon=True)


def model_in(kernels: Kernels, number: str) -> tuple[InC, Kernels | InC]:
    """The descriptor of a mechanism's kernels in a number type, and the library that it lives in; made once for every type."""
    if number == "double":
        return model_of(kernels), kernels
    return kernels.remember("models", number, lambda: _compiled_model(kernels, number))


def _compiled_model(kernels: Kernels, number: str) -> tuple[InC, InC]:
    getter = f"{prefix_of(kernels.name)}_model"
    _, library = load_with_headers(model_files(kernels.programs), number, f"const ncgen_model *{getter}(void);")
    return getattr(library, getter)(), library


def prepare(kernels: Kernels, number: str = "double") -> None:
    """Compile what a run may ask for on its way, so that a limit to its time is a limit to the run."""
    for component in RUNS:
        runtime_of(number, component)
    model_in(kernels, number)
    kernels.tangents  # noqa: B018
