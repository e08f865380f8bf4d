"""From a model to kernels that can be called: seconds the first time, with an empty cache, and again from it; and its growth.

Every figure comes from a process of its own, so that nothing derived before helps. Imports are not counted.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator

from ncgen.errors import NcgenError

LENGTHS = (100, 320, 640, 1280, 2560, 5000)
"""Links of a chain."""

SCRIPT = """
import json, sys, time
import numpy, scipy.linalg, cffi.cparser, ncgen.compiler
import ncgen.mechanism.batch, ncgen.mechanism.library, ncgen.mechanism.numpy_module, ncgen.mechanism.recall, ncgen.symbolic.numbering
from ncgen.exchange.examples import example_module, load
name, count, cold, emission = json.loads(sys.argv[1])
if cold:
    import sympy, ncgen.emit.sources, ncgen.program.assemble, ncgen.symbolic.equations
model = load(name) if count is None else example_module(name).build(count)
timings = ncgen.compiler.Timings()
start = time.perf_counter()
kernels = ncgen.compiler.compile(model, "c", emission, timings)
seconds = time.perf_counter() - start - timings.seconds.get("import", 0.0)
from ncgen.emit.naming import identifier
from ncgen.comparisons.rivals.generated import code_bytes
code = code_bytes(kernels.library, identifier(kernels.name), kernels.programs.programs)
json.dump({"seconds": seconds, "stages": timings.seconds, "code": sum(code.values())}, sys.stdout)
"""


def generation_records(name: str) -> list[dict]:
    """The first time and again, with all kernels. Raises NcgenError where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        return [
            {"case": "generation", "tool": tool, "error": None, **_measured(folder, name, None, cold, "auto")}
            for tool, cold in (("the first time", True), ("again", False))
        ]


def growth_records(name: str = "chain", lengths: Iterable[int] = LENGTHS) -> Iterator[dict]:
    """A chain of more and more links, in loops over tables."""
    for count in lengths:
        with tempfile.TemporaryDirectory() as folder:
            found = _measured(folder, name, count, True, "tabled")
        yield {"case": "growth", "tool": f"{count} links", "error": None, **found}


def _measured(folder: str, name: str, count: int | None, cold: bool, emission: str) -> dict:
    command = [sys.executable, "-c", SCRIPT, json.dumps([name, count, cold, emission])]
    done = subprocess.run(command, env=os.environ | {"NCGEN_CACHE_DIR": folder}, capture_output=True, text=True)
    if done.returncode:
        raise NcgenError(f"{name}: it cannot be generated: {done.stderr.strip().splitlines()[-1]}")
    return json.loads(done.stdout)
