"""Laws of time: steps end where they change their formula, so that errors are those of smooth motions."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import scipy.integrate
import sympy
from sliding import sliding_block

import ncgen
from ncgen.mechanism.break_times import break_times

KNOTS, VALUES = np.array([0.0, 0.3, 0.5, 1.0]), np.array([0.0, 2.0, -1.0, 0.0])
SPEED, SHIFT = 3.0, 0.2


def block(argument) -> ncgen.Model:
    """1 kg on a spring of 4 N/m, pushed by 10 law(argument(m, w)), a periodic table."""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0)
    m.independent(s)
    law = m.table("law", KNOTS, VALUES, periodic=True)
    m.torque(s, 10 * law(argument(m, m.parameter("w", 1.0))) - 4 * s)
    return m


def ends(seconds: float) -> list[float]:
    """When SPEED t + SHIFT passes a knot."""
    passed = ((turn + knot - SHIFT) / SPEED for turn in range(int(SPEED * seconds) + 2) for knot in KNOTS[:-1])
    return sorted(t for t in passed if 0 < t < seconds)


def exact(seconds: float) -> np.ndarray:
    """Place and speed, from corner to corner by SciPy."""
    y, places = np.zeros(2), [0.0, *ends(seconds), seconds]
    for a, b in zip(places, places[1:], strict=False):
        turn = np.floor(SPEED * (a + b) / 2 + SHIFT)

        def rates(t, y, turn=turn):
            return [y[1], 10 * np.interp(SPEED * t + SHIFT - turn, KNOTS, VALUES) - 4 * y[0]]

        y = scipy.integrate.solve_ivp(rates, (a, b), y, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return y


@pytest.mark.parametrize(
    "options", [{}, {"engine": "c"}, {"engine": "python"}, {"formalism": "coordinate-partitioning", "integrator": "dop853"}], ids=str
)
def test_steps_end_at_knots(options):
    """Three orders better than asked for, in a few steps from corner to corner."""
    kernels = ncgen.compile(block(lambda m, w: w * m.time + SHIFT))
    run = ncgen.simulate(kernels, 2.0, rtol=1e-8, points=2, p={"w": SPEED}, **options)
    np.testing.assert_allclose([run["s"][-1], run["rate(s)"][-1]], exact(2.0), atol=2e-11)
    assert run.statistics.steps < 5 * len(ends(2.0))


def passed(kernels, p, start, end):
    """The breaks of a run (s), without what is about them."""
    return break_times(kernels, np.asarray(p, dtype=float), start, end).mean(axis=1)


def test_where_knots_are():
    kernels = ncgen.compile(block(lambda m, w: w * m.time + SHIFT), "numpy")
    assert passed(kernels, [SPEED], 0.0, 2.0) == pytest.approx(ends(2.0), abs=1e-14)
    assert passed(kernels, [-SPEED], 0.0, 1.0) == pytest.approx(
        sorted((SHIFT - k + n) / SPEED for k in KNOTS[:-1] for n in range(4) if 0 < SHIFT - k + n < 3)
    )
    assert not len(passed(kernels, [0.0], 0.0, 2.0)) and not len(passed(kernels, [1e9], 0.0, 2.0))


@pytest.mark.parametrize("argument", [lambda m, w: m.elements["s"] + m.time, lambda m, w: w + 0.0])
def test_a_law_of_coordinates_is_left_to_error_control(argument):
    kernels = ncgen.compile(block(argument), "numpy")
    assert not len(passed(kernels, kernels.p0, 0.0, 2.0))


def test_a_driver_by_a_spline_has_breaks_at_its_knots():
    m = ncgen.Model("driven")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=1.0)
    m.drive(s, m.spline("profile", (0.0, 0.4, 1.0, 1.5), (0.0, 1.0, 0.5, 0.0))(m.time))
    kernels = ncgen.compile(m, "numpy")
    assert break_times(kernels, kernels.p0, 0.0, 1.2).tolist() == [[0.4, 0.4], [1.0, 1.0]]


def pushed(law) -> ncgen.Model:
    """1 kg on a slide, pushed by law(t, w, m) in N."""
    m, s = sliding_block("pushed")
    m.torque(s, law(m.time, m.parameter("w", 3.0), m))
    return m


def roots(function, *near):
    """Zeros of a function of mpmath's numbers."""
    return [float(mpmath.findroot(function, place)) for place in near]


