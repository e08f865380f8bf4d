"""C99 source of a mechanism's programs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import TYPE_CHECKING

from ncgen.emit.c.c_spelling import C, number
from ncgen.emit.environment import render
from ncgen.emit.naming import prefix_of
from ncgen.emit.number_table import NumberTable
from ncgen.emit.runtime_files import HEADERS, runtime_files
from ncgen.emit.spelling import Record
from ncgen.program.ir.blocks import Program

if TYPE_CHECKING:
    from ncgen.program.motions.dynamics import DynamicsPrograms, MotionPrograms
    from ncgen.program.programs import Programs, TangentPrograms
    from ncgen.symbolic.numbering import Terms

IS_READ = True
WIDTH = 100

MAX_STATEMENTS_PER_FILE = 4000
"""Statements of a motion's programs above which each is a file, so that compilers work on them side by side: they take two seconds for so
many."""

MAX_STATEMENTS_OF_PARTS = MAX_STATEMENTS_PER_FILE // 2
"""Statements of a file with blocks of a program: two compilers share those of an arm of seven hinges."""

DIFFERENTIATED = {"tangent": "along a direction", "adjoint": "transposed"}


def model_files(programs: Programs, numbers: NumberTable | None = None) -> dict[str, str]:
    """{file name: text}: the model's source and header, and the headers they include.

    numbers: a table that the source reads the model's numbers from, for equations that are traced; None where they stand in the code
    """
    prefix = prefix_of(programs.equations.model.name)
    records = _model_records(programs, prefix, numbers)
    body = render("c/model.c.jinja", fingerprint="", **records)
    fingerprint = hashlib.sha256(body.encode()).hexdigest()[:16]
    files = {
        f"{prefix}.h": render("c/model.h.jinja", **records),
        f"{prefix}.c": render("c/model.c.jinja", fingerprint=fingerprint, **records),
    }
    return files | runtime_files(*HEADERS)


def dynamics_files(programs: DynamicsPrograms, equations: Terms, row_sizes: Iterable[float]) -> dict[str, str]:
    """{file name: text}: the state derivative, for the runtime to integrate."""
    prefix = prefix_of(equations.model.name)
    split = programs.split
    records = {
        "model": equations.model,
        **program_records((programs.newton, programs.acceleration), prefix, "dynamics"),
        "independent": [equations.free[i].name for i in split.independent],
        "independent_positions": split.independent,
        "dependent_positions": split.dependent,
        "closes": int(programs.closes),
        "row_sizes": [number(float(size)) for size in row_sizes] or ["0"],
    }
    return {f"{prefix}_dynamics.{end}": render(f"c/dynamics.{end}.jinja", **records) for end in "ch"}


def motion_files(programs: MotionPrograms, equations: Terms, forced: bool = False, numbers: NumberTable | None = None) -> dict[str, str]:
    """{file name: text}: the motion of all coordinates, for the runtime to integrate; long programs in files of their own. forced: the
    derivative takes forces as one more input; numbers: as of `model_files`."""
    prefix = prefix_of(equations.model.name)
    in_files = sum(program.length for program in programs.emitted) > MAX_STATEMENTS_PER_FILE
    files: dict[str, str] = {}
    for program in programs.emitted if in_files else ():
        records = program_records((program,), prefix, program.name, numbers)
        others = {} if program.phases is None else _parts_files(program, records)
        files |= others | {f"{prefix}_{program.name}.c": render("c/recursion_kernel.c.jinja", are_declared=bool(others), **records)}
    records = {
        "model": equations.model,
        "prepared": programs.prepared,
        "closing_rows": programs.closing.size - len(equations.free),
        "follow_from_angles": programs.follow_from_angles,
        "in_files": in_files,
        "forced": forced,
    }
    records |= program_records(programs.emitted, prefix, "recursion", numbers)
    return files | {f"{prefix}_recursion.{end}": render(f"c/recursion.{end}.jinja", **records) for end in "ch"}


def _parts_files(program: Program, records: Record) -> dict[str, str]:
    """{file name: text}: the blocks of a program in phases, about as many statements in each file; none of one whose blocks read tables."""
    if records["index_tables"] or records["number_tables"]:
        return {}
    (kernel,) = records["kernels"]
    count = -(-program.length // MAX_STATEMENTS_OF_PARTS)
    file_of = [sum(len(block.ops) for block in program.blocks[:k]) * count // program.length for k in range(len(program.blocks))]
    files: dict[str, str] = {}
    for number_of_file in range(count):
        name = f"{kernel['function']}_parts{number_of_file + 1}"
        blocks = [block for block, home in zip(kernel["blocks"], file_of, strict=True) if home == number_of_file]
        files[f"{name}.c"] = render("c/recursion_parts.c.jinja", name=name, prefix=records["prefix"], blocks=blocks)
    return files


def seeded_files(programs: MotionPrograms, equations: Terms, kind: str) -> dict[str, str]:
    """{file name: text}: a motion differentiated. kind: "tangent" or "adjoint"."""
    prefix = prefix_of(equations.model.name)
    records = {"model": equations.model, "kind": kind, "description": DIFFERENTIATED[kind], **program_records(programs.all, prefix, kind)}
    return {f"{prefix}_{kind}.c": render("c/seeded.c.jinja", **records)}


def function_files(programs: Iterable[Program], equations: Terms, kind: str) -> dict[str, str]:
    """{file name: text}: programs as functions by their own names. kind: a word for the file and its tables."""
    prefix = prefix_of(equations.model.name)
    records = program_records(programs, prefix, kind)
    return {f"{prefix}_{kind}.c": render("c/functions.c.jinja", model=equations.model, kind=kind, **records)}


def tangent_files(programs: TangentPrograms, equations: Terms) -> dict[str, str]:
    """{file name: text}: the tangent kernels."""
    prefix = prefix_of(equations.model.name)
    records = {
        "kind": programs.kind,
        "model": equations.model,
        **program_records(programs.programs.values(), prefix, programs.kind),
        "patterns": list(programs.patterns.items()),
    }
    return {f"{prefix}_{programs.kind}.{end}": render(f"c/tangents.{end}.jinja", **records) for end in "ch"}


def program_records(programs: Iterable[Program], prefix: str, kind: str = "", numbers: NumberTable | None = None) -> Record:
    """Programs as a template prints them; kind: a word for the names of their tables, where a model has several files; numbers: as of
    `model_files`."""
    records = C(prefix, kind, numbers).records(programs)
    return {"prefix": prefix, "upper": prefix.upper(), **records, "width": WIDTH, "number_table": numbers}


def _model_records(programs: Programs, prefix: str, numbers: NumberTable | None) -> Record:
    equations = programs.equations
    model = equations.model
    parameters = equations.parameters
    return {
        **program_records(programs.programs.values(), prefix, "", numbers),
        **_tables_of_numbers(equations, numbers),
        "model": model,
        "coordinates": [c.name for c in equations.free],
        "initial": [number(c.initial) for c in equations.free],
        "rows": [{"number": i + 1, "row": row} for i, row in enumerate(model.rows)],
        "parameters": parameters,
        "inputs": len(model.inputs),
        "defaults": [number(p.default) for p in parameters],
        "phi_q": programs.phi_q,
        "mass": programs.mass,
        "mass_is_constant": "mass" in programs.programs and programs.programs["mass"].is_constant,
        "omitted": programs.omitted,
    }


def _tables_of_numbers(equations: Terms, numbers: NumberTable | None) -> Record:
    """What the model's structure points to in a table of numbers."""
    tables = {"initial_table": [c.initial for c in equations.free], "default_table": [p.default for p in equations.parameters]}
    return {name: numbers and numbers.column(values) for name, values in tables.items()}
