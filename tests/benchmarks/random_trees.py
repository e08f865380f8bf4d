"""Random trees of 10 to 200 bodies with 0 to 6 loops: µs a body and evaluation, the worst over the median, and which form moves them.

python tests/benchmarks/random_trees.py [TREES]

Processor time of runs with dop853. Accelerations in a random state are compared with those of a null space of the constraints, found by
singular values; so are those of the factored
matrix, which is singular (nan) for some trees with redundant rows.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.positions.open_tree import why_no_tables
from ncgen.solver.positions.rank import freedom, scaled_jacobian

TREES = 40
BODIES, LOOPS = (10, 200), (0, 6)

DURATION, RTOL, REPEATS = 0.02, 1e-6, 3


@dataclass(frozen=True)
class Measured:
    """bodies, loops; form: of accelerations; each: µs a body and evaluation; apart, matrix_apart: largest difference of accelerations, and
    of the factored matrix's, from those of the null space, over the largest of these; fallbacks: of evaluations; reason: why there are no
    tables"""

    bodies: int
    loops: int
    form: str
    each: float
    apart: float
    matrix_apart: float
    fallbacks: int
    reason: str | None


def drawn(number: int) -> tuple[int, int]:
    """Bodies and loops of a tree."""
    rng = np.random.default_rng([9, number])
    bodies, loops = (int(rng.integers(least, most + 1)) for least, most in (BODIES, LOOPS))
    return bodies, loops


def measure(number: int) -> Measured:
    """One random tree."""
    bodies, loops = drawn(number)
    kernels = ncgen.compile(example_module("tree").build(bodies, number, loops, False))
    form = acceleration_forms.form_of(kernels, Method.of("lagrange", "dop853"))
    rank = freedom(kernels).rank
    chosen, matrix = (
        Stepping(acceleration_forms.all_coordinates(kernels, form=f), "dop853", rank, RTOL, RTOL, None, 1e-12) for f in (form, "dense")
    )
    start = Moving(chosen)
    start.p[:] = kernels.p0
    start.q[:] = ncgen.assemble(kernels)
    start.qd[:] = np.random.default_rng(number).uniform(-0.5, 0.5, kernels.n) * kernels.column_sizes
    if start.project_state() != "ok":
        raise ArithmeticError(f"tree {number}: no velocities are allowed")
    q, qd = start.q.copy(), start.qd.copy()
    found = []
    for stepping in (chosen, matrix):
        state = _at(kernels, stepping, q, qd)
        status = state.evaluate()
        found.append(state.qdd.copy() if status == "ok" else np.full(kernels.n, np.nan))
    expected = by_null_space(kernels, q, qd)
    apart, matrix_apart = (float(np.max(np.abs(qdd - expected)) / np.max(np.abs(expected))) for qdd in found)
    each, fallbacks = np.inf, 0
    for _ in range(REPEATS):
        state = _at(kernels, chosen, q, qd)
        begin = time.process_time()
        if state.go_on(DURATION) != "ok":
            raise ArithmeticError(f"tree {number}: the run failed")
        spent = time.process_time() - begin
        each, fallbacks = min(each, 1e6 * spent / chosen.statistics.evaluations / bodies), chosen.statistics.fallbacks
    return Measured(bodies, loops, form, each, apart, matrix_apart, fallbacks, why_no_tables(kernels))


def by_null_space(kernels: Kernels, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Accelerations T (TᵀMT)⁻¹ Tᵀ (Q − M a) + a, where T spans what the constraints allow and a has their right sides."""
    force, gamma = (kernels.values(name, 0.0, q, qd, kernels.p0) for name in ("force", "gamma"))
    left, values, right = np.linalg.svd(scaled_jacobian(kernels, q))
    rank = freedom(kernels).rank
    T = kernels.column_sizes[:, None] * right[rank:].T
    a = kernels.column_sizes * (right[:rank].T @ (left[:, :rank].T @ (gamma / kernels.row_sizes) / values[:rank]))
    M = kernels.mass(q)
    return a + T @ np.linalg.solve(T.T @ (M @ T), T.T @ (force - M @ a))


def _at(kernels: Kernels, stepping: Stepping, q: np.ndarray, qd: np.ndarray) -> Moving:
    state = Moving(stepping)
    state.p[:], state.q[:], state.qd[:] = kernels.p0, q, qd
    return state


def main(count: int) -> None:
    print("number  bodies  loops  form     µs a body    apart   matrix  fallbacks  no tables since")
    all_trees = []
    for number in range(count):
        tree = measure(number)
        all_trees.append(tree)
        figures = f"{tree.each:9.2f}  {tree.apart:7.0e}  {tree.matrix_apart:7.0e}  {tree.fallbacks:9}  {tree.reason or ''}"
        print(f"{number:6}  {tree.bodies:6}  {tree.loops:5}  {tree.form:7}  {figures}", flush=True)
    each = np.array([tree.each for tree in all_trees])
    have, take = sum(tree.reason is None for tree in all_trees), sum(tree.form == "tree" for tree in all_trees)
    print(f"{have} of {count} have tables, {take} take them")
    median, worst = np.median(each), np.max(each)
    print(f"µs a body: median {median:.2f}, worst {worst:.2f}, worst over median {worst / median:.2f}")
    singular = sum(np.isnan(tree.matrix_apart) for tree in all_trees)
    print(f"apart at most {max(tree.apart for tree in all_trees):.0e}")
    print(f"the matrix {np.nanmax([tree.matrix_apart for tree in all_trees]):.0e}, and singular in {singular}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else TREES)
