"""What a careful engineer wrote for an example: handwritten.c and handwritten.py in its folder, where they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ncgen.comparisons.rivals.base import KERNELS, Inputs, Rival, called, foreign, handwritten, nonzeros
from ncgen.exchange.examples import example_names
from ncgen.mechanism.kernels import Kernels
from ncgen.report.repeat import KernelCall
from ncgen.resources import folder


def source(kernels: Kernels) -> Path | None:
    """The example's handwritten.c, if it has one."""
    path = folder("examples") / kernels.name / "handwritten.c"
    return path if kernels.name in example_names() and path.is_file() else None


def in_c(kernels: Kernels) -> list[dict[str, KernelCall]]:
    """The functions of the example's handwritten.c, compiled like generated ones."""
    path = source(kernels)
    if path is None:
        return []
    sizes = {name: kernels.programs.programs[name].size for name in KERNELS}
    return [foreign({path.name: path.read_text(encoding="utf-8")}, sizes, "handwritten_{}")[0]]


def in_numpy(kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """The functions of handwritten.py: in the paper's manner, and vectorised."""
    module = handwritten(kernels)
    if module is None:
        return []
    tools = []
    for prefix, words in (("loop", "a loop over the table"), ("vector", "vectorised")):
        functions = {k: getattr(module, f"{prefix}_{k}") for k in names if hasattr(module, f"{prefix}_{k}")}
        calls = {k: lambda k=k, f=f: f(inputs.q, inputs.qd) if k == "gamma" else f(inputs.q) for k, f in functions.items()}
        tools.append(called(f"hand-written NumPy, {words}", calls, lambda k, calls=calls: nonzeros(kernels, k, calls[k]())))
    return tools
