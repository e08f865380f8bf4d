"""Bytes of WebAssembly 1.0 beside its specification, written by hand, and where things lie in memory; no program runs them."""

from __future__ import annotations

import pytest

from ncgen.emit.wasm import binary
from ncgen.emit.wasm.binary import F64, I32, Import, Signature, WasmFunction
from ncgen.emit.wasm.code import function
from ncgen.emit.wasm.memory import Memory
from ncgen.program.ir.blocks import Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.graph import ArrayElement, Op

MODULE = """
    00 61 73 6d 01 00 00 00
    01 0b  02  60 01 7c 01 7c  60 02 7c 7f 00
    02 3b  04  04 4d 61 74 68 03 74 61 6e 00 00
       05 6e 63 67 65 6e 06 6d 65 6d 6f 72 79 02 00 00
       05 6e 63 67 65 6e 06 74 61 62 6c 65 73 03 7f 00
       05 6e 63 67 65 6e 05 72 6f 6f 6d 73 03 7f 00
    03 03  02  01 00
    07 09  02  01 66 00 01  01 67 00 02
    0a 0e  02  07 02 01 7f 02 7c 01 0b  04 00 20 00 0b
    0b 09  01  00 23 00 0b 03 07 08 09
    00 05  02 6d 65  01 02
"""
"""Of Math.tan and two functions: magic and version, then types, imports, functions, exports, code, data and a section for others."""


@pytest.mark.parametrize(
    ("number", "bytes_"),
    [(0, "00"), (127, "7f"), (128, "80 01"), (16383, "ff 7f"), (16384, "80 80 01"), (624485, "e5 8e 26")],
)
def test_whole_numbers(number, bytes_):
    """LEB128, with the example of its inventors."""
    assert binary.unsigned(number) == bytes.fromhex(bytes_)


@pytest.mark.parametrize(
    ("number", "bytes_"),
    [(0, "00"), (63, "3f"), (64, "c0 00"), (-1, "7f"), (-64, "40"), (-65, "bf 7f"), (8191, "ff 3f"), (8192, "80 c0 00"),
     (-8192, "80 40"), (-8193, "ff bf 7f"), (-123456, "c0 bb 78")],
)  # fmt: skip
def test_whole_numbers_of_either_sign(number, bytes_):
    assert binary.signed(number) == bytes.fromhex(bytes_)


def test_a_module():
    tangent = Signature((F64,), (F64,))
    functions = [WasmFunction("f", Signature((F64, I32), ()), b"\x01", 1, 2), WasmFunction("g", tangent, b"\x20\x00", 0, 0)]
    whole = bytes.fromhex(MODULE)
    assert binary.linked([Import("Math", "tan", tangent)], functions, b"\7\10\11", {"me": b"\1\2"}) == whole
    assert binary.linked([Import("Math", "tan", tangent)], functions, b"", {}) == whole[:-18] + b"\x0b\1\0"


def test_where_arrays_and_tables_lie():
    """Arrays one after the other; tables, each once and at a multiple of eight bytes."""
    memory = Memory({"w": 3, "sine": 2})
    assert memory.places == {"w": 0, "sine": 24} and memory.size == 40
    assert [memory.distances((0, 5, 2)), memory.numbers((1.5,)), memory.distances((0, 5, 2))] == [0, 16, 0]
    assert memory.data == bytes.fromhex("00000000 28000000 10000000 00000000 000000000000f83f")
    assert (memory.integers((7,)), len(memory.data)) == (24, 28)


def made(program: Program, **rooms: int) -> WasmFunction:
    return function(program, "m", Memory(rooms), {})


def test_locals_are_used_again():
    """A value's place is free behind its last use: of a chain two are held at a time, of a sum that waits for both ends three."""
    chain = (Op("load", (), ArrayElement("q", 0)), *(Op("neg", (k,)) for k in range(5)))
    assert (
        made(
            Program(name="chain", inputs=("q",), output="out", size=1, blocks=(Straight(chain, (Store(array="out", index=0, node=5),)),))
        ).numbers
        == 2
    )
    sums = (*chain, Op("add", (0, 5)))
    done = made(Program(name="sums", inputs=("q",), output="out", size=1, blocks=(Straight(sums, (Store(array="out", index=0, node=6),)),)))
    assert (done.integers, done.numbers) == (0, 3)
    kept = made(
        Program(
            name="kept",
            inputs=("q",),
            output="out",
            size=2,
            blocks=(Straight(chain, (Store(array="out", index=0, node=5), Store(array="out", index=1, node=1))),),
        )
    )
    assert kept.numbers == 3  # the second store waits for the first


def test_instructions():
    """out[1] += q[2] · q[2], and a loop of q[2 i] into w[i + 1]: loads, a product, a sum, stores, and what counts runs."""
    square = (Op("load", (), ArrayElement("q", 2)), Op("mul", (0, 0)))
    line = made(
        Program(
            name="line",
            inputs=("q",),
            output="out",
            size=2,
            blocks=(Straight(square, (Store(array="out", index=1, node=1, accumulate=True),)),),
        )
    )
    load, product = "20 00 2b 03 10 21 02", "20 02 20 02 a2 21 03"
    assert line.body == bytes.fromhex(f"{load} {product} 20 01 20 01 2b 03 08 20 03 a0 39 03 08 41 00")
    assert (line.name, line.signature) == ("m_line", Signature((I32, I32), (I32,)))
    loop = Loop(count=3, ops=(Op("slot", (), 0),), slots=(Slot("q", (0, 2, 4)),), stores=(TableStore("w", (1, 2, 3), 0),))
    done = made(Program(name="loop", inputs=("t", "q"), output="out", size=2, blocks=(loop,)), w=4)
    run = "20 03 41"
    load = f"20 01 41 00 6a {run} 10 6c 6a 2b 03 00 21 04"
    store = f"23 01 41 08 6a {run} 08 6c 6a 20 04 39 03 00"
    assert done.body == bytes.fromhex(f"41 00 21 03 03 40 {load} {store} {run} 01 6a 21 03 {run} 03 49 0d 00 0b 41 00")
    assert (done.signature.arguments, done.integers, done.numbers) == ((F64, I32, I32), 1, 1)
