"""Kernels of NumPy in the table that the C runtime reads: the same runs as of compiled kernels, to rounding."""

from __future__ import annotations

import signal

import numpy as np
import pytest

import ncgen
from ncgen.errors import DomainError, NcgenError
from ncgen.mechanism import runtime_library

METHODS = {
    ("auto", "auto"): {},
    ("coordinate-partitioning", "dop853"): {},
    ("coordinate-partitioning", "radau"): {},
    ("lagrange", "radau"): {},
    ("lagrange", "rattle"): {"max_step": 2e-3},
    ("lagrange", "generalized-alpha"): {"max_step": 2e-3},
    ("coordinate-partitioning", "trapezoidal"): {"max_step": 2e-3},
}


@pytest.fixture(scope="module")
def kernels():
    runtime_library.has_runtime.cache_clear()  # others may have taken the compilers away
    return [ncgen.compile(ncgen.load("fourbar"), backend) for backend in ("numpy", "c")]


@pytest.mark.parametrize(("formalism", "integrator"), METHODS)
def test_numpy_runs_in_c_as_compiled_kernels_do(kernels, formalism, integrator):
    runs = [
        ncgen.simulate(k, 0.1, points=11, formalism=formalism, integrator=integrator, engine=engine, **METHODS[formalism, integrator])
        for k, engine in zip(kernels, ("auto", "c"), strict=True)
    ]
    assert [run.engine for run in runs] == ["c", "c"]
    assert runs[0].statistics.steps == runs[1].statistics.steps
    assert np.max(np.abs(runs[0].q - runs[1].q)) < 1e-11 and np.max(np.abs(runs[0].work - runs[1].work)) < 1e-11


def test_without_a_runtime_it_is_the_python_engine(kernels, monkeypatch):
    def nothing(*asked):
        raise NcgenError("no C compiler")

    runtime_library.has_runtime.cache_clear()
    monkeypatch.setattr(runtime_library, "runtime_of", nothing)
    run = ncgen.simulate(kernels[0], 0.01, points=2)
    runtime_library.has_runtime.cache_clear()
    assert run.engine == "python: the kernels are numpy, not compiled"


def test_ctrl_c_in_a_kernel_ends_a_run(monkeypatch, heard):
    kernels = ncgen.compile(ncgen.load("pendulum"), "numpy")
    ncgen.simulate(kernels, 0.1)
    call, calls = type(kernels)._call, []

    def pressed(self, kernel, t, *given):
        calls.append(t)
        if t > 0.5:
            signal.raise_signal(signal.SIGINT)
        return call(self, kernel, t, *given)

    monkeypatch.setattr(type(kernels), "_call", pressed)
    fresh = ncgen.compile(ncgen.load("pendulum"), "numpy")
    with pytest.raises(KeyboardInterrupt):
        ncgen.simulate(fresh, 1.0)
    assert sum(t > 0.5 for t in calls) == 1


def test_nan_is_reported_by_name():
    import sympy

    m = ncgen.Model("pendulum")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81))
    m.force(B, (0, sympy.sqrt(B.y + 0.3)), label="lift")
    with pytest.raises(DomainError, match=r"lift.* is not a number at t = 0\.\d+ s \(.*B\.y = -0\.3"):
        ncgen.simulate(ncgen.compile(m, "numpy"), 1.5)


def test_inputs_and_callbacks_reach_numpy_kernels():
    m = ncgen.Model("pendulum")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    push = m.input("push")
    m.force(B, (0, push))
    m.callback(lambda t, q, qd, kernels: -0.5 * qd)
    runs = [ncgen.simulate(ncgen.compile(m, b), 1.0, rtol=1e-10, inputs={"push": np.sin}, engine="c") for b in ("numpy", "c")]
    assert np.max(np.abs(runs[0].q - runs[1].q)) < 1e-12 and abs(runs[0].q[-1, 1]) > 0.01
