"""Instructions of a step of RK4 in a run called from Python, over those of its four derivatives alone, counted by valgrind.

python tests/benchmarks/steps.py [MODEL ...]

MODEL is an example, armN, an arm of N joints, or randomN, a random one (arm7 and robot unless told otherwise). A step comes from the
difference of whole processes with 3,100 and with 100 steps, so what is done once is left out.
Counts repeat to 0.1 %.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import ncgen
from benchmarks.arms import SEED, arm
from benchmarks.instructions import COMMON, counted_by_valgrind, derivative_of_all
from ncgen.mechanism import listening
from ncgen.model import Model

LENGTHS = 100, 3100
"""Steps of the two runs."""

DURATION = 0.1
"""Of both, in s."""

RUN = """
import sys
from benchmarks import steps
steps.run(*sys.argv[1:])
"""


def model_of(name: str) -> Model:
    found = re.fullmatch(r"(arm|random)(\d+)", name)
    return arm(int(found[2]), SEED if found[1] == "random" else None) if found else ncgen.load(name)


def run(name: str, steps: str) -> None:
    """A run of so many steps, whose progress is reported after numbers of stages that the clock has no part in."""
    listening.REACTION = 1e6
    given = {"formalism": "lagrange", "integrator": "rk4", "max_step": DURATION / int(steps), "points": 2}
    ncgen.simulate(ncgen.compile(model_of(name), backend="c"), DURATION, **given)


def instructions_of_run(name: str, steps: int) -> int:
    """Of a process with a run. Raises NcgenError where valgrind does not count it."""
    arguments = [sys.executable, "-c", RUN, name, str(steps)]
    env = os.environ | {
        "NCGEN_CFLAGS": f"-march={COMMON}",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(sys.path),
        "PYTHONHASHSEED": "0",
    }
    subprocess.run(arguments, env=env, check=True)  # compiled outside of valgrind
    return counted_by_valgrind(name, arguments, env=env)


def step(name: str) -> tuple[float, float]:
    """Instructions of a step, and of a derivative by itself."""
    few, many = (instructions_of_run(name, length) for length in LENGTHS)
    return (many - few) / (LENGTHS[1] - LENGTHS[0]), derivative_of_all(model_of(name))[1]


def main(names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as cache:
        os.environ["NCGEN_CACHE_DIR"] = cache
        for name in names or ["arm7", "robot"]:
            whole, derivative = step(name)
            print(
                f"{name:10s} {whole:8.0f} a step, {derivative:6.0f} a derivative, {whole / (4 * derivative):.2f} of four of them",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
