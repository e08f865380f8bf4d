"""C of a mechanism whose numbers are data: it is kept under the structure of a model and serves every model of that structure.

What is kept says how each number of its table is computed from those of a model, and what the generator compared on its way. Where one
of these comparisons has another outcome for the numbers of a model, its code is generated and kept for these numbers alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from ncgen.emit.number_table import FilledSources, NumberTable
from ncgen.mechanism import recall
from ncgen.mechanism.by_programs import ByPrograms
from ncgen.mechanism.generator_identity import generator_identity
from ncgen.mechanism.recall import Files
from ncgen.model import Model
from ncgen.model.traced_numbers import Operation, Trace, TracedComparison, computed
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.programs import Programs, TangentPrograms
from ncgen.symbolic.traced_model import Description, TracedModel, described, has_structure, traced
from ncgen.toolchain.cache_location import keep, kept
from ncgen.toolchain.undisturbed import undisturbed

if TYPE_CHECKING:
    from ncgen.symbolic.equations import Equations
    from ncgen.symbolic.numbering import Terms

FUNCTIONS_OF_NUMBERS = {name: function.python for name, function in FUNCTIONS.items()}


class KeptCode(NamedTuple):
    """What was kept: more than sources, restored for the numbers of a model, and the sources."""

    more: Any
    sources: FilledSources


@dataclass(frozen=True, eq=False, kw_only=True)
class Structured:
    """A mechanism as one of its structure. emission: as of `ncgen.generate`; key: what it is kept under with its numbers; digest, numbers,
    rates: as of `Description.told_apart`; unfit: kinds of which `recall` found what other numbers need."""

    model: Model
    emission: str
    key: str
    digest: str
    numbers: list[float]
    rates: int
    unfit: set[str] = field(default_factory=set, init=False)

    @cached_property
    def traced(self) -> TracedModel:
        """The model with traced numbers, made where code is generated."""
        copy = traced(self.model)
        assert copy is not None and copy.digest == self.digest, f"{self.model.name}: another model than was compiled"
        return copy

    @cached_property
    def terms(self) -> Equations:
        """The equations, whose numbers are traced."""
        from ncgen.symbolic.equations import build_equations

        return build_equations(self.traced.model)

    def recall(self, kind: str, only_exact: bool = False, is_traced: bool = True) -> KeptCode | None:
        """What was kept of a kind for these numbers, or for others where it holds for these, too. only_exact: not for others; is_traced:
        with traced numbers, from which more can be generated."""
        general, exact = self._keys(kind)
        if only_exact:
            self.unfit.add(kind)
        for key in (exact,) if only_exact else (general, exact):
            entry = kept(recall.KIND, key)
            if entry is None:
                continue
            made_for, plain, files, table, *trace = entry
            operations, comparisons = _restored_trace(*trace)
            values = computed(operations, comparisons, self.numbers, FUNCTIONS_OF_NUMBERS)
            if values is not None:
                more = recall.restored(plain, Trace(operations) if is_traced else None, values)
                return KeptCode(more, FilledSources(files, None if table is None else [values[k] for k in table], made_for == exact))
            self.unfit.add(kind)
        return None

    def remember(self, kind: str, more: Any, files: Files, table: NumberTable | None, is_general: bool = True) -> FilledSources:
        """Keep what was generated from traced equations: for the structure, or for these numbers alone where `recall` found something else
        for the structure, or where it is not general."""
        trace = self.traced.trace
        operations = None if table is None else [trace.operation(value) for value in table.entries]
        general, exact = self._keys(kind)
        entry = (exact, recall.plain(more), files, operations, trace.operations, trace.comparisons if is_general else [])
        keep(recall.KIND, general if is_general and kind not in self.unfit else exact, entry, recall.MAX_ENTRY_BYTES)
        return FilledSources(files, None if table is None else [float(value) for value in table.entries], True)

    def _keys(self, kind: str) -> tuple[str, str]:
        """What a kind is kept under, for the structure and for the numbers alone."""
        words = f"{generator_identity()}\n{self.emission}\n{kind}\n{self.digest}"
        numbers = " ".join(map(float.hex, self.numbers))
        return recall.digest_of(words), recall.digest_of(f"{words}\n{numbers}")


def structured(model: Model, emission: str) -> Structured | None:
    """A model as one of its structure; None where its numbers are not told from it."""
    description = described(model) if has_structure(model) else None
    if description is None:
        return None
    key = recall.key_of_described(description, emission)
    digest, numbers, rates = _told_apart(description, key)
    if not digest:
        return None
    return Structured(model=model, emission=emission, key=key, digest=digest, numbers=numbers, rates=rates)


def _told_apart(description: Description, key: str) -> tuple[str, list[float], int]:
    """What a description tells apart, from the cache or found now; no digest where it tells nothing."""
    named = recall.digest_of(f"{key}\nstructure")
    entry = kept(recall.KIND, named)
    if entry is None:
        entry = description.told_apart() or ("", [], 0)
        keep(recall.KIND, named, entry, recall.MAX_ENTRY_BYTES)
    digest, numbers, rates = entry
    return digest, numbers, rates


def associate(programs: Programs, structure: Structured | None) -> Structured | None:
    """Let this be what `of` finds."""
    if structure is not None:
        recall.key_of.note(programs, structure.key)
    return of.note(programs, structure)


of = ByPrograms(lambda programs: associate(programs, structured(programs.equations.model, programs.emission)))
"""The mechanism of some programs as one of its structure."""


def kept_tangents(programs: Programs, kind: str, make: Callable[[Terms], TangentPrograms]) -> TangentPrograms:
    """Tangent programs of a mechanism: kept for its structure, else for itself, or made now of its equations."""
    structure = of(programs)
    if structure is None:
        return recall.derived_tangents(programs, kind, lambda: make(programs.equations))
    with undisturbed():
        entry = structure.recall(kind, is_traced=False)
        if entry is not None:
            return TangentPrograms(kind, *entry.more)
        made = make(structure.terms)
        structure.remember(kind, (made.programs, made.patterns), {}, None)
        return TangentPrograms(kind, *recall.untraced((made.programs, made.patterns)))


def _restored_trace(operations: Sequence[Any], comparisons: Sequence[Any]) -> tuple[list[Operation], list[TracedComparison]]:
    return [(code, tuple(operands)) for code, operands in operations], [TracedComparison(*each) for each in comparisons]
