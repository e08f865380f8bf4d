"""Rows that are long: what costs as much to compile as they do is left out, and gives the same numbers."""

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module


def test_long_rows_are_not_written_out_twice():
    """Φ, Φ_q and γ of an arm in one call are those of three calls, and the folder of the model says what is missing."""
    kernels = ncgen.compile(example_module("arm").build(20), "numpy", emission="unrolled")
    assert "constraints" not in kernels.programs.programs
    assert any("constraints" in line for line in kernels.programs.omitted)
    qd = np.linspace(-1.0, 1.0, kernels.n)
    phi, phi_q, gamma = kernels.constraints(kernels.q0, qd)
    assert np.array_equal(phi, kernels.phi(kernels.q0)) and np.array_equal(gamma, kernels.gamma(kernels.q0, qd))
    assert np.array_equal(phi_q.toarray(), kernels.phi_q(kernels.q0).toarray())


def test_short_rows_have_one_kernel():
    """The quadruped's, which is the longest of the examples."""
    assert "constraints" in ncgen.generate(ncgen.load("quadruped")).programs.programs
