"""Pulses that are smooth and narrow: no step passes one without a stage inside."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.special
import sympy
from sliding import sliding_block

import ncgen
from ncgen.mechanism.break_times import break_times
from ncgen.mechanism.time_laws import time_laws

DURATION, MASS = 10.0, 2.0


def _log_cosh(x):
    return np.logaddexp(x, -x)


LAWS = {
    "gaussian": lambda u: sympy.exp(-(u**2) / 2),
    "sech": lambda u: 1 / sympy.cosh(u),
    "lorentzian": lambda u: 1 / (1 + u**2) ** 2,
    "two tanh": lambda u: sympy.tanh(8 * u + 8) - sympy.tanh(8 * u - 8),
    "two atan": lambda u: sympy.atan(8 * u + 8) - sympy.atan(8 * u - 8),
}
"""Laws of u = (t − at) / s."""

INTEGRALS = {
    "gaussian": lambda u: math.sqrt(math.pi / 2) * scipy.special.erf(u / math.sqrt(2)),
    "sech": lambda u: 2 * np.arctan(np.tanh(u / 2)),
    "lorentzian": lambda u: (u / (1 + u**2) + np.arctan(u)) / 2,
    "two tanh": lambda u: (_log_cosh(8 * u + 8) - _log_cosh(8 * u - 8)) / 8,
    "two atan": lambda u: sum(sign * (x * np.arctan(x) - np.log1p(x**2) / 2) / 8 for sign, x in ((1, 8 * u + 8), (-1, 8 * u - 8))),
}
"""Their integrals over u."""


def pushed(law) -> ncgen.Model:
    """2 kg on a slide, pushed by size law((t − at) / s) + F in N."""
    m, slide = sliding_block("pushed", MASS)
    u = (m.time - m.parameter("at", 5.0)) / m.parameter("width", 1e-3)
    m.torque(slide, m.parameter("size", 1.0) * law(u) + m.input("F", "N"))
    return m


def gained(name: str, at: float, s: float, size: float, t: float) -> float:
    """The velocity (m/s) that a pulse has given at a time (s)."""
    integral = INTEGRALS[name]
    return size * s / MASS * float(integral((t - at) / s) - integral(-at / s))


OPTIONS = [
    {},
    {"engine": "python"},
    {"formalism": "coordinate-partitioning", "integrator": "dop853"},
    {"formalism": "coordinate-partitioning", "integrator": "radau"},
    {"formalism": "coordinate-partitioning", "integrator": "radau", "engine": "python"},
    {"formalism": "lagrange", "integrator": "bdf"},
    {"formalism": "lagrange", "integrator": "rk4", "max_step": 0.5},
]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_a_law_of_the_model_is_felt(name, options):
    """1 m/s more, by pulses from a millionth of the run on, at any time, at rest and in motion."""
    kernels = ncgen.compile(pushed(LAWS[name]))
    rng = np.random.default_rng(list(LAWS).index(name))
    cases = [(3e-4, 1e-3, 0.0), (0.02, 1e-3, 2.0), (3e-4, 1e-8, 2.0), (1e-5, 1e-8, 0.0), (0.3, 1e-3, 0.0)]
    for s, rtol, speed in cases[: 2 if "engine" in options or options.get("integrator") == "bdf" else None]:
        at = rng.uniform(0.2, 9.8)
        size = MASS / s / float(INTEGRALS[name](1e9) - INTEGRALS[name](-1e9))
        given = {"at": at, "width": s, "size": size}
        run = ncgen.simulate(kernels, DURATION, rtol=rtol, points=2, p=given, zd0={"s": speed}, **options)
        loose = 1e-2 if "max_step" in options else 5 * rtol
        assert run["rate(s)"][-1] - speed == pytest.approx(gained(name, at, s, size, DURATION), abs=loose), (s, rtol, speed, at)
        assert run.statistics.steps < 1000 or "max_step" in options or rtol < 1e-3


@pytest.mark.parametrize("rtol", [1e-3, 1e-8])
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_a_function_of_python_is_felt(options, rtol):
    """From a hundredth of the run on, a Gaussian's width at half its height."""
    kernels = ncgen.compile(pushed(LAWS["gaussian"]))
    rng = np.random.default_rng(5)
    for speed in (0.0, 2.0):
        at, s = rng.uniform(0.5, 9.5), 0.0425
        size = MASS / s / math.sqrt(2 * math.pi)
        pulses = {
            "gaussian": lambda t, at=at, s=s, k=size: k * math.exp(-(((t - at) / s) ** 2) / 2),
            "jumps": lambda t, at=at: 20.0 * (at < t < at + 0.1),
        }
        for kind, pulse in pulses.items():
            loose = 2e-2 if "max_step" in options else (100 if kind == "jumps" else 10) * rtol  # the place of a jump is nobody's to know
            run = ncgen.simulate(kernels, DURATION, rtol=rtol, points=2, p={"size": 0.0}, zd0={"s": speed}, inputs={"F": pulse}, **options)
            assert run["rate(s)"][-1] - speed == pytest.approx(1.0, abs=loose)