WAVE = roots(lambda t: mpmath.exp(-t) - mpmath.cos(3 * t), 0.207, 1.636, 2.593, 3.674, 4.709, 5.761, 6.806, 7.854, 8.901, 9.948)


@pytest.mark.parametrize(
    "law, times",
    [
        (lambda t, w, m: sympy.Heaviside(t - 5) - sympy.Heaviside(t - 6), [5, 6]),
        (lambda t, w, m: sympy.Max(0, t - 1) * sympy.Min(1, w - t), [1, 2]),
        (lambda t, w, m: sympy.Piecewise((1.0, t < w), (t, t <= 2 * w), (0.0, True)), [3, 6]),
        (lambda t, w, m: ncgen.smooth_step(t, 5, 6) + sympy.Abs(t - w) * m.elements["s"], [3, 5, 6]),
        (lambda t, w, m: sympy.sign(sympy.Max(0, t - 1) - 1), [1, 2]),
        (lambda t, w, m: sympy.Heaviside((t - 1) ** 3), [1]),
        (lambda t, w, m: sympy.Heaviside(t**2 - w * t + 1), [(3 - 5**0.5) / 2, (3 + 5**0.5) / 2]),
        (lambda t, w, m: sympy.Abs(sympy.sin(w * t + 1)), [(k * np.pi - 1) / 3 for k in range(1, 10)]),
        (lambda t, w, m: sympy.sign(sympy.exp(-t) - sympy.cos(w * t)), WAVE),
        (lambda t, w, m: sympy.sign(sympy.sqrt(t) - sympy.log(1 + w * t)), roots(lambda t: mpmath.sqrt(t) - mpmath.log(1 + 3 * t), 0.15)),
        (lambda t, w, m: m.table("law", (0, 1, 2), (0, 1, 0))(2 * sympy.atan(t / 5)), [5 * np.tan(0.5), 5 * np.tan(1)]),
    ],
)  # fmt: skip
def test_laws_of_time_change_their_formula_at_these_times(law, times):
    """Zeros of arguments in closed form or by mpmath, from whichever functions they come."""
    kernels = ncgen.compile(pushed(law), "numpy")
    found = passed(kernels, kernels.p0, 0.0, 10.0)
    found = found[found > 1e-9]
    np.testing.assert_allclose(found, [t for t in times if t < 10], rtol=0, atol=2e-8)
    assert len(found) == len(times)


def test_a_law_that_switches_without_end_is_left_out():
    """3e9 zeros of a square wave would be a list without end; 31,831 are none."""
    kernels = ncgen.compile(pushed(lambda t, w, m: sympy.sign(sympy.sin(w * t))), "numpy")
    assert not len(passed(kernels, [1e9], 0.0, 10.0))
    assert passed(kernels, [1e4], 0.0, 10.0) == pytest.approx(np.arange(31831) * np.pi / 1e4, abs=1e-13)


PENDULUM_PULSES = {
    "Heaviside": lambda t, m: sympy.Heaviside(t - 5) - sympy.Heaviside(t - 6),
    "Piecewise": lambda t, m: sympy.Piecewise((0.0, t < 5), (1.0, t < 6), (0.0, True)),
    "Max and Min": lambda t, m: sympy.Min(1, sympy.Max(0, 1e6 * (t - 5))) - sympy.Min(1, sympy.Max(0, 1e6 * (t - 6))),
    "smooth_step": lambda t, m: ncgen.smooth_step(t, 5, 5.000001) - ncgen.smooth_step(t, 6, 6.000001),
}


