"""WebAssembly with a typed wrapper in JavaScript: a mechanism's kernels, linked to the runtime, by which they move."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ncgen.emit.environment import render
from ncgen.emit.wasm.binary import LINK
from ncgen.emit.wasm.linked import Linked, linked_module
from ncgen.exchange.export.package import Package
from ncgen.mechanism.impacts_in_c import LAWS
from ncgen.program.algebra.quasidefinite import Elimination
from ncgen.program.ir.blocks import Pattern, Program
from ncgen.solver.events.holdables import CONTACT, GAP, JOINT, LOCK, RATCHET, RUBBING_GAP
from ncgen.toolchain.generic_wasm import LINKED, WITHOUT_EVENTS, binary

CONSTANTS = frozenset("N ROWS KERNELS LARGEST PARAMETERS DRIVES T WORK Q QD QDD LAM HAPPENED STOPPED STATE FUNCTIONS WORDS".split())
"""What the wrapper calls its constants: no class can be called so."""

FUNCTIONS = (
    "phi", "phi_q", "nu", "gamma", "mass", "force", "energy", "switches", "conditions", "condition_derivatives", "condition_rates",
    "action_values", "held_phi", "held_phi_q", "held_nu", "held_gamma", "held_conditions",
    "friction_forces", "contact_velocities",
)  # fmt: skip
"""Functions that the runtime calls, in the order of ncgen_linked.h."""

KINDS = ("NCGEN_SET", "NCGEN_SET_VELOCITY", "NCGEN_IMPACT", "NCGEN_STOP", "NCGEN_LOCK", "NCGEN_FREE")
HOLDS = (GAP, JOINT, RATCHET, LOCK, RUBBING_GAP, CONTACT)
"""Kinds of actions and of what is held, in the order of their numbers in ncgen_event_table.h."""

FIRST_FUNCTION = 24
"""Where their numbers begin in the description."""


HAS_EVENTS = True


def files(package: Package) -> dict[str, str | bytes]:
    """{file name: contents}."""
    prefix = package.prefix
    title = prefix[0].upper() + prefix[1:]
    made, records = assembled(package, package.sources.programs.programs.values(), f"{title}_" if title in CONSTANTS else title)

    def filled(template: str) -> str:
        return render(f"package/wasm/{template}.jinja", **records)

    return {
        "README.md": filled("README.md"),
        "package.json": filled("package.json"),
        f"{prefix}.wasm": made.binary,
        f"{prefix}.js": filled("wrapper.js"),
        f"{prefix}.d.ts": filled("wrapper.d.ts"),
        "main.mjs": filled("main.mjs"),
    }


def assembled(package: Package, kernels: Iterable[Program], title: str) -> tuple[Linked, dict]:
    """(the module, what its wrapper is filled with): these kernels, which include those of the motion; title: of the wrapper's class."""
    kernels = list(kernels)
    switches = [package.switching.program] if package.switching else []
    programs = [*kernels, *package.outputs[:1], *switches, *(package.events.programs if package.events else []), *_held_programs(package)]
    runtime = binary(LINKED if package.events else WITHOUT_EVENTS)
    made = linked_module(programs, package.prefix, _integers(package), _numbers(package), {LINK: runtime})
    return made, package.records | {
        "title": title,
        "linked": made,
        "kernel_shapes": [{"name": program.name, "inputs": program.inputs, "size": program.size} for program in kernels],
        "functions": [name for name in FUNCTIONS if any(program.name == name for program in programs)],
        "function_places": {name: FIRST_FUNCTION + k for k, name in enumerate(FUNCTIONS)},
        "drives": package.independent,
        "largest": max(program.size for program in programs),
        "size": len(made.binary),
    }


def _held_programs(package: Package) -> list[Program]:
    """Kernels of the mechanism with what is held that are not those of the mechanism itself."""
    if not package.held:
        return []
    programs = package.held.sources.programs.programs
    return [replace(programs[name], name=f"held_{name}") for name in ("phi", "phi_q", "nu", "gamma") if name in programs]


