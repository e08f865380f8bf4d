"""What the program stage hands on: the kernels of one mechanism, and what a choice of independent coordinates is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ncgen.program.ir.blocks import Pattern, Program

if TYPE_CHECKING:
    from ncgen.symbolic.numbering import Terms


EMISSIONS = {"unrolled": math.inf, "tabled": 2, "auto": 16}
"""The least number of equal terms that become a loop; measured, loops pay from about 16 on (docs/performance.md)."""

ENERGIES = ("kinetic", "potential", "power")
"""The numbers of the kernel "energy", in their order: J, J, and W of forces without a potential."""

MAX_ELIMINATED_DOF = 24
"""Degrees of freedom up to which a mechanism without a tree of bodies has its mass matrix eliminated in straight-line code."""


@dataclass(frozen=True, kw_only=True)
class Programs:
    """All kernels of a mechanism, with the patterns of its matrices.

    programs: {kernel name: Program}; kernels that a scene does not need are missing
    equations: the numbering, and all terms; those of programs that were kept from before are built again when asked for
    omitted: what was left out, in words
    """

    equations: Terms
    programs: dict[str, Program]
    phi_q: Pattern
    mass: Pattern
    emission: str
    omitted: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Programs {self.equations.model.name}: {', '.join(self.programs)}>"


@dataclass(frozen=True)
class TangentPrograms:
    """programs, patterns: by kernel name; what a mechanism does not need has a pattern without nonzeros and no program.

    kind: "tangents" or "parameter_tangents", as in ncgen.h
    """

    kind: str
    programs: dict[str, Program]
    patterns: dict[str, Pattern]


@dataclass(frozen=True)
class Split:
    """rows: kept rows; dependent, independent: positions in q."""

    rows: tuple[int, ...]
    dependent: tuple[int, ...]
    independent: tuple[int, ...]
