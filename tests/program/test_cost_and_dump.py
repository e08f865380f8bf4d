"""What a program costs, counted by hand; and its text, which says everything and nothing but the program."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from program_text import dump

from ncgen.model.pieces import Pieces
from ncgen.program.assemble import assemble
from ncgen.program.ir.blocks import Column, Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.cost import cost
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.symbolic.equations import build_equations

# out[0] = sin(q0)*q1 + q1, and three times out[place] += number * q[place]
LINE = Straight(
    (Op("load", (), ArrayElement("q", 0)), Op("load", (), ArrayElement("q", 1)), Op("sin", (0,)), Op("mul", (2, 1)), Op("add", (1, 3))),
    (Store(array="out", index=0, node=4, comment="sin and more"),),
    {0: "angle"},
    "a line",
)
LOOP = Loop(
    count=3,
    ops=(Op("slot", (), 0), Op("slot", (), 1), Op("mul", (0, 1))),
    slots=(Column((0.5, 0.25, 2.0)), Slot("q", (1, 0, 1))),
    stores=(TableStore("out", (0, 0, 0), 2, True),),
    title="a loop",
)
PROGRAM = Program(name="small", inputs=("t", "q"), output="out", size=1, blocks=(LINE, LOOP), temporaries={"d": 2})


def test_operations_are_counted_by_kind():
    """Straight code counts once, a loop once a run, an accumulating store as an addition."""
    counted = cost(PROGRAM)
    assert counted.operations == {"add": 1 + 3, "mul": 1 + 3, "sin": 1}
    assert counted.total == 9
    assert counted.calls == 1


def test_bytes_are_counted_by_mention():
    """8 bytes a number that is read or written, 4 an entry of an index table; numbers added to are read, too."""
    counted = cost(PROGRAM)
    assert counted.read == 8 * 2 + 8 * 3 * (2 + 1) + 4 * (3 + 3)
    assert counted.written == 8 * 1 + 8 * 3


def test_statements_are_counted_as_written():
    """A loop stands in the source once, however often it runs."""
    assert cost(PROGRAM).statements == (3 + 1) + (1 + 1)


def test_a_table_that_serves_twice_is_read_once():
    """A store through the table that a slot reads through costs no further table."""
    shared = replace(LOOP, slots=(LOOP.slots[0], Slot("q", (0, 0, 0))))
    assert cost(PROGRAM).read - cost(replace(PROGRAM, blocks=(LINE, shared))).read == 4 * 3


def test_text_in_full():
    """The whole text of the small program."""
    assert dump(PROGRAM) == (
        "program small(t, q) -> out[1]\n"
        "  temporary d[2]\n"
        "  straight  # a line\n"
        "    %0 = load q[0]  # angle\n"
        "    %1 = load q[1]\n"
        "    %2 = sin %0\n"
        "    %3 = mul %2 %1\n"
        "    %4 = add %1 %3\n"
        "    out[0] = %4  # sin and more\n"
        "  loop 3  # a loop\n"
        "    slot 0 = const[0.5, 0.25, 2.0]\n"
        "    slot 1 = q[1, 0, 1]\n"
        "    %0 = slot 0\n"
        "    %1 = slot 1\n"
        "    %2 = mul %0 %1\n"
        "    out[0, 0, 0] += %2\n"
    )


def test_a_lookup_in_text():
    """Its degree, its knots, and what is looked up."""
    steps = Pieces((0.0, 1.0), ((0.0, 1.0, 2.0, 3.0),) * 3)
    line = Straight((*LINE.ops, Op("pieces", (4,), steps)), (Store(array="out", index=0, node=5),))
    assert "    %5 = pieces 2 2 %4\n" in dump(replace(PROGRAM, blocks=(line,)))


@pytest.mark.parametrize("emission", ["unrolled", "tabled", "auto"])
def test_text_is_the_same_for_the_same_model(robot_tables, assembled, emission):
    """Two models built apart give the same text, program by program."""
    again = assemble(build_equations(robot_tables.build()), emission)
    assert {n: dump(p) for n, p in again.programs.items()} == {n: dump(p) for n, p in assembled[emission].programs.items()}


def test_text_mentions_every_operation(assembled):
    """One line per operation with its code, one per slot and store, for all programs of the robot."""
    for program in assembled["auto"].programs.values():
        said = re.findall(r"^    %\d+ = (\w+)", dump(program), re.MULTILINE)
        assert said == [op.code for block in program.blocks for op in block.ops]
        lines = sum(1 + len(b.ops) + len(b.stores) + len(getattr(b, "slots", ())) for b in program.blocks)
        assert dump(program).count("\n") == 1 + len(program.temporaries) + bool(program.angles) + lines


def test_text_tells_programs_apart():
    """One bit in a constant, a place or a sign of a store changes the text."""
    base = dump(PROGRAM)
    variants = [
        replace(LOOP, slots=(Column((0.5, 0.25, 2.0000000000000004)), LOOP.slots[1])),
        replace(LOOP, slots=(LOOP.slots[0], Slot("q", (1, 0, 0)))),
        replace(LOOP, stores=(replace(LOOP.stores[0], accumulate=False),)),
        replace(LOOP, ops=(*LOOP.ops[:2], Op("mul", (1, 1)))),
        replace(LOOP, ops=(Op("const", (), 0.1), Op("slot", (), 1), Op("mul", (0, 1)))),
        replace(LOOP, ops=(Op("const", (), 0.10000000000000002), Op("slot", (), 1), Op("mul", (0, 1)))),
    ]
    assert len({base, *(dump(replace(PROGRAM, blocks=(LINE, loop))) for loop in variants)}) == 1 + len(variants)
