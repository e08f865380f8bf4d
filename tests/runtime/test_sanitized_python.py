"""Compiled code under the address and undefined-behaviour sanitizers while Python calls it: the runtime and all kernels have them.

    python -m pytest -m slow tests/runtime/test_sanitized_python.py -s

prints what each set of tests said. The sanitizers' library is loaded before Python, whose memory and NumPy's is then watched, too.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ncgen.emit.runtime_files import needed_by, runtime_files

ROOT = Path(__file__).resolve().parents[2]
FLAGS = "-O0 -g -DNCGEN_GAP=32 -fsanitize=address,undefined -fno-sanitize-recover=all"
SETS = {
    "wrong calls": ["-m", "slow or not slow", "tests/abuse/test_wrong_calls.py", "tests/mechanism/test_arguments.py"],
    "steppers": ["tests/solver/test_steppers.py", "tests/solver/test_simulation.py", "tests/solver/test_stepper_state.py"],
    "batches": ["tests/solver/test_batch_runs.py", "tests/solver/test_simulations.py", "tests/solver/test_gradients_of_many.py"],
    "joint space": ["tests/robots/test_joint_space.py", "tests/robots/test_joint_arguments.py"],
    "kernels": ["tests/kernels"],
    "breaks": ["tests/solver/test_break_times.py", "tests/solver/test_inputs.py"],
    "trees in tables": ["tests/runtime/test_loops_by_tables.py", "tests/runtime/test_trees_with_mimics.py"],
}
BEYOND = """
import numpy as np, ncgen
kernels = ncgen.compile(ncgen.load("robot"), "c")
ffi, out = kernels._ffi, np.zeros(kernels.m)
arrays = (ffi.from_buffer("double[]", array) for array in (np.zeros(1), kernels.p0.copy(), out))
kernels.function("phi")(0.0, *arrays)
"""
"""A call behind the back of all checks: one number where the kernel reads all coordinates."""

PARTS = """
#include <stdlib.h>
#include "ncgen_space.h"
int main(int argc, char **argv)
{
    ncgen_space space = {(ncgen_real *)malloc(1000 * sizeof(ncgen_real)), 0};
    ncgen_real *part = ncgen_take(&space, 3), *next = ncgen_take(&space, 3);
    next[0] = 1;
    part[atoi(argv[argc - 1])] = next[0];
    return 0;
}
"""


def preloaded() -> str | None:
    """The sanitizers' libraries of the compiler, as LD_PRELOAD takes them; None where there are none."""
    if not sys.platform.startswith("linux") or not shutil.which("gcc"):
        return None
    found = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    return ":".join(found) if all(map(os.path.isabs, found)) else None


pytestmark = [pytest.mark.slow, pytest.mark.skipif(preloaded() is None, reason="no gcc with sanitizers")]


def run(*command: str, cache: Path) -> subprocess.CompletedProcess[str]:
    """Python with everything that it compiles under the sanitizers."""
    environment = os.environ | {
        "CC": "gcc", "NCGEN_CFLAGS": FLAGS, "NCGEN_CACHE_DIR": str(cache), "LD_PRELOAD": preloaded() or "", "PYTHONMALLOC": "malloc",
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0", "UBSAN_OPTIONS": "print_stacktrace=1", "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": str(ROOT), "LONGEST_CALL": "600",
    }  # fmt: skip
    return subprocess.run([sys.executable, *command], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=3600)


def test_the_sanitizers_see_what_python_hands_over(tmp_path):
    """Else silence would say nothing."""
    done = run("-c", BEYOND, cache=tmp_path)
    assert done.returncode != 0 and "AddressSanitizer: heap-buffer-overflow" in done.stderr, done.stderr[-2000:]


def _reports(done: subprocess.CompletedProcess[str]) -> list[str]:
    return [line for line in (done.stdout + done.stderr).splitlines() if "Sanitizer" in line or "runtime error:" in line]


def test_motions_are_silent(tmp_path):
    """Of all methods, by tables, with events and derivatives, alone and in batches. Parts of a workspace have gaps between them then."""
    done = run("tests/runtime/sanitized_motions.py", cache=tmp_path)
    assert _reports(done) == [] and done.returncode == 0, done.stdout[-1000:] + done.stderr[-3000:]


@pytest.mark.parametrize("position", [2, 3])
def test_one_number_beyond_a_part_of_a_workspace_is_seen(position, tmp_path):
    """Though that is no end of the memory that was allocated. The part has three numbers."""
    (tmp_path / "parts.c").write_text(PARTS)
    for name, text in runtime_files(*needed_by("ncgen_space.c")).items():
        (tmp_path / name).write_text(text)
    subprocess.run(["gcc", "-I.", *FLAGS.split(), "parts.c", "ncgen_space.c", "-o", "parts"], cwd=tmp_path, check=True)
    done = subprocess.run(["./parts", str(position)], cwd=tmp_path, capture_output=True, text=True, env={"ASAN_OPTIONS": "detect_leaks=0"})
    assert done.returncode != 0 if position == 3 else done.returncode == 0, done.stderr
    assert ("AddressSanitizer: use-after-poison" in done.stderr) == (position == 3), done.stderr[-2000:]


@pytest.mark.parametrize("name", SETS)
def test_ordinary_tests_are_silent(name, tmp_path):
    """Every one of them passes, and nothing is reported."""
    done = run("-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *SETS[name], cache=tmp_path)
    reports = _reports(done)
    last = (done.stdout.strip().splitlines() or ["nothing"])[-1]
    print(f"\n{name}: exit {done.returncode}, {len(reports)} reports; {last}")
    assert reports == [] and done.returncode == 0, (reports[:5], done.stdout[-3000:], done.stderr[-3000:])
