"""NumPy source of a mechanism's programs: a module of plain functions that needs nothing but NumPy.

Arguments may have leading batch dimensions, and any number type that NumPy adds and multiplies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ncgen.emit.environment import comment_text, loop_comments, render
from ncgen.emit.expressions import write
from ncgen.emit.naming import Names, identifier
from ncgen.emit.tables import Place, Tables
from ncgen.program.angles import SHARED
from ncgen.program.blocks import Block, Loop, Program, Store, TableStore
from ncgen.program.cost import cost
from ncgen.program.functions import FUNCTIONS
from ncgen.program.graph import Op

if TYPE_CHECKING:
    from ncgen.program.programs import Programs
    from ncgen.program.tangents import TangentPrograms
    from ncgen.symbolic.numbering import Terms

WIDTH = 110


def numpy_files(programs: Programs) -> dict[str, str]:
    """{file name: text} of the NumPy module."""
    model = programs.equations.model
    tables = Tables("_")
    kernels = [_kernel(program, tables) for program in programs.programs.values()]
    name = identifier(model.name)
    text = render(
        "numpy/model.py.jinja",
        model=model,
        kernels=kernels,
        coordinates=[c.name for c in programs.equations.free],
        initial=[c.initial for c in programs.equations.free],
        rows=model.rows,
        parameters=programs.equations.parameters,
        phi_q=programs.phi_q,
        mass=programs.mass,
        **_tables(tables),
        width=WIDTH,
    )
    return {f"{name}.py": text}


def numpy_tangents(programs: TangentPrograms, equations: Terms) -> dict[str, str]:
    """{file name: text} of the tangent kernels."""
    tables = Tables("_")
    kernels = [_kernel(program, tables) for program in programs.programs.values()]
    name = identifier(equations.model.name)
    text = render("numpy/tangents.py.jinja", model=equations.model, kernels=kernels, **_tables(tables), width=WIDTH)
    return {f"{name}_{programs.kind}.py": text}


def _tables(tables: Tables) -> dict[str, Any]:
    return {
        "index_tables": [(name, values) for values, name in tables.indices.items()],
        "number_tables": [(name, [repr(v) for v in values]) for values, name in tables.numbers.items()],
    }


class _NumPy:
    """How NumPy spells leaves and calls."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables

    def number(self, value: float) -> str:
        return repr(value)

    def leaf(self, op: Op, block: Block) -> str:
        if op.code == "load":
            array, index = op.input
            if array == "t":
                return "t[..., None]" if isinstance(block, Loop) else "t"
            return f"{array}[..., {index}]" if not isinstance(block, Loop) else f"{array}[..., {index}, None]"
        slot = block.slots[op.slot]
        if slot.array == "const":
            return self.tables.number(slot.table)
        return f"{slot.array}[..., {_subscript(self.tables.place(slot.table), block.count)}]"

    def call(self, name: str, arguments: list[str]) -> str:
        return f"np.{FUNCTIONS[name].numpy}({', '.join(arguments)})"


def _subscript(place: Place, count: int) -> str:
    if place.table:
        return place.table if not place.offset else f"{place.table} + {place.offset}".replace("+ -", "- ")
    if place.step == 0 or count == 1:
        return f"{place.offset}, None"
    stop = place.offset + place.step * count
    if place.step > 0:
        return f"{place.offset}:{stop}" if place.step == 1 else f"{place.offset}:{stop}:{place.step}"
    return f"{place.offset}:{stop if stop >= 0 else ''}:{place.step}"


def _kernel(program: Program, tables: Tables) -> dict[str, Any]:
    lines = _angles(program.angles, tables) if program.angles else []
    for block in program.blocks:
        lines += _block(block, tables, Names([program.output, *SHARED.values()]))
    operations = cost(program)
    return {
        "name": program.name,
        "inputs": program.inputs,
        "output": program.output,
        "size": program.size,
        "temporaries": program.temporaries,
        "lines": lines,
        "operations": operations.total,
    }


def _angles(angles: tuple[int, ...], tables: Tables) -> list[str]:
    subscript = _subscript(tables.place(angles), len(angles))
    return [f"{array} = np.{FUNCTIONS[code].numpy}(q[..., {subscript}])" for code, array in SHARED.items()]


def _block(block: Block, tables: Tables, names: Names) -> list[str]:
    written = write(block, _NumPy(tables), names)
    lines = [f"# {block.title}"] if block.title else []
    lines += [f"#   {comment}" for comment in loop_comments(block)]
    said = ""
    for store, before, value in zip(block.stores, written.before, written.values, strict=True):
        if isinstance(store, Store) and store.comment not in ("", said):
            said = store.comment
            lines.append(f"# {comment_text(said)}")
        lines += [f"{a.name} = {a.value}" for a in before]
        lines.append(_set(store, store.index, value) if isinstance(store, Store) else _store(store, value, block.count, tables))
    return lines


def _set(store: Store | TableStore, place: int | str, value: str) -> str:
    return f"{store.array}[..., {place}] {'+=' if store.accumulate else '='} {value}"


def _store(store: TableStore, value: str, count: int, tables: Tables) -> str:
    if store.accumulate and len(set(store.table)) == 1:
        # Every run adds to the same place: a sum over the runs, whatever the value's own shape is.
        return f"{store.array}[..., {store.table[0]}] += np.sum({value} + np.zeros({count}), axis=-1)"
    place = tables.place(store.table)
    if store.accumulate and len(set(store.table)) < len(store.table):
        index = _subscript(place, count)
        return f"np.add.at({store.array}, (..., {index}), {value})"
    subscript = _subscript(place, count).removesuffix(", None")
    if count == 1:
        value, subscript = f"np.asarray({value})", f"{subscript}:{int(subscript) + 1}"
    return _set(store, subscript, value)
