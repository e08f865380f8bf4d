"""Drivers whose velocity jumps: an impulse changes all velocities, in every method and engine alike. Positions that jump are refused.

A carriage slides along a line beside the hinge of a body that turns freely, as its driver says: the angular momentum never changes.
"""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import ModelError
from ncgen.mechanism.break_times import break_times
from ncgen.mechanism.driver_jumps import driver_jumps
from ncgen.methods.table import FORMALISMS, INTEGRATORS, goes_with
from ncgen.solver.trajectories.energy import drift

MASS, OFFSET, SPEED, PLACE, TURNING = 2.0, 0.4, 0.7, 0.5, 1.3
INERTIA = 1.5 + 0.3 + MASS * OFFSET**2

LAWS = {
    "Max": (lambda m: PLACE + SPEED * sympy.Max(0, m.time - 1), [(1.0, 0.0), (2.0, SPEED)]),
    "Abs": (lambda m: PLACE + SPEED * sympy.Abs(m.time - 1) - SPEED, [(1.0, -SPEED), (2.0, SPEED)]),
    "Piecewise": (
        lambda m: sympy.Piecewise((PLACE, m.time < 1), (PLACE + SPEED * (m.time - 1), True)),
        [(1.0, 0.0), (2.0, SPEED)],
    ),
    "table": (
        lambda m: m.table("law", (0.0, 1.0, 1.5, 2.5), (PLACE, PLACE, PLACE + SPEED / 2, PLACE - SPEED / 2))(m.time),
        [(1.0, 0.0), (1.5, SPEED), (2.0, -SPEED)],
    ),
    "parameter": (lambda m: PLACE + SPEED * sympy.Max(0, m.time - m.parameter("begin", 1.0)), [(1.0, 0.0), (2.0, SPEED)]),
}
"""{law: from a model to the place of the carriage, and the ends (s) of its parts with the velocity of each}."""


def spinner(law) -> ncgen.Model:
    m = ncgen.Model("spinner")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, OFFSET))
    e = m.vector("e", (1, 0, 0), fixed="z")
    base = m.body("base", [O, A], [e], mass=1.0, com=(0, 0), inertia=1.5)
    C = m.point("C", (PLACE, OFFSET))
    carriage = m.body("carriage", [C], [e], mass=MASS, com=(PLACE, OFFSET), inertia=0.3)
    m.prismatic(base, carriage, A, C, e)
    s = m.slide("s", A, C, e)
    m.independent(m.angle("phi", m.vector("x", (1, 0, 0), fixed=True), e, m.vector("z", (0, 0, 1), fixed=True)))
    m.drive(s, law(m))
    return m


@cache
def kernels_of(law: str):
    return ncgen.compile(spinner(LAWS[law][0]))


def exact(law: str, end: float = 2.0, begin: float = 1.0) -> tuple[float, float, list[float], float]:
    """Angle, its velocity, the driver's impulses and its work: L = (I + m s²) ω − m d ṡ is constant, dφ/ds is a rational function."""
    s, t, phi, pieces = PLACE, 0.0, 0.0, LAWS[law][1]
    momentum = (INERTIA + MASS * s**2) * TURNING - MASS * OFFSET * pieces[0][1]
    impulses, last, root = [], pieces[0][1], np.sqrt(MASS / INERTIA)

    def turning(s, v):
        return (momentum + MASS * OFFSET * v) / (INERTIA + MASS * s**2)

    def kinetic(s, v):
        w = turning(s, v)
        return ((INERTIA + MASS * s**2) * w**2 + MASS * v**2 - 2 * MASS * OFFSET * v * w) / 2

    first = kinetic(s, last)
    for until, v in pieces:
        until = begin if until == 1.0 else min(until, end)
        if t:
            impulses.append(MASS * (v - last - OFFSET * (turning(s, v) - turning(s, last))))
        if v == 0.0:
            phi += (until - t) * turning(s, 0.0)
        else:
            new = s + v * (until - t)
            phi += (momentum / v + MASS * OFFSET) / np.sqrt(INERTIA * MASS) * (np.arctan(new * root) - np.arctan(s * root))
            s = new
        t, last = until, v
    return phi, turning(s, last), impulses, kinetic(s, last) - first


