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
from ncgen.solver.formalisms.impulse import cross
from ncgen.solver.trajectories.energy import Instants, drift

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


def spinner(law, drive=None) -> ncgen.Model:
    """drive: what makes the carriage follow the law, from model, slide, angle and law; None for a driver."""
    m = ncgen.Model("spinner")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, OFFSET))
    e = m.vector("e", (1, 0, 0), fixed="z")
    base = m.body("base", [O, A], [e], mass=1.0, com=(0, 0), inertia=1.5)
    C = m.point("C", (PLACE, OFFSET))
    carriage = m.body("carriage", [C], [e], mass=MASS, com=(PLACE, OFFSET), inertia=0.3)
    m.prismatic(base, carriage, A, C, e)
    s = m.slide("s", A, C, e)
    phi = m.angle("phi", m.vector("x", (1, 0, 0), fixed=True), e, m.vector("z", (0, 0, 1), fixed=True))
    m.independent(phi)
    if drive:
        drive(m, s, phi, law(m))
    else:
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
    if goes_with(formalism, integrator)
    and not integrator.extra
    and (integrator.in_python if engine == "python" else formalism.in_c and integrator.in_c)
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
    assert drift(run.kernels, Instants(run.t, run.q, run.qd, run.work), run.p) < 1e-9


def held(m, s, phi, law) -> None:
    m.drive(s, law)
    m.drive(phi, 0 * m.time)


@pytest.mark.parametrize("engine", ["c", "python"])
def test_a_driver_that_holds_a_coordinate_has_an_impulse_too(engine):
    """m v along the slide, and m d v about the hinge against it."""
    run = ncgen.simulate(ncgen.compile(spinner(LAWS["Max"][0], held)), 2.0, engine=engine)
    assert [each.driver for each in run.impulses] == ["s", "phi"]
    assert [each.size for each in run.impulses] == pytest.approx([MASS * SPEED, -MASS * OFFSET * SPEED], rel=1e-12)
    assert run.work[-1] == pytest.approx(MASS * SPEED**2 / 2, rel=1e-12)


@pytest.mark.parametrize("options", [{}, {"engine": "python"}, {"formalism": "coordinate-partitioning"}, {"integrator": "radau"}], ids=str)
def test_other_rows_that_depend_on_time_are_drivers(options):
    """Equations of the user's own, of positions (whose impulse is half as large, since they are twice as long) and of velocities."""
    by_position = lambda m, s, phi, law: m.constrain(2 * s.symbol - 2 * law)  # noqa: E731
    by_velocity = lambda m, s, phi, law: m.constrain_velocity(s.rate - SPEED * sympy.Heaviside(m.time - 1))  # noqa: E731
    phi, _, (size,), work = exact("Max")
    for drive, name, scale in ((by_position, "constraint", 0.5), (by_velocity, "velocity constraint", 1.0)):
        kernels = ncgen.compile(spinner(LAWS["Max"][0], drive))
        run = ncgen.simulate(kernels, 2.0, rtol=1e-10, zd0={"phi": TURNING}, **options)
        assert [run["phi"][-1], run.work[-1]] == pytest.approx([phi, work], abs=1e-8)
        assert [(each.driver, each.t) for each in run.impulses] == [(name, 1.0)]
        assert run.impulses[0].size == pytest.approx(scale * size, abs=1e-8)


