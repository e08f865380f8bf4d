"""Programs run on every kind of number, and every emission is the same program."""

from __future__ import annotations

import cmath
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from programs import program_of, run

import ncgen
from ncgen import Model
from ncgen.exchange.examples import example_names
from ncgen.model.values import evaluate as number_of
from ncgen.program.assemble import assemble
from ncgen.program.ir.blocks import Column, Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import ArrayElement, Graph, Op
from ncgen.program.programs import EMISSIONS
from ncgen.symbolic.equations import build_equations

MPMATH = {name: getattr(mpmath, {"abs": "fabs", "pow": "power"}.get(name, name)) for name in FUNCTIONS}
COMPLEX = {"sin": cmath.sin, "cos": cmath.cos, "sqrt": cmath.sqrt}
ROBOT_KERNELS = ("phi", "phi_q", "gamma", "mass", "force", "energy", "constraints")
EXACT_KERNELS = ROBOT_KERNELS[:3]
"""Kernels whose rows are written one by one: no emission adds numbers in another order."""


@pytest.fixture(scope="module")
def square():
    """Programs of two points on a diagonal of whole numbers: raw rows, no angle, nothing that rounds."""
    model = Model("square", scale=False)
    origin = model.point("O", (0, 0, 0), fixed=True)
    corner = model.point("C", (3, 4, 12))
    model.distance(origin, corner)
    return assemble(build_equations(model)).programs


def test_on_fractions_rows_are_exact(square):
    """|a|² − L² with whole numbers is a fraction without error, and so is its second derivative."""
    q, qd = [Fraction(1, 3), Fraction(-2, 7), Fraction(5)], [Fraction(1, 9), Fraction(2), Fraction(-3, 11)]
    position = {"t": 0, "q": q, "qd": qd, "p": []}
    assert evaluate(square["phi"], position, number=Fraction) == [sum(x * x for x in q) - 169]
    assert evaluate(square["phi_q"], position, number=Fraction) == [2 * x for x in q]
    assert evaluate(square["gamma"], position, number=Fraction) == [-2 * sum(x * x for x in qd)]


def test_every_constant_becomes_the_kind_of_number():
    """Constants of code and of tables, and what is not yet written: fractions come out, never floats."""
    loop = Loop(
        count=2,
        ops=(Op("slot", (), 0), Op("slot", (), 1), Op("mul", (0, 1)), Op("const", (), 0.5), Op("add", (2, 3))),
        slots=(Column((0.25, 0.125)), Slot("q", (0, 1))),
        stores=(TableStore("out", (0, 1), 4, True),),
    )
    base = Straight((Op("const", (), 1.0),), (Store(array="out", index=0, node=0), Store(array="out", index=1, node=0)))
    found = run(program_of(base, loop, size=2), (Fraction(1, 3), Fraction(1, 7), 0, 0), Fraction)
    assert found == [Fraction(3, 2) + Fraction(1, 12), Fraction(3, 2) + Fraction(1, 56)]
    assert {type(value) for value in found} == {Fraction}


def test_nothing_drives_the_robot(assembled):
    """The list above is complete: only nu is missing."""
    assert all(set(a.programs) == set(ROBOT_KERNELS) for a in assembled.values())


@pytest.mark.parametrize("kernel", ROBOT_KERNELS)
def test_mpmath_agrees_with_floats(assembled, inputs, kernel):
    """50 digits give the floats' result to their rounding errors."""
    program = assembled["auto"].programs[kernel]
    with mpmath.workdps(50):
        high = {name: [mpmath.mpf(v) for v in array] if name != "t" else mpmath.mpf(array) for name, array in inputs.items()}
        exact = [float(v) for v in evaluate(program, high, MPMATH, mpmath.mpf)]
    assert evaluate(program, inputs) == pytest.approx(exact, rel=1e-12, abs=1e-14 * max(map(abs, exact)))


def test_complex_steps_are_the_jacobian(assembled, inputs):
    """The imaginary part of Φ(q + i h e_k)/h is column k of Φ_q: no cancellation, so all digits agree."""
    programs = assembled["auto"]
    pattern, q = programs.phi_q, inputs["q"]
    values = np.zeros(pattern.shape)
    values.flat[pattern.flat] = evaluate(programs.programs["phi_q"], inputs)
    for column in range(0, len(q), 5):
        moved = [complex(x, 1e-200 * (k == column)) for k, x in enumerate(q)]
        phi = evaluate(programs.programs["phi"], {**inputs, "q": moved}, COMPLEX, complex)
        assert [v.imag * 1e200 for v in phi] == pytest.approx(values[:, column], rel=1e-13, abs=1e-14)


