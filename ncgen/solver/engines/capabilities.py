"""What C can run: refusals of methods and mechanisms, in words."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, INTEGRATORS, in_c
from ncgen.solver.positions.partition import Partitions
from ncgen.solver.positions.position import TOLERANCE
from ncgen.solver.runs.settings import EMITTED
from ncgen.symbolic.tree import spanning_tree

if TYPE_CHECKING:
    from ncgen.mechanism.library import CompiledKernels


def refusal(kernels: Kernels, method: Method, engine: str, number: str) -> str | None:
    """Why a simulation cannot run in C, as far as its method and the mechanism tell, in words, or None if it can.

    engine: as of `simulate`; number: C's type
    """
    from ncgen.mechanism.library import CompiledKernels
    from ncgen.mechanism.properties import uses_tangents
    from ncgen.mechanism.runtime_library import has_runtime, part_for

    name = method.integrator.name
    if not isinstance(kernels, CompiledKernels) and (engine in EMITTED or number != "double" or not has_runtime(part_for(name))):
        return f"the kernels are {kernels.backend}, not compiled"
    if not method.integrator.in_c:
        return f"{name} runs in Python; in C there are {', '.join(in_c(INTEGRATORS))}"
    if not method.formalism.in_c:
        return f"{method.formalism.name} runs in Python; in C there are {', '.join(in_c(FORMALISMS))}"
    if engine in EMITTED and method.is_constrained:
        return f"a state derivative is emitted for coordinate-partitioning, not for {method.formalism.name}"
    if kernels.model.callbacks and number != "double":
        return f"the model calls a Python function, which computes with doubles, not {number}"
    if kernels.model.callbacks and engine in EMITTED:
        return "the model calls a Python function, whose forces are not in what is written out"
    if kernels.model.branches and (engine in EMITTED or number != "double"):
        return "the paper's sine-or-cosine constraints change between steps, in doubles and in C that is the same for all mechanisms"
    if number != "double" and uses_tangents(kernels, name):
        return f"{name} takes derivatives of the kernels, which are double"
    return None


def refusal_of_size(kernels: Kernels, partitions: Partitions, engine: str) -> str | None:
    """Why a state derivative cannot be emitted for a choice of independent coordinates, in words, or None if it can."""
    from ncgen.program.programs import MAX_ELIMINATED_DOF

    if engine in EMITTED and partitions.position is not partitions.velocity:
        return "a state derivative is emitted for one choice of independent coordinates; rolling conditions need two"
    if engine in EMITTED and len(partitions.position.independent) > MAX_ELIMINATED_DOF and not spanning_tree(kernels.model).links:
        return f"without a tree of bodies a state derivative is emitted for up to {MAX_ELIMINATED_DOF} degrees of freedom"
    return None


def is_emitted(kernels: Kernels, partitions: Partitions) -> TypeGuard[CompiledKernels]:
    """True where the state derivative of a choice of independent coordinates can be emitted and run in C."""
    method = Method.of("coordinate-partitioning", "dopri5")
    return (refusal(kernels, method, "emitted", "double") or refusal_of_size(kernels, partitions, "emitted")) is None


def checked_compiled(kernels: Kernels) -> CompiledKernels:
    """The kernels themselves, where `refusal` has nothing against them. Raises ModelError for those that are not compiled."""
    from ncgen.mechanism.library import CompiledKernels

    if not isinstance(kernels, CompiledKernels):
        raise ModelError(f"{kernels.name}: the kernels are {kernels.backend}, not compiled; compile the model with backend='c'")
    return kernels


@cache
def rounding(number: str) -> float:
    """The relative rounding of a number type."""
    from ncgen.toolchain.abi import NUMBERS

    return float(np.finfo(NUMBERS[number].dtype).eps)


def closeness(number: str) -> float:
    """`TOLERANCE` of positions for the digits of a number type."""
    return TOLERANCE * rounding(number) / rounding("double")
