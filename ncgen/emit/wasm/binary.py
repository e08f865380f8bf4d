"""The binary format of WebAssembly 1.0: numbers, vectors and sections (https://www.w3.org/TR/wasm-core-1/, chapter 5)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

MAGIC = b"\0asm\1\0\0\0"
I32, F64 = 0x7F, 0x7C
FUNCTION = 0
"""A kind of imports and exports."""


class Signature(NamedTuple):
    """Types of a function's arguments and of its result, if it has one."""

    arguments: tuple[int, ...]
    results: tuple[int, ...]


class WasmFunction(NamedTuple):
    """A function with a body: instructions without the final end, and how many local numbers of each type it needs."""

    name: str
    signature: Signature
    body: bytes
    integers: int
    numbers: int


class Import(NamedTuple):
    """A function from outside."""

    module: str
    name: str
    signature: Signature


def unsigned(value: int) -> bytes:
    """LEB128 of a whole number ≥ 0."""
    parts = bytearray()
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])


def signed(value: int) -> bytes:
    """LEB128 of a whole number of either sign."""
    parts = bytearray()
    while not -0x40 <= value < 0x40:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value & 0x7F])


def double(value: float) -> bytes:
    """The eight bytes of a double."""
    return struct.pack("<d", value)


def vector(items: Iterable[bytes]) -> bytes:
    """Items behind their number."""
    items = list(items)
    return unsigned(len(items)) + b"".join(items)


def name(text: str) -> bytes:
    """A name in UTF-8."""
    data = text.encode("utf-8")
    return unsigned(len(data)) + data


LINK = "ncgen"
"""The module from which a linked one imports its memory, and the addresses of its data and of its arrays."""


def linked(imports: list[Import], functions: list[WasmFunction], data: bytes, custom: dict[str, bytes]) -> bytes:
    """A module with `data` at an imported address of an imported memory, and other sections, {name: contents}, that engines pass over."""
    signatures = list(dict.fromkeys([*(each.signature for each in imports), *(each.signature for each in functions)]))
    number = {signature: k for k, signature in enumerate(signatures)}
    link = [name(LINK) + name(word) + kind for word, kind in (("memory", b"\2\0\0"), ("tables", b"\3\x7f\0"), ("rooms", b"\3\x7f\0"))]
    sections = {
        1: vector(b"\x60" + vector(bytes([t]) for t in s.arguments) + vector(bytes([t]) for t in s.results) for s in signatures),
        2: vector([*(_imported(each, number) for each in imports), *link]),
        3: vector(unsigned(number[each.signature]) for each in functions),
        7: vector(name(each.name) + bytes([FUNCTION]) + unsigned(len(imports) + k) for k, each in enumerate(functions)),
        10: vector(_sized(_locals(each) + each.body + b"\x0b") for each in functions),
        11: vector([b"\0\x23\0\x0b" + unsigned(len(data)) + data] if data else []),
    }
    named = b"".join(bytes([0]) + _sized(name(word) + content) for word, content in custom.items())
    return MAGIC + b"".join(bytes([kind]) + _sized(content) for kind, content in sections.items()) + named


def _imported(each: Import, number: dict[Signature, int]) -> bytes:
    return name(each.module) + name(each.name) + bytes([FUNCTION]) + unsigned(number[each.signature])


def _sized(content: bytes) -> bytes:
    return unsigned(len(content)) + content


def _locals(function: WasmFunction) -> bytes:
    groups = [(function.integers, I32), (function.numbers, F64)]
    return vector(unsigned(count) + bytes([kind]) for count, kind in groups if count)
