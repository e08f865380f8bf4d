"""Sine and cosine of one angle as instructions: the assignments of `ncgen_sincos` are read from ncgen_math.h, so that a module and
compiled C agree to the last bit."""

from __future__ import annotations

import ast
import re

from ncgen.emit.runtime_files import runtime_text
from ncgen.emit.wasm.binary import F64, I32, Signature, WasmFunction, double, unsigned
from ncgen.emit.wasm.code import CALL, ELSE, END, F64_CONST, F64_STORE, GET, IF, LESS, OWN, SET, SINCOS

X, SINE, COSINE = range(3)
"""The function's arguments: an angle, and the addresses of its sine and cosine."""

SUMS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
"""All that C computes there: the same words as in Python."""


def sincos(sine: int, cosine: int) -> WasmFunction:
    """f(x, address of the sine, address of the cosine); `sine` and `cosine` are the numbers of the functions for large angles."""
    far, assignments = _in_c()
    local = {"x": X}
    near = b""
    for name, expression in assignments:
        value = _instructions(ast.parse(expression, mode="eval").body, local)
        local.setdefault(name, COSINE + len(local))
        near += value + SET + unsigned(local[name])
    results = ((SINE, "sine", sine), (COSINE, "cosine", cosine))
    near += b"".join(_stored(place, GET + unsigned(local[name])) for place, name, _ in results)
    beyond = b"".join(_stored(place, GET + unsigned(X) + CALL + unsigned(number)) for place, _, number in results)
    is_near = GET + unsigned(X) + OWN["abs"] + F64_CONST + double(far) + LESS
    return WasmFunction(SINCOS, Signature((F64, I32, I32), ()), is_near + IF + near + ELSE + beyond + END, 0, len(local) - 1)


def _in_c() -> tuple[float, list[tuple[str, str]]]:
    """(the angle from which on the library's functions are taken, the assignments of the function for doubles), from the header."""
    text = runtime_text("ncgen_math.h")
    limit, body = text.split("#define NCGEN_FAR ")[1].split("\n", 1)
    body = re.sub(r"/\*.*?\*/|\[i\]", "", body.split("NCGEN_SINCOS_FAR(")[0], flags=re.DOTALL)
    assignments = re.findall(r"(?:const ncgen_(?:real|scalar) |^ +|, )(\w+) =\s+([^;,]+)(?=[;,])", body, re.MULTILINE)
    return float(limit), [(name, " ".join(expression.split())) for name, expression in assignments]


def _instructions(node: ast.expr, local: dict[str, int]) -> bytes:
    """An expression of names, numbers, sums and products, in the order in which C computes it."""
    match node:
        case ast.BinOp(left, op, right):
            return _instructions(left, local) + _instructions(right, local) + OWN[SUMS[type(op)]]
        case ast.UnaryOp(ast.USub(), ast.Constant(number)) if isinstance(number, float):
            return F64_CONST + double(-number)
        case ast.Constant(number) if isinstance(number, float):
            return F64_CONST + double(number)
        case ast.Name(name):
            return GET + unsigned(local[name])
    raise ValueError(f"ncgen_sincos: {ast.unparse(node)} is no sum or product of numbers")


def _stored(place: int, value: bytes) -> bytes:
    return GET + unsigned(place) + value + F64_STORE + unsigned(0)
