"""Operations, loops and stores as instructions (WebAssembly 1.0, chapter 5.4)."""

from __future__ import annotations

from ncgen.emit.wasm.binary import F64, I32, Signature, WasmFunction, double, signed, unsigned
from ncgen.emit.wasm.memory import ROOMS, TABLES, Memory
from ncgen.model.pieces import Pieces
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Loop, Program, Slot, Store, TableStore
from ncgen.program.ir.graph import PIECES, Op

GET, SET, CALL, LOOP, END, BRANCH_IF = b"\x20", b"\x21", b"\x10", b"\x03\x40", b"\x0b", b"\x0d\x00"
I32_CONST, I32_ADD, I32_SUB, I32_MUL, I32_LESS, I32_LOAD = b"\x41", b"\x6a", b"\x6b", b"\x6c", b"\x49", b"\x28\x02"
F64_CONST, F64_LOAD, F64_STORE, F64_ADD = b"\x44", b"\x2b\x03", b"\x39\x03", b"\xa0"
GREATER, LESS, TO_NUMBER = b"\x64", b"\x63", b"\xb7"

INSTRUCTIONS = {"add": F64_ADD, "sub": b"\xa1", "mul": b"\xa2", "div": b"\xa3", "neg": b"\x9a", "abs": b"\x99", "sqrt": b"\x9f"}
"""Operations that are instructions."""

SINCOS = "sincos"


def function(program: Program, prefix: str, memory: Memory, callable_: dict[str, int]) -> WasmFunction:
    """A kernel, which returns NCGEN_OK.

    callable_: {function: its number in the module}, of imported ones by their names here, such as "tan".
    """
    arguments = tuple(F64 if name == "t" else I32 for name in program.inputs) + (I32,)
    body = _Body(program, memory, callable_)
    blocks = [_angles(program.angles)] if program.angles else []
    code = b"".join(body.block(block) for block in (*blocks, *program.blocks))
    return WasmFunction(f"{prefix}_{program.name}", Signature(arguments, (I32,)), code + I32_CONST + signed(0), body.integers, body.numbers)


def called(program: Program) -> set[str]:
    """Functions that a program calls, the sines and cosines of its angles apart."""
    codes = {op.code for block in program.blocks for op in block.ops} - INSTRUCTIONS.keys() - {"const", "load", "slot", "sign"}
    return codes | ({SINCOS} if program.angles else set())


def _angles(angles: tuple[int, ...]) -> Loop:
    """The loop that fills the shared arrays: a pseudo-operation that writes both."""
    indices = tuple(range(len(angles)))
    sine, cosine = (TableStore(array, indices, 1) for array in SHARED.values())
    return Loop(count=len(angles), ops=(Op("slot", (), 0), Op(SINCOS, (0,))), slots=(Slot("q", angles),), stores=(sine, cosine))


