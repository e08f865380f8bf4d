"""From a model to kernels that can be called: seconds the first time, with an empty cache, and again from it; and its growth, with what
a motion takes.

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

LENGTHS = {"chain": (100, 320, 1000, 3200, 10000), "arm": (20, 50, 70, 200, 1000)}
"""Links of a chain, joints of an arm."""

STEPS = 100
"""Of a motion by rk4."""

SCRIPT = """
import json, resource, sys, time
import numpy, scipy.linalg, cffi.cparser, ncgen.compiler
import ncgen.mechanism.kernel_batch, ncgen.mechanism.library, ncgen.mechanism.numpy_module, ncgen.mechanism.recall, ncgen.symbolic.numbering
from ncgen.exchange.examples import example_module, load
name, count, cold, emission, steps = json.loads(sys.argv[1])
if cold:
    import sympy, ncgen.emit.sources, ncgen.program.assemble, ncgen.symbolic.equations
model = load(name) if count is None else example_module(name).build(count)
spent = lambda: sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
timings = ncgen.compiler.Timings()
start, before = time.perf_counter(), spent()
kernels = ncgen.compiler.compile(model, "c", emission, timings)
seconds = time.perf_counter() - start - timings.seconds.get("import", 0.0)
processor = spent() - before
from ncgen.emit.naming import prefix_of
from ncgen.comparisons.rivals.generated import code_bytes
code = code_bytes(kernels.library, prefix_of(kernels.name), kernels.programs.programs)
found = {"seconds": seconds, "processor": processor, "stages": timings.seconds, "code": sum(code.values())}
if steps:
    from ncgen import simulate
    from ncgen.solver.positions.rank import freedom
    from ncgen.mechanism.runtime_library import compiling_thread
    runtime = compiling_thread()
    runtime.start()
    runtime.join()
    start = spent()
    freedom(kernels)
    found["freedom"] = spent() - start
    few, many = steps // 5, steps + steps // 5
    given = model.simulation_options | {"integrator": "rk4", "max_step": 1e-4, "points": 2}
    runs = [("first", few), ("short", few), ("long", many)], [("", few), ("few", few), ("many", many)]
    for name, count, engine in [(*each, engine) for engine, some in zip(("auto", "c"), runs) for each in some]:
        start = spent()
        run = simulate(kernels, engine=engine, **given | {"duration": count * 1e-4})
        found[name] = spent() - start
        found.setdefault("engine", run.engine)
    found |= {"steps": (found["long"] - found["short"]) / steps, "matrix": (found["many"] - found["few"]) / steps}
json.dump(found, sys.stdout)
"""


def generation_records(name: str) -> list[dict]:
    """The first time and again, with all kernels. Raises NcgenError where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        return [
            {"case": "generation", "tool": tool, "error": None, **_measured(folder, name, None, cold, "auto", 0)}
            for tool, cold in (("the first time", True), ("again", False))
        ]


def growth_records(name: str = "chain", lengths: Iterable[int] | None = None, steps: int = STEPS) -> Iterator[dict]:
    """A chain of more and more links, or an arm, in loops over tables; steps: of a motion, 0 for none."""
    for count in lengths or LENGTHS[name]:
        with tempfile.TemporaryDirectory() as folder:
            found = _measured(folder, name, count, True, "tabled", steps)
        yield {"case": "growth", "tool": f"{count} {'links' if name == 'chain' else 'joints'}", "error": None, **found}


def _measured(folder: str, name: str, count: int | None, cold: bool, emission: str, steps: int) -> dict:
    """From a process of its own. freedom, first: seconds of processor time for the degrees of freedom, and until a first motion of a fifth
    of the steps is over, compilers included; short: the same again; steps: for one more step; matrix: for one by the
    factored matrix."""
    command = [sys.executable, "-c", SCRIPT, json.dumps([name, count, cold, emission, steps])]
    done = subprocess.run(command, env=os.environ | {"NCGEN_CACHE_DIR": folder}, capture_output=True, text=True)
    if done.returncode:
        raise NcgenError(f"{name}: it cannot be generated: {done.stderr.strip().splitlines()[-1]}")
    return json.loads(done.stdout)
