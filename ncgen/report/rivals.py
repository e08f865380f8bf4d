"""Everything that can evaluate Φ, Φ_q and γ of a mechanism, behind one face: generated, written by hand, lambdified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mpmath
import numpy as np
import sympy
from cffi import FFI

from ncgen.build.cache import build
from ncgen.build.compilers import find_compiler
from ncgen.build.kernels import Kernels
from ncgen.build.library import CompiledKernels, _abi
from ncgen.compiler import compile, generate
from ncgen.exchange.examples import example_module, example_names
from ncgen.model import Model
from ncgen.program.assemble import EMISSIONS
from ncgen.program.evaluate import evaluate
from ncgen.program.functions import FUNCTIONS
from ncgen.report.clock import repeated
from ncgen.report.repeat import Call, runner
from ncgen.resources import folder

KERNELS = ("phi", "phi_q", "gamma")
DIGITS = 50
LAMBDIFY_ROWS = 60
"""Rows up to which sympy is asked to differentiate the whole mechanism: it takes long beyond."""


@dataclass(frozen=True)
class Inputs:
    """One place at which everything is evaluated: away from the initial position, where rows are zero."""

    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    t: float = 0.0

    @classmethod
    def typical(cls, kernels: Kernels) -> Inputs:
        random = np.random.default_rng(1)
        q = kernels.q0 + 0.1 * kernels.length * random.standard_normal(kernels.n)
        return cls(q, random.standard_normal(kernels.n), kernels.p0)


@dataclass(frozen=True)
class Rival:
    """runs: {kernel, or "all": run(times)}; values(kernel): its output, in the order of the generated kernel

    What computes all kernels at once has runs["all"] only.
    """

    name: str
    runs: dict[str, Callable[[int], None]]
    values: Callable[[str], np.ndarray]


def rivals(model: Model, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """All of them; first the generated C that has all kernels in one."""
    generated = {emission: compile(generate(model, emission), "c") for emission in ("auto", *(set(EMISSIONS) - {"auto"}))}
    kernels = generated["auto"]
    found = [_at_once(kernels, inputs, names)]
    found += [_compiled(f"generated C, {emission}", _functions(k), inputs, names) for emission, k in sorted(generated.items())]
    found += [_compiled("hand-written C", f, inputs, names) for f in _handwritten_c(kernels)]
    found.append(_called("generated C, from Python", kernels, inputs, names))
    found.append(_called("generated NumPy", compile(model, "numpy"), inputs, names))
    found += _handwritten_numpy(kernels, inputs, names)
    found += _lambdified(kernels, inputs, names)
    return found


def exact(kernels: Kernels, name: str, inputs: Inputs) -> np.ndarray:
    """A kernel's output with 50 digits, rounded at the end."""
    with mpmath.workdps(DIGITS):
        functions = {f: getattr(mpmath, f) for f in FUNCTIONS if hasattr(mpmath, f)} | {"abs": abs, "pow": mpmath.power}
        numbers = {key: [mpmath.mpf(float(x)) for x in getattr(inputs, key)] for key in ("q", "qd", "p")}
        values = evaluate(kernels.programs.programs[name], {"t": mpmath.mpf(inputs.t), **numbers}, functions, mpmath.mpf)
        return np.array([float(v) for v in values])


def relative_error(value, reference) -> float:
    """The largest difference, relative to the largest entry."""
    return float(np.max(np.abs(value - reference), initial=0.0) / max(np.max(np.abs(reference), initial=0.0), 1e-300))


def handwritten(kernels: Kernels):
    """The example's module of hand-written functions, or None."""
    if kernels.name not in example_names() or not (folder("examples") / kernels.name / "handwritten.py").is_file():
        return None
    return example_module(kernels.name, "handwritten.py")


def _functions(kernels: CompiledKernels) -> dict[str, Call]:
    programs = kernels.programs.programs
    return {name: Call(kernels.function(name), program.size, kernels) for name, program in programs.items()}


def _compiled(name: str, functions: dict[str, Call], inputs: Inputs, names) -> Rival:
    def run(*chosen):
        calls = [functions[k] for k in chosen]
        velocity = functions["gamma"] if "gamma" in chosen else None
        return runner(inputs.t, inputs.q, inputs.qd, inputs.p, [c for c in calls if c is not velocity], velocity)

    runs = {k: run(k) for k in names} | {"all": run(*names)}
    return Rival(name, runs, lambda k: (runs[k](1), functions[k].out.copy())[1])