def hanging(law) -> ncgen.Model:
    """2 kg on a massless rod of 1 m, at rest, pushed by law(t, m) in N along x."""
    m = ncgen.Model("pendulum")
    m.gravity((0, -9.81, 0))
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -1))
    m.body("mass", [A], mass=2.0)
    m.distance(O, A)
    m.force(A, (law(m.time, m), 0, 0))
    return m


def after_the_pulse(t):
    """x (m) at times from 6 s on, by SciPy from break to break."""
    y = np.zeros(2)
    for force, a, b in ((1.0, 5.0, 6.0), (0.0, 6.0, 14.0)):
        run = scipy.integrate.solve_ivp(
            lambda t, y, f=force: [y[1], -9.81 * np.sin(y[0]) + f / 2 * np.cos(y[0])], (a, b), y, "DOP853", rtol=1e-12, atol=1e-14,
            dense_output=True,
        )  # fmt: skip
        y = run.y[:, -1]
    return np.sin(run.sol(t)[0])


OPTIONS = [
    {},
    {"engine": "python"},
    {"formalism": "coordinate-partitioning", "integrator": "dop853"},
    {"formalism": "coordinate-partitioning", "integrator": "dopri5", "engine": "python"},
    {"formalism": "coordinate-partitioning", "integrator": "radau"},
    {"formalism": "coordinate-partitioning", "integrator": "radau", "engine": "python"},
    {"formalism": "lagrange", "integrator": "bdf"},
    {"formalism": "lagrange", "integrator": "rk4", "max_step": 0.01},
    {"formalism": "lagrange", "integrator": "rk4", "max_step": 0.01, "engine": "python"},
]
FIXED = [
    ("lagrange", "rattle"),
    ("lagrange", "energy-momentum"),
    ("lagrange", "generalized-alpha"),
    ("ali3p", "trapezoidal"),
    ("coordinate-partitioning", "trapezoidal"),
]


@pytest.mark.parametrize("pulse", PENDULUM_PULSES)
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_a_pendulum_at_rest_feels_a_push(pulse, options):
    """1 N from 5 s to 6 s: a step control that looks for errors alone goes past it, since nothing moves before."""
    kernels = ncgen.compile(hanging(PENDULUM_PULSES[pulse]))
    run = ncgen.simulate(kernels, 10.0, rtol=1e-9, points=np.append(0.0, np.linspace(6.1, 10.0, 40)), **options)
    np.testing.assert_allclose(run["A.x"][1:], after_the_pulse(run.t[1:]), rtol=0, atol=2e-6 if "max_step" in options else 3e-7)


TABLE = np.arange(9) * 0.05, np.array([1.0, -2.0, 3.0, 0.5, -1.5, 2.0, -3.0, 1.0, 0.0])


def stiff() -> ncgen.Model:
    """1 kg pushed by the input F, and beside it 1 kg on 1e6 N/m with 1e5 N s/m, which makes the mechanism stiff."""
    m = ncgen.Model("stiff")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    free, held = m.slide("free", O, A, axis), m.slide("held", O, B, axis)
    m.body("one", [A], mass=1.0)
    m.body("other", [B], mass=1.0)
    m.independent(free, held)
    m.torque(free, m.input("F", "N"))
    m.torque(held, -1e6 * (held - 0.1) - 1e5 * held.rate + sympy.sin(m.time))
    return m


@pytest.mark.parametrize("points", [2, 11, 101])
@pytest.mark.parametrize(
    "options", [{"rtol": 1e-8}, {"rtol": 1e-6}, {"formalism": "coordinate-partitioning", "integrator": "radau"}], ids=str
)
def test_radau_ends_steps_at_breaks(options, points):
    """m x'' = F, nine values 0.05 s apart: the default call becomes Radau's, since the mechanism turns out stiff."""
    run = ncgen.simulate(ncgen.compile(stiff()), 3.0, inputs={"F": (*TABLE, "zero")}, points=points, **options)
    speeds = np.concatenate([[0.0], np.cumsum(0.05 * TABLE[1][:-1])])
    place = np.sum(0.05 * (speeds[:-1] + speeds[1:]) / 2) + 2.6 * speeds[-1]
    assert "radau" in str(run.made_with)
    assert [run["free"][-1], run["rate(free)"][-1]] == pytest.approx([place, speeds[-1]], rel=0, abs=1e-9)


