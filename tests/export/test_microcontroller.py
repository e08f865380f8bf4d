"""Exported C in single precision moves on a processor of microcontrollers as it does here in double."""

from __future__ import annotations

import importlib.util

import microcontroller
import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="ziglang is not installed"),
    pytest.mark.skipif(bool(microcontroller.missing()), reason=f"{microcontroller.missing()} not installed"),
]


@pytest.mark.parametrize("name", ["pendulum", "robot"])
def test_moves_and_fits(name, tmp_path):
    """To float's digits; code and stack of a step fit into a controller of 256 kB flash and 64 kB memory."""
    stack = microcontroller.build(name, tmp_path)
    header, *rows = microcontroller.run(tmp_path).splitlines()
    table = np.array([list(map(float, row.split(","))) for row in rows])
    kernels = ncgen.compile(load(name))
    assert header.split(",")[1 : kernels.n + 1] == list(kernels.coordinates)
    options = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    run = ncgen.simulate(kernels, table[-1, 0], points=len(table), **options)
    assert np.max(np.abs(table[:, 1 : kernels.n + 1] - run.q)) < 1e-3
    assert microcontroller.code(tmp_path) < 256 * 1024
    assert stack[f"{name}_step"] < 64 * 1024
