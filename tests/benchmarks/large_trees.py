"""Large random trees of all joints: µs a body and evaluation of a run in loops over tables, and by the factored matrix.

python tests/benchmarks/large_trees.py
"""

from __future__ import annotations

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.open_tree import tree_with_loops

TREES = ((30, 2, 1), (40, 2, 0), (60, 3, 0), (100, 1, 3), (100, 8, 3))
"""Bodies, seed, loops."""

DURATION, RTOL, REPEATS = 0.03, 1e-6, 3


def main() -> None:
    print("bodies  loops  closing rows  tables  matrix   apart")
    for bodies, seed, loops in TREES:
        kernels = ncgen.compile(example_module("tree").build(bodies, seed, loops, False))
        tree = tree_with_loops(kernels)
        assert tree is not None
        runs, each = {}, {}
        for engine in ("auto", "c"):
            for _ in range(REPEATS):
                runs[engine] = ncgen.simulate(kernels, DURATION, rtol=RTOL, points=2, engine=engine)
                spent = 1e6 * runs[engine].statistics.seconds / runs[engine].statistics.evaluations / bodies
                each[engine] = min(spent, each.get(engine, np.inf))
        apart = np.max(np.abs(runs["auto"].q - runs["c"].q) / kernels.column_sizes)
        print(f"{bodies:6}  {loops:5}  {len(tree.closing):12}  {each['auto']:6.2f}  {each['c']:6.1f}  {apart:6.0e}", flush=True)


if __name__ == "__main__":
    main()
