"""The examples with their degrees of freedom, as `ncgen list` shows them.

Degrees of freedom are numerical facts that take a moment to find, so they are kept beside the compiled libraries,
under a digest of the example's text.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable

import ncgen
from ncgen.build.cache import cache_folder
from ncgen.emit.sources import write_text
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_names, example_text, lesson, load
from ncgen.model import Model


def gallery(progress: Callable[[int], None] | None = None) -> list[dict]:
    """One record an example: name, coordinates, rows, dof, redundant (how many rows), teaches."""
    records = []
    for number, name in enumerate(example_names(), 1):
        records.append({"name": name, **_facts(name), "teaches": lesson(name)})
        if progress:
            progress(number)
    return records


def _facts(name: str) -> dict:
    digest = hashlib.sha256(f"{ncgen.__version__}\n{example_text(name)}".encode()).hexdigest()
    path = cache_folder() / f"facts-{digest[:40]}.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        facts = _found(load(name))
    try:
        write_text(path, json.dumps(facts))
    except NcgenError:
        pass  # a cache that cannot be written only means that this is computed again
    return facts


def _found(model: Model) -> dict:
    from ncgen.compiler import compile
    from ncgen.solver.rank import freedom

    found = freedom(compile(model, backend="numpy"))
    return {
        "coordinates": len(model.components),
        "rows": len(model.rows),
        "dof": found.dof,
        "redundant": len(found.redundant),
    }
