"""symjit: sympy's derivatives of Φ, turned into machine code without a compiler."""

from __future__ import annotations

import time

import numpy as np

from ncgen.build.kernels import Kernels
from ncgen.report.rivals.base import Inputs, Rival, called, differentiable
from ncgen.report.rivals.lambdified import LARGEST, symbolic


def rivals(kernels: Kernels, inputs: Inputs, names) -> list[Rival]:
    """Nothing where symjit is not installed."""
    try:
        import symjit
    except ImportError:
        return []
    names = [k for k in names if k in ("phi", "phi_q", "gamma")]
    if kernels.m > LARGEST or not differentiable(kernels):
        return []
    start = time.perf_counter()
    expressions, (q, qd) = symbolic(kernels)
    functions = {k: symjit.compile_func([*q, *qd], expressions[k]) for k in names}
    seconds = time.perf_counter() - start
    state = np.concatenate([inputs.q, inputs.qd])
    calls = {k: lambda f=f: np.array(f(*state)).ravel() for k, f in functions.items()}
    return [called("symjit", calls, generation=seconds)]
