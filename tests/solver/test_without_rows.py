"""Mechanisms without a constraint row, such as masses on springs: every method in C, against harmonic motion."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

import ncgen
from ncgen.methods.table import FORMALISMS, INTEGRATORS
from ncgen.model import Model

STIFFNESS, MASS, DURATION = 90.0, 2.5, 1.0


def bob() -> Model:
    """A mass on a spring of no free length: (cos ωt, sin ωt / ω) from (1, 0) with the velocity (0, 1)."""
    m = Model("bob")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("ball", points=[B], mass=MASS)
    m.spring(A, B, stiffness=STIFFNESS, free_length=0.0)
    m.simulation(qd0={"B.y": 1.0})
    return m


def expected(t: np.ndarray) -> np.ndarray:
    omega = np.sqrt(STIFFNESS / MASS)
    return np.column_stack([np.cos(omega * t), np.sin(omega * t) / omega])


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(bob(), "c")


# The trapezoidal rule turns too slowly by (ωh)²/12 of the angle: 1.8e-5 after 1 s with steps of 1 ms.
ALL = [(f.name, "dop853", 1e-5) for f in FORMALISMS.values() if f.is_ordinary]
ALL += [("coordinate-partitioning", i.name, 2e-5) for i in INTEGRATORS.values() if i.is_ordinary and i.in_c]
ALL += [(formalism, i.name, 1e-2) for i in INTEGRATORS.values() for formalism in i.steps]


@pytest.mark.parametrize(("formalism", "integrator", "allowed"), ALL)
def test_every_method_in_c(kernels, formalism, integrator, allowed):
    step = {"max_step": 1e-3} if INTEGRATORS[integrator].has_fixed_step else {}
    run = ncgen.simulate(kernels, DURATION, formalism=formalism, integrator=integrator, qd0={"B.y": 1.0}, engine="c", **step)
    assert run.engine == "c"
    assert np.max(np.abs(run.q - expected(run.t))) < allowed


def test_the_default_runs_in_c(kernels):
    run = ncgen.simulate(kernels, DURATION, qd0={"B.y": 1.0})
    assert run.engine in ("c", "emitted")
    assert np.max(np.abs(run.q - expected(run.t))) < 1e-7


def test_a_batch(kernels):
    runs = ncgen.simulate(kernels, DURATION, zd0=np.array([[0.0, 1.0], [0.0, 2.0]]), points=11)
    assert list(runs.status) == ["ok", "ok"]
    assert np.max(np.abs(runs.q[0] - expected(runs.t))) < 1e-6


@pytest.mark.skipif(not shutil.which("make") or not shutil.which("cc"), reason="builds with make and cc")
def test_exported(tmp_path):
    """The exported program moves as it should; it ended with "an argument is out of range"."""
    ncgen.export(bob(), "c", tmp_path)
    subprocess.run(["make", "-s", "main"], cwd=tmp_path, check=True, capture_output=True)
    said = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.splitlines()
    rows = np.array([[float(number) for number in line.split(",")[:3]] for line in said[1:]])
    assert len(rows) > 2 and np.max(np.abs(rows[:, 1:] - expected(rows[:, 0]))) < 1e-6
