"""The C library in ncgen/runtime: its files as they stand, and those headers of it that are printed from tables in Python.

    include/   what a model's source and programs around it include
    src/       the library, one idea a file
    lanes/     many states at once, compiled with vectors for numbers
    generic/   kernels that read a mechanism from a table

All files of a library end in one folder, where they include each other by name.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from ncgen.emit.environment import render
from ncgen.files import write_text
from ncgen.methods.table import FORMALISMS, INTEGRATORS
from ncgen.model.contacts import REST

FOLDER = Path(__file__).resolve().parent.parent / "runtime"

PRINTED = ("ncgen_facts.h", "ncgen_methods.h", "ncgen_rest.h", "ncgen_tableaus.h")
"""Headers with a template in templates/c: the formalisms and integrators that are in C, and what conditions of contacts say of rest."""

HEADERS = ("ncgen.h", "ncgen_math.h")
"""What the source of a model includes."""

RUNTIME_HEADERS = (
    "ncgen_runtime.h",
    "ncgen_driven.h",
    "ncgen_event_table.h",
    "ncgen_events.h",
    "ncgen_differentiated.h",
    "ncgen_methods.h",
)
"""What state derivatives and embedders include."""

EXPLICIT_ONLY = "NCGEN_EXPLICIT_ONLY"
"""The macro without which the library has methods that take implicit steps, too: nearly twice as much to compile."""

WITHOUT_TABLES = "NCGEN_WITHOUT_TABLES"
"""The macro with which no tree of bodies moves in loops over tables, a twelfth of what an export needs."""

WITHOUT_PARTITIONING = "NCGEN_WITHOUT_PARTITIONING"
"""The macro with which there are formalisms over all coordinates alone."""

WITHOUT_STEPPERS = "NCGEN_WITHOUT_STEPPERS"
"""The macro with which there are no methods that discretise the constrained equations themselves."""

ORDINARY_TREE = (EXPLICIT_ONLY, WITHOUT_PARTITIONING)
"""What a run by an explicit method does without where a tree moves in loops over tables."""

OMITTED_FOR_EXPLICIT = (*ORDINARY_TREE, WITHOUT_TABLES)
"""What a run by an explicit method and emitted accelerations does without."""

STIFF_TREE = (WITHOUT_PARTITIONING, WITHOUT_STEPPERS)
"""What a run by Radau's method does without where a tree moves in loops over tables."""

OMITTED_FOR_RADAU = (*STIFF_TREE, WITHOUT_TABLES)
"""What a run by Radau's method and emitted accelerations does without."""


def runtime_names() -> tuple[str, ...]:
    """The files of the library, headers that it includes among them."""
    sources = (path.name for path in sorted((FOLDER / "src").iterdir()))
    return tuple(dict.fromkeys((*sources, *RUNTIME_HEADERS, *HEADERS, *PRINTED)))


def explicit_names() -> tuple[str, ...]:
    """The files of the library where EXPLICIT_ONLY is defined."""
    return _part("ncgen_run.c", "ncgen_driven.c", "ncgen_piecewise.c", defined=(EXPLICIT_ONLY,))


def ordinary_names(defined: Sequence[str] = OMITTED_FOR_EXPLICIT) -> tuple[str, ...]:
    """The files of the library where OMITTED_FOR_EXPLICIT, or ORDINARY_TREE, is defined."""
    return _part("ncgen_run.c", "ncgen_piecewise.c", defined=defined)


def stiff_names(defined: Sequence[str] = OMITTED_FOR_RADAU) -> tuple[str, ...]:
    """The files of the library where OMITTED_FOR_RADAU, or STIFF_TREE, is defined."""
    return _part("ncgen_run.c", "ncgen_piecewise.c", "ncgen_radau.c", "ncgen_trapezoidal.c", defined=defined)


def event_run_names() -> tuple[str, ...]:
    """The files that carry many motions through their events by explicit methods."""
    return _part("ncgen_event_runs.c", "ncgen_run.c", "ncgen_piecewise.c", defined=(EXPLICIT_ONLY,))


def indifferent(names: Iterable[str], macros: Collection[str]) -> tuple[str, ...]:
    """Those of the library's sources that are the same whether macros are defined or not, with all headers that they include."""
    return tuple(name for name in names if name.endswith(".c") and not _mentioned(name).intersection(macros))


@cache
def _mentioned(source: str) -> frozenset[str]:
    """The macros that leave parts of the library out and that a source, or a header that it includes, asks for."""
    known = {*OMITTED_FOR_EXPLICIT, *OMITTED_FOR_RADAU}
    return frozenset(macro for macro in known if any(macro in runtime_text(name) for name in (source, *_headers(source))))


