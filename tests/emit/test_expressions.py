"""Infix text means what the operations mean: parentheses, names and order of rounding."""

from __future__ import annotations

import math

from hypothesis import example, given
from hypothesis import strategies as st

from ncgen.emit.infix import MAX_INLINED_CHARACTERS, write
from ncgen.emit.naming import Names
from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Program, Store, Straight
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.graph import ArrayElement, Op

Q = (0.1, -1.7, 2.3, 1e-3)
FIRST = tuple(Op("load", (), ArrayElement("q", i)) for i in range(len(Q))) + (Op("const", (), 0.3), Op("const", (), -2.0))
# Operations as they are, without the graph's simplification: text must be right for every program.
steps = st.lists(
    st.tuples(st.sampled_from(["add", "sub", "mul", "div", "neg", "sin", "atan2"]), st.integers(1, 4), st.integers(1, 9)),
    min_size=1,
    max_size=25,
)


class Python:
    """Python's spelling of leaves and calls."""

    def number(self, value):
        return repr(value)

    def leaf(self, op, block):
        return f"{op.leaf[0]}[{op.leaf[1]}]"

    def call(self, name, arguments):
        return f"{name}({', '.join(arguments)})"


def block_of(listed, names=None) -> Straight:
    """Operations on recent ones, counted backwards; the last one is stored, and a third of the way to it, too."""
    ops = list(FIRST)
    for code, a, b in listed:
        unary = code in ("neg", "sin")
        ops.append(Op(code, (len(ops) - min(a, len(ops)),) + (() if unary else (len(ops) - min(b, len(ops)),))))
    stores = (Store(array="out", index=0, node=len(ops) - 1), Store(array="out", index=1, node=len(ops) // 3))
    return passes.schedule(passes.dead_code(Straight(tuple(ops), stores, names or {})))


def said(block: Straight) -> list[float]:
    """What the text of a block computes when Python reads it; a name may be given once only."""
    written = write(block, Python(), Names(["out"]))
    space = {"q": Q, "sin": math.sin, "atan2": math.atan2}
    results = []
    for before, value in zip(written.before, written.values, strict=True):
        for name, text, _ in before:
            assert name not in space
            space[name] = eval(text, {}, space)
        results.append(eval(value, {}, space))
    return results


@given(steps)
@example([("sub", 3, 4), ("sub", 5, 1)])
@example([("div", 3, 4), ("div", 5, 1)])
@example([("add", 3, 4), ("mul", 1, 5)])
@example([("add", 3, 4), ("neg", 1, 1)])
@example([("neg", 3, 1), ("neg", 1, 1), ("sub", 5, 1)])
def test_text_has_the_value_of_the_program(listed):
    """Read by Python, the text gives the program's result to the last bit: nothing is associated otherwise."""
    block = block_of(listed)
    program = Program(name="test", inputs=("q",), output="out", size=len(block.stores), blocks=(block,))
    try:
        expected = evaluate(program, {"q": Q})
    except (ZeroDivisionError, ValueError, OverflowError):
        return
    assert list(map(repr, said(block))) == list(map(repr, expected))


@given(steps)
def test_what_is_used_twice_has_a_name(listed):
    """No operation is written twice, and no text that stands inside another is longer than allowed."""
    block = block_of(listed)
    written = write(block, Python(), Names(["out"]))
    texts = [text for before in written.before for _, text, _ in before] + written.values
    inner = [op for op in block.ops if op.args]
    signs = sum(text.count(sign) for text in texts for sign in (" + ", " - ", " * ", " / ", "sin(", "atan2("))
    assert signs == sum(op.code != "neg" for op in inner)
    assert all(len(text) <= 2 * MAX_INLINED_CHARACTERS + len("atan2(, )") + 4 for text in texts)


def test_names_of_the_user_are_taken():
    """Operations with a name keep it, others are numbered; a name that is taken gets a number."""
    ops = (*FIRST[:3], Op("mul", (0, 1)), Op("add", (3, 3)), Op("add", (4, 2)))
    block = Straight(ops, (Store(array="out", index=0, node=5),), {0: "angle", 1: "angle", 2: "x1"})
    (before,) = write(block, Python(), Names(["out"])).before
    assert [a.name for a in before] == ["angle", "angle_2", "x1", "x1_2"]
