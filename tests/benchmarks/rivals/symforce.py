"""SymForce: symbolic derivatives of Φ, its common subexpressions, its C++ expressions.

They are compiled like the generated code and without the matrices of Eigen around them, so that both are timed alike.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from types import ModuleType

from benchmarks.rivals.lambdified import symbolic
from benchmarks.rivals.translation import translatable
from ncgen.comparisons.rivals.base import Inputs, Rival, foreign
from ncgen.comparisons.rivals.generated import code_bytes, compiled
from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.kernels import Kernels

LARGEST = 150
"""Rows up to which it is asked: its time grows with the square of the size, and worse."""

TEXT = """#include <math.h>
#include "ncgen.h"
#define Scalar(x) ((double)(x))
"""


def rivals(kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """Nothing where SymForce is not installed."""
    try:
        import_module("symforce").set_epsilon_to_number()
        symbolic = import_module("symforce.symbolic")
    except ImportError:
        return []
    if not translatable(kernels) or kernels.m > LARGEST:
        return []
    names = [k for k in names if k in ("phi", "phi_q", "gamma")]
    start = time.perf_counter()
    text, operations = _code(symbolic, kernels, names)
    generation = time.perf_counter() - start
    files = {"symforce.c": text} | runtime_files("ncgen.h")
    calls, built = foreign(files, {k: kernels.programs.programs[k].size for k in names}, "symforce_{}")
    raw = compiled("SymForce, C", calls, inputs, names)
    code = code_bytes(built.library, "symforce", names)
    return [replace(raw, generation=generation, compilation=built.spent, operations=operations, code=code)]


def _code(sf: ModuleType, kernels: Kernels, names: Sequence[str]) -> tuple[str, dict[str, int]]:
    """The C text, and SymForce's own count of operations."""
    codegen = import_module("symforce.codegen")
    print_code = import_module("symforce.codegen.codegen_util").print_code
    Values = import_module("symforce.values").Values

    expressions, (q, qd) = symbolic(kernels, sf, sf.S)
    text, operations = TEXT, {}
    for name in names:
        found = print_code(Values(q=q, qd=qd), Values(out=expressions[name]), {}, codegen.CppConfig())
        lines = [f"const double {symbol} = {code};" for symbol, code in found.intermediate_terms]
        lines += [f"{place} = {code};" for place, code in found.dense_terms[0].terms]
        arguments = "double t, const double *q, " + "const double *qd, " * (name == "gamma") + "const double *p, double *out"
        body = "\n    ".join(["(void)t, (void)p;", *lines, "return 0;"])
        text += f"\nint symforce_{name}({arguments})\n{{\n    {body}\n}}\n".replace("std::", "")
        operations[name] = found.total_ops
    return text, operations
