"""What every way to compute kernels has in common, and what all of them are held to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from ncgen.exchange.examples import example_module, example_names
from ncgen.mechanism.kernels import Kernels
from ncgen.report.clock import Run, repeated
from ncgen.report.repeat import KernelCall
from ncgen.resources import folder
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.partition import Partitions, partitions_for
from ncgen.toolchain.abi import abi
from ncgen.toolchain.cache import BuiltLibrary, compiled
from ncgen.toolchain.loader import opened

KERNELS = ("phi", "phi_q", "gamma")


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, kw_only=True)
class Rival:
    """runs: {kernel, or "all" for Φ, Φ_q and γ: run(times)}; values(kernel): its output, in the order of the generated kernel

    What computes all kernels at once has runs["all"] only.
    language: that of the loop of a run, "C" or "Python"; calls: states that one turn of the loop evaluates
    generation, compilation: seconds until it can be called, each; operations, code (bytes): {kernel: number}
    epsilon: rounding error of its numbers
    """

    name: str
    runs: dict[str, Run]
    values: Callable[[str], np.ndarray]
    language: str = "C"
    calls: int = 1
    generation: float | None = None
    compilation: float | None = None
    operations: dict[str, int] = field(default_factory=dict)
    code: dict[str, int] = field(default_factory=dict)
    epsilon: float = float(np.finfo(float).eps)


def foreign(files: dict[str, str], sizes: dict[str, int], symbol: str) -> tuple[dict[str, KernelCall], BuiltLibrary]:
    """{kernel: call} of C sources that ncgen did not write, whose functions have the arguments of kernels; and the library.

    sizes: how many numbers each kernel writes; symbol: its name in C, with {} for the kernel's
    """
    built = compiled(files)
    kinds = {name: "velocity" if name == "gamma" else "position" for name in sizes}
    ffi, library = opened(built.library, "".join(f"ncgen_{kinds[name]}_kernel {symbol.format(name)};" for name in sizes), abi())
    return {name: KernelCall(ffi.addressof(library, symbol.format(name)), size, library) for name, size in sizes.items()}, built


def called(
    name: str,
    functions: Mapping[str, Callable[[], Any]],
    values: Callable[[str], np.ndarray] | None = None,
    every: Callable[[], object] | None = None,
    generation: float | None = None,
    compilation: float | None = None,
) -> Rival:
    """A rival whose kernels are Python functions without arguments; values: as in Rival, if they give something else than arrays."""

    def all_of_them() -> None:
        for kernel in KERNELS:
            functions[kernel]()

    runs = {k: repeated(function) for k, function in functions.items()}
    if set(KERNELS) <= set(functions):
        runs["all"] = repeated(every or all_of_them)
    return Rival(
        name=name, runs=runs, values=values or (lambda k: functions[k]()), language="Python", generation=generation, compilation=compilation
    )


def nonzeros(kernels: Kernels, name: str, value: np.ndarray) -> np.ndarray:
    """A kernel's numbers, of a dense matrix those in the kernel's pattern."""
    patterns = {"phi_q": kernels.phi_q_pattern, "mass": kernels.mass_pattern}
    return np.asarray(value).ravel()[patterns[name].flat] if name in patterns else np.asarray(value)


def handwritten(kernels: Kernels) -> ModuleType | None:
    """The example's module of hand-written functions, or None."""
    if kernels.name not in example_names() or not (folder("examples") / kernels.name / "handwritten.py").is_file():
        return None
    return example_module(kernels.name, "handwritten.py")


def own_start(kernels: Kernels) -> tuple[np.ndarray, Partitions]:
    """The closed position (n,) that a model begins at, and independent coordinates there: those that it names, or good ones."""
    q = assemble(kernels, kernels.q0)
    return q, partitions_for(kernels, q, 0.0, kernels.p0)


def differentiable(kernels: Kernels) -> bool:
    """Whether derivatives of Φ by q alone are all there is: no drivers, no rolling."""
    return "nu" not in kernels.programs.programs and len(kernels.holonomic) == kernels.m
