"""Everything that can evaluate the kernels of a mechanism without other programs, behind one face, one kind a module."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from ncgen.comparisons.rivals import differences, generated, user
from ncgen.comparisons.rivals import handwritten as by_hand
from ncgen.comparisons.rivals.base import KERNELS, Inputs, Rival, handwritten
from ncgen.comparisons.rivals.exact import by_differences, exact, relative_error, scale
from ncgen.compiler import compile
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model

__all__ = ["KERNELS", "Inputs", "Rival", "all_rivals", "by_differences", "exact", "handwritten", "relative_error", "rivals", "scale"]

Others: TypeAlias = Callable[[Kernels, Inputs, tuple[str, ...]], list[Rival]]
"""What else computes the kernels of these names: other people's generators, say."""


def nobody(kernels: Kernels, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """No others."""
    return []


def rivals(model: Model, inputs: Inputs, names: tuple[str, ...]) -> list[Rival]:
    """The generated code and what was written by hand; first the generated C that has all kernels in one."""
    kernels = compile(model, "c")
    tools = [*generated.at_once(kernels, inputs), *generated.emissions(model, inputs, names)]
    tools += [generated.compiled("hand-written C", functions, inputs, names) for functions in by_hand.in_c(kernels)]
    tools.append(generated.direct(kernels, inputs, names))
    tools.append(generated.from_python("generated C, from Python", kernels, inputs, names))
    tools.append(generated.from_python("generated NumPy", compile(model, "numpy"), inputs, names))
    return tools + by_hand.in_numpy(kernels, inputs, names)


def all_rivals(model: Model, inputs: Inputs, names: tuple[str, ...], users: list[str], others: Others = nobody) -> list[Rival]:
    """`rivals`, and also: other number types, batches, differences, complex steps, others, the user's own."""
    kernels = compile(model, "c")
    tools = rivals(model, inputs, names)
    tools += generated.other_types(model, inputs, names)
    tools.append(generated.batch(kernels, inputs, names))
    tools += differences.rivals(kernels, compile(model, "numpy"), inputs, names)
    return tools + others(kernels, inputs, names) + user.rivals(kernels, inputs, users)