@pytest.mark.parametrize("name", example_names())
@pytest.mark.parametrize("emission", EMISSIONS)
def test_all_at_once_is_one_after_the_other(name, emission):
    """The fused program writes Φ, the values of Φ_q and γ: of straight-line code, of loops, and with derived parameters."""
    equations = build_equations(ncgen.load(name))
    programs = assemble(equations, emission).programs
    if "phi_q" not in programs:
        assert "constraints" not in programs
        return
    rng = np.random.default_rng(3)
    arrays = {"q": [c.initial for c in equations.free], "qd": rng.uniform(-1, 1, len(equations.free))}
    inputs = {"t": 0.3, "q": arrays["q"] + rng.uniform(-0.01, 0.01, len(arrays["q"])), "qd": arrays["qd"]}
    inputs["p"] = [number_of(p, equations.model.parameters, p.name) for p in equations.parameters]
    alone = [x for kernel in ("phi", "phi_q", "gamma") for x in evaluate(programs[kernel], inputs)]
    assert evaluate(programs["constraints"], inputs) == pytest.approx(alone, rel=1e-13, abs=1e-13 * max(map(abs, alone)))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_have_their_meaning_and_can_be_replaced(name):
    """Every function is `math`'s unless the caller brings another one."""
    arguments = (0.3, 0.8)[: FUNCTIONS[name].arity]
    graph = Graph()
    node = graph.call(name, *(graph.load("q", k) for k in range(len(arguments))))
    program = program_of(Straight(tuple(graph.ops), (Store(array="out", index=0, node=node),)))
    inputs = {"t": 0.0, "q": arguments}
    assert evaluate(program, inputs)[0] == pytest.approx(float(MPMATH[name](*arguments)), rel=1e-15)
    assert evaluate(program, inputs, {name: lambda *a: a})[0] == arguments


@pytest.mark.parametrize("kernel", ROBOT_KERNELS)
def test_every_emission_computes_the_same(assembled, inputs, kernel):
    """Unrolled, tabled and mixed programs of the robot give equal numbers: sums alone may be in another order."""
    results = {emission: evaluate(assembled[emission].programs[kernel], inputs) for emission in EMISSIONS}
    for emission in EMISSIONS:
        if kernel in EXACT_KERNELS:
            assert results[emission] == results["unrolled"]
        else:
            size = max(map(abs, results["unrolled"]))
            assert results[emission] == pytest.approx(results["unrolled"], rel=1e-14, abs=1e-15 * size)


def test_emissions_differ_in_form(assembled):
    """Unrolled programs loop over constants only; tabled ones are shorter in the source."""
    for name, program in assembled["unrolled"].programs.items():
        loops = [b for b in program.blocks if isinstance(b, Loop)]
        assert all(slot.array == "const" for b in loops for slot in b.slots)
        assert any(isinstance(b, Loop) and len(b.slots) > 0 for b in assembled["tabled"].programs[name].blocks)


def test_stores_run_in_order():
    """Blocks see what earlier blocks wrote, `+=` adds to it, and a loop may add to one place many times."""
    base = Straight((Op("const", (), 1.0),), (Store(array="out", index=0, node=0), Store(array="d", index=0, node=0)))
    again = Straight((Op("load", (), ArrayElement("d", 0)), Op("add", (0, 0))), (Store(array="d", index=0, node=1),))
    adding = Loop(
        count=3,
        ops=(Op("slot", (), 0), Op("load", (), ArrayElement("d", 0)), Op("mul", (0, 1))),
        slots=(Column((1.0, 2.0, 4.0)),),
        stores=(TableStore("out", (0, 0, 0), 2, True),),
    )
    program = Program(name="order", inputs=(), output="out", size=1, blocks=(base, again, adding), temporaries={"d": 1})
    assert evaluate(program, {}) == [1.0 + 2.0 * (1.0 + 2.0 + 4.0)]
    assert evaluate(program, {}) == [15.0]
