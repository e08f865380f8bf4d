"""`bench.py robot`: what was written by hand and what others have stands next to `ncgen bench`."""

import shutil

import numpy as np
import pytest

import ncgen
from benchmarks import students
from benchmarks.positions import worst_errors
from benchmarks.rivals import lambdified, octave
from ncgen.comparisons import falls
from ncgen.comparisons.bench import _simulation_rows, kernel_records
from ncgen.comparisons.rivals import handwritten
from ncgen.report import clock
from ncgen.report.document import aligned


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the times are not looked at."""
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))
    monkeypatch.setattr(falls, "TOLERANCES", (1e-6,))
    monkeypatch.setattr(falls, "STEPS", (100,))
    monkeypatch.setattr(falls, "REPEATS", 1)


@pytest.mark.slow
def test_sympy_beside_the_kernels_of_the_robot(robot_model):
    """The same numbers; lambdify prints 15 digits."""
    records = [r for r in kernel_records(robot_model, 1e9, lambdified.rivals) if r["tool"].startswith("sympy")]
    assert {r["case"] for r in records} == {"phi", "phi_q", "gamma", "all"}
    assert all(r["error"] < 2e-15 for r in records)


def test_the_fall_by_hand(robot, monkeypatch):
    """Students reach the known end state, each in his own way; Octave would take a quarter of a minute."""
    end = [0.0] * 6
    for name, value in handwritten(robot).END.items():
        end[int(name[-1]) - 1] = value
    octaves = [{"tool": tool, "seconds": 1.0, "psi": end, "evaluations": 400} for tool in ("RK4", "ode45")]
    monkeypatch.setattr(students.octave, "available", lambda kernels: True)
    monkeypatch.setattr(students.octave, "falls", lambda kernels, **settings: octaves)
    records = {r["tool"]: r for r in falls.fall_records(robot, students.student_records)}
    assert records["hand-written NumPy, SciPy RK45"]["error"] < 1e-5
    assert records["hand-written Octave, RK4"] | {"error": 0.0, "seconds": 1.0} == records["hand-written Octave, RK4"]
    assert records["the paper's Table 9, ode45"]["seconds"] == 4.125


def test_octave_that_fails_takes_nothing_else_with_it(robot, monkeypatch):
    """Its line says why; a bench has other results by then."""

    def fails(kernels, **settings):
        raise ncgen.NcgenError("octave-cli: no jsondecode")

    monkeypatch.setattr(students.octave, "available", lambda kernels: True)
    monkeypatch.setattr(students.octave, "falls", fails)
    (record,) = students._octave(robot, 0.5, {})
    assert record["stopped"] == "octave-cli: no jsondecode" and record["seconds"] is None
    assert "stopped" in "".join(aligned(_simulation_rows([record])))


@pytest.mark.slow
def test_the_worst_of_many_positions(robot):
    """Refined accelerations are exact everywhere, where long double is more than double."""
    if worst := worst_errors(robot):
        assert worst["accelerations, refined"] < 1e-13 < 10 * worst["accelerations"] < 1e-8


@pytest.mark.skipif(shutil.which(octave.PROGRAM) is None, reason="Octave is not installed")
def test_octave(robot):
    """The paper's own program reaches, in few steps, the angles that ncgen's runs reach at tight tolerance."""
    run = ncgen.simulate(robot, 0.05, rtol=1e-11, atol=1e-13, points=2)
    found = {r["tool"]: r for r in octave.falls(robot, duration=0.05, steps=4, rtol=1e-5, atol=1e-7)}
    assert found["RK4"]["evaluations"] == 16
    for tool in ("RK4", "ode45"):
        assert np.allclose(found[tool]["psi"], run.q[-1][30:], rtol=0, atol=1e-6), tool


def test_octave_that_fails_says_why(robot, monkeypatch, tmp_path):
    program = tmp_path / octave.PROGRAM
    program.write_text("#!/bin/sh\necho 'error: undefined function' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(ncgen.NcgenError, match="octave-cli: error: undefined function"):
        octave.falls(robot, duration=0.05, steps=1, rtol=1e-5, atol=1e-7)
