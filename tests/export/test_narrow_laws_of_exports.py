"""Exported motions feel pulses that are smooth and narrow, whatever their parameters are: no step passes one without a stage inside."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from sliding import sliding_block
from test_breaks_of_exports import Moved, by_node

import ncgen
from ncgen.exchange.export import export
from ncgen.exchange.export.package import package

DURATION, LATEST = 10.0, 9.8


def sliding(law) -> ncgen.Model:
    """1 kg on a slide along A.x, pushed by law(t, at, width) in N."""
    m, slide = sliding_block("sliding")
    m.torque(slide, law(m.time, m.parameter("at", 5.0), m.parameter("width", 1e-3)))
    m.simulation(duration=DURATION)
    return m


def gaussian(t, at, width):
    return sympy.exp(-(((t - at) / width) ** 2) / 2) / width / sympy.sqrt(2 * sympy.pi)


LAWS = {
    "gaussian": (gaussian, lambda u: math.erf(u / math.sqrt(2)) / 2),
    "1/cosh": (lambda t, at, w: 1 / sympy.cosh((t - at) / w) / w / math.pi, lambda u: math.atan(math.tanh(u / 2)) * 2 / math.pi),
    "two tanh": (
        lambda t, at, w: (sympy.tanh((t - at) / w + 1) - sympy.tanh((t - at) / w - 1)) / (4 * w),
        lambda u: float(np.logaddexp(u + 1, -u - 1) - np.logaddexp(u - 1, 1 - u)) / 4,
    ),
    "lorentzian": (lambda t, at, w: w / (w**2 + (t - at) ** 2) / math.pi, lambda u: math.atan(u) / math.pi),
    "gaussian beside a sine": (
        lambda t, at, w: gaussian(t, at, w) * (1 + sympy.sin(t) ** 2) / (1 + sympy.sin(at) ** 2),
        lambda u: math.erf(u / math.sqrt(2)) / 2,
    ),
}
"""{name: (a law whose impulse is 1 N s, its integral over u = (t − at) / width, that of the last one but for terms of width²)}."""


@pytest.mark.parametrize("name", LAWS)
def test_no_pulse_is_missed(name, tmp_path):
    """Sixty random ones from a millionth of the run on: the velocity is their impulse, from steps of all lengths."""
    law, integral = LAWS[name]
    moved = Moved(sliding(law), tmp_path)
    speed = 4 + (moved.size - 4) // 3
    random = np.random.default_rng(3)
    for _ in range(60):
        at, width = random.uniform(0.2, LATEST), 10.0 ** random.uniform(-5, -3.5)
        expected = integral((DURATION - at) / width) - integral(-at / width)
        tolerance = 10.0 ** random.uniform(-8, -4)
        moved.start(at=at, width=width)
        for t in (*sorted(random.uniform(0.0, DURATION, random.integers(3))), DURATION):
            moved.advance(t, tolerance)
        assert moved.state[speed] == pytest.approx(expected, abs=3 * tolerance + width)
    moved.start(at=7.3, width=1e-3)
    for _ in range(100):
        moved.step(0.1)
    assert moved.state[speed] == pytest.approx(integral(2700) - integral(-7300), abs=5e-3)  # a pulse in a few steps of the fourth order


def test_a_law_of_which_nothing_is_known_for_all_parameters(tmp_path):
    """Where it is narrow as it is described it is looked at 10,000 times in the described motion."""
    moved = Moved(sliding(lambda t, at, w: sympy.exp(-(((t - at) / w) ** 4)) / (2 * w * math.gamma(1.25))), tmp_path)
    speed = 4 + (moved.size - 4) // 3
    for at in np.random.default_rng(5).uniform(0.2, LATEST, 20):
        assert moved.start(at=at, width=2e-3).advance(DURATION, 1e-7).state[speed] == pytest.approx(1.0, abs=1e-6)


def test_pulses_that_repeat_themselves(tmp_path):
    """Three of them in ten seconds, at at + k π."""
    law = lambda t, at, w: sympy.exp(-100 * sympy.sin(t - at) ** 2) * 100 * w  # noqa: E731
    moved = Moved(sliding(law), tmp_path)
    speed = 4 + (moved.size - 4) // 3
    each = math.pi * math.exp(-50) * float(sympy.besseli(0, 50).evalf())
    assert moved.start(at=2.0, width=1.0).advance(10.0, 1e-9).state[speed] == pytest.approx(300 * each, rel=1e-7)


def test_in_javascript(tmp_path):
    """x, from one long step, twenty, and many of 13 ms."""
    at = 6.3
    long, many, t, steps = by_node(sliding(gaussian), tmp_path, DURATION, at, 1e-3)
    assert [long, many] == pytest.approx([DURATION - at] * 2, abs=1e-6)
    assert steps == pytest.approx(t - at, abs=4e-3)  # a speed of 1 m/s within 1e-3, of the fourth order in steps of half a width


@pytest.mark.parametrize("mode", ["ModelExchange", "CoSimulation"])
def test_in_units(mode, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    export(sliding(gaussian), "fmu2", tmp_path)
    found = fmpy.simulate_fmu(
        str(tmp_path / "sliding.fmu"), fmi_type=mode, stop_time=DURATION, output_interval=2.5, relative_tolerance=1e-9,
        output=["A.x"], start_values={"at": 6.3},
    )  # fmt: skip
    assert found["A.x"][-1] == pytest.approx(DURATION - 6.3, abs=1e-6)


SLOW = {
    "sine": lambda t, at, w: sympy.sin(t * 50 + at) * w,
    "square of a sine": lambda t, at, w: sympy.sin(t / w + at) ** 2,
    "beats": lambda t, at, w: sympy.sin(50 * t) * sympy.sin(at * t) * w,
    "function of a sine": lambda t, at, w: sympy.exp(sympy.sin(t / w + at)),
    "polynomial": lambda t, at, w: (t - at) ** 3 / w,
    "decay": lambda t, at, w: at * (1 - sympy.exp(-t / w)),
}


@pytest.mark.parametrize("name", SLOW)
def test_what_is_not_narrow_costs_nothing(name):
    assert package(sliding(SLOW[name])).switching is None
