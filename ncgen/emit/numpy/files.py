"""NumPy source of a mechanism's programs: a module of plain functions that needs nothing but NumPy.

Arguments may have leading batch dimensions, and any number type that NumPy adds and multiplies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ncgen.emit.environment import render
from ncgen.emit.naming import prefix_of
from ncgen.emit.numpy.numpy_spelling import NumPy

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ncgen.program.ir.blocks import Program
    from ncgen.program.programs import Programs, TangentPrograms
    from ncgen.symbolic.numbering import Terms

IS_READ = True
WIDTH = 110


def model_files(programs: Programs) -> dict[str, str]:
    """{file name: text} of the NumPy module."""
    equations = programs.equations
    text = render(
        "numpy/model.py.jinja",
        model=equations.model,
        coordinates=[c.name for c in equations.free],
        initial=[c.initial for c in equations.free],
        rows=equations.model.rows,
        parameters=equations.parameters,
        phi_q=programs.phi_q,
        mass=programs.mass,
        **NumPy().records(programs.programs.values()),
        width=WIDTH,
    )
    return {f"{prefix_of(equations.model.name)}.py": text}


def tangent_files(programs: TangentPrograms, equations: Terms) -> dict[str, str]:
    """{file name: text} of the tangent kernels."""
    records = NumPy().records(programs.programs.values())
    text = render("numpy/tangents.py.jinja", model=equations.model, **records, width=WIDTH)
    return {f"{prefix_of(equations.model.name)}_{programs.kind}.py": text}


def function_files(programs: Iterable[Program], equations: Terms, kind: str) -> dict[str, str]:
    """{file name: text}: programs as functions by their own names. kind: a word for the file."""
    text = render("numpy/functions.py.jinja", model=equations.model, kind=kind, **NumPy().records(programs), width=WIDTH)
    return {f"{prefix_of(equations.model.name)}_{kind}.py": text}
