"""State derivatives as C source, made now or found in the cache."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

from ncgen.emit.c.files import dynamics_files, motion_files, seeded_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.number_table import FilledSources, NumberTable
from ncgen.mechanism import numbered, recall
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.mechanism.recall import Files
from ncgen.program.ir.sampling import Sample
from ncgen.program.programs import Split
from ncgen.toolchain.undisturbed import undisturbed

if TYPE_CHECKING:
    from ncgen.program.motions.dynamics import DynamicsPrograms, MotionPrograms

Seen: TypeAlias = tuple[Split, Sequence[Sample]]
"""Independent coordinates, and typical positions."""


def motion_source(
    kernels: Kernels, samples_of: Callable[[], Seen | None], kind: Literal["motion", "tangent", "adjoint"] = "motion"
) -> Files:
    """{file name: text} of the motion of all coordinates by recursion, or of its derivatives; {} where there is none. Of a model with
    functions of Python, or friction of loads, its derivative takes their forces as one more input; its derivatives have those of friction.

    samples_of: called for independent coordinates of the positions, and typical positions, None where there are none
    """
    equations, forced = kernels.programs.equations, bool(kernels.model.callbacks)
    friction = ReactiveForce.only(kernels.model.callbacks)

    def made() -> Files:
        from ncgen.program.motions.dynamics import differentiated

        programs = _programs(kernels, samples_of)
        if programs is None:
            return {}
        if kind == "motion":
            return motion_files(programs, equations, forced)
        return seeded_files(differentiated(programs, equations, kind, friction.programs() if friction else None), equations, kind)

    words = kind if not forced else f"forced {kind}" if kind == "motion" or not friction else f"{kind} with {friction.key}"
    return recall.derived(kernels.programs, words, made)


def filled_motion(kernels: Kernels, samples_of: Callable[[], Seen | None], only_exact: bool = False) -> FilledSources:
    """The motion as it is compiled for calls from Python: its numbers are data. Arguments as of `motion_source`; only_exact: not what
    was generated for other numbers."""
    structure, forced = numbered.of(kernels.programs), bool(kernels.model.callbacks)
    if structure is None:
        return FilledSources(motion_source(kernels, samples_of), None)
    kind = "forced motion" if forced else "motion"
    entry = structure.recall(kind, only_exact)
    if entry is not None:
        return entry.sources
    with undisturbed():
        programs = _programs(kernels, samples_of)
        table = NumberTable(f"{prefix_of(kernels.name)}_recursion_numbers")
        files = motion_files(programs, kernels.programs.equations, forced, table) if programs else {}
        return structure.remember(kind, (), files, table, is_general=programs is not None and programs.is_general)


def _programs(kernels: Kernels, samples_of: Callable[[], Seen | None]) -> MotionPrograms | None:
    """The programs of the motion, None where there are none; found once."""
    structure = numbered.of(kernels.programs)
    equations = kernels.programs.equations if structure is None else structure.terms

    def assembled() -> MotionPrograms | None:
        from ncgen.program.motions.dynamics import assemble_motion

        samples = samples_of()
        return assemble_motion(equations, *samples, kernels.column_sizes, bool(kernels.model.callbacks)) if samples else None

    return kernels.remember("motion programs", (), assembled)


@dataclass(frozen=True, eq=False, kw_only=True)
class Written:
    """A state derivative on independent coordinates.

    samples_of: called for typical positions, where they are needed; around: tells these positions from others; refine: as of
    `assemble_dynamics`"""

    kernels: CompiledKernels
    split: Split
    samples_of: Callable[[], Sequence[Sample]]
    around: str
    refine: bool = False

    @cached_property
    def programs(self) -> DynamicsPrograms:
        """The programs that the source is printed from."""
        from ncgen.program.motions.dynamics import assemble_dynamics

        kernels = self.kernels
        return assemble_dynamics(kernels.programs.equations, self.split, self.samples_of(), kernels.column_sizes, self.refine)

    @cached_property
    def files(self) -> Files:
        """{file name: text}."""
        kernels = self.kernels
        description = f"dynamics {self.split} {self.around} {self.refine}"
        return recall.derived(
            kernels.programs, description, lambda: dynamics_files(self.programs, kernels.programs.equations, kernels.row_sizes)
        )
