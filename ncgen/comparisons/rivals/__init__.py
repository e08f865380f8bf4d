"""Everything that can evaluate the kernels of a mechanism, behind one face, one kind a module."""

from __future__ import annotations

from ncgen.comparisons.rivals import casadi, differences, generated, jax, lambdified, symforce, user
from ncgen.comparisons.rivals import handwritten as by_hand
from ncgen.comparisons.rivals.base import KERNELS, Inputs, Rival, handwritten
from ncgen.comparisons.rivals.exact import by_differences, exact, relative_error, scale
from ncgen.compiler import compile
from ncgen.model import Model

__all__ = ["KERNELS", "Inputs", "Rival", "all_rivals", "by_differences", "exact", "handwritten", "relative_error", "rivals", "scale"]


def rivals(model: Model, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """The generated code, what was written by hand and sympy's own; first the generated C that has all kernels in one."""
    kernels = compile(model, "c")
    found = [*generated.at_once(kernels, inputs), *generated.emissions(model, inputs, names)]
    found += [generated.compiled("hand-written C", functions, inputs, names) for functions in by_hand.in_c(kernels)]
    found.append(generated.direct(kernels, inputs, names))
    found.append(generated.from_python("generated C, from Python", kernels, inputs, names))
    found.append(generated.from_python("generated NumPy", compile(model, "numpy"), inputs, names))
    return found + by_hand.in_numpy(kernels, inputs, names) + lambdified.rivals(kernels, inputs, names)


def all_rivals(model: Model, inputs: Inputs, names: tuple[str, ...], users: list[str]) -> list[Rival]:
    """`rivals`, and also: other number types, batches, differences, complex steps, automatic differentiation, the user's own."""
    kernels = compile(model, "c")
    found = rivals(model, inputs, names)
    found += generated.other_types(model, inputs, names)
    found.append(generated.batch(kernels, inputs, names))
    found += differences.rivals(kernels, compile(model, "numpy"), inputs, names)
    for tool in (casadi, jax, symforce):
        found += tool.rivals(kernels, inputs, names)
    return found + user.rivals(kernels, inputs, users)
