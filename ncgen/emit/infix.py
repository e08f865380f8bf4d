"""From operations to assignments in infix notation, the same for every language.

A value that is used once is written where it is used, as long as the line stays readable; everything
else gets a name. A `Dialect` says how a language spells leaves and calls.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from ncgen.emit.naming import Names
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Block
from ncgen.program.ir.graph import ARITHMETIC, PIECES, Op
from ncgen.program.ir.passes import uses

MAX_INLINED_CHARACTERS = 56
"""Characters of a value that may still be written inside another."""

ATOM, UNARY, PRODUCT, SUM = 4, 3, 2, 1
STRENGTH = {"add": SUM, "sub": SUM, "mul": PRODUCT, "div": PRODUCT, "neg": UNARY}


class Dialect(Protocol):
    def number(self, value: float) -> str: ...

    def leaf(self, op: Op, block: Block) -> str: ...

    def call(self, name: str, arguments: list[str]) -> str: ...

    def lookup(self, pieces: Pieces, x: str) -> str: ...


class Assignment(NamedTuple):
    """A name for the value of an operation, whose number in the block is `node`."""

    name: str
    value: str
    node: int


class WrittenExpression(NamedTuple):
    """A block in words: `values[k]` is the text of store k, to be written after `before[k]`."""

    before: list[list[Assignment]]
    values: list[str]


def write(block: Block, dialect: Dialect, names: Names) -> WrittenExpression:
    """The assignments and stored values of a block, in the order of its stores."""
    count = uses(block)
    text: dict[int, tuple[str, int]] = {}
    before: list[list[Assignment]] = []
    values: list[str] = []
    needed = _needed_by(block)
    temporaries = 0
    for store, nodes in zip(block.stores, needed, strict=True):
        lines: list[Assignment] = []
        for node in nodes:
            op = block.ops[node]
            value, strength = _value(op, block, dialect, text)
            named_leaf = op.code in ("load", "slot")
            if op.code == "const" or (not named_leaf and count[node] == 1 and len(value) <= MAX_INLINED_CHARACTERS):
                text[node] = (value, strength)
                continue
            if node not in block.names:
                temporaries += 1
            name = names(block.names.get(node, f"x{temporaries}"))
            lines.append(Assignment(name, value, node))
            text[node] = (name, ATOM)
        before.append(lines)
        values.append(text[store.node][0])
    return WrittenExpression(before, values)


def _needed_by(block: Block) -> list[list[int]]:
    """New operations needed by each store; a scheduled block has them in that order already."""
    result, start = [], 0
    for store in block.stores:
        result.append(list(range(start, max(start, store.node + 1))))
        start = max(start, store.node + 1)
    return result


def _value(op: Op, block: Block, dialect: Dialect, text: dict[int, tuple[str, int]]) -> tuple[str, int]:
    if op.code == "const":
        number = dialect.number(op.value)
        return number, UNARY if number.startswith("-") else ATOM
    if op.code in ("load", "slot"):
        return dialect.leaf(op, block), ATOM
    if op.code == PIECES:
        return dialect.lookup(op.pieces, text[op.args[0]][0]), ATOM
    if op.code not in ARITHMETIC:
        return dialect.call(op.code, [text[a][0] for a in op.args]), ATOM
    strength = STRENGTH[op.code]
    if op.code == "neg":
        return f"-{_inside(text[op.args[0]], PRODUCT + 1)}", UNARY
    left, right = op.args
    # The right side of - and / needs parentheses at equal strength; so does it of + and *, to keep the order of rounding.
    return f"{_inside(text[left], strength)} {ARITHMETIC[op.code]} {_inside(text[right], strength + 1)}", strength


def _inside(piece: tuple[str, int], least: int) -> str:
    value, strength = piece
    return value if strength >= least else f"({value})"
