"""How C spells kernels."""

from __future__ import annotations

from ncgen.emit.infix import Assignment
from ncgen.emit.loop_tables import Tables
from ncgen.emit.number_table import NumberTable
from ncgen.emit.spelling import Record, Spelling
from ncgen.model.traced_numbers import Traced
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Loop, Program, Slot, Store, TableStore
from ncgen.program.ir.cost import cost
from ncgen.program.ir.cut import CUT_ARRAY, cut


class C(Spelling):
    reserved = ("angle",)

    def __init__(self, prefix: str, kind: str = "", numbers: NumberTable | None = None) -> None:
        """prefix: the model's; kind: a word for the names of tables, where a model has several files; numbers: where the model's are read
        from, None where they stand in the code."""
        super().__init__(Tables(f"{prefix}_{kind}_" if kind else f"{prefix}_"), prefix)
        self.numbers = numbers

    def number(self, value: float) -> str:
        return self.numbers.element(value) if self.numbers is not None and isinstance(value, Traced) else number(value)

    def table(self, values: tuple[float, ...]) -> str:
        if self.numbers is None or not any(isinstance(value, Traced) for value in values):
            return super().table(values)
        return self.numbers.column(values)

    def element(self, array: str, index: int, block: Block) -> str:
        return "t" if array == "t" else f"{array}[{index}]"

    def slot(self, slot: Slot, block: Block) -> str:
        return f"{slot.array}[{self.tables.place(slot.table).infix}]"

    def column(self, table: str) -> str:
        return f"{table}[i]"

    def call(self, name: str, arguments: list[str]) -> str:
        return f"NCGEN_{name.upper()}({', '.join(arguments)})"

    def comment(self, text: str) -> str:
        return f"/* {text} */"

    def assignment(self, new: Assignment, block: Block) -> str:
        op = block.ops[new.node]
        is_number = op.code == "slot" and not isinstance(block.slots[op.slot], Slot)
        return f"const ncgen_real {new.name} = {_splat(new.value) if is_number else new.value};"

    def store(self, store: Store | TableStore, value: str, block: Block) -> str:
        index = store.index if isinstance(store, Store) else self.tables.place(store.table).infix
        value = _splat(value) if block.ops[store.node].code == "const" else value
        return f"{store.array}[{index}] {'+=' if store.accumulate else '='} {value};"

    def kernel(self, program: Program) -> Record:
        program = cut(program)
        record = super().kernel(program)
        for number, block in enumerate(program.blocks):
            is_apart = CUT_ARRAY in program.temporaries and not isinstance(block, Loop)
            record["blocks"][number]["part"] = self._part(program, number) if is_apart else None
        return record | {
            "function": f"{self.prefix}_{program.name}",
            "phases": self._phases(program),
            "angles": self._angles(program.angles),
            "unused": [a for a in program.inputs if a not in _read(program)],
        }

    def _phases(self, program: Program) -> Record | None:
        """Where the phases of a program end, and how many operations those of which others consist have; None where it has none."""
        if program.phases is None:
            return None
        return {
            "ends": program.phases.ends,
            "operations": {
                name: cost(each).total for name, each in (("velocities", program.beginning), ("derivative", program.uncorrected))
            },
        }

    def _part(self, program: Program, number: int) -> Record:
        """A block as a function: its name, and what is given to it as pairs (declaration, name)."""
        block = program.blocks[number]
        loads = {op.input.array for op in block.ops if op.code == "load"}
        stores = {store.array for store in block.stores}
        arguments = [name for name in (*program.inputs, *SHARED.values(), *program.temporaries, program.output) if name in loads | stores]
        declared = [
            "ncgen_real t" if name == "t" else f"{'' if name in stores else 'const '}ncgen_real *NCGEN_RESTRICT {name}"
            for name in arguments
        ]
        return {"function": f"{self.prefix}_{program.name}_{number + 1}", "declared": declared, "given": arguments}

    def _angles(self, angles: tuple[int, ...]) -> Record:
        """Where the angles of a program lie: one after the other in q, or anywhere."""
        if not angles:
            return {"count": 0}
        position = self.tables.place(angles)
        together = position.table is None and (position.step == 1 or len(angles) == 1)
        return {"count": len(angles), "first": position.offset if together else None, "place": position.infix}


def number(value: float) -> str:
    """The shortest text that reads back to the same double."""
    value = float(value)
    return f"R({value!r})" if value >= 0 else f"-R({-value!r})"


def _splat(value: str) -> str:
    """A constant as a number of the kernels' type, which may be a vector."""
    return f"NCGEN_SPLAT({value})"


def _read(program: Program) -> set[str]:
    """The arrays a program reads."""
    loads = {op.input.array for block in program.blocks for op in block.ops if op.code == "load"}
    slots = {slot.array for block in program.blocks for slot in block.slots}
    return loads | slots | ({"q"} if program.angles else set())