def test_a_table_of_many_knots_is_followed():
    """Of a sine, so that the motion is nearly that of the sine, whose momentum stays, too."""
    knots = np.linspace(0.0, 2.0, 201)
    kernels = ncgen.compile(spinner(lambda m: m.table("law", knots, PLACE + 0.1 * np.sin(5 * knots))(m.time)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(kernels, 2.0, zd0={"phi": TURNING}, points=41)
    momentum = (INERTIA + MASS * run["s"] ** 2) * run["rate(phi)"] - MASS * OFFSET * run["rate(s)"]
    assert len(run.impulses) == 199 and momentum == pytest.approx(momentum[0], rel=1e-8)


def test_a_large_mechanism_is_carried_over_a_jump():
    """A chain of 120 links that hangs from a driven slide: momentum and energy say the same of all its velocities, by sparse factors."""
    m = ncgen.Model("chain")
    first, P = m.vector("x", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True)
    A = m.point("P0", (0, 0), fixed="y")
    s = m.slide("s", P, A, first)
    m.drive(s, sympy.Max(0, m.time - 1))
    for k in range(1, 121):
        B = m.point(f"P{k}", (0.1 * k, -0.1 * k))
        m.body(f"link{k}", [A, B], mass=1.0, inertia="rod")
        A = B
    kernels = ncgen.compile(m, "numpy")
    qd = np.zeros(kernels.n)
    found = cross(kernels, kernels.q0, qd, 1.0 - 1e-12, 1.0 + 1e-12, kernels.p0)
    assert np.abs(kernels.phi_q(kernels.q0, 2.0) @ found.qd - kernels.nu(kernels.q0, 2.0)).max() < 1e-10
    along_x = np.array([c.endswith(".x") for c in kernels.coordinates])
    momentum = (kernels.mass(kernels.q0) @ found.qd)[along_x].sum()
    assert [each.driver for each in found.impulses] == ["s"]
    assert found.impulses[0].size == pytest.approx(momentum, rel=1e-9)
    assert found.work == pytest.approx(kernels.energy(kernels.q0, found.qd)[0], rel=1e-9)


def test_impulses_are_kept_in_files(tmp_path):
    run = moved("table")
    again = ncgen.read(run.to_npz(tmp_path / "trajectory.npz"))
    assert again.impulses == run.impulses and len(run.impulses) == 2


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


@pytest.mark.parametrize("integrator, h, within", [("auto", 0.1, 1e-7), ("auto", 0.3, 1e-7), ("auto", 2.0, 1e-7), ("rk4", 0.01, 1e-7)])
def test_steps_from_outside_take_the_impulse(integrator, h, within):
    """Steps that end at the jump, and such that pass it."""
    kernels, impulses = kernels_of("Max"), []
    given = dict(integrator=integrator, rtol=1e-9, zd0={"phi": TURNING})
    one, many = ncgen.start(kernels, **given), ncgen.start(kernels, 3, threads=2, **given)
    before, total = one.state, sum(one.energy()[:2])
    while one.t < 2.0 - 1e-9:
        step = min(h, 2.0 - one.t)
        one.step(step)
        many.step(step)
        impulses += one.impulses
        assert sum(one.energy()[:2]) - one.work == pytest.approx(total, abs=1e-7)
    phi, rate, sizes, work = exact("Max")
    assert [one["phi"], one["rate(phi)"], one.work] == pytest.approx([phi, rate, work], abs=within)
    assert [(each.driver, each.t) for each in impulses] == [("s", 1.0)] and impulses[0].size == pytest.approx(sizes[0], abs=within)
    assert many["phi"] == pytest.approx(3 * [one["phi"]], abs=1e-14) and many.work == pytest.approx(3 * [one.work], abs=1e-14)
    one.reset(before).step(2.0)
    assert one["phi"] == pytest.approx(phi, abs=0.05 if integrator == "rk4" else within)  # one step of rk4 up to the jump, and one after


def test_a_step_that_ends_at_a_jump_ends_before_it():
    """However the steps' sum is rounded."""
    for count in (1, 3, 7, 10, 49):
        sim = ncgen.start(kernels_of("Max"), rtol=1e-9, zd0={"phi": TURNING})
        for _ in range(count):
            sim.step(1.0 / count)
        assert sim["rate(s)"] == pytest.approx(0.0, abs=1e-12) and not sim.impulses
        sim.step(1.0)
        assert sim["rate(phi)"] == pytest.approx(exact("Max", sim.t)[1], abs=1e-7) and len(sim.impulses) == 1


def test_a_stepper_refuses_positions_that_jump():
    sim = ncgen.start(ncgen.compile(spinner(lambda m: PLACE + 0.1 * sympy.Heaviside(m.time - 1))))
    with pytest.raises(ModelError, match="the driver of s jumps by 0.1 at t = 1 s"):
        sim.step(1.5)
    assert sim.t == 0.0


def test_a_state_that_goes_on_alone_takes_the_recursion(monkeypatch):
    """As `simulate` does by default: the matrix would cost more and round more."""
    engines = []

    def simulate(*args, **options):
        run = ncgen.simulate(*args, **options)
        engines.append(run.engine)
        return run

    monkeypatch.setattr("ncgen.solver.motions.batch.simulate_one", simulate)
    batch = ncgen.simulate(kernels_of("parameter"), 2.0, zd0={"phi": TURNING}, p={"begin": np.array([1.0])})
    assert batch.alone.all() and engines == ["emitted"]


@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "rk4"])
def test_states_of_a_batch_take_the_impulse(integrator):
    """Each at a time of its own; those without a jump in the run go in lanes, with the bits that they have alone."""
    begins = np.array([0.5, 1.0, 1.7, 2.5, 3.0])
    step = {"max_step": 0.01} if integrator == "rk4" else {}
    given = dict(zd0={"phi": TURNING}, rtol=1e-9, integrator=integrator, **step)
    batch = ncgen.simulate(kernels_of("parameter"), 2.0, p={"begin": begins}, **given)
    assert batch.ok.all() and batch.alone.tolist() == [True, True, True, False, False]
    index = kernels_of("parameter").index
    for k, begin in enumerate(begins[:3]):
        phi, rate, _, work = exact("parameter", begin=begin)
        found = [batch.q[k, -1, index["phi"]], batch.qd[k, -1, index["phi"]], batch.work[k, -1]]
        assert found == pytest.approx([phi, rate, work], abs=1e-7)
    assert batch.q[3:, -1, index["phi"]] == pytest.approx(2 * TURNING, abs=1e-7)
    alone = ncgen.simulate(kernels_of("parameter"), 2.0, p={"begin": begins[3:4]}, **given)
    assert np.array_equal(alone.q[0], batch.q[3])


def test_a_batch_says_which_positions_jump():
    def law(m):
        return PLACE + 0.1 * sympy.Heaviside(m.time - m.parameter("begin", 1.0))

    batch = ncgen.simulate(ncgen.compile(spinner(law)), 2.0, p={"begin": np.array([1.0, 3.0])})
    assert batch.status[1] == "ok" and "jumps by 0.1 at t = 1 s" in batch.status[0]


@pytest.mark.parametrize("integrator", ["rk4", "dop853", "rattle", "trapezoidal"])
def test_derivatives_over_an_impulse_are_refused(integrator):
    with pytest.raises(ModelError, match="the velocity of a driver jumps at t = 1 s, and derivatives do not go through that impulse"):
        ncgen.sensitivities(kernels_of("parameter"), 2.0, 100, integrator=integrator, zd0={"phi": TURNING})
    early = ncgen.sensitivities(kernels_of("parameter"), 0.9, 100, integrator=integrator, zd0={"phi": TURNING})
    assert np.all(np.isfinite(early.qd))


def test_derivatives_of_many_motions_over_an_impulse_are_refused():
    def objective(q, qd):
        slope = np.zeros_like(q)
        slope[-1, 0] = 1.0
        return q[-1, 0], slope, np.zeros_like(qd)

    found = ncgen.gradient(kernels_of("parameter"), 2.0, 100, objective, p={"begin": np.array([1.0, 3.0])})
    assert found.status[1] == "ok" and "do not go through that impulse" in found.status[0]
