"""Gradients that a study keeps: those of single calls, by the names of what they are taken by, and right."""

from __future__ import annotations

import numpy as np
import pytest
from study_models import swing
from test_studies import pendulum

import ncgen
from ncgen.studies.extremes import weights

LENGTHS, RATES = [0.8, 1.0, 1.2], [1.5, 1.0, 2.0]
VARIED = {"length": LENGTHS, "start(rate(psi))": RATES}
REST = ("gradient(square, length)", "gradient(psi, mass)", "gradient(psi, start(psi))")
KEEP = ("psi", "max(psi)", "gradient(psi)", "gradient(max(psi))", *REST)
STEPS = 200


@pytest.fixture(scope="module")
def found():
    return ncgen.study(swing(), VARIED, design="list", keep=KEEP, steps=STEPS, duration=2.0, rtol=1e-9)


def test_columns_have_the_names_of_what_they_are_taken_by(found):
    both = ("length", "start(rate(psi))")
    each = [f"gradient({what}, {name})" for what in ("psi", "max(psi)") for name in both]
    assert found.about["kept"] == ["psi", "max(psi)", *each, *REST]
    assert found.ok.all() and not found.messages and "gradients by 200 steps of rk4" in found.about["made_with"]


def test_gradients_are_those_of_single_calls(found):
    """To the last bit, and what is kept beside them is what it is without them."""
    kernels = ncgen.compile(swing())

    def end(q, qd):
        by_q = np.zeros_like(q)
        by_q[-1, kernels.index["psi"]] = 1.0
        return q[-1, kernels.index["psi"]], by_q, None

    for i, (length, rate) in enumerate(zip(LENGTHS, RATES, strict=True)):
        own = ncgen.gradient(kernels, 2.0, STEPS, end, p={"length": length}, zd0={"psi": rate}).derivatives
        for column, name in (("length", "length"), ("start(rate(psi))", "rate(psi)"), ("mass", "mass"), ("start(psi)", "psi")):
            assert found[f"gradient(psi, {column})"][i] == own[name], column
    plain = ncgen.study(swing(), VARIED, design="list", keep=["psi", "max(psi)"], duration=2.0, rtol=1e-9)
    assert np.array_equal(plain["psi"], found["psi"]) and np.array_equal(plain["max(psi)"], found["max(psi)"])


def test_gradients_are_those_of_another_program(found):
    """Differences of SciPy's motion of the same rod, whose period does not know its mass; the top from energy, cos ψ = 1 − ω² L/(3 g)."""
    h = 1e-4
    for i, (length, rate) in enumerate(zip(LENGTHS, RATES, strict=True)):
        sides = {
            "length": [pendulum(length + s, rate, [0.0, 2.0]) for s in (h, -h)],
            "start(rate(psi))": [pendulum(length, rate + s, [0.0, 2.0]) for s in (h, -h)],
        }
        for name, (up, down) in sides.items():
            assert found[f"gradient(psi, {name})"][i] == pytest.approx((up - down)[0, -1] / (2 * h), abs=2e-6)
        up, down = sides["length"]
        assert found["gradient(square, length)"][i] == pytest.approx((up**2 - down**2)[1, -1] / (2 * h), abs=2e-5)
        top = np.arccos(1 - rate**2 * length / (3 * 9.81))
        own = [found[f"gradient(max(psi), {name})"][i] for name in sides]
        assert own == pytest.approx([rate**2 / (3 * 9.81 * np.sin(top)), 2 * rate * length / (3 * 9.81 * np.sin(top))], abs=2e-6)
    assert found["gradient(psi, mass)"] == pytest.approx(0.0, abs=1e-12)


