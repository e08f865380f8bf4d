"""Min, Max, Heaviside and Piecewise in forces: values and derivatives against sympy's own, and a motion against SciPy from kink to kink."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate
import sympy

import ncgen
from ncgen import ModelError
from ncgen.exchange.grammar import parse_expression
from ncgen.model.kinks import without_kinks

X, Y = sympy.symbols("x y", real=True)

EXPRESSIONS = [
    sympy.Max(0, X),
    sympy.Min(X, Y),
    sympy.Max(X, Y, 0.1),
    sympy.Min(sympy.Max(X * Y, -0.3), 0.3),
    sympy.Heaviside(X - Y) * Y**2,
    sympy.Piecewise((X**2, X < 0), (sympy.sin(X), True)),
    sympy.Piecewise((Y, X <= -0.5), (X * Y, Y >= X), (1 + X, True)),
    sympy.Piecewise((0, X > 0.2), (X, X >= -0.2), (Y, True)),
    sympy.Piecewise((X**2, (X > -0.2) & (Y < 0.3)), (Y, True)),
    sympy.Piecewise((X, (X < -0.4) | (Y > X) | (Y < -0.5)), (X * Y, ~((X > 0.2) & (Y < 0.6))), (1, True)),
]


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_values_are_sympys(expression):
    plain = sympy.lambdify((X, Y), without_kinks(expression, ""), [{"sign": np.sign}, "numpy"])
    for x, y in np.random.default_rng(5).uniform(-1, 1, (40, 2)):
        assert plain(x, y) == pytest.approx(float(expression.subs({X: x, Y: y})), rel=1e-15, abs=1e-16)


def spring_with_play() -> ncgen.Model:
    """A block of 1 kg: a spring beyond a play of 0.1, and a motor that saturates."""
    m = ncgen.Model("play")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0)
    m.torque(s, -200 * sympy.Max(s - 0.1, 0) - 200 * sympy.Min(s + 0.1, 0))
    m.torque(s, sympy.Min(sympy.Max(20 * sympy.sin(5 * m.time), -3), 3))
    m.independent(s)
    return m


def test_a_motion():
    """Error control finds the kinks; SciPy is stopped at them and begins anew."""

    def rates(t, y):
        play = -200 * max(y[0] - 0.1, 0) - 200 * min(y[0] + 0.1, 0)
        return [y[1], play + min(max(20 * np.sin(5 * t), -3), 3)]

    exact = scipy.integrate.solve_ivp(rates, (0, 2), [0, 0], method="DOP853", rtol=1e-12, atol=1e-12, max_step=2e-3)
    run = ncgen.simulate(ncgen.compile(spring_with_play()), 2.0, rtol=1e-10, points=3)
    assert run["s"][-1] == pytest.approx(exact.y[0, -1], abs=1e-8)


@pytest.mark.parametrize("place", [-0.3, 0.05, 0.4])
def test_derivatives(place):
    """K of the springs is 200 beyond the play and nothing within."""
    kernels = ncgen.compile(spring_with_play())
    q = kernels.q0 + place
    zero = np.zeros(kernels.n)
    K = kernels.stiffness(q, zero, zero, np.zeros(kernels.m)).toarray()
    assert K[kernels.index["s"], kernels.index["s"]] == pytest.approx(0.0 if abs(place) < 0.1 else 200.0)


def test_constraints_with_kinks():
    """A cam of two slopes drives a slide: velocities and γ beside the kink."""
    m = ncgen.Model("cam")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0)
    m.drive(s, sympy.Piecewise((m.time**2, m.time < 1), (2 * m.time - 1, True)))
    run = ncgen.simulate(ncgen.compile(m), 2.0, points=5)
    assert np.allclose(run["s"], [0, 0.25, 1.0, 2.0, 3.0], atol=1e-9)
    assert np.allclose(run["rate(s)"], [0, 1, 2, 2, 2], atol=1e-9)


def test_files_say_min_and_max(tmp_path):
    known = {"x", "y"}
    assert parse_expression("max(x, 0) - min(2*x, y)", known) == without_kinks(sympy.Max(X, 0) - sympy.Min(2 * X, Y), "")
    from ncgen.exchange.toml_writer import to_toml

    text = to_toml(spring_with_play())
    (tmp_path / "play.toml").write_text(text)
    assert to_toml(ncgen.load(tmp_path / "play.toml")) == text


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        (sympy.Piecewise((X, X < 1)), "a Piecewise whose last case is not for all others"),
        (sympy.Piecewise((X, sympy.Eq(X, 1)), (Y, True)), "is no condition of a Piecewise here; compare two expressions"),
        (sympy.Max(*sympy.symbols("a0:12", real=True)), "choices within choices make an expression of"),
    ],
)
def test_refusals(expression, said):
    m = spring_with_play()
    with pytest.raises(ModelError, match=said):
        m.torque(m.elements["s"], expression)


def test_nested_choices_in_a_file_are_bounded():
    text = "x"
    for _ in range(30):
        text = f"max({text}, y)"
    with pytest.raises(ModelError):
        parse_expression(text, {"x", "y"})