def moved(law: str, duration: float = 2.0, **options):
    """A run; any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return ncgen.simulate(kernels_of(law), duration, **{"points": 5, "rtol": 1e-10, "zd0": {"phi": TURNING}, **options})


def check(run, law: str, within: float) -> None:
    phi, rate, impulses, work = exact(law)
    assert [run["phi"][-1], run["rate(phi)"][-1]] == pytest.approx([phi, rate], rel=0, abs=within)
    assert [each.size for each in run.impulses] == pytest.approx(impulses, rel=0, abs=max(within, 1e-8))
    assert run.work[-1] == pytest.approx(work, rel=0, abs=10 * within)
    assert [each.driver for each in run.impulses] == ["s"] * len(impulses)
    assert [each.t for each in run.impulses] == pytest.approx([end for end, _ in LAWS[law][1][:-1]], rel=1e-15)


METHODS = [
    (formalism, integrator, engine)
    for formalism in FORMALISMS.values()
    for integrator in INTEGRATORS.values()
    for engine in ("c", "python")
    if goes_with(formalism, integrator) and not integrator.extra and (engine == "python" or (formalism.in_c and integrator.in_c))
]
LESS = {"penalty": 2e-8}
"""Where constraints are held by feedback alone, what a smooth motion is off by, too."""

SECOND_ORDER = ("rattle", "energy-momentum", "trapezoidal", "generalized-alpha")


@pytest.mark.parametrize("formalism, integrator, engine", METHODS, ids=lambda each: getattr(each, "name", each))
def test_every_method_takes_the_impulse(formalism, integrator, engine):
    """Its error is that of a smooth motion: 1e-8, and of methods of order 2 a quarter with half the step."""
    options = dict(formalism=formalism.name, integrator=integrator.name, engine=engine)
    if integrator.name not in SECOND_ORDER:
        check(moved("Max", **options, **({"max_step": 0.004} if integrator.has_fixed_step else {})), "Max", LESS.get(formalism.name, 1e-8))
        return
    errors = []
    for step in (0.013, 0.0065):
        run = moved("Max", max_step=step, **options)
        errors.append(np.abs(np.subtract([run["phi"][-1], run["rate(phi)"][-1]], exact("Max")[:2])).max())
        check(run, "Max", 1e-3)
    assert errors[0] < 1e-4 and (errors[1] < errors[0] / 3 or errors[0] < 1e-9)


STABILISED = [each for each in METHODS if "stabilisation" in each[0].options and each[1].name in ("dop853", "radau")]


@pytest.mark.parametrize("formalism, integrator, engine", STABILISED, ids=lambda each: getattr(each, "name", each))
def test_methods_without_projection_take_it_too(formalism, integrator, engine):
    options = dict(formalism=formalism.name, integrator=integrator.name, engine=engine, options={"stabilisation": "baumgarte"})
    check(moved("Max", **options), "Max", 1e-8)


@pytest.mark.parametrize("engine", ["auto", "c", "emitted", "python"])
@pytest.mark.parametrize("law", LAWS)
def test_every_law(law, engine):
    formalism = {"formalism": "coordinate-partitioning"} if engine == "emitted" else {}
    run = moved(law, engine=engine, **formalism)
    check(run, law, 1e-8)
    assert drift(run.kernels, run.t, run.q, run.qd, run.work, run.p) < 1e-9


@pytest.mark.parametrize("engine", ["c", "python"])
def test_rows_at_a_jump_are_before_it(engine):
    """Also at the end of a run, which is no contradiction."""
    run = moved("Max", points=[0.0, 0.5, 1.0, 1.0 + 1e-9, 2.0], engine=engine)
    check(run, "Max", 1e-8)
    assert run["rate(s)"] == pytest.approx([0.0, 0.0, 0.0, SPEED, SPEED], abs=1e-9)
    assert run["rate(phi)"][:3] == pytest.approx(TURNING, abs=1e-9)
    short = moved("Max", 1.0, engine=engine)
    assert short["rate(s)"][-1] == pytest.approx(0.0, abs=1e-12) and not short.impulses


@pytest.mark.parametrize("engine", ["c", "python"])
def test_a_run_that_begins_at_a_jump_begins_behind_it(engine):
    """What is asked of the start are the velocities after it."""
    run = moved("Max", 1.0, t0=1.0, engine=engine)
    assert run["rate(s)"][0] == pytest.approx(SPEED, abs=1e-12) and run["rate(phi)"][0] == pytest.approx(TURNING, abs=1e-12)
    assert not run.impulses


@pytest.mark.parametrize("number, within", [("float", 2e-4), ("long double", 1e-9)])
def test_other_numbers(number, within):
    options = {"number": number, "rtol": 1e-5 if number == "float" else 1e-10}
    check(moved("Max", formalism="lagrange", integrator="dop853", **options), "Max", within)


@pytest.mark.parametrize("engine", ["c", "python"])
def test_a_run_stops_before_and_behind_a_jump(engine):
    """The rows behind the jump are of the motion after it, and only impulses before the stop are there."""
    early = moved("Max", stop={"phi": 0.9}, engine=engine)
    assert early.stopped and not early.impulses and early.t[-1] == pytest.approx(0.9 / TURNING, abs=1e-8)
    late = moved("Max", stop={"s": PLACE + SPEED / 2}, engine=engine)
    assert late.stopped and len(late.impulses) == 1 and late.t[-1] == pytest.approx(1.5, abs=1e-8)


def test_a_stiff_run_that_goes_on_with_another_method_has_every_impulse_once():
    """The default call becomes Radau's: what was found of the run is done again from its last row on, over the jump."""

    def law(m):
        held = m.slide("held", m.point("G", (3, 0), fixed=True), m.point("H", (3.1, 0), fixed="y"), m.vector("h", (1, 0, 0), fixed=True))
        m.body("buffer", [m.elements["H"]], mass=1.0)
        m.torque(held, -1e6 * (held - 0.1) - 1e5 * held.rate)
        return PLACE + SPEED * sympy.Max(0, m.time - 1)

    kernels = ncgen.compile(spinner(law))
    run = ncgen.simulate(kernels, 2.0, points=2, zd0={"phi": TURNING, "held": 1e-3}, z=("phi", "held"), rtol=1e-8)
    assert "radau" in str(run.made_with)
    check(run, "Max", 1e-7)


