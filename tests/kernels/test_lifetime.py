"""Kernels come and go: a library that was freed takes nothing with it that the next one needs."""

import gc

import numpy as np

import ncgen


def pendulum(length):
    m = ncgen.Model("pendulum")
    m.distance(m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), length=length)
    return m


def test_compiled_kernels_after_others_were_freed():
    """Φ = (1 − L²)/(2L) at (1, 0), for one model after another with none alive in between."""
    for length in (1.0, 2.0, 4.0):
        kernels = ncgen.compile(pendulum(length), "c")
        assert np.array_equal(kernels.phi(kernels.q0), [(1 - length**2) / (2 * length)])
        del kernels
        gc.collect()
