"""Seconds of the processor, of Python and of the compilers together, from a model to its first step: with nothing in the cache, and with
what the first time left there; each in a process of its own, without the imports. Run by hand:

    python tests/program/first_step.py                          # the examples arm, quadruped and robot
    python tests/program/first_step.py quadruped FOLDER/cassie_v2.sdf

Beside, how long each took by the clock; the runtime is compiled alone, once for all mechanisms.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

STEP = """
import json, os, sys, time
import numpy, scipy.linalg, scipy.sparse.linalg, cffi.cparser, sympy, ncgen
import ncgen.emit.sources, ncgen.mechanism.constrained_dynamics, ncgen.program.assemble, ncgen.program.motions.dynamics
import ncgen.solver.engines.compiled
import ncgen.exchange.robots.natural
def spent():
    return sum(os.times()[:4]), time.perf_counter()
before = spent()
library = ncgen.mechanism.runtime_library
kernels = ncgen.compile(ncgen.load(sys.argv[1]), "c") if len(sys.argv) > 1 else library.runtime_of("double", "explicit")
if len(sys.argv) > 1:
    run = ncgen.simulate(kernels, 1e-3, points=2)
print(json.dumps([b - a for a, b in zip(before, spent())]))
"""


def spent(folder: str, *model: str) -> list[float]:
    """Seconds of the processor, and by the clock."""
    done = subprocess.run(
        [sys.executable, "-c", STEP, *model], env=os.environ | {"NCGEN_CACHE_DIR": folder}, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main(*models: str) -> None:
    print(f"{'':24s} {'processor, s':>14s} {'clock, s':>10s}")
    with tempfile.TemporaryDirectory() as folder:
        print("{:24s} {:14.2f} {:10.2f}".format("the runtime alone", *spent(folder)))
    for model in models or ("arm", "quadruped", "robot"):
        with tempfile.TemporaryDirectory() as folder:
            for when in ("nothing cached", "cached"):
                print("{:24s} {:14.2f} {:10.2f}  {}".format(Path(model).stem, *spent(folder, model), when), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
