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
def block(law, backend: str = "c") -> ncgen.Mechanism:
    return ncgen.compile(model(law), backend)


def model(law) -> ncgen.Model:
    """1 kg on a slide with a spring, pushed by law(t, t1, t2, w, m) in N."""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0, inertia="point")
    m.independent(s)
    parameters = [m.parameter(name, value) for name, value in AT.items()]
    m.torque(s, law(m.time, *parameters, m) - OMEGA**2 * s)
    return m


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
    ("rk4", 60, "c", 1e-5), ("dop853", 20, "c", 1e-9), ("dopri5", 40, "c", 2e-7), ("rattle", 60, "c", 4e-3),
    ("energy-momentum", 60, "c", 4e-3), ("generalized-alpha", 60, "c", 6e-3), ("trapezoidal", 60, "c", 4e-3), ("rk4", 20, "numpy", 1e-3),
    ("rattle", 20, "numpy", 3e-2), ("generalized-alpha", 20, "numpy", 6e-2), ("trapezoidal", 20, "numpy", 4e-2),
]  # fmt: skip


@pytest.mark.parametrize("law", [law if law in ("Heaviside", "smooth_step") else pytest.param(law, marks=pytest.mark.slow) for law in LAWS])
@pytest.mark.parametrize(("integrator", "steps", "backend", "close"), WAYS)
def test_a_parameter_that_moves_a_break(law, integrator, steps, backend, close):
    """Of jumps, corners and what is smooth: back and forth, against 40 digits, to the error of the steps.

    A law that changes its sign three times takes twice as many steps to the same error, which falls with their square.
    """
    kernels, wanted = block(LAWS[law][0], backend), expected(law)
    steps *= 2 if law == "sign of a curve" else 1
    found = ncgen.gradient(kernels, T, steps, end_of, integrator=integrator)
    forward = ncgen.sensitivities(kernels, T, steps, integrator=integrator)
    assert found.value == pytest.approx(wanted["x"], abs=close)
    for name in AT:
        assert found.derivatives[name] == pytest.approx(wanted[name], rel=0, abs=close), name
    assert list(found.derivatives.values()) == pytest.approx(forward.q_by[-1, 0].tolist(), rel=1e-9, abs=1e-11)
    assert forward.q[-1, 0] == found.value


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("integrator", "backend"), [(way[0], way[2]) for way in WAYS if way[3] > 3e-4])
def test_errors_of_implicit_steps_fall_with_their_square(law, integrator, backend):
    """Whatever lies between the instants of the grid."""
    kernels, wanted, off = block(LAWS[law][0], backend), expected(law), []
    for steps in (150, 600):
        found = ncgen.gradient(kernels, T, steps, end_of, integrator=integrator).derivatives
        off.append(max(abs(found[name] - wanted[name]) for name in AT))
    assert off[1] < off[0] / 10


def test_many_motions():
    """One after the other where a law has breaks in the run, side by side where none has; a state without a derivative says why."""
    kernels = block(LAWS["Heaviside"][0])
    t1 = np.array([T1, 1.2, 0.0])
    found = ncgen.gradient(kernels, T, 20, end_of, integrator="dop853", p={"t1": t1})
    for k in (0, 1):
        alone = ncgen.gradient(kernels, T, 20, end_of, integrator="dop853", p={"t1": t1[k]})
        assert found.values[k] == alone.value
        assert found.derivatives[k].tolist() == list(alone.derivatives.values())
    assert found.by("t1")[0] == pytest.approx(expected("Heaviside")["t1"], abs=1e-9)
    assert found.ok.tolist() == [True, True, False] and np.isnan(found.values[2]) and np.all(np.isnan(found.derivatives[2]))
    assert "no derivative by t1" in found.status[2]
    assert not np.any(ncgen.gradient(kernels, 0.5, 20, end_of, p={"t1": t1[:2]}).alone)


def test_many_motions_with_a_break_in_their_last_step():
    kernels, t1 = block(LAWS["Heaviside"][0]), np.array([2.9, 2.95])
    found = ncgen.gradient(kernels, T, 20, end_of, p={"t1": t1, "t2": np.full(2, 9.0)})
    for k in range(2):
        alone = ncgen.gradient(kernels, T, 20, end_of, p={"t1": t1[k], "t2": 9.0})
        assert found.derivatives[k].tolist() == list(alone.derivatives.values())


def test_a_long_run_in_segments_feels_jumps(monkeypatch):
    kernels = block(LAWS["Heaviside"][0])
    whole = ncgen.gradient(kernels, T, 40, end_of)
    monkeypatch.setattr(taped, "SEGMENT", 7 * 8 * taped.step_size("rk4", kernels.n))
    parts = ncgen.gradient(kernels, T, 40, end_of)
    assert parts.derivatives == pytest.approx(whole.derivatives, rel=1e-12)
    forward = ncgen.sensitivities(kernels, T, 40)
    assert forward.q_by[-1, 0].tolist() == pytest.approx(list(whole.derivatives.values()), rel=1e-11)


def test_steps_by_tolerance_feel_jumps():
    found, wanted = ncgen.gradient(block(LAWS["Heaviside"][0]), T, 2, end_of, integrator="dop853", rtol=1e-11), expected("Heaviside")
    assert [found.value, *found.derivatives.values()][:4] == pytest.approx(list(wanted.values()), abs=1e-9)


def of_an_input(t, t1, t2, w, m):
    return sympy.Heaviside(m.input("F", "N") - w)