class _Body:
    """The instructions of one kernel under way: which local number holds what."""

    def __init__(self, program: Program, memory: Memory, callable_: dict[str, int]) -> None:
        self.memory, self.callable = memory, callable_
        names = (*program.inputs, program.output)
        self.arguments = {name: k for k, name in enumerate(names)}
        self.integers = 1 if program.angles or any(isinstance(block, Loop) for block in program.blocks) else 0
        self.run = len(names)
        """The local that counts the runs of a loop."""
        self.numbers = 0

    def block(self, block: Block) -> bytes:
        """A block, which leaves nothing behind in locals."""
        if not isinstance(block, Loop):
            return self._once(block)
        run = unsigned(self.run)
        begin = I32_CONST + signed(0) + SET + run + LOOP
        step = GET + run + I32_CONST + signed(1) + I32_ADD + SET + run
        again = GET + run + I32_CONST + signed(block.count) + I32_LESS + BRANCH_IF + END
        return begin + self._once(block) + step + again

    def _once(self, block: Block) -> bytes:
        """Operations in their order, each followed by the stores that waited for it; locals are used again after a value's last use."""
        ending = _ending(block)
        held: dict[int, int] = {}
        free: list[int] = []
        used = 0
        code = []
        waiting = list(block.stores)
        for node, op in enumerate(block.ops):
            if op.code == SINCOS:
                code.append(self._sincos(held[op.args[0]], block))
                break
            if op.code != "const":
                if not free:
                    free.append(self.run + self.integers + used)
                    used += 1
                code += [self._value(op, block, held), SET, unsigned(free[-1])]
                held[node] = free.pop()
            while waiting and waiting[0].node <= node:
                code.append(self._store(waiting.pop(0), block, held))
            free += [held.pop(ended) for ended in ending[node] if ended in held]
        self.numbers = max(self.numbers, used)
        return b"".join(code)

    def _value(self, op: Op, block: Block, held: dict[int, int]) -> bytes:
        if op.code == "load":
            array, index = op.input
            return (
                GET + unsigned(self.arguments["t"])
                if array == "t"
                else self._address(array) + F64_LOAD + unsigned(self._offset(array, index))
            )
        if op.code == "slot":
            slot = block.slots[op.slot]
            if slot.array == "const":
                return self._run_in_table(8) + F64_LOAD + unsigned(self.memory.numbers(slot.table))
            return self._element(slot.array, slot.table) + F64_LOAD + unsigned(0)
        arguments = [self._number(a, block, held) for a in op.args]
        if op.code == PIECES:
            return arguments[0] + self._table(op.pieces) + CALL + unsigned(self.callable[PIECES])
        if op.code == "sign":
            zero = F64_CONST + double(0.0)
            return arguments[0] + zero + GREATER + arguments[0] + zero + LESS + I32_SUB + TO_NUMBER
        return b"".join(arguments) + (INSTRUCTIONS[op.code] if op.code in INSTRUCTIONS else CALL + unsigned(self.callable[op.code]))

    def _table(self, pieces: Pieces) -> bytes:
        """What a lookup is given behind its argument."""
        addresses = map(self.memory.numbers, (pieces.knots, pieces.numbers))
        tables = [TABLES + I32_CONST + signed(address) + I32_ADD for address in addresses]
        sizes = [I32_CONST + signed(number) for number in (len(pieces.knots), pieces.degree)]
        return b"".join([*tables, *sizes]) + F64_CONST + double(pieces.period)

    def _number(self, node: int, block: Block, held: dict[int, int]) -> bytes:
        op = block.ops[node]
        return F64_CONST + double(op.value) if op.code == "const" else GET + unsigned(held[node])

    def _store(self, store: Store | TableStore, block: Block, held: dict[int, int]) -> bytes:
        value = self._number(store.node, block, held)
        if isinstance(store, TableStore):
            address, offset = self._element(store.array, store.table), 0
        else:
            address, offset = self._address(store.array), self._offset(store.array, store.index)
        if store.accumulate:
            value = address + F64_LOAD + unsigned(offset) + value + F64_ADD
        return address + value + F64_STORE + unsigned(offset)

    def _sincos(self, angle: int, block: Block) -> bytes:
        sine, cosine = (self._element(store.array, store.table) for store in block.stores)
        return GET + unsigned(angle) + sine + cosine + CALL + unsigned(self.callable[SINCOS])

    def _address(self, array: str) -> bytes:
        """The beginning of an array: an argument, or 0 where the place is known."""
        return GET + unsigned(self.arguments[array]) if array in self.arguments else ROOMS

    def _offset(self, array: str, index: int) -> int:
        return 8 * index + (0 if array in self.arguments else self.memory.places[array])

    def _element(self, array: str, table: tuple[int, ...]) -> bytes:
        """The address of an array's element in this run of a loop."""
        steps = {b - a for a, b in zip(table, table[1:], strict=False)}
        first = self._offset(array, table[0] if len(steps) <= 1 else 0)
        base = self._address(array) + I32_CONST + signed(first) + I32_ADD
        if len(steps) > 1:
            return base + self._run_in_table(4) + I32_LOAD + unsigned(self.memory.distances(table)) + I32_ADD
        return base + self._run_times(8 * steps.pop()) + I32_ADD if steps else base

    def _run_in_table(self, step: int) -> bytes:
        """Where a table has what belongs to this run of a loop, from the table's place on."""
        return TABLES + self._run_times(step) + I32_ADD

    def _run_times(self, step: int) -> bytes:
        return GET + unsigned(self.run) + I32_CONST + signed(step) + I32_MUL


def _ending(block: Block) -> list[list[int]]:
    """For every operation, those whose values nobody needs after it; a store waits for its value and for all stores before it."""
    last = list(range(len(block.ops)))
    for node, op in enumerate(block.ops):
        for argument in op.args:
            last[argument] = node
    reached = 0
    for store in block.stores:
        reached = max(reached, store.node)
        last[store.node] = max(last[store.node], reached)
    ending: list[list[int]] = [[] for _ in block.ops]
    for node, end in enumerate(last):
        ending[end].append(node)
    return ending
