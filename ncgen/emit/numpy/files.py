"""NumPy source of a mechanism's programs: a module of plain functions that needs nothing but NumPy.

Arguments may have leading batch dimensions, and any number type that NumPy adds and multiplies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ncgen.emit.environment import render
from ncgen.emit.infix import Assignment
from ncgen.emit.loop_tables import Tables
from ncgen.emit.naming import prefix_of
from ncgen.emit.spelling import Record, Spelling
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Loop, Program, Slot, Store, TableStore
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ncgen.program.ir.blocks import Program
    from ncgen.program.programs import Programs, TangentPrograms
    from ncgen.symbolic.numbering import Terms


class NumPy(Spelling):
    def __init__(self) -> None:
        super().__init__(Tables("_"))

    def number(self, value: float) -> str:
        return repr(value)

    def element(self, array: str, index: int, block: Block) -> str:
        is_loop = isinstance(block, Loop)
        if array == "t":
            return "t[..., None]" if is_loop else "t"
        return f"{array}[..., {index}, None]" if is_loop else f"{array}[..., {index}]"

    def slot(self, slot: Slot, block: Block) -> str:
        return f"{slot.array}[..., {self._subscript(slot.table)}]"

    def column(self, table: str) -> str:
        return table

    def call(self, name: str, arguments: list[str]) -> str:
        function = "_pieces" if name == PIECES else f"np.{FUNCTIONS[name].numpy}"
        return f"{function}({', '.join(arguments)})"

    def comment(self, text: str) -> str:
        return f"# {text}"

    def assignment(self, new: Assignment, block: Block) -> str:
        return f"{new.name} = {new.value}"

    def store(self, store: Store | TableStore, value: str, block: Block) -> str:
        if isinstance(store, Store):
            return _set(store, str(store.index), value)
        if store.accumulate and len(set(store.table)) == 1:
            # Every run adds to the same place: a sum over the runs, whatever the value's own shape is.
            return _set(store, str(store.table[0]), f"np.sum({value} + np.zeros({block.count}), axis=-1)")
        subscript = self._subscript(store.table)
        if store.accumulate and len(set(store.table)) < len(store.table):
            return f"np.add.at({store.array}, (..., {subscript}), {value})"
        subscript = subscript.removesuffix(", None")
        if block.count == 1:
            value, subscript = f"np.asarray({value})", f"{subscript}:{int(subscript) + 1}"
        return _set(store, subscript, value)

    def kernel(self, program: Program) -> Record:
        subscript = self._subscript(program.angles) if program.angles else ""
        angles = [f"{array} = {self.call(code, [f'q[..., {subscript}]'])}" for code, array in SHARED.items()] if program.angles else []
        has_lookups = any(op.code == PIECES for block in program.blocks for op in block.ops)
        return {"angles": angles, "has_lookups": has_lookups, **super().kernel(program)}

    def _subscript(self, table: tuple[int, ...]) -> str:
        """The places of all runs."""
        position = self.tables.place(table)
        if position.table:
            return position.table if not position.offset else f"{position.table} + {position.offset}".replace("+ -", "- ")
        if position.step == 0:
            return f"{position.offset}, None"
        stop = position.offset + position.step * len(table)
        if position.step > 0:
            return f"{position.offset}:{stop}" if position.step == 1 else f"{position.offset}:{stop}:{position.step}"
        return f"{position.offset}:{stop if stop >= 0 else ''}:{position.step}"


def _set(store: Store | TableStore, subscript: str, value: str) -> str:
    return f"{store.array}[..., {subscript}] {'+=' if store.accumulate else '='} {value}"


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
