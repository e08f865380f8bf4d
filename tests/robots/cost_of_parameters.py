"""What a run of a robot costs where all inertias are parameters: operations and instructions of its state derivative.

    python tests/robots/cost_of_parameters.py arm.urdf …

A line a file: with the file's numbers, with numbers that differ by a hundredth, whose zeros and equal moments save nothing, and with
`parameters="inertia"`; the last two columns divide the last by the first and by the second. Instructions are counted by valgrind.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.data import with_other_numbers  # noqa: E402
from benchmarks.instructions import derivative_of_all  # noqa: E402

import ncgen  # noqa: E402

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print("file, what: numbers of the file, others, parameters; parameters / numbers, parameters / others")
    for path in sys.argv[1:]:
        plain, free = ncgen.load(path), ncgen.load(path, parameters="inertia")
        counts = [derivative_of_all(model) for model in (plain, with_other_numbers(plain, inertia_alone=True), free)]
        for what, (own, other, chosen) in zip(("operations", "instructions"), zip(*counts, strict=True), strict=True):
            ratios = f"{chosen / own:.3f}, {chosen / other:.3f}"
            print(f"{Path(path).name}, {what}: {own:,.0f}, {other:,.0f}, {chosen:,.0f}; {ratios}", flush=True)
