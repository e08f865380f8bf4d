"""A piecewise polynomial as a function of a module: the search and the polynomial of `ncgen_pieces` in ncgen_math.h, instruction by
instruction, so that a module and compiled C agree to the last bit."""

from __future__ import annotations

from ncgen.emit.wasm.binary import F64, I32, Signature, WasmFunction, double, signed, unsigned
from ncgen.emit.wasm.code import (
    ELSE,
    END,
    F64_ADD,
    F64_CONST,
    F64_LOAD,
    GET,
    GREATER,
    I32_ADD,
    I32_CONST,
    I32_MUL,
    I32_SUB,
    IF,
    LOOP,
    OWN,
    SET,
)
from ncgen.program.ir.graph import PIECES

BLOCK, BRANCH, BRANCH_OUT_IF = b"\x02\x40", b"\x0c\x00", b"\x0d\x01"
F64_LESS_EQUAL, F64_FLOOR, I32_ZERO, I32_NOT_LESS, I32_HALF = b"\x65", b"\x9c", b"\x45", b"\x4e", b"\x41\x01\x76"

X, KNOTS, ROWS, COUNT, DEGREE, PERIOD, LOW, MIDDLE, Y = (unsigned(k) for k in range(9))
"""The function's arguments, of which count ends where the search does, and its own locals."""


def lookup() -> WasmFunction:
    """f(x, address of the knots, address of the rows, how many knots, degree, period) -> the value."""
    arguments = (F64, I32, I32, I32, I32, F64)
    return WasmFunction(f"ncgen_{PIECES}", Signature(arguments, (F64,)), _reduced() + _searched() + _summed(), 2, 1)


def _reduced() -> bytes:
    """x −= period · ⌊(x − first knot)/period⌋ where there is a period."""
    turns = GET + X + _number(GET + KNOTS) + OWN["sub"] + GET + PERIOD + OWN["div"] + F64_FLOOR
    less = GET + X + GET + PERIOD + turns + OWN["mul"] + OWN["sub"] + SET + X
    return GET + PERIOD + F64_CONST + double(0.0) + GREATER + IF + less + END


def _searched() -> bytes:
    """low: how many knots are not beyond x."""
    halved = GET + LOW + GET + COUNT + I32_ADD + I32_HALF + SET + MIDDLE
    is_before = _number(_at(KNOTS, GET + MIDDLE)) + GET + X + F64_LESS_EQUAL
    above = GET + MIDDLE + I32_CONST + signed(1) + I32_ADD + SET + LOW
    below = GET + MIDDLE + SET + COUNT
    return _until(GET + LOW + GET + COUNT + I32_NOT_LESS, halved + is_before + IF + above + ELSE + below + END)


def _summed() -> bytes:
    """The polynomial of the row that was found, from its highest power."""
    row = _at(ROWS, GET + LOW + GET + DEGREE + I32_CONST + signed(2) + I32_ADD + I32_MUL) + SET + ROWS
    begin = _number(_at(ROWS, GET + DEGREE), 1) + SET + Y + GET + X + _number(GET + ROWS) + OWN["sub"] + SET + X
    one = GET + Y + GET + X + OWN["mul"] + _number(_at(ROWS, GET + DEGREE)) + F64_ADD + SET + Y
    down = GET + DEGREE + I32_CONST + signed(1) + I32_SUB + SET + DEGREE
    return row + begin + _until(GET + DEGREE + I32_ZERO, one + down) + GET + Y


def _until(end: bytes, body: bytes) -> bytes:
    """The body again and again, until the condition holds."""
    return BLOCK + LOOP + end + BRANCH_OUT_IF + body + BRANCH + END + END


def _at(table: bytes, index: bytes) -> bytes:
    """The address of a number of a table."""
    return GET + table + index + I32_CONST + signed(8) + I32_MUL + I32_ADD


def _number(address: bytes, beyond: int = 0) -> bytes:
    return address + F64_LOAD + unsigned(8 * beyond)