def _at_once(kernels: CompiledKernels, inputs: Inputs, names) -> Rival:
    """The one function that writes Φ, Φ_q and γ."""
    function = _functions(kernels)["constraints"]
    run = runner(inputs.t, inputs.q, inputs.qd, inputs.p, [], function)
    ends = np.cumsum([kernels.programs.programs[k].size for k in names])
    part = dict(zip(names, np.split(np.arange(function.size), ends[:-1]), strict=True))
    return Rival("generated C, all at once", {"all": run}, lambda k: (run(1), function.out[part[k]])[1])


def _handwritten_c(kernels: Kernels) -> list[dict[str, Call]]:
    """The functions of the example's handwritten.c, compiled like generated ones."""
    path = folder("examples") / kernels.name / "handwritten.c"
    if kernels.name not in example_names() or not path.is_file():
        return []
    ffi = FFI()
    ffi.include(_abi())
    types = {name: "velocity" if name == "gamma" else "position" for name in KERNELS}
    ffi.cdef("".join(f"ncgen_{kind}_kernel handwritten_{name};" for name, kind in types.items()))
    library = ffi.dlopen(str(build({path.name: path.read_text(encoding="utf-8")}, find_compiler()).library))
    sizes = {name: kernels.programs.programs[name].size for name in KERNELS}
    return [{name: Call(ffi.addressof(library, f"handwritten_{name}"), size, library) for name, size in sizes.items()}]


def _python(name: str, functions: dict[str, Callable[[], np.ndarray]], values, every=None) -> Rival:
    def all_of_them():
        for function in functions.values():
            function()

    runs = {k: repeated(function) for k, function in functions.items()} | {"all": repeated(every or all_of_them)}
    return Rival(name, runs, values)


def _called(name: str, kernels: Kernels, inputs: Inputs, names) -> Rival:
    functions = {k: lambda k=k: kernels.values(k, inputs.t, inputs.q, inputs.qd, inputs.p) for k in names}
    return _python(name, functions, lambda k: functions[k]())


def _handwritten_numpy(kernels: Kernels, inputs: Inputs, names) -> list[Rival]:
    module = handwritten(kernels)
    if module is None:
        return []
    found = []
    for prefix, words in (("loop", "a loop over the table"), ("vector", "vectorised")):
        functions = {k: getattr(module, f"{prefix}_{k}") for k in names}
        calls = {k: lambda k=k, f=f: f(inputs.q, inputs.qd) if k == "gamma" else f(inputs.q) for k, f in functions.items()}
        found.append(_python(f"hand-written NumPy, {words}", calls, lambda k, calls=calls: _nonzeros(kernels, k, calls[k]())))
    return found


def _nonzeros(kernels: Kernels, name: str, value: np.ndarray) -> np.ndarray:
    return value.ravel()[kernels.phi_q_pattern.flat] if name == "phi_q" else value


def _lambdified(kernels: Kernels, inputs: Inputs, names) -> list[Rival]:
    """sympy's own way: symbolic derivatives of Φ, common subexpressions, a NumPy function. Not for drivers and rolling."""
    if kernels.m > LAMBDIFY_ROWS or "nu" in kernels.programs.programs or len(kernels.holonomic) < kernels.m:
        return []
    expressions, symbols = _symbolic(kernels)
    functions = {k: sympy.lambdify(symbols, expressions[k], cse=True) for k in names}
    together = sympy.lambdify(symbols, [expressions[k] for k in names], cse=True)
    calls = {k: lambda f=f: np.array(f(inputs.q, inputs.qd)) for k, f in functions.items()}
    every = lambda: [np.array(part) for part in together(inputs.q, inputs.qd)]  # noqa: E731
    return [_python("sympy.lambdify(cse=True)", calls, lambda k: calls[k](), every)]


def _symbolic(kernels: Kernels):
    """{kernel: [expression]} and the arguments (q, q̇), Φ_q in the kernels' pattern."""
    q, qd = (sympy.symbols(f"{letter}:{kernels.n}") for letter in ("x", "v"))
    functions = {name: getattr(sympy, f.sympy) for name, f in FUNCTIONS.items()}
    given = {"t": sympy.Float(0), "q": q, "p": [sympy.Float(float(x)) for x in kernels.p0]}
    phi = evaluate(kernels.programs.programs["phi"], given, functions, sympy.Float)
    jacobian = {place: sympy.diff(phi[place[0]], q[place[1]]) for place in kernels.phi_q_pattern.positions()}
    rate = [sympy.Integer(0)] * kernels.m
    for (row, column), entry in jacobian.items():
        rate[row] += entry * qd[column]
    gamma = [sympy.Integer(0)] * kernels.m
    for row, column in jacobian:
        gamma[row] -= sympy.diff(rate[row], q[column]) * qd[column]
    return {"phi": phi, "phi_q": list(jacobian.values()), "gamma": gamma}, (q, qd)
