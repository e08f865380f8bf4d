"""C99 source of a mechanism's programs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ncgen.emit.environment import comment_text, loop_comments, render
from ncgen.emit.expressions import write
from ncgen.emit.naming import Names, identifier
from ncgen.emit.runtime import HEADERS, runtime_files
from ncgen.emit.tables import Place, Tables
from ncgen.model.values import evaluate
from ncgen.program.angles import SHARED
from ncgen.program.blocks import Block, Loop, Program, Store
from ncgen.program.cost import cost
from ncgen.program.functions import FUNCTIONS
from ncgen.program.graph import Op

if TYPE_CHECKING:
    from ncgen.program.dynamics import DynamicsPrograms
    from ncgen.program.programs import Programs
    from ncgen.program.tangents import TangentPrograms
    from ncgen.symbolic.numbering import Terms

WIDTH = 100


def c_files(programs: Programs) -> dict[str, str]:
    """{file name: text}: the model's source and header, and the headers they include."""
    prefix = identifier(programs.equations.model.name)
    tables = Tables(f"{prefix}_")
    kernels = [_kernel(program, prefix, tables) for program in programs.programs.values()]
    records = _records(programs, prefix, kernels, tables)
    body = render("c/model.c.jinja", fingerprint="", **records)
    fingerprint = hashlib.sha256(body.encode()).hexdigest()[:16]
    files = {
        f"{prefix}.h": render("c/model.h.jinja", **records),
        f"{prefix}.c": render("c/model.c.jinja", fingerprint=fingerprint, **records),
    }
    return files | runtime_files(*HEADERS)


def dynamics_files(programs: DynamicsPrograms, equations: Terms, row_sizes: Iterable[float]) -> dict[str, str]:
    """{file name: text}: the state derivative, for the runtime to integrate."""
    prefix = identifier(equations.model.name)
    tables = Tables(f"{prefix}_dynamics_")
    split = programs.split
    records = {
        "prefix": prefix,
        "upper": prefix.upper(),
        "model": equations.model,
        "kernels": [_kernel(program, prefix, tables) for program in (programs.newton, programs.acceleration)],
        "independent": [equations.free[i].name for i in split.independent],
        "independent_positions": split.independent,
        "dependent_positions": split.dependent,
        "row_sizes": [number(float(size)) for size in row_sizes] or ["0"],
        "width": WIDTH,
    }
    return {f"{prefix}_dynamics.{kind}": render(f"c/dynamics.{kind}.jinja", **records) for kind in "ch"}


def tangent_files(programs: TangentPrograms, equations: Terms) -> dict[str, str]:
    """{file name: text}: the tangent kernels."""
    prefix = identifier(equations.model.name)
    tables = Tables(f"{prefix}_{programs.kind}_")
    records = {
        "prefix": prefix,
        "kind": programs.kind,
        "upper": prefix.upper(),
        "model": equations.model,
        "kernels": [_kernel(program, prefix, tables) for program in programs.programs.values()],
        "patterns": list(programs.patterns.items()),
        **_tables(tables),
        "width": WIDTH,
    }
    return {f"{prefix}_{programs.kind}.{end}": render(f"c/tangents.{end}.jinja", **records) for end in "ch"}


def program_records(programs: Iterable[Program], prefix: str, kind: str) -> dict[str, Any]:
    """Programs as a template prints them: {kernels, index_tables, number_tables}; kind: a word for the names of their tables."""
    tables = Tables(f"{prefix}_{kind}_")
    kernels = [_kernel(program, prefix, tables) for program in programs]
    return {"kernels": kernels, **_tables(tables)}


def number(value: float) -> str:
    """The shortest text that reads back to the same double."""
    return f"R({value!r})" if value >= 0 else f"-R({-value!r})"


