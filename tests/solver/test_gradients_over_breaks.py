"""Derivatives of motions whose laws change their formula in time: steps are split there, and a parameter that moves a jump is felt.

The motion is that of 1 kg on a spring of 4 N/m, x(T) = ∫ sin 2(T − s)/2 F(s) ds, so that mpmath says what everything must be.
"""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import ModelError
from ncgen.mechanism import taped

T, T1, T2, W, OMEGA = 3.0, 0.83, 2.14, 1.7, 2.0
KNOTS, VALUES = [0.0, 0.3, 0.5, 1.0], [0.0, 2.0, -1.0, 0.0]
AT = {"t1": T1, "t2": T2, "w": W}


@cache
def block(law, backend: str = "c", name: str = "block") -> ncgen.Mechanism:
    """1 kg on a slide with a spring, pushed by law(t, t1, t2, w, m) in N."""
    m = ncgen.Model(name)
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0, inertia="point")
    m.independent(s)
    parameters = [m.parameter(name, value) for name, value in AT.items()]
    m.torque(s, law(m.time, *parameters, m) - OMEGA**2 * s)
    return ncgen.compile(m, backend)


def interpolated(x):
    """The periodic table."""
    x = x - mpmath.floor(x)
    k = max(i for i in range(3) if x >= KNOTS[i])
    return VALUES[k] + (VALUES[k + 1] - VALUES[k]) * (x - KNOTS[k]) / (KNOTS[k + 1] - KNOTS[k])


def quintic(u):
    return u**3 * (10 - 15 * u + 6 * u**2)


def up(x):
    return 1 if x > 0 else 0


LAWS = {
    "Heaviside": (
        lambda t, t1, t2, w, m: sympy.Heaviside(t - t1) - 2 * w * sympy.Heaviside(w * t - t2),
        lambda t, t1, t2, w: up(t - t1) - 2 * w * up(w * t - t2),
        lambda t1, t2, w: [t1, t2 / w],
    ),
    "Piecewise": (
        lambda t, t1, t2, w, m: sympy.Piecewise((w * t, t < t1), (1 - t + t1, t <= t1 + w / 2), (0, True)),
        lambda t, t1, t2, w: w * t if t < t1 else 1 - t + t1 if t <= t1 + w / 2 else 0,
        lambda t1, t2, w: [t1, t1 + w / 2],
    ),
    "Max": (
        lambda t, t1, t2, w, m: sympy.Max(0, t - t1) * sympy.Min(w, t2**2 - t),
        lambda t, t1, t2, w: max(0, t - t1) * min(w, t2**2 - t),
        lambda t1, t2, w: [t1, t2**2 - w],
    ),
    "sign of a curve": (
        lambda t, t1, t2, w, m: sympy.sign(sympy.sin(2 * w * t + t1)) * t2,
        lambda t, t1, t2, w: mpmath.sign(mpmath.sin(2 * w * t + t1)) * t2,
        lambda t1, t2, w: [(k * mpmath.pi - t1) / (2 * w) for k in range(1, 4)],
    ),
    "table": (
        lambda t, t1, t2, w, m: t1 * m.table("law", KNOTS, VALUES, periodic=True)(w * t + t2),
        lambda t, t1, t2, w: t1 * interpolated(w * t + t2),
        lambda t1, t2, w: [x for turn in range(9) for k in KNOTS[:-1] if 0 < (x := (turn + k - t2) / w) < T],
    ),
    "smooth_step": (
        lambda t, t1, t2, w, m: w * ncgen.smooth_step(t, t1, t2),
        lambda t, t1, t2, w: w * (0 if t < t1 else 1 if t > t2 else quintic((t - t1) / (t2 - t1))),
        lambda t1, t2, w: [t1, t2],
    ),
}  # fmt: skip


def place(law: str, t1, t2, w):
    """x(T) by mpmath, from break to break."""
    _, force, breaks = LAWS[law]
    found = 0
    ends = [mpmath.mpf(0), *sorted(x for x in breaks(t1, t2, w) if 0 < x < T), mpmath.mpf(T)]
    for a, b in zip(ends, ends[1:], strict=False):
        found += mpmath.quad(
            lambda s: mpmath.sin(OMEGA * (T - s)) / OMEGA * force(a + (s - a) * (1 - mpmath.mpf(10) ** -30), t1, t2, w), [a, b]
        )
    return found


@cache
def expected(law: str) -> dict[str, float]:
    """x(T) and its derivatives by all parameters, by differences with 40 digits."""
    with mpmath.workdps(40):
        values = [mpmath.mpf(x) for x in AT.values()]
        found = {"x": float(place(law, *values))}
        for k, name in enumerate(AT):
            step = mpmath.mpf(10) ** -12
            ends = [place(law, *(v + sign * step * (i == k) for i, v in enumerate(values))) for sign in (1, -1)]
            found[name] = float((ends[0] - ends[1]) / (2 * step))
    return found


def end_of(q, qd):
    """x at the end."""
    by_q = 0 * q
    by_q[-1, 0] = 1.0  # A.x
    return q[-1, 0], by_q, None


