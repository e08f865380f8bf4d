"""verify() accepts sound programs and names the rule that a broken one breaks."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from ncgen.program.ir.blocks import Column, Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.program.ir.verify import ProgramError, verify

SIZES = {"t": 1, "q": 3}
LINE = Straight((Op("load", (), ArrayElement("q", 2)), Op("sin", (0,)), Op("add", (0, 1))), (Store(array="out", index=0, node=2),))
LOOP = Loop(
    count=2,
    ops=(Op("slot", (), 0), Op("slot", (), 1), Op("mul", (0, 1))),
    slots=(Slot("q", (0, 2)), Column((0.5, 0.25))),
    stores=(TableStore("out", (1, 2), 2),),
)
SOUND = Program(name="sound", inputs=("t", "q"), output="out", size=3, blocks=(LINE, LOOP))

FIRST = Store(array="out", index=0, node=0)


def line(*ops: Op, store: Store = FIRST) -> Program:
    """The sound program with another straight block."""
    return replace(SOUND, blocks=(Straight(ops, (store,)), LOOP))


def loop(**changes) -> Program:
    """The sound program with another loop."""
    return replace(SOUND, blocks=(LINE, replace(LOOP, **changes)))


BROKEN = {
    "an argument that comes later": (line(Op("neg", (1,)), Op("const", (), 1.0)), "not yet defined"),
    "an operation of itself": (line(Op("neg", (0,))), "not yet defined"),
    "a negative argument": (line(Op("const", (), 1.0), Op("neg", (-1,))), "not yet defined"),
    "an infinite constant": (line(Op("const", (), math.inf)), "constant inf"),
    "a constant that is no number": (line(Op("const", (), math.nan)), "constant nan"),
    "a load beyond the input": (line(Op("load", (), ArrayElement("q", 3))), r"q\[3\], which does not exist"),
    "a load before the input": (line(Op("load", (), ArrayElement("q", -1))), r"q\[-1\], which does not exist"),
    "a load from nowhere": (line(Op("load", (), ArrayElement("z", 0))), r"z\[0\], which does not exist"),
    "a slot outside a loop": (line(Op("slot", (), 0)), "unknown slot 0"),
    "a slot that the loop lacks": (loop(ops=(Op("slot", (), 2),), stores=(TableStore("out", (1, 2), 0),)), "unknown slot 2"),
    "too few arguments": (
        line(Op("load", (), ArrayElement("q", 0)), Op("add", (0,)), store=Store(array="out", index=0, node=1)),
        "add of 1 arguments",
    ),
    "too many arguments": (
        line(Op("load", (), ArrayElement("q", 0)), Op("sin", (0, 0)), store=Store(array="out", index=0, node=1)),
        "sin of 2 arguments",
    ),
    "a short table of places": (loop(slots=(Slot("q", (0,)), LOOP.slots[1])), "a table of 1 entries for 2 runs"),
    "a long table of numbers": (loop(slots=(LOOP.slots[0], Slot("const", (1.0,) * 3))), "a table of 3 entries for 2 runs"),
    "a table with a number that is none": (loop(slots=(LOOP.slots[0], Column((1.0, math.nan)))), "not finite"),
    "a table that leaves the input": (loop(slots=(Slot("q", (0, 3)), LOOP.slots[1])), "reads beyond q"),
    "a table with a negative place": (loop(slots=(Slot("q", (-1, 0)), LOOP.slots[1])), "reads beyond q"),
    "a short store": (loop(stores=(TableStore("out", (1,), 2),)), "store's table has 1 entries for 2 runs"),
    "a store beyond the output": (loop(stores=(TableStore("out", (1, 3), 2),)), "a store leaves out"),
    "a store before the output": (line(Op("const", (), 1.0), store=Store(array="out", index=-1, node=0)), "a store leaves out"),
    "a store of nothing": (line(Op("const", (), 1.0), store=Store(array="out", index=0, node=1)), "store of an unknown operation"),
    "an addition to nothing": (line(Op("const", (), 1.0), store=Store(array="out", index=0, node=0, accumulate=True)), "never set"),
    "an addition to partly nothing": (loop(stores=(TableStore("out", (0, 1), 2, True),)), "never set"),
    "two runs for one place": (loop(stores=(TableStore("out", (1, 1), 2),)), "overwrites"),
    "an output that is never written": (replace(SOUND, blocks=(LINE,)), "never written"),
    "no blocks at all": (replace(SOUND, blocks=()), "never written"),
}
UNKNOWN = {
    "an operation that does not exist": line(
        Op("load", (), ArrayElement("q", 0)), Op("square", (0,)), store=Store(array="out", index=0, node=1)
    ),
    "a table into nowhere": loop(slots=(Slot("z", (0, 1)), LOOP.slots[1])),
    "a store into nowhere": loop(stores=(TableStore("z", (0, 1), 2),)),
}


def test_sound_programs_pass():
    """The program that the tests below break is sound, and so is one that adds to what it has set."""
    verify(SOUND, SIZES)
    verify(
        replace(SOUND, blocks=(*SOUND.blocks, Straight((Op("const", (), 1.0),), (Store(array="out", index=2, node=0, accumulate=True),)))),
        SIZES,
    )


@pytest.mark.parametrize("defect", BROKEN)
def test_broken_programs_are_rejected(defect):
    """Each rule is broken alone, and the message names the program and the rule."""
    program, rule = BROKEN[defect]
    with pytest.raises(ProgramError, match=f"program sound.*{rule}"):
        verify(program, SIZES)


@pytest.mark.parametrize("defect", UNKNOWN)
def test_unknown_names_are_rejected(defect):
    """Operations and arrays that do not exist are told as a broken rule, not as a missing key."""
    with pytest.raises(ProgramError, match="program sound"):
        verify(UNKNOWN[defect], SIZES)


def test_temporaries_are_arrays_too():
    """A temporary can be written and read, within its length."""
    first = Straight((Op("load", (), ArrayElement("q", 0)),), (Store(array="d", index=1, node=0),))
    second = Straight((Op("load", (), ArrayElement("d", 1)),), tuple(Store(array="out", index=k, node=0) for k in range(3)))
    program = replace(SOUND, blocks=(first, second), temporaries={"d": 2})
    verify(program, SIZES)
    with pytest.raises(ProgramError, match="leaves d"):
        verify(replace(program, temporaries={"d": 1}), SIZES)
