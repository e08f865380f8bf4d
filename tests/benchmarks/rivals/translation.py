"""Which mechanisms other people's generators can be given."""

from __future__ import annotations

from ncgen.comparisons.rivals.base import differentiable
from ncgen.mechanism.kernels import Kernels
from ncgen.program.ir.graph import PIECES


def translatable(kernels: Kernels) -> bool:
    """Whether programs of Φ and forces have functions alone that others have by themselves, too: no splines, no tables."""
    lookups = (op.code == PIECES for program in kernels.programs.programs.values() for block in program.blocks for op in block.ops)
    return differentiable(kernels) and not any(lookups)
