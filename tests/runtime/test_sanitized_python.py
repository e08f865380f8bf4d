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

ROOT = Path(__file__).resolve().parents[2]
FLAGS = "-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
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


@pytest.mark.parametrize("name", SETS)
def test_ordinary_tests_are_silent(name, tmp_path):
    """Every one of them passes, and nothing is reported."""
    done = run("-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *SETS[name], cache=tmp_path)
    reports = [line for line in (done.stdout + done.stderr).splitlines() if "Sanitizer" in line or "runtime error:" in line]
    last = (done.stdout.strip().splitlines() or ["nothing"])[-1]
    print(f"\n{name}: exit {done.returncode}, {len(reports)} reports; {last}")
    assert reports == [] and done.returncode == 0, (reports[:5], done.stdout[-3000:], done.stderr[-3000:])