WAYS = [
    ("rk4", 90, "c", 3e-6), ("dop853", 20, "c", 1e-9), ("dopri5", 60, "c", 1e-8), ("rk4", 90, "numpy", 3e-6), ("rattle", 600, "c", 4e-5),
    ("energy-momentum", 600, "c", 4e-5), ("generalized-alpha", 600, "c", 2e-4), ("generalized-alpha", 200, "numpy", 1.5e-3),
    ("trapezoidal", 600, "c", 4e-5), ("trapezoidal", 200, "numpy", 4e-4), ("rattle", 200, "numpy", 4e-4),
]  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("integrator", "steps", "backend", "close"), WAYS)
def test_a_parameter_that_moves_a_break(law, integrator, steps, backend, close):
    """Of jumps, corners and what is smooth: back and forth, against 40 digits, to the error of the steps."""
    kernels, wanted = block(LAWS[law][0], backend), expected(law)
    found = ncgen.gradient(kernels, T, steps, end_of, integrator)
    forward = ncgen.sensitivities(kernels, T, steps, integrator)
    assert found.value == pytest.approx(wanted["x"], abs=close)
    for name in AT:
        assert found.slopes[name] == pytest.approx(wanted[name], rel=0, abs=close * 3), name
    assert list(found.slopes.values()) == pytest.approx(forward.q_by[-1, 0].tolist(), rel=1e-9, abs=1e-11)
    assert forward.q[-1, 0] == found.value


def test_a_long_run_in_segments_feels_jumps(monkeypatch):
    kernels = block(LAWS["Heaviside"][0])
    whole = ncgen.gradient(kernels, T, 40, end_of)
    monkeypatch.setattr(taped, "SEGMENT", 7 * 8 * taped.step_size("rk4", kernels.n))
    parts = ncgen.gradient(kernels, T, 40, end_of)
    assert parts.slopes == pytest.approx(whole.slopes, rel=1e-12)
    forward = ncgen.sensitivities(kernels, T, 40)
    assert forward.q_by[-1, 0].tolist() == pytest.approx(list(whole.slopes.values()), rel=1e-11)


def test_steps_by_tolerance_feel_jumps():
    found, wanted = ncgen.gradient(block(LAWS["Heaviside"][0]), T, 2, end_of, "dop853", 1e-11), expected("Heaviside")
    assert [found.value, *found.slopes.values()][:4] == pytest.approx(list(wanted.values()), abs=1e-9)


REFUSED = {
    "two that do not move together": (lambda t, t1, t2, w, m: sympy.Heaviside(t - t1) * sympy.Heaviside(t - T1), "t1"),
    "the start": (lambda t, t1, t2, w, m: sympy.Heaviside(t - t1 + T1), "t1"),
    "an input in the argument": (lambda t, t1, t2, w, m: sympy.Heaviside(m.input("F", "N") - w), "w"),
}


@pytest.mark.parametrize("integrator", ["rk4", "rattle", "trapezoidal"])
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_known_is_refused_by_name(case, integrator):
    law, name = REFUSED[case]
    kernels = block(law)
    inputs = {"F": ([0.0, T], [0.0, 4.0])} if kernels.inputs else None
    others = [other for other in (*AT, "s") if other != name]
    for call in (lambda **more: ncgen.gradient(kernels, T, 50, end_of, **more), lambda **more: ncgen.sensitivities(kernels, T, 50, **more)):
        with pytest.raises(
            ModelError, match=f"^block: there is no derivative by {name}, which moves .*; give {name} another value or leave"
        ):
            call(integrator=integrator, inputs=inputs)
        call(integrator=integrator, inputs=inputs, by=others)


@pytest.mark.parametrize("law", ["Heaviside", "Max"])
def test_second_derivatives_by_what_moves_a_corner_are_refused(law):
    with pytest.raises(
        ModelError, match=r"^block: there are no second derivatives, since t1, t2(, w)? may move the corner or jump of a law at t = "
    ):
        ncgen.hessian(block(LAWS[law][0]), T, 50, lambda q, qd: (*end_of(q, qd), None))


def test_second_derivatives_over_breaks_that_move_smoothly():
    """A smooth step has two continuous derivatives."""
    kernels = block(LAWS["smooth_step"][0])
    found = ncgen.hessian(kernels, T, 100, lambda q, qd: (*end_of(q, qd), None))
    for k, name in enumerate(AT):
        ends = [ncgen.gradient(kernels, T, 100, end_of, p={name: AT[name] + step}).slopes for step in (1e-4, -1e-4)]
        wanted = [(ends[0][other] - ends[1][other]) / 2e-4 for other in AT]
        np.testing.assert_allclose(found.products[:3, k], wanted, rtol=0, atol=2e-6)


@pytest.mark.parametrize("integrator", ["rk4", "rattle", "energy-momentum", "generalized-alpha", "trapezoidal"])
@pytest.mark.parametrize("hold", ["zero", "linear", "cubic"])
def test_no_sample_is_passed_over(integrator, hold):
    """Steps five times as long as what lies between samples."""
    kernels = block(lambda t, t1, t2, w, m: m.input("F", "N"))
    times = np.linspace(0.0, T, 301)
    found = ncgen.gradient(kernels, T, 60, end_of, integrator, inputs={"F": (times, np.cos(5 * times), hold)})
    slopes = found.by_inputs["F"]
    wanted = np.sin(OMEGA * (T - times)) / OMEGA * 0.01
    if hold == "zero":
        wanted[:-1] = (wanted[:-1] + wanted[1:]) / 2
    np.testing.assert_allclose(slopes[12:-12], wanted[12:-12], rtol=0, atol=1e-5)


def test_steps_are_those_of_a_run():
    """The same steps, whether derivatives are wanted or not: the value of explicit steps is that of the run, bit for bit."""
    kernels = block(LAWS["Heaviside"][0])
    run = ncgen.simulate(kernels, T, formalism="lagrange", integrator="rk4", max_step=T / 40, points=41)
    assert ncgen.gradient(kernels, T, 40, end_of).value == pytest.approx(run.q[-1, 0], rel=0, abs=1e-14)