@pytest.mark.parametrize(
    "law, size, when",
    [
        (lambda m: PLACE + 0.1 * sympy.Heaviside(m.time - 1), "0.1", "1"),
        (lambda m: sympy.Piecewise((PLACE, m.time < 0.5), (PLACE - 0.2, True)), "-0.2", "0.5"),
        (lambda m: PLACE + 0.3 * sympy.sign(m.time - 1.5) + 0.3, "0.6", "1.5"),
    ],
)
@pytest.mark.parametrize("engine", ["c", "python"])
def test_positions_that_jump_are_refused(law, size, when, engine):
    kernels = ncgen.compile(spinner(law))
    with pytest.raises(
        ModelError, match=f"spinner: the driver of s jumps by {size} at t = {when} s, and a position cannot jump"
    ) as refused:
        ncgen.simulate(kernels, 2.0, engine=engine)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "law",
    [
        lambda m: PLACE + 0.1 * ncgen.smooth_step(m.time, 0.5, 1.5),
        lambda m: m.spline("law", (0, 0.4, 1, 2), (PLACE, 0.6, 0.4, 0.7))(m.time),
        lambda m: PLACE + sympy.Max(0, m.time - 1) ** 2,
        lambda m: PLACE + 1e-3 * sympy.sin(300 * m.time) + 0 * sympy.Abs(m.time - 1),
        lambda m: PLACE + sympy.Abs(m.time - 1) ** 3,
    ],
)
def test_smooth_velocities_do_not_jump(law):
    kernels = ncgen.compile(spinner(law), "numpy")
    assert not len(driver_jumps(kernels, kernels.p0, kernels.q0, break_times(kernels, kernels.p0, 0.0, 2.0)))


def test_which_breaks_are_jumps():
    """Of a table, and of a velocity that jumps by little beside what else it does."""

    def law(m):
        return m.table("law", (0, 0.4, 1, 2), (PLACE, 0.6, 0.4, 0.7))(m.time) + sympy.sin(10 * m.time) + 1e-6 * sympy.Abs(m.time - 1.7)

    kernels = ncgen.compile(spinner(law), "numpy")
    found = driver_jumps(kernels, kernels.p0, kernels.q0, break_times(kernels, kernels.p0, 0.0, 2.0))
    assert found.mean(axis=1) == pytest.approx([0.4, 1.0, 1.7], rel=1e-14)