def test_a_start_that_is_given_in_part_follows_parameters():
    """Two rods that hang: the first one's start is given, the second one's is where a parameter puts it."""
    m = ncgen.Model("two")
    a, b = m.parameter("a", 0.5), m.parameter("b", 1.0)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0, -1))
    C, D = m.point("C", (3, 0), fixed=True), m.point("D", (3 + a, -b))
    x, z = m.vector("x", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("first", [A, B], mass=1.0, inertia=0.1)
    m.body("second", [C, D], mass=1.0, inertia=0.1)
    m.angle("psi", x, B - A, z)
    m.angle("phi", x, D - C, z)
    m.gravity((0, -9.81, 0))
    m.independent("psi", "phi")
    h, keep = 1e-4, ["phi", "gradient(phi, a)", "gradient(psi, a)", "gradient(psi, start(psi))"]
    found = ncgen.study(m, {"a": [0.5 - h, 0.5, 0.5 + h], "start(psi)": [0.3]}, keep=keep, steps=200, duration=0.5, rtol=1e-11)
    assert found["gradient(phi, a)"][1] == pytest.approx((found["phi"][2] - found["phi"][0]) / (2 * h), rel=1e-6)
    assert abs(found["gradient(phi, a)"][1]) > 0.05 and found["gradient(psi, a)"] == pytest.approx(0.0, abs=1e-12)
    assert found["gradient(psi, start(psi))"][1] < 0.9  # the first rod does move


def test_a_top_between_instants():
    """A parabola through three instants: its top is c − b²/(4 a), which its coefficients b and c change."""
    t = np.array([0.0, 1.0, 2.0])
    by_x, by_rates = weights(t, -((t - 1.3) ** 2), -2 * (t - 1.3), largest=True)
    assert by_x.sum() == pytest.approx(1.0) and by_x @ t + by_rates.sum() == pytest.approx(1.3)
    assert [a.tolist() for a in weights(t, np.array([3.0, 1.0, 2.0]), None, largest=False)] == [[0, 1, 0], [0, 0, 0]]


def test_too_few_steps_are_said():
    """Of rows that arrived."""
    few = ncgen.study(swing(), {"length": [1.0]}, keep="gradient(psi)", steps=12, duration=2.0, zd0={"psi": 2.0})
    assert few.ok.all() and "its 12 steps end" in few.messages[0] and "take more steps" in few.messages[0]


@pytest.mark.parametrize(
    "keep, options, said",
    [
        ("gradient(phi)", {}, "keep: swing has no coordinate or output phi"),
        ("gradient(psi, lenght)", {}, r"keep, gradient\(psi, lenght\): the mechanism has no parameter lenght; it has length, mass, g"),
        ("gradient(psi, start(phi))", {}, "has no free coordinate phi"),
        ("gradient(history(psi))", {}, "a gradient is of a value at the end, or of max"),
        ("gradient(energy_drift)", {}, "a gradient is of a value at the end"),
        (["gradient(psi)", "gradient(psi, length)"], {}, r"gradient\(psi, length\) is named twice"),
        ("gradient(psi)", {"steps": None}, "steps: gradient.* goes through steps of equal length"),
        ("psi", {}, "steps: gradient"),
        ("gradient(psi)", {"steps": 0}, "steps is 0"),
        ("gradient(psi, start(B.x))", {}, "B.x is not independent at the start; psi are, others are chosen by z"),
        ("gradient(psi)", {"stop": {"psi": 0.3}}, "stop is given, and such runs have no derivative"),
    ],
)
def test_mistakes_are_named(keep, options, said):
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        ncgen.study(swing(), {"length": [1.0]}, **{"keep": keep, "steps": 10, "duration": 1.0, **options})
    assert "\n" not in str(caught.value)


def test_in_a_file(tmp_path):
    from ncgen.exchange.toml_writer import to_toml
    from ncgen.studies.file import read_study

    (tmp_path / "swing.toml").write_text(to_toml(swing()), encoding="utf-8")
    text = 'model = "swing.toml"\nkeep = ["gradient(psi)"]\nsteps = 50\n\n[vary]\nlength = [0.9, 1.1]\n\n[simulation]\nduration = 1.0\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    study = read_study(tmp_path / "study.toml")
    assert study.steps == 50 and [column.word for column in study.kept] == ["gradient(psi, length)"]
