"""A state derivative on independent coordinates as C source, made now or found in the cache."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ncgen.emit.c.files import dynamics_files
from ncgen.mechanism import recall
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.recall import Files
from ncgen.program.programs import Split
from ncgen.program.sampling import Sample

if TYPE_CHECKING:
    from ncgen.program.dynamics import DynamicsPrograms


@dataclass(frozen=True, eq=False)
class Written:
    """seen: called for typical positions, where they are needed; around: tells these positions from others; refine: as of
    `assemble_dynamics`"""

    kernels: CompiledKernels
    split: Split
    seen: Callable[[], Sequence[Sample]]
    around: str
    refine: bool = False

    @cached_property
    def programs(self) -> DynamicsPrograms:
        """The programs that the source is printed from."""
        from ncgen.program.dynamics import assemble_dynamics

        kernels = self.kernels
        return assemble_dynamics(kernels.programs.equations, self.split, self.seen(), kernels.column_sizes, self.refine)

    @cached_property
    def files(self) -> Files:
        """{file name: text}."""
        kernels = self.kernels
        told = f"dynamics {self.split} {self.around} {self.refine}"
        return recall.derived(kernels.programs, told, lambda: dynamics_files(self.programs, kernels.programs.equations, kernels.row_sizes))
