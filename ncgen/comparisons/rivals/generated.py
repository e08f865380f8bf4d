"""ncgen's own code: C timed in C, C called from Python, NumPy."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterable, Sequence
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
from ncgen.report.clock import Run
from ncgen.report.repeat import KernelCall, runner
from ncgen.toolchain import cache, compilers


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


def emitted(model: Model, inputs: Inputs, names: Sequence[str], emission: str = "auto") -> Rival:
    """One emission, with the seconds it took to make."""
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
    return replace(rival, generation=generation, compilation=built.spent, operations=operations, code=code)


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


def from_python(name: str, kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Kernels as a user calls them."""
    functions = {k: lambda k=k: kernels.values(k, inputs.t, inputs.q, inputs.qd, inputs.p) for k in names}
    return called(name, functions)


def code_bytes(library: Path, prefix: str, names: Iterable[str]) -> dict[str, int]:
    """Size of every kernel's machine code, where the tool `nm` can tell."""
    if shutil.which("nm") is None:
        return {}
    listing = subprocess.run(["nm", "--print-size", str(library)], capture_output=True, text=True, check=False).stdout
    sizes = {words[3]: int(words[1], 16) for line in listing.splitlines() if len(words := line.split()) == 4}
    return {name: sizes[f"{prefix}_{name}"] for name in names if f"{prefix}_{name}" in sizes}