def _headers(source: str) -> set[str]:
    """What a source of the library includes, and what that includes."""
    headers: set[str] = set()
    waiting = [source]
    while waiting:
        included = set(re.findall(r'^#include "([^"]+)"', runtime_text(waiting.pop()), flags=re.MULTILINE)) - headers
        headers |= included
        waiting += included
    return headers


def adjoint_names() -> tuple[str, ...]:
    """The files of the library that go back over a run, which few runs are."""
    return _part("ncgen_adjoint.c")


def formula_names() -> tuple[str, ...]:
    """The files of the library that bound conditions which are no polynomials, which few models have."""
    return _part("ncgen_formula.c")


def event_names() -> tuple[str, ...]:
    """The files of the library that say what happens at an instant of events, whatever it is of."""
    return _part("ncgen_active.c", "ncgen_chain.c", "ncgen_impulses.c", "ncgen_rates.c", "ncgen_sliding.c")


def _part(*sources: str, defined: Sequence[str] = ()) -> tuple[str, ...]:
    """The files of a part of the library, as of `needed_by`, with the headers that the whole of it comes with."""
    return tuple(dict.fromkeys((*needed_by(*sources, defined=defined), *RUNTIME_HEADERS, *HEADERS, *PRINTED)))


def needed_by(*sources: str, defined: Sequence[str] = ()) -> tuple[str, ...]:
    """Sources of the library, the headers that they include, the sources of these, and so on: all that they need to work alone.

    defined: macros that are defined, so that nothing behind `#ifndef` of one is included
    """
    files: dict[str, None] = {}
    waiting = [*sources]
    while waiting:
        name = waiting.pop()
        if name in files:
            continue
        files[name] = None
        text = resolve_ifndef(runtime_text(name), defined)
        headers = re.findall(r'^#include "([^"]+)"', text, flags=re.MULTILINE)
        bodies = [f"{header[:-2]}.c" for header in headers]
        waiting += [*headers, *(body for body in bodies if (FOLDER / "src" / body).is_file())]
    return tuple(sorted(files, key=lambda name: (name.endswith(".c"), name)))


def resolve_ifndef(text: str, defined: Sequence[str]) -> str:
    """A text with what is left of every `#ifndef` of some macros, which has no other one inside, once they are defined."""
    for macro in defined:
        branches = rf"^#ifndef {macro}\n(?:(?!#else|#endif).*\n)*(?:#else.*\n((?:(?!#endif).*\n)*))?#endif.*\n"
        text = re.sub(branches, lambda match: match[1] or "", text, flags=re.MULTILINE)
    return text


def runtime_files(*names: str, defined: Sequence[str] = ()) -> dict[str, str]:
    """{file name: text} of files of the library; defined: macros that all of them are defined."""
    return {name: resolve_ifndef(runtime_text(name), defined) for name in names}


@cache
def runtime_text(name: str) -> str:
    """One file of the library. Raises FileNotFoundError for one that it does not have."""
    if name in PRINTED:
        return render(f"c/{name}.jinja", rest=REST, **_methods())
    candidates = [FOLDER / folder / name for folder in ("include", "src", "lanes", "generic")]
    return next((path for path in candidates if path.is_file()), candidates[0]).read_text(encoding="utf-8")


def constant_of(source: str, name: str) -> int:
    """A whole number that a source of the library names in an enum, such as the last turn of a loop. Raises KeyError where it has none."""
    match = re.search(rf"\b{name} = (\d+)", runtime_text(source))
    if not match:
        raise KeyError(name)
    return int(match[1])


def row_vectors(m: int, rank: int) -> int:
    """How many vectors of all unknowns the choice among redundant rows needs in ncgen_redundant.c; rank: −1 where it changes."""
    besides = constant_of("ncgen_redundant.c", "BESIDES")
    return 0 if rank == m else 1 + (m if rank < besides else m - rank + besides)


def widest_tableau() -> int:
    """Slopes that the largest of the explicit methods keeps."""
    return _methods()["width"]


@cache
def _methods() -> dict[str, Any]:
    """The entries that are in C, in the order of their numbers there."""
    from ncgen.methods.tableau import nonzeros

    integrators = [entry for entry in INTEGRATORS.values() if entry.in_c]
    explicit = [entry for entry in integrators if entry.tableau]
    width = max(entry.coefficients.width for entry in explicit)
    return {
        "formalisms": [f for f in FORMALISMS.values() if f.in_c],
        "integrators": integrators,
        "explicit": explicit,
        "width": width,
        "nonzeros": nonzeros,
    }


def write_printed(folder: Path) -> None:
    """Write the printed headers into a folder, for a build of the library without ncgen around it (see its Makefile)."""
    for name, text in runtime_files(*PRINTED).items():
        write_text(folder / name, text)


if __name__ == "__main__":
    import sys

    write_printed(Path(sys.argv[1]))
