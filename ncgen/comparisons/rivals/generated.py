"""ncgen's own code: C in every emission and number type, C called from Python, batches, NumPy."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ncgen.comparisons.rivals.base import KERNELS, Inputs, Rival, called
from ncgen.compiler import compile, generate
from ncgen.emit.naming import prefix_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.model import Model
from ncgen.program.ir.cost import cost
from ncgen.program.programs import EMISSIONS
from ncgen.report.clock import Run, repeated
from ncgen.report.repeat import KernelCall, runner, typed_runner
from ncgen.toolchain import cache, compilers
from ncgen.toolchain.abi import NUMBERS

STATES = 1000
"""States of a batch: few enough to stay in the processor's second cache."""


def at_once(kernels: CompiledKernels, inputs: Inputs) -> list[Rival]:
    """The one function that writes Φ, Φ_q and γ, where there is one."""
    if "constraints" not in kernels.programs.programs:
        return []
    program = kernels.programs.programs["constraints"]
    function = KernelCall(kernels.function("constraints"), program.size, kernels)
    run = runner(inputs.t, inputs.q, inputs.qd, inputs.p, [], function)
    ends = np.cumsum([kernels.programs.programs[k].size for k in KERNELS])
    positions: dict[str, np.ndarray] = dict(zip(KERNELS, np.split(np.arange(function.size), ends[:-1]), strict=True))
    return [Rival(name="generated C, all at once", runs={"all": run}, values=lambda k: (run(1), function.out[positions[k]])[1])]


def emissions(model: Model, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """Every emission, `auto` first, with the seconds it took to make."""
    tools = []
    for emission in ("auto", *sorted(set(EMISSIONS) - {"auto"})):
        start = time.perf_counter()
        sources = generate(model, emission)
        generation = time.perf_counter() - start
        kernels = compile(sources, "c")
        programs = kernels.programs.programs
        functions = {name: KernelCall(kernels.function(name), programs[name].size, kernels) for name in programs}
        rival = compiled(f"generated C, {emission}", functions, inputs, names)
        built = cache.compiled(sources.c, compilers.flags_for(sources.c))
        operations = {name: cost(program).total for name, program in programs.items()}
        code = code_bytes(built.library, prefix_of(model.name), names)
        tools.append(replace(rival, generation=generation, compilation=built.spent, operations=operations, code=code))
    return tools


def compiled(name: str, functions: dict[str, KernelCall], inputs: Inputs, names: Sequence[str]) -> Rival:
    """A rival of functions in C with the face of kernels."""

    def run(*chosen: str) -> Run:
        velocity = functions["gamma"] if "gamma" in chosen else None
        return runner(inputs.t, inputs.q, inputs.qd, inputs.p, [functions[k] for k in chosen if k != "gamma"], velocity)

    names = [k for k in names if k in functions]
    runs = {k: run(k) for k in names}
    if set(KERNELS) <= set(names):
        runs["all"] = run(*KERNELS)
    return Rival(name=name, runs=runs, values=lambda k: (runs[k](1), functions[k].out.copy())[1])


def other_types(model: Model, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """The same source for float and long double."""
    sources = generate(model)
    tools = []
    for name in (name for name in NUMBERS if name != "double"):
        runs, out = typed_runner(sources, name, inputs.t, inputs.q, inputs.qd, inputs.p, names)
        epsilon = float(np.finfo(NUMBERS[name].dtype).eps)
        tools.append(
            Rival(
                name=f"generated C, {name}", runs=runs, values=lambda k, runs=runs, out=out: (runs[k](1), out[k].copy())[1], epsilon=epsilon
            )
        )
    return tools


def from_python(name: str, kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Kernels as a user calls them."""
    functions = {k: lambda k=k: kernels.values(k, inputs.t, inputs.q, inputs.qd, inputs.p) for k in names}
    return called(name, functions)


def direct(kernels: CompiledKernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Kernels on arrays of their own, for loops in Python."""
    functions = {k: kernels.direct(k) for k in names if k in kernels.programs.programs}
    for function in functions.values():
        function.q[:], function.qd[:], function.p[:], function.t = inputs.q, inputs.qd, inputs.p, inputs.t
    return called("generated C, direct", functions, lambda k: (functions[k](), functions[k].out.copy())[1])


def batch(kernels: CompiledKernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Many states in one call, each the same; times are those of a state."""
    q, qd = (np.tile(x, (STATES, 1)) for x in (inputs.q, inputs.qd))
    out = {k: np.empty((STATES, kernels.programs.programs[k].size)) for k in names}

    def function(k: str) -> Callable[[], np.ndarray]:
        return lambda: kernels.batch.values(k, inputs.t, q, qd, inputs.p, out[k])

    runs = {k: repeated(function(k)) for k in names}
    return Rival(name=f"generated C, batch of {STATES}", runs=runs, values=lambda k: function(k)()[0], language="Python", calls=STATES)


def code_bytes(library: Path, prefix: str, names: Iterable[str]) -> dict[str, int]:
    """Size of every kernel's machine code, where the tool `nm` can tell."""
    if shutil.which("nm") is None:
        return {}
    listing = subprocess.run(["nm", "--print-size", str(library)], capture_output=True, text=True, check=False).stdout
    sizes = {words[3]: int(words[1], 16) for line in listing.splitlines() if len(words := line.split()) == 4}
    return {name: sizes[f"{prefix}_{name}"] for name in names if f"{prefix}_{name}" in sizes}