class _C:
    """How C spells leaves and calls."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables

    def number(self, value: float) -> str:
        return number(value)

    def leaf(self, op: Op, block: Block) -> str:
        if op.code == "load":
            array, index = op.input
            return "t" if array == "t" else f"{array}[{index}]"
        slot = block.slots[op.slot]
        if slot.array == "const":
            return f"{self.tables.number(slot.table)}[i]"
        return f"{slot.array}[{_subscript(self.tables.place(slot.table))}]"

    def call(self, name: str, arguments: list[str]) -> str:
        return f"{FUNCTIONS[name].c}({', '.join(arguments)})"


def _subscript(place: Place) -> str:
    head = f"{place.table}[i]" if place.table else {0: "", 1: "i"}.get(place.step, f"{place.step} * i")
    if not head:
        return str(place.offset)
    return head if not place.offset else f"{head} + {place.offset}" if place.offset > 0 else f"{head} - {-place.offset}"


def _kernel(program: Program, prefix: str, tables: Tables) -> dict[str, Any]:
    reserved = [*program.inputs, program.output, *SHARED.values(), "angle"]
    blocks = [_block(block, tables, Names(reserved, prefix)) for block in program.blocks]
    operations = cost(program)
    return {
        "name": program.name,
        "function": f"{prefix}_{program.name}",
        "inputs": program.inputs,
        "output": program.output,
        "size": program.size,
        "temporaries": program.temporaries,
        "angles": _angles(program.angles, tables),
        "blocks": blocks,
        "unused": [a for a in program.inputs if a not in _read(program)],
        "operations": operations.total,
        "calls": operations.calls,
    }


def _read(program: Program) -> set[str]:
    """The arrays a program reads."""
    loads = {op.input.array for block in program.blocks for op in block.ops if op.code == "load"}
    slots = {slot.array for block in program.blocks for slot in block.slots}
    return loads | slots | ({"q"} if program.angles else set())


def _angles(angles: tuple[int, ...], tables: Tables) -> dict[str, Any]:
    """Where the angles of a program lie: one after the other in q, or anywhere."""
    if not angles:
        return {"count": 0}
    place = tables.place(angles)
    together = place.table is None and (place.step == 1 or len(angles) == 1)
    return {"count": len(angles), "first": place.offset if together else None, "place": _subscript(place)}


def _block(block: Block, tables: Tables, names: Names) -> dict[str, Any]:
    dialect = _C(tables)
    written = write(block, dialect, names)
    lines: list[str] = []
    said = ""
    for store, before, value in zip(block.stores, written.before, written.values, strict=True):
        if isinstance(store, Store) and store.comment not in ("", said):
            said = store.comment
            lines.append(f"/* {comment_text(said)} */")
        lines += [f"const ncgen_real {a.name} = {_splat(a.value) if _is_number(a.node, block) else a.value};" for a in before]
        place = store.index if isinstance(store, Store) else _subscript(tables.place(store.table))
        sign = "+=" if store.accumulate else "="
        value = _splat(value) if block.ops[store.node].code == "const" else value
        lines.append(f"{store.array}[{place}] {sign} {value};")
    return {
        "loop": isinstance(block, Loop),
        "count": block.count,
        "title": comment_text(block.title),
        "lines": lines,
        "comments": loop_comments(block),
    }


def _is_number(node: int, block: Block) -> bool:
    """True for what a loop reads from a table of numbers."""
    op = block.ops[node]
    return op.code == "slot" and block.slots[op.slot].array == "const"


def _splat(value: str) -> str:
    """A constant as a number of the kernels' type, which may be a vector."""
    return f"NCGEN_SPLAT({value})"


def _records(programs: Programs, prefix: str, kernels: list[dict[str, Any]], tables: Tables) -> dict[str, Any]:
    equations = programs.equations
    model = equations.model
    parameters = equations.parameters
    return {
        "prefix": prefix,
        "upper": prefix.upper(),
        "model": model,
        "kernels": kernels,
        "coordinates": [c.name for c in equations.free],
        "initial": [number(c.initial) for c in equations.free],
        "rows": [{"number": i + 1, "row": row} for i, row in enumerate(model.rows)],
        "parameters": parameters,
        "defaults": [number(evaluate(p, model.parameters, p.name)) for p in parameters],
        "phi_q": programs.phi_q,
        "mass": programs.mass,
        "mass_is_constant": "mass" in programs.programs and programs.programs["mass"].is_constant,
        "omitted": programs.omitted,
        **_tables(tables),
        "width": WIDTH,
    }


def _tables(tables: Tables) -> dict[str, Any]:
    return {
        "index_tables": [(name, values) for values, name in tables.indices.items()],
        "number_tables": [(name, [number(v) for v in values]) for values, name in tables.numbers.items()],
    }