@pytest.mark.parametrize("formalism, integrator", FIXED)
def test_fixed_steps_are_split_at_breaks(formalism, integrator):
    """Of 13 ms, none of which ends at 5 s or 6 s: methods of order 2 keep their order, so the error falls by 4 with half the step."""
    kernels = ncgen.compile(hanging(PENDULUM_PULSES["Piecewise"]))
    errors = []
    for step in (0.013, 0.0065):
        run = ncgen.simulate(kernels, 10.0, formalism=formalism, integrator=integrator, max_step=step, points=[0.0, 5.0, 6.0, 10.0])
        errors.append(abs(run["A.x"][-1] - after_the_pulse(10.0)))
    assert 3.3 < errors[0] / errors[1] < 4.9
    assert abs(run["A.x"][1]) < 1e-12 and run["A.x"][2] == pytest.approx(after_the_pulse(6.0), abs=2e-5)


@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "rk4"])
def test_states_in_lanes_end_steps_at_breaks(integrator):
    """Ten pendulums, each pushed at a time of its own, and each with the bits that it has alone."""
    m = hanging(lambda t, m: sympy.Heaviside(t - m.parameter("begin", 5.0)) - sympy.Heaviside(t - m.numbers["begin"] - 1))
    kernels = ncgen.compile(m)
    begins = np.linspace(1.03, 5.0, 10)
    given = dict(integrator=integrator, rtol=1e-9, points=[0.0, 6.1, 10.0], max_step=0.01 if integrator == "rk4" else np.inf)
    batch = ncgen.simulate(kernels, 10.0, p={"begin": begins}, **given)
    assert batch.ok.all() and not batch.alone.any()
    x = batch.q[:, :, kernels.index["A.x"]]
    for k, begin in enumerate(begins):
        np.testing.assert_allclose(x[k, -1], after_the_pulse(15.0 - begin), rtol=0, atol=3e-7)
    alone = ncgen.simulate(kernels, 10.0, p={"begin": begins[3:4]}, **given)
    assert np.array_equal(alone.q[0], batch.q[3])


@pytest.mark.parametrize("integrator", ["auto", "rk4"])
@pytest.mark.parametrize("h", [10.0, 2.5, 0.1])
def test_steps_from_outside_end_at_breaks(integrator, h):
    if integrator == "rk4":
        h = 0.01
    kernels = ncgen.compile(hanging(PENDULUM_PULSES["Heaviside"]))
    one, many = ncgen.start(kernels, integrator=integrator, rtol=1e-9), ncgen.start(kernels, 3, integrator=integrator, rtol=1e-9)
    for _ in range(round(10.0 / h)):
        one.step(h)
        many.step(h)
    assert one["A.x"] == pytest.approx(after_the_pulse(one.t), abs=3e-7)
    assert many["A.x"] == pytest.approx(3 * [one["A.x"]], abs=1e-14)


@pytest.mark.parametrize("formalism, integrator", FIXED)
def test_a_jump_at_the_start(formalism, integrator):
    """1 N from the first instant on, on 1 kg: x = t²/2 at every row."""
    kernels = ncgen.compile(pushed(lambda t, w, m: sympy.Heaviside(t)))
    run = ncgen.simulate(kernels, 1.0, formalism=formalism, integrator=integrator, max_step=0.1, points=11)
    np.testing.assert_allclose(run["s"], run.t**2 / 2, rtol=0, atol=1e-10 if formalism != "ali3p" else 1e-4)
    np.testing.assert_allclose(run["rate(s)"], run.t, rtol=0, atol=1e-10 if formalism != "ali3p" else 1e-4)
