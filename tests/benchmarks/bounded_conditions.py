"""Instructions that conditions cost, bounded between the nodes and sampled there: `python tests/benchmarks/bounded_conditions.py`.

A double pendulum swings for 2 s, and a condition that does not happen is watched. Counted by valgrind, for the function that looks for
conditions in a step and for the run as a whole, so that the load of the machine does not matter.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import sympy as sp

import ncgen
from ncgen.mechanism import conditions_in_c

CONDITIONS = {
    "angle between the rods": lambda A, B: sp.atan2(A.x * (B.y - A.y) - A.y * (B.x - A.x), A.x * (B.x - A.x) + A.y * (B.y - A.y)) - 4,
    "distance, with its root": lambda A, B: sp.sqrt(B.x**2 + B.y**2) - 2.5,
    "pull of a spring": lambda A, B: 10 * (sp.sqrt((B.x - 3) ** 2 + B.y**2) - 0.5) * (B.x - 3) / sp.sqrt((B.x - 3) ** 2 + B.y**2) - 100,
    "cubic": lambda A, B: A.x * B.x * B.y - 9,
    "sine": lambda A, B: sp.sin(2 * B.x) + B.y - 9,
}


def run(name: str, is_sampled: bool) -> None:
    m = ncgen.Model("double")
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0)), m.point("B", (2, 0))
    m.body("upper", [O, A], mass=1.0, com=(0.5, 0), inertia=1 / 12)
    m.body("lower", [A, B], mass=1.0, com=(0.5, 0), inertia=1 / 12)
    m.gravity((0, -9.81))
    m.event("seen", when=CONDITIONS[name](A, B), direction="either")
    if is_sampled:
        conditions_in_c.Watched.__init__ = without_formulas(conditions_in_c.Watched.__init__)
    done = ncgen.simulate(ncgen.compile(m), 2.0, points=2)
    assert is_sampled or not done.events  # samples of an angle that jumps make a polynomial that passes anything
    print(done.statistics.steps)


def without_formulas(begin):
    def begun(self, conditions, ffi, number):
        begin(self, conditions_in_c.Conditions(**{**vars(conditions), "formulas": None}), ffi, number)

    return begun


def instructions(function: str, *arguments: str) -> tuple[int, int]:
    """Of all calls of a function of C, and how many steps the run took."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--toggle-collect={function}", f"--callgrind-out-file={Path(folder, 'out')}"]
        done = subprocess.run([*command, sys.executable, __file__, *arguments], capture_output=True, text=True, check=True)
        (total,) = re.findall(r"^summary: (\d+)", Path(folder, "out").read_text(), re.MULTILINE)
    return int(total), int(done.stdout)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        run(sys.argv[1], sys.argv[2] == "sampled")
        sys.exit()
    os.environ["NCGEN_CFLAGS"] = "-march=x86-64-v3"  # valgrind knows no AVX-512
    print("| condition | sampled | bounded | the run with it sampled |\n|---|---|---|---|")
    for name in CONDITIONS:
        run(name, False)  # compiles
        (sampled, steps), (bounded, _) = (instructions("ncgen_conditions_step", name, kind) for kind in ("sampled", "bounded"))
        whole, _ = instructions("ncgen_simulate", name, "sampled")
        print(f"| {name} | {sampled / steps:,.0f} | {bounded / steps:,.0f} | {whole / steps:,.0f} |", flush=True)
