"""CasADi: Φ handed over as an expression graph, differentiated there, its C code compiled like the generated one.

Any: an expression or a function of CasADi.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.rivals.translation import translatable
from ncgen.comparisons.rivals.base import Inputs, Rival, foreign
from ncgen.comparisons.rivals.generated import code_bytes, compiled
from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.kernels import Kernels
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS

LARGEST = 500
"""Rows up to which its straight-line code is compiled."""

WRAPPERS = """
int casadi_{name}_call(double t, const double *q, {qd}const double *p, double *out)
{{
    const double *in[] = {{ q{given} }};
    double *res[] = {{ out }};
    double work[{work}];
    long long whole[{whole}];
    (void)t, (void)p;
    return casadi_{name}(in, res, whole, work, 0);
}}
"""


def rivals(kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """Nothing where CasADi is not installed."""
    try:
        casadi = import_module("casadi")
    except ImportError:
        return []
    if not translatable(kernels) or kernels.m > LARGEST:
        return []
    names = [k for k in names if k in ("phi", "phi_q", "gamma")]
    start = time.perf_counter()
    functions, places = _functions(casadi, kernels, names)
    text = _code(casadi, functions)
    generation = time.perf_counter() - start
    files = {"casadi.c": text} | runtime_files("ncgen.h")
    calls, built = foreign(files, {k: f.nnz_out(0) for k, f in functions.items()}, "casadi_{}_call")
    raw = compiled("CasADi, C", calls, inputs, names)
    operations = {k: f.n_instructions() - f.nnz_in() - f.nnz_out() for k, f in functions.items()}

    def values(name: str) -> np.ndarray:
        found = np.zeros(kernels.programs.programs[name].size)
        found[places[name]] = raw.values(name)
        return found

    size = code_bytes(built.library, "casadi", names)
    return [replace(raw, values=values, generation=generation, compilation=built.spent, operations=operations, code=size)]


def graph(casadi: ModuleType, kernels: Kernels, name: str, given: Mapping[str, Any]) -> Any:
    """A kernel's numbers as a column of CasADi's expressions in the symbols given; zeros where the mechanism has no such kernel."""
    program = kernels.programs.programs.get(name)
    if program is None:
        return casadi.SX(kernels.n, 1)
    return column(casadi, program, {"t": 0.0, "p": kernels.p0.tolist()} | {letter: casadi.vertsplit(x) for letter, x in given.items()})


def column(casadi: ModuleType, program: Program, given: Mapping[str, Any]) -> Any:
    """What a program gives, as a column of CasADi's expressions; given: what it reads, in lists."""
    words = {"abs": "fabs", "pow": "power"}
    known = {code: getattr(casadi, words.get(code, f.numpy.replace("arc", "a")), None) for code, f in FUNCTIONS.items()}
    return casadi.vertcat(*evaluate(program, given, {code: f for code, f in known.items() if f}, casadi.SX))


def _functions(casadi: ModuleType, kernels: Kernels, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, np.ndarray | list[int]]]:
    """{kernel: casadi.Function}, and where each of its numbers stands in the kernel's output."""
    q, qd = casadi.SX.sym("q", kernels.n), casadi.SX.sym("qd", kernels.n)
    phi = graph(casadi, kernels, "phi", {"q": q})
    gamma = -casadi.jtimes(casadi.jtimes(phi, q, qd), q, qd)
    # CasADi stores columns; those of the transpose are rows.
    outputs = {"phi": casadi.densify(phi), "phi_q": casadi.jacobian(phi, q).T, "gamma": casadi.densify(gamma)}
    functions = {k: casadi.Function(f"casadi_{k}", [q, qd] if k == "gamma" else [q], [outputs[k]]) for k in names}
    position = kernels.phi_q_pattern.positions()
    columns, rows = outputs["phi_q"].sparsity().get_triplet()
    places = {k: np.arange(kernels.m) for k in names} | {"phi_q": [position[r, c] for r, c in zip(rows, columns, strict=True)]}
    return functions, places


def _code(casadi: ModuleType, functions: Mapping[str, Any]) -> str:
    text = code(casadi, functions)
    for name, function in functions.items():
        qd, given = ("const double *qd, ", ", qd") if name == "gamma" else ("", "")
        text += WRAPPERS.format(name=name, qd=qd, given=given, work=max(function.sz_w(), 1), whole=max(function.sz_iw(), 1))
    return text


def code(casadi: ModuleType, functions: Mapping[str, Any]) -> str:
    """CasADi's C text of its functions."""
    generator = casadi.CodeGenerator("casadi_code.c", {"with_header": False})
    for function in functions.values():
        generator.add(function)
    with tempfile.TemporaryDirectory() as folder:
        return Path(generator.generate(f"{folder}/")).read_text(encoding="utf-8")
