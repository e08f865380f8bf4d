"""Every operation that programs know, in WebAssembly, beside Python's own arithmetic."""

from __future__ import annotations

import json
import math
import shutil

import pytest
from wasm_in_node import in_node as run_in_node

from ncgen.model.pieces import Pieces
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Column, Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import ARITHMETIC, PIECES, ArrayElement, Op

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")

SCRIPT = """
for (const q of INPUTS) {
  view.fill(0, at, at + 64);
  view.set(q, at);
  w.m_all(8 * at, 8 * (at + 8));
  found.push(Array.from(view.slice(at + 8, at + 8 + SIZE)));
}
"""


def in_node(program: Program, inputs: list[list[float]], folder) -> list[list[float]]:
    """What the program makes of q, each time."""
    return run_in_node([program], "m", SCRIPT.replace("INPUTS", json.dumps(inputs)).replace("SIZE", str(program.size)), folder)


def test_operations(tmp_path):
    """Of two numbers in their domains; functions within the last bits, since node has its own."""
    counts = {name: function.arity for name, function in FUNCTIONS.items()}
    counts |= {name: 1 if name == "neg" else 2 for name in ARITHMETIC}
    ops = [Op("load", (), ArrayElement("q", 0)), Op("load", (), ArrayElement("q", 1))]
    ops += [Op(name, (0, 1)[:count]) for name, count in counts.items()]
    line = Straight(tuple(ops), tuple(Store(array="out", index=k, node=k + 2) for k in range(len(counts))))
    program = Program(name="all", inputs=("q",), output="out", size=len(counts), blocks=(line,))
    inputs = [[0.3, 1.7], [0.875, -0.25], [1.0, 0.5], [1e-3, -40.0]]
    for q, found in zip(inputs, in_node(program, inputs, tmp_path), strict=True):
        assert found == pytest.approx(evaluate(program, {"q": q}), rel=1e-14, abs=0)


@pytest.mark.parametrize("x", [-2.5, -0.0, 0.0, 3.0])
def test_signs(tmp_path, x):
    line = Straight(
        (Op("load", (), ArrayElement("q", 0)), Op("sign", (0,)), Op("abs", (0,))),
        (Store(array="out", index=0, node=1), Store(array="out", index=1, node=2)),
    )
    ((sign, size),) = in_node(Program(name="all", inputs=("q",), output="out", size=2, blocks=(line,)), [[x]], tmp_path)
    assert (sign, size) == ((x > 0) - (x < 0), abs(x))


def test_loops(tmp_path):
    """Places in even distances that do not begin at 0, in uneven ones, always the same one, and constants."""
    ops = (
        Op("slot", (), 0),
        Op("slot", (), 1),
        Op("slot", (), 2),
        Op("slot", (), 3),
        Op("mul", (0, 1)),
        Op("mul", (2, 3)),
        Op("add", (4, 5)),
    )
    slots = (Slot("q", (1, 3, 5)), Column((0.5, 0.25, 2.0)), Slot("q", (4, 0, 1)), Slot("q", (2, 2, 2)))
    loop = Loop(count=3, ops=ops, slots=slots, stores=(TableStore("out", (4, 2, 0), 6, True),))
    q = [3.0, 5.0, 7.0, 11.0, 13.0, 17.0]
    ((*found,),) = in_node(Program(name="all", inputs=("q",), output="out", size=5, blocks=(loop,)), [q], tmp_path)
    assert found == [17 * 2 + 5 * 7, 0.0, 11 * 0.25 + 3 * 7, 0.0, 5 * 0.5 + 13 * 7]


@pytest.mark.parametrize("period", [0.0, 4.5])
@pytest.mark.parametrize("knots", [(1.0,), (1.0, 2.0), (-0.5, 1.0, 1.25, 4.0)])
def test_lookups(tmp_path, knots, period):
    """Of polynomials of degree 0, 1 and 3 at every knot, between and beyond them, to the last bit."""
    lookups = []
    for degree in (0, 1, 3):
        rows = ((0.5 + k, *(0.75 * (-1) ** j * (k + 1) / (j + 2) for j in range(degree + 1))) for k in range(len(knots) + 1))
        lookups.append(Pieces(knots, tuple(rows), period))
    ops = (Op("load", (), ArrayElement("q", 0)), *(Op(PIECES, (0,), pieces) for pieces in lookups))
    line = Straight(ops, tuple(Store(array="out", index=k, node=k + 1) for k in range(len(lookups))))
    points = sorted({-7.0, -0.75, *knots, *(x + 0.375 for x in knots), 9.5})
    found = in_node(Program(name="all", inputs=("q",), output="out", size=len(lookups), blocks=(line,)), [[x] for x in points], tmp_path)
    assert found == [[pieces.at(x) for pieces in lookups] for x in points]


def test_sines_and_cosines_of_angles(tmp_path):
    """Of two coordinates, near and so far that they are Math's own: both in an array of their own, in the last bits."""
    loads = tuple(Op("load", (), ArrayElement(array, k)) for array in SHARED.values() for k in range(2))
    line = Straight(loads, tuple(Store(array="out", index=k, node=k) for k in range(4)))
    inputs = [[0.3, 9.0, -0.7], [-2.0, 9.0, 100.25], [1e6, 9.0, 0.0], [3.14159, 9.0, -1e9]]
    for q, found in zip(
        inputs,
        in_node(Program(name="all", inputs=("q",), output="out", size=4, blocks=(line,), angles=(0, 2)), inputs, tmp_path),
        strict=True,
    ):
        assert found == pytest.approx([f(q[k]) for f in (math.sin, math.cos) for k in (0, 2)], rel=4e-16, abs=1e-18)
