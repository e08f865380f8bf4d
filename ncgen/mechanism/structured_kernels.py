"""The kernels of a mechanism as C whose numbers are data."""

from __future__ import annotations

from dataclasses import replace

from ncgen.emit.c.files import model_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.number_table import FilledSources, NumberTable
from ncgen.emit.sources import Sources
from ncgen.mechanism import numbered
from ncgen.mechanism.numbered import Structured
from ncgen.mechanism.recall import Files
from ncgen.model import Model
from ncgen.program.programs import Programs
from ncgen.symbolic.numbering import DeferredTerms
from ncgen.toolchain.undisturbed import undisturbed

KIND = "kernels"


def kept_sources(structure: Structured, model: Model) -> Sources | None:
    """The sources of a model of a structure that was compiled before, or None."""
    with undisturbed():
        entry = structure.recall(KIND)
    if entry is None:
        return None
    programs, phi_q, mass, omitted = entry.more
    made = Programs(equations=DeferredTerms(model), programs=programs, phi_q=phi_q, mass=mass, emission=structure.emission, omitted=omitted)
    numbered.associate(made, structure)
    return Sources(made, {}, entry.sources)


def compiled_sources(programs: Programs) -> FilledSources:
    """The sources of programs that are compiled for calls from Python, printed now."""
    if numbered.of(programs) is None:
        return FilledSources(model_files(programs), None)
    files, table = _printed(programs)
    return FilledSources(files, list(map(float, table.entries)))


def remembered_sources(structure: Structured, model: Model, programs: Programs) -> Sources:
    """The sources of programs that were generated from the traced equations of a model, which are kept."""
    more = (programs.programs, programs.phi_q, programs.mass, programs.omitted)
    made = replace(programs, equations=DeferredTerms(model))
    numbered.associate(made, structure)
    return Sources(made, {}, structure.remember(KIND, more, *_printed(programs)))


def _printed(programs: Programs) -> tuple[Files, NumberTable]:
    """Their sources, and the table that these read the numbers from."""
    table = NumberTable(f"{prefix_of(programs.equations.model.name)}_numbers")
    return model_files(programs, table), table
