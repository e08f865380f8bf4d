"""Seconds to the first answer of `freedom`, `joint_space` and `linearise` for robots' files, in processes of their own with empty caches.

python tests/benchmarks/first_answers.py FILE [FILE ...]

A time begins with the import of ncgen. linearise is asked at the file's own position, at rest.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

QUESTIONS = {
    "freedom": "ncgen.freedom(kernels)",
    "joint_space": "ncgen.joint_space(kernels)",
    "linearise": "ncgen.linearise(kernels)",
}
"""Expressions of `kernels`."""

SCRIPT = """
import time
begun = time.perf_counter()
import sys, warnings
warnings.simplefilter("ignore")
import ncgen
kernels = ncgen.compile(ncgen.load(sys.argv[1]))
{question}
print(time.perf_counter() - begun)
"""


def seconds(path: str, question: str) -> float | str:
    """Of one answer, or the last line of its error."""
    with tempfile.TemporaryDirectory() as cache:
        env = os.environ | {"NCGEN_CACHE_DIR": cache, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run([sys.executable, "-c", SCRIPT.format(question=question), path], capture_output=True, text=True, env=env)
    return float(done.stdout) if done.returncode == 0 else done.stderr.strip().splitlines()[-1]


def main(paths: list[str]) -> None:
    spent: dict[str, list[float]] = {name: [] for name in QUESTIONS}
    for path in paths:
        found = {name: seconds(path, question) for name, question in QUESTIONS.items()}
        for name, value in found.items():
            if isinstance(value, float):
                spent[name].append(value)
        told = "  ".join(f"{name} {value:.1f}" if isinstance(value, float) else f"{name}: {value}" for name, value in found.items())
        print(f"{Path(path).name:40s} {told}", flush=True)
    for name, values in spent.items():
        if values:
            print(f"{name:12s} median {statistics.median(values):.1f} s, worst {max(values):.1f} s, {len(values)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