REFUSED = {
    "two that do not move together": (LAWS["Heaviside"][0], ("t1", "t2", "w"), {"t1": T2 / W}),
    "the start": (LAWS["Heaviside"][0], ("t1",), {"t1": 0.0}),
    "an input in the argument": (of_an_input, ("w",), {}),
}


@pytest.mark.parametrize("integrator", ["rk4", "rattle", "trapezoidal"])
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_known_is_refused_by_name(case, integrator):
    law, names, p = REFUSED[case]
    kernels = block(law)
    inputs = {"F": ([0.0, T], [0.0, 4.0])} if kernels.inputs else None

    def calls(**more):
        ncgen.gradient(kernels, T, 20, end_of, integrator=integrator, p=p, inputs=inputs, **more)
        ncgen.sensitivities(kernels, T, 20, integrator=integrator, p=p, inputs=inputs, **more)

    for name in names:
        said = f"^block: there is no derivative by {name}, which moves .*; give {name} another value or leave"
        with pytest.raises(ModelError, match=said):
            ncgen.gradient(kernels, T, 20, end_of, integrator=integrator, by=name, p=p, inputs=inputs)
        with pytest.raises(ModelError, match=said):
            ncgen.sensitivities(kernels, T, 20, integrator=integrator, by=name, p=p, inputs=inputs)
    with pytest.raises(ModelError, match="there is no derivative by"):
        calls()
    calls(by=[name for name in (*AT, "s") if name not in names])


def test_a_study_is_refused_what_it_asks_for_alone():
    given = {"design": "list", "steps": 20, "duration": T}
    found = ncgen.study(model(LAWS["Heaviside"][0]), {"t1": [T1, 0.0]}, keep=["gradient(s, w)"], **given)
    for k, t1 in enumerate((T1, 0.0)):
        wanted = ncgen.gradient(block(LAWS["Heaviside"][0]), T, 20, end_of, by="w", p={"t1": t1}).derivatives["w"]
        assert found["gradient(s, w)"][k] == pytest.approx(wanted, rel=1e-12)
    found = ncgen.study(model(LAWS["Heaviside"][0]), {"t1": [0.0]}, keep=["gradient(s, w)", "gradient(s, t1)"], **given)
    assert np.isnan(found["gradient(s, t1)"][0]) and "no gradient: block: there is no derivative by t1, which moves" in str(found.messages)


def test_a_corner_at_the_start_is_no_jump():
    """Of a mechanism at rest, where all accelerations are rounding: Max(0, t − t₁) Min(w, t₂² − t) by t₁ is −Min(w, t₂² − t)."""
    found = ncgen.gradient(block(LAWS["Max"][0]), T, 20, end_of, integrator="dop853", p={"t1": 0.0})
    wanted = -mpmath.quad(lambda s: mpmath.sin(OMEGA * (T - s)) / OMEGA * min(W, T2**2 - s), [0, T2**2 - W, T])
    assert found.derivatives["t1"] == pytest.approx(float(wanted), abs=1e-9)


@pytest.mark.parametrize("law", ["Heaviside", "Max"])
def test_second_derivatives_by_what_moves_a_corner_are_refused(law):
    with pytest.raises(
        ModelError, match=r"^block: there are no second derivatives, since t1, t2, w may move the corner or jump of a law in time; take "
    ):
        ncgen.hessian(block(LAWS[law][0]), T, 50, lambda q, qd: (*end_of(q, qd), None))


def test_second_derivatives_over_breaks_that_move_smoothly():
    """A smooth step has two continuous derivatives."""
    kernels = block(LAWS["smooth_step"][0])
    found = ncgen.hessian(kernels, T, 100, lambda q, qd: (*end_of(q, qd), None))
    for k, name in enumerate(AT):
        ends = [ncgen.gradient(kernels, T, 100, end_of, p={name: AT[name] + step}).derivatives for step in (1e-4, -1e-4)]
        wanted = [(ends[0][other] - ends[1][other]) / 2e-4 for other in AT]
        np.testing.assert_allclose(found.products[:3, k], wanted, rtol=0, atol=2e-6)


@cache
def pushed_by_an_input():
    return block(lambda t, t1, t2, w, m: m.input("F", "N"))


@pytest.mark.parametrize("integrator", ["rk4", "rattle", "energy-momentum", "generalized-alpha", "trapezoidal"])
@pytest.mark.parametrize("hold", ["zero", "linear", "cubic"])
def test_no_sample_is_passed_over(integrator, hold):
    """Steps five times as long as what lies between samples."""
    times = np.linspace(0.0, T, 101)
    found = ncgen.gradient(pushed_by_an_input(), T, 20, end_of, integrator=integrator, inputs={"F": (times, np.cos(5 * times), hold)})
    slopes = found.by_inputs["F"]
    wanted = np.sin(OMEGA * (T - times)) / OMEGA * 0.03
    if hold == "zero":
        wanted[:-1] = (wanted[:-1] + wanted[1:]) / 2
    np.testing.assert_allclose(slopes[12:-12], wanted[12:-12], rtol=0, atol=1e-4)


def test_steps_are_those_of_a_run():
    """The same steps, whether derivatives are wanted or not: the value of explicit steps is that of the run, bit for bit."""
    kernels = block(LAWS["Heaviside"][0])
    run = ncgen.simulate(kernels, T, formalism="lagrange", integrator="rk4", max_step=T / 40, points=41)
    assert ncgen.gradient(kernels, T, 40, end_of).value == pytest.approx(run.q[-1, 0], rel=0, abs=1e-14)
