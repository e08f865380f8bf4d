"""The examples with their degrees of freedom, as `ncgen list` shows them.

Degrees of freedom are numerical facts that take a moment to find, so they are kept next to the compiled libraries,
under a digest of the example's text.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from ncgen import __version__
from ncgen.exchange.examples import example_names, example_text, lesson, load
from ncgen.model import Model
from ncgen.toolchain.cache_location import keep, kept

ENTRIES = {"coordinates", "constraints", "dof", "redundant"}
"""What is kept of an example; what an older ncgen kept has other entries."""


def gallery(progress: Callable[[int], None] | None = None) -> list[dict]:
    """One record an example: name, coordinates, constraints, dof, redundant (how many constraints), teaches."""
    records = []
    for number, name in enumerate(example_names(), 1):
        records.append({"name": name, **_facts(name), "teaches": lesson(name)})
        if progress:
            progress(number)
    return records


def _facts(name: str) -> dict:
    digest = hashlib.sha256(f"{__version__}\n{example_text(name)}".encode()).hexdigest()
    facts = kept("facts", digest[:40])
    if facts is None or set(facts) != ENTRIES:
        facts = _degrees_of_freedom(load(name))
        keep("facts", digest[:40], facts)
    return facts


def _degrees_of_freedom(model: Model) -> dict:
    from ncgen.compiler import compile
    from ncgen.solver.positions.rank import freedom

    freedoms = freedom(compile(model, backend="numpy"))
    return {"coordinates": len(model.components), "constraints": len(model.rows), "dof": freedoms.dof, "redundant": len(freedoms.redundant)}
