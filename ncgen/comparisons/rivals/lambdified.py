"""sympy's own way: symbolic derivatives of Φ, common subexpressions, a NumPy function."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import sympy

from ncgen.comparisons.rivals.base import Inputs, Rival, called, translatable
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


def symbolic(kernels: Kernels) -> tuple[dict[str, list[sympy.Expr]], tuple[Sequence[sympy.Symbol], Sequence[sympy.Symbol]]]:
    """{kernel: [expression]} and the arguments (q, q̇), Φ_q in the kernels' pattern."""
    q, qd = (sympy.symbols(f"{letter}:{kernels.n}") for letter in ("x", "v"))
    functions = {name: getattr(sympy, f.sympy) for name, f in FUNCTIONS.items()}
    given = {"t": sympy.Float(0), "q": q, "p": [sympy.Float(float(x)) for x in kernels.p0]}
    phi = evaluate(kernels.programs.programs["phi"], given, functions, sympy.Float)
    jacobian = {place: sympy.diff(phi[place[0]], q[place[1]]) for place in kernels.phi_q_pattern.positions()}
    rate: list[sympy.Expr] = [sympy.Integer(0)] * kernels.m
    for (row, column), entry in jacobian.items():
        rate[row] += entry * qd[column]
    gamma: list[sympy.Expr] = [sympy.Integer(0)] * kernels.m
    for row, column in jacobian:
        gamma[row] -= sympy.diff(rate[row], q[column]) * qd[column]
    return {"phi": phi, "phi_q": list(jacobian.values()), "gamma": gamma}, (q, qd)