def _integers(package: Package) -> list[int]:
    """The description in whole numbers, as ncgen_linked.h says; numbers of functions are 0 until they are linked."""
    kernels, breaks, drives = package.kernels, package.switching, [package.kernels.index[name] for name in package.independent]
    singular, rank = package.singular_mass, package.rank
    counts = [
        kernels.n,
        kernels.m,
        len(kernels.p0),
        rank if rank < kernels.m else 0,
        int(singular),
        int(package.conservative and not (package.events and package.events.rubs)),
        len(drives),
    ]
    counts += [breaks.lines, breaks.curves, int(breaks.jumps)] if breaks else [0, 0, 0]
    happening: dict[str, Any] = package.events.described if package.events else {}
    if happening:
        counts += [happening["count"], happening["most"], len(happening["rows"]), [*LAWS.values()].index(happening["law"])]
        counts += [happening[word] for word in ("values", "degree", "events")]
        counts += [len(happening["holds"]), happening["loads"], len(happening["own"])]
    else:
        counts += 10 * [0]
    counts.append(package.held.kernels.m if package.held else 0)
    counts += [int(happening["follows_loads"]), len(happening["rubbings"]), happening["sliding"]] if happening else [0, 0, 0]
    phi_q = _with_rows(kernels.phi_q_pattern, drives)
    patterns = [*phi_q.indptr, *phi_q.indices, *kernels.mass_pattern.indptr, *kernels.mass_pattern.indices]
    orders = [package.elimination(pattern) for pattern in (kernels.phi_q_pattern, phi_q)]
    tables = [x for order in orders for x in (order.nonzeros, *(x for name in Elimination.ARRAYS for x in getattr(order, name)))]
    actions = [x for row in happening.get("rows", ()) for x in (row.event, KINDS.index(row.kind), row.index, row.value)]
    sides = [
        *happening.get("directions", ()),
        *[-1] * (happening.get("count", 0) + happening.get("loads", 0)),
        *happening.get("unknown", ()),
    ]
    return [*counts, *[0] * len(FUNCTIONS), *patterns, *tables, *sides, *actions, *_held_integers(package, happening)]


def _held_integers(package: Package, happening: dict[str, Any]) -> list[int]:
    """The same of what is held."""
    rubbings = [x for row in happening.get("rubbings", ()) for x in row]
    if not package.held:
        return rubbings
    rows = [x for r in happening["holds"] for x in (HOLDS.index(r.kind), r.condition, r.on, r.held, r.value, r.slip, r.load)]
    pattern = package.held.kernels.phi_q_pattern
    order = package.of_held.elimination(pattern)
    tables = [order.nonzeros, *(x for name in Elimination.ARRAYS for x in getattr(order, name))]
    return [*rows, *rubbings, *happening["own"], *pattern.indptr, *pattern.indices, *tables]


def _with_rows(pattern: Pattern, columns: list[int]) -> Pattern:
    """A pattern with one row more for each of some columns."""
    rows, nonzeros = pattern.shape[0] + len(columns), len(pattern.indices)
    indptr = (*pattern.indptr, *(nonzeros + k + 1 for k in range(len(columns))))
    return replace(pattern, shape=(rows, pattern.shape[1]), indptr=indptr, indices=(*pattern.indices, *columns))


def _numbers(package: Package) -> list[float]:
    """The description in numbers."""
    kernels = package.kernels
    sizes = [float(kernels.column_sizes[kernels.index[name]]) for name in package.independent]
    interval = package.switching.interval if package.switching else 0.0
    arrays = (kernels.column_sizes, kernels.row_sizes, sizes, package.q, package.qd, kernels.p0)
    happening: dict[str, Any] = package.events.described if package.events else {}
    watched = [happening["noise"], *happening["nodes"], *happening["inverse"]] if happening else []
    watched += package.held.kernels.row_sizes.tolist() if package.held else []
    return [interval, *(float(x) for array in arrays for x in array), *watched]
