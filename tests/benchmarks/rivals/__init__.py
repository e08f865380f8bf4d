"""Other people's generators and simulators behind the face of `ncgen.comparisons.rivals`, one kind a module."""

from __future__ import annotations

from benchmarks.rivals import casadi, jax, lambdified, symforce
from ncgen.comparisons.rivals import Inputs, Rival
from ncgen.mechanism.kernels import Kernels


def differentiating(kernels: Kernels, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """Symbolic and automatic differentiation by what is installed: sympy's own, CasADi, JAX, SymForce."""
    return [rival for tool in (lambdified, casadi, jax, symforce) for rival in tool.rivals(kernels, inputs, names)]