def test_batches_and_steppers_feel_it():
    kernels = ncgen.compile(pushed(LAWS["gaussian"]))
    s, rng = 4e-4, np.random.default_rng(8)
    size = MASS / s / math.sqrt(2 * math.pi)
    at = rng.uniform(0.5, 9.5, 40)
    batch = ncgen.simulate(kernels, DURATION, p={"at": at, "width": s, "size": size}, points=2, rtol=1e-6)
    assert batch.ok.all()
    np.testing.assert_allclose(batch.qd[:, -1, kernels.index["A.x"]], 1.0, rtol=0, atol=1e-5)
    np.testing.assert_allclose(batch.q[:, -1, kernels.index["A.x"]], DURATION - at, rtol=0, atol=1e-4)
    for h in (10.0, 1.0, 0.03):
        one = ncgen.start(kernels, p={"at": at[0], "width": s, "size": size}, rtol=1e-6)
        many = ncgen.start(kernels, 3, p={"at": at[0], "width": s, "size": size}, rtol=1e-6)
        for _ in range(math.ceil(DURATION / h)):
            one.step(h)
            many.step(h)
        assert one["rate(s)"] == pytest.approx(1.0, abs=1e-5)
        assert many["rate(s)"] == pytest.approx(3 * [1.0], abs=1e-5)


@pytest.mark.parametrize("given", [{"integrator": "rk4"}, {"integrator": "dop853", "rtol": 1e-8}], ids=str)
def test_a_pulse_has_a_gradient(given):
    """A rod on a hinge, without weight, is pushed at its end and turns by rate (T − at), the rate being the impulse over m L / 3. Ten steps
    of rk4 with those between breaks are too coarse for the time of the pulse, by which forces change a thousand times as fast."""
    m = ncgen.Model("turned")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    m.body("rod", [O, A], mass=MASS, inertia="rod")
    u = (m.time - m.parameter("at", 5.0)) / m.parameter("width", 1e-3)
    m.force(A, (0, m.parameter("size", 1.0) * LAWS["gaussian"](u)))
    kernels = ncgen.compile(m)
    s, at, rate = 1e-3, 6.543, 0.3
    size = rate * MASS / 3 / (s * math.sqrt(2 * math.pi))

    def height(q, qd):
        by_q = np.zeros_like(q)
        by_q[-1, kernels.index["A.y"]] = 1.0
        return q[-1, kernels.index["A.y"]], by_q, None

    found = ncgen.gradient(kernels, DURATION, 10, height, **given, p={"at": at, "width": s, "size": size})
    angle = rate * (DURATION - at)
    assert found.value == pytest.approx(math.sin(angle), rel=1e-3)
    assert found.derivatives["size"] == pytest.approx(math.cos(angle) * angle / size, rel=5e-3)
    assert found.derivatives["at"] == pytest.approx(-math.cos(angle) * rate, rel=2e-3) or given["integrator"] == "rk4"


def test_every_pulse_of_a_train_is_felt():
    """20 of them in a run, whose area in closed form has a Bessel function."""
    sharp = 1e8
    kernels = ncgen.compile(pushed(lambda u: sympy.exp(-sharp * sympy.sin(u * 1e-3 * 2 * sympy.pi) ** 2)))
    run = ncgen.simulate(kernels, DURATION, rtol=1e-6, points=2, p={"size": 1e4, "at": 0.2})
    assert run["rate(s)"][-1] == pytest.approx(1e4 / MASS * 20 * 0.5 * scipy.special.ive(0, sharp / 2), rel=1e-5)


SMOOTH = {
    "sine": lambda u: sympy.sin(u / 20),
    "its square": lambda u: sympy.sin(u / 20) ** 2,
    "two of them": lambda u: sympy.sin(u / 20) * sympy.cos(u / 33 + 1),
    "chirp": lambda u: sympy.sin(u**2 / 1e6),
    "polynomial": lambda u: (u / 1e3) ** 5 - u / 1e3,
    "decay": lambda u: sympy.exp(-u / 1e3) * sympy.cos(u / 50),
    "fourth power": lambda u: sympy.sin(u / 20) ** 4,
    "smooth square wave": lambda u: sympy.tanh(3 * sympy.sin(u / 20)),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_laws_that_vary_all_the_time_have_no_breaks(name):
    """Error control sees them; breaks would cost steps."""
    kernels = ncgen.compile(pushed(SMOOTH[name]), "numpy")
    for at in (5.0, 4.321, -2.0):
        given = dict(zip(kernels.parameters, kernels.p0, strict=True)) | {"at": at}
        assert not len(break_times(kernels, np.array(list(given.values())), 0.0, DURATION))


def test_a_model_without_narrow_laws_is_not_asked():
    kernels = ncgen.compile(pushed(lambda u: sympy.sin(u) + u**3), "numpy")
    assert not time_laws(kernels).has_breaks


def test_a_function_is_asked_less_often_than_a_thousand_times():
    kernels = ncgen.compile(pushed(lambda u: 0.0 * u), "numpy")
    for function in (lambda t: 1.0, lambda t: float(int(1000 * t) % 7), lambda t: float(t > 3), lambda t: 1 / (t - t)):
        calls = []
        break_times(kernels, kernels.p0, 0.0, DURATION, [lambda t, f=function, c=calls: c.append(t) or f(t)])
        assert 400 < len(calls) < 1000 and all(type(t) is float for t in calls)


def test_beside_a_jump_nothing_is_fast():
    """The acceleration of a driver, a sum of products of what jumps, gives no breaks besides the jump."""
    m = ncgen.Model("driven")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    m.body("block", [A], mass=MASS)
    m.drive(m.slide("s", O, A, axis), m.parameter("w", 1.3) * sympy.Max(0, m.time - m.parameter("t1", 0.62)) ** 2)
    kernels = ncgen.compile(m, "numpy")
    assert break_times(kernels, kernels.p0, 0.0, 2.0) == pytest.approx(np.array([[0.62, 0.62]]), rel=1e-14)
