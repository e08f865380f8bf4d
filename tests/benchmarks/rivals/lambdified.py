"""sympy's own way: symbolic derivatives of Φ, common subexpressions, a NumPy function."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np
import sympy

from benchmarks.rivals.translation import translatable
from ncgen.comparisons.rivals.base import Inputs, Rival, called
from ncgen.mechanism.kernels import Kernels
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS

LARGEST = 60
"""Rows up to which sympy is asked to differentiate the whole mechanism: it takes long beyond."""


def rivals(kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    names = [k for k in names if k in ("phi", "phi_q", "gamma")]
    if kernels.m > LARGEST or not translatable(kernels):
        return []
    start = time.perf_counter()
    expressions, symbols = symbolic(kernels)
    functions = {k: sympy.lambdify(symbols, expressions[k], cse=True) for k in names}
    together = sympy.lambdify(symbols, [expressions[k] for k in names], cse=True)
    seconds = time.perf_counter() - start
    calls = {k: lambda f=f: np.array(f(inputs.q, inputs.qd)) for k, f in functions.items()}
    every = lambda: [np.array(part) for part in together(inputs.q, inputs.qd)]  # noqa: E731
    return [called("sympy.lambdify(cse=True)", calls, every=every, generation=seconds)]


def symbolic(
    kernels: Kernels, library: ModuleType = sympy, number: Callable[[float], Any] = sympy.Float
) -> tuple[dict[str, list[Any]], tuple[list[Any], list[Any]]]:
    """{kernel: [expression]} and the arguments (q, q̇), Φ_q in the kernels' pattern, by sympy or a library of the same words."""
    q, qd = ([library.Symbol(f"{letter}{i}") for i in range(kernels.n)] for letter in ("x", "v"))
    functions = {name: getattr(library, f.sympy) for name, f in FUNCTIONS.items()}
    given = {"t": number(0.0), "q": q, "p": [number(float(x)) for x in kernels.p0]}
    phi = evaluate(kernels.programs.programs["phi"], given, functions, number)
    jacobian = {(row, column): phi[row].diff(q[column]) for row, column in kernels.phi_q_pattern.positions()}
    rate, gamma = ([library.S(0)] * kernels.m for _ in range(2))
    for (row, column), entry in jacobian.items():
        rate[row] += entry * qd[column]
    for row, column in jacobian:
        gamma[row] -= rate[row].diff(q[column]) * qd[column]
    return {"phi": phi, "phi_q": list(jacobian.values()), "gamma": gamma}, (q, qd)
