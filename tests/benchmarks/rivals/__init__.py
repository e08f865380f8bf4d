"""Other people's generators and simulators behind the face of `ncgen.comparisons.rivals`, one kind a module."""

from __future__ import annotations

from benchmarks.rivals import casadi, emitted, handwritten, jax, lambdified, symforce
from ncgen.comparisons.rivals import Inputs, Rival
from ncgen.comparisons.rivals.generated import compiled
from ncgen.mechanism.kernels import Kernels


def emitted_and_by_hand(kernels: Kernels, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """The other emissions of the kernels, and what was written by hand for them."""
    tools = emitted.emissions(kernels.model, inputs, names)
    tools += [compiled("hand-written C", functions, inputs, names) for functions in handwritten.in_c(kernels)]
    return [*tools, emitted.direct(kernels, inputs, names), *handwritten.in_numpy(kernels, inputs, names)]


def of_all_kinds(kernels: Kernels, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """The same with other number types, and in batches."""
    tools = emitted_and_by_hand(kernels, inputs, names) + emitted.other_types(kernels.model, inputs, names)
    return [*tools, emitted.batch(kernels, inputs, names)]


def differentiating(kernels: Kernels, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """The same, and symbolic and automatic differentiation by what is installed: sympy's own, CasADi, JAX, SymForce."""
    others = [rival for tool in (lambdified, casadi, jax, symforce) for rival in tool.rivals(kernels, inputs, names)]
    return of_all_kinds(kernels, inputs, names) + others
