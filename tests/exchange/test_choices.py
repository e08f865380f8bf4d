"""Choices in model files, what is no condition, and laws with choices on their way from Python into a file and back."""

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import ModelError
from ncgen.exchange.grammar import parse_expression
from ncgen.exchange.toml_writer import to_toml

t, x = sympy.symbols("t x", real=True)

CHOICES = {
    "piecewise((2*t, t < 1), x)": lambda t, x: 2 * t if t < 1 else x,
    "piecewise((1, (t > 0.4) & (x <= 0.2)), (2, t > 0.9), 0)": lambda t, x: 1 if t > 0.4 and x <= 0.2 else 2 if t > 0.9 else 0,
    "piecewise((1, (t < 0.3) | (t >= 1.2) | (x > 0)), 0)": lambda t, x: float(t < 0.3 or t >= 1.2 or x > 0),
    "piecewise((x, not (t < 1 and x > 0)), -x)": lambda t, x: x if not (t < 1 and x > 0) else -x,
    "3*piecewise((x, 0.25 < t < 0.75), 1)": lambda t, x: 3 * (x if 0.25 < t < 0.75 else 1),
    "piecewise((1, ~(x > t)), piecewise((2, t < 1), 3))": lambda t, x: 1 if not x > t else 2 if t < 1 else 3,
}


@pytest.mark.parametrize("text", CHOICES)
def test_choices_mean_what_python_means(text):
    found = sympy.lambdify((t, x), parse_expression(text, {"t", "x"}), [{"sign": np.sign}, "numpy"])
    for place in np.random.default_rng(3).uniform((0, -1), (1.5, 1), (60, 2)):
        assert found(*place) == pytest.approx(CHOICES[text](*place), abs=1e-15)  # of numbers up to 3


REFUSED = {
    "piecewise(t, x)": r"write a choice as piecewise\(\(value, condition\), …, otherwise\)",
    "piecewise((t, x < 1))": "write a choice as",
    "piecewise((t, x < 1), (1, True))": "write a choice as",
    "piecewise((t, x), 1)": "a condition compares expressions",
    "piecewise((t, x == 1), 1)": "a condition compares expressions",
    "piecewise((t, x > 1 & t < 2), 1)": "is not allowed in an expression",
    "piecewise((t, y > 1), 1)": "y is no coordinate",
    "t > 1": "is not allowed in an expression",
    "(t > 1) & (x > 1)": "is not allowed in an expression",
    f"piecewise((t, {'not ' * 60}(x > 1)), 1)": "conditions stand more than 50 deep",
    "piecewise(" + ", ".join(f"(t, x > {k})" for k in range(900)) + ", 1)": (
        "900 comparisons in a choice; 64 are allowed, take a table instead"
    ),
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_choice(text):
    with pytest.raises(ModelError, match=REFUSED[text]) as caught:
        parse_expression(text, {"t", "x"})
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


LAWS = [
    sympy.Max(0, t - 0.3),
    sympy.Heaviside(t - 0.3),
    sympy.Piecewise((t, (t < 0.6) & (t > 0.3)), (0.5, True)),
    sympy.Piecewise((1, (t < 0.2) | (t > 0.5)), (0, True)),
]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_laws_with_choices_go_through_files(law, tmp_path):
    """In the list of a force as well as by itself."""
    m = ncgen.Model("m")
    P = m.point("P", (0, 0))
    m.body("b", [P], mass=1.0)
    m.force(P, (law, 0))
    (tmp_path / "m.toml").write_text(to_toml(m), encoding="utf-8")
    again = ncgen.load(tmp_path / "m.toml")
    runs = [ncgen.simulate(ncgen.compile(each, "numpy"), 1.0, points=5, rtol=1e-9) for each in (m, again)]
    assert np.allclose(runs[0].q, runs[1].q, rtol=1e-9, atol=1e-12)
