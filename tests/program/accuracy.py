"""Errors of accelerations in random positions of every example, by recursion and by the factored matrix, as docs/performance.md shows them.

    python tests/program/accuracy.py [NAME …] [--count 1000] [--away 0 | 1e6]

Expected values take nothing that was generated but Φ, Φ_q, γ, M and Q, which are evaluated with 50 digits: positions are closed, velocities
made consistent and [M Φ_qᵀ; Φ_q 0] solved by refinement, whose residuals have 50 digits, until 30 are right. The state is then rounded
to doubles, which both ways are given; so their errors hold what rounding of the state alone does to accelerations.

--away: metres along x and along y by which the whole mechanism is moved
"""

from __future__ import annotations

import argparse
import contextlib
import re
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

import ncgen
from ncgen.comparisons.rivals.exact import DIGITS, MPMATH
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_names, load
from ncgen.exchange.toml_writer import to_toml
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.program.ir.blocks import Pattern
from ncgen.program.ir.evaluate import evaluate
from ncgen.report.repeat import KernelCall, runner
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.engines.capabilities import closeness
from ncgen.solver.positions.position import TOLERANCE, solve_position
from ncgen.solver.positions.rank import freedom, scaled_jacobian

RIGHT = 1e-30
"""How closely expected values are known."""

REACH = 0.3
"""How far one random position is from the last one, in natural sizes."""

ROUND = 25
"""Positions of a walk before it begins again at the start."""

HANDED_OVER = 10.0
"""The growth from which the runtime takes the matrix instead of the recursion (`ncgen_has_pivot_growth`)."""

SINGULAR = 1e9
"""Condition of the whole matrix from which a position is left out: refinement finds nothing there."""


class NoAnswer(Exception):
    """A position at which refinement does not converge."""


@dataclass(frozen=True)
class Errors:
    """Of one mechanism: relative errors of all accelerations, in natural sizes; left_out: positions too near singular ones;
    handed_over: those in which the recursion gives way to the matrix, which are in `matrix` alone."""

    recursion: np.ndarray
    matrix: np.ndarray
    left_out: int
    handed_over: int


def moved(name: str, away: float) -> ncgen.Model:
    """An example that stands `away` metres farther along x and y, from its own file."""

    def shifted(found: re.Match[str]) -> str:
        x, y, *rest = found[2].split(", ")
        return f"{found[1]} = [{', '.join([repr(float(x) + away), repr(float(y) + away), *rest])}]"

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(re.sub(r"^(position|com) = \[(.*)\]$", shifted, to_toml(load(name)), flags=re.M), encoding="utf-8")
        return load(path)


class Judge:
    """Accelerations with 50 digits."""

    def __init__(self, kernels: CompiledKernels, rows: Sequence[int]) -> None:
        """rows: those that no others imply, since rounded dimensions contradict each other at 50 digits."""
        self.kernels, self.p, self.rows = kernels, [mpmath.mpf(float(x)) for x in kernels.p0], list(rows)
        self.sizes = kernels.row_sizes[self.rows]

    def values(self, name: str, q: list[Any], qd: list[Any] | None = None) -> list[Any] | None:
        """The output of a kernel, None where the mechanism has no such kernel."""
        program = self.kernels.programs.programs.get(name)
        given = {"t": mpmath.mpf(0), "q": q, "qd": qd, "p": self.p}
        return None if program is None else evaluate(program, given, MPMATH, mpmath.mpf)

    def closed(self, guess: np.ndarray) -> list[Any]:
        k, rows = self.kernels, [r for r in self.rows if r in set(self.kernels.holonomic)]
        q = [mpmath.mpf(float(x)) for x in guess]
        inverse = np.linalg.pinv(scaled_jacobian(k, guess)[rows], rcond=1e-10)
        for _ in range(60):
            phi = self.values("phi", q) or []
            rest = np.array([float(phi[r]) / k.row_sizes[r] for r in rows])
            step = inverse @ rest * k.column_sizes
            q = [x - mpmath.mpf(float(d)) for x, d in zip(q, step, strict=True)]
            if np.max(np.abs(rest), initial=0.0) < RIGHT:
                return q
        raise NoAnswer

    def velocities(self, q: list[Any], wanted: np.ndarray) -> list[Any]:
        """The consistent ones nearest to those wanted."""
        k = self.kernels
        qd = [mpmath.mpf(float(x)) for x in wanted]
        inverse = np.linalg.pinv(scaled_jacobian(k, np.array(q, dtype=float))[self.rows], rcond=1e-10)
        phi_q, nu = self.values("phi_q", q) or [], self.values("nu", q) or [mpmath.mpf(0)] * k.m
        for _ in range(60):
            found = _times(k.phi_q_pattern, phi_q, qd)
            rest = np.array([float(found[r] - nu[r]) for r in self.rows]) / self.sizes
            step = inverse @ rest * k.column_sizes
            qd = [x - mpmath.mpf(float(d)) for x, d in zip(qd, step, strict=True)]
            if np.max(np.abs(rest), initial=0.0) < RIGHT:
                return qd
        raise NoAnswer

    def accelerations(self, q: list[Any], qd: list[Any]) -> np.ndarray:
        k, n, m, zero = self.kernels, self.kernels.n, self.kernels.m, mpmath.mpf(0)
        count = len(self.rows)
        position = np.array(q, dtype=float)
        mass, jacobian = k.mass_matrix(position), k.jacobian(position)[self.rows]
        sizes = k.column_sizes
        unit = float(np.max(np.abs(np.diag(mass) * sizes**2)))
        scale = np.concatenate([sizes / np.sqrt(unit), np.sqrt(unit) / self.sizes])
        whole = np.block([[mass, jacobian.T], [jacobian, np.zeros((count, count))]])
        left, values, right = np.linalg.svd(scale[:, None] * whole * scale)
        kept = values > 1e-12 * values[0]
        if values[kept][-1] * SINGULAR < values[0]:
            raise NoAnswer
        inverse = (right[kept].T / values[kept]) @ left[:, kept].T
        M, J = self.values("mass", q) or [], self.values("phi_q", q) or []
        Q, gamma = self.values("force", q, qd) or [zero] * n, self.values("gamma", q, qd) or [zero] * m
        x = [zero] * (n + count)
        for _ in range(60):
            lam = [zero] * m
            for r, value in zip(self.rows, x[n:], strict=True):
                lam[r] = value
            forces = zip(Q, _times(k.mass_pattern, M, x[:n]), _transposed(k.phi_q_pattern, J, lam), strict=True)
            found = _times(k.phi_q_pattern, J, x[:n])
            rest = [*(f - a - b for f, a, b in forces), *(gamma[r] - found[r] for r in self.rows)]
            step = scale * (inverse @ (scale * np.array([float(r) for r in rest])))
            x = [a + mpmath.mpf(float(d)) for a, d in zip(x, step, strict=True)]
            qdd = np.array([float(a) for a in x[:n]])
            if np.max(np.abs(step[:n]) / sizes) <= RIGHT * max(float(np.max(np.abs(qdd) / sizes)), 1e-300):
                return qdd
        raise NoAnswer


def _times(pattern: Pattern, values: list[Any], x: list[Any]) -> list[Any]:
    """A sparse matrix times a vector."""
    rows = zip(pattern.indptr, pattern.indptr[1:])
    return [mpmath.fsum(values[k] * x[pattern.indices[k]] for k in range(start, end)) for start, end in rows]


def _transposed(pattern: Pattern, values: list[Any], x: list[Any]) -> list[Any]:
    sums = [mpmath.mpf(0)] * pattern.shape[1]
    for row, (start, end) in enumerate(zip(pattern.indptr, pattern.indptr[1:])):
        for k in range(start, end):
            sums[pattern.indices[k]] += values[k] * x[row]
    return sums


def positions(kernels: CompiledKernels, count: int) -> Iterator[np.ndarray]:
    """Consistent positions of random walks that begin again and again at the start."""
    rng, sizes = np.random.default_rng(15), kernels.column_sizes
    start = ncgen.assemble(kernels)
    q, found = start, 0
    for attempt in range(4 * count):
        if found == count:
            return
        q = q if attempt % ROUND else start
        _, values, right = np.linalg.svd(scaled_jacobian(kernels, q))
        free = right[int(np.sum(values > 1e-9)) :]
        step = free.T @ (free @ rng.standard_normal(kernels.n))
        guess = q + REACH * sizes * step / max(float(np.max(np.abs(step))), 1e-300)
        with contextlib.suppress(NcgenError):
            q = solve_position(kernels, guess, tolerance=TOLERANCE).q
            found += 1
            yield q


def places_of_points(kernels: CompiledKernels) -> np.ndarray:
    """1 for coordinates along x and y of points, which move with the mechanism; else 0 (n,)."""
    points = [e for e in kernels.model.elements.values() if isinstance(e, ncgen.model.elements.Point)]
    axes = {c.name for e in points for c in e.components[:2]}
    return np.array([float(name in axes) for name in kernels.coordinates])


def errors(name: str, count: int, away: float) -> Errors | None:
    """None where there is no recursion."""
    near = ncgen.compile(load(name), "c")
    kernels = ncgen.compile(moved(name, away), "c") if away else near
    emitted, known, n = all_coordinates(kernels, form="emitted"), freedom(near), kernels.n
    if not emitted.is_emitted:
        return None
    judge, rank = Judge(kernels, known.kept_rows), known.rank
    dense = Moving(Stepping(all_coordinates(kernels), "rk4", rank, 1e-8, 1e-8, None, closeness("double")))
    dense.p[:] = kernels.p0
    call = KernelCall(emitted._dynamics.motion.derivative, 2 * n + 2, (kernels, emitted))
    given, rng, shift = emitted.with_prepared(kernels.p0), np.random.default_rng(1), away * places_of_points(kernels)
    by_recursion, by_matrix, left_out, handed_over = [], [], 0, 0
    for start in positions(near, count):
        try:
            exact = judge.closed(start + shift)
            rates = judge.velocities(exact, rng.standard_normal(n) * kernels.column_sizes)
            expected = judge.accelerations(exact, rates)
        except NoAnswer:
            left_out += 1
            continue
        q, qd = (np.array([float(x) for x in values]) for values in (exact, rates))
        runner(0.0, q, qd, given, [], call)(1)
        dense.q[:], dense.qd[:] = q, qd
        by_matrix.append(_error(kernels, dense.qdd if dense.evaluate() == "ok" else np.full(n, np.nan), expected))
        if call.out[2 * n + 1] < HANDED_OVER:
            by_recursion.append(_error(kernels, call.out[:n], expected))
        else:
            handed_over += 1
    return Errors(np.array(by_recursion), np.array(by_matrix), left_out, handed_over)


def _error(kernels: CompiledKernels, found: np.ndarray, expected: np.ndarray) -> float:
    largest = float(np.max(np.abs(expected) / kernels.column_sizes))
    return float(np.max(np.abs(found - expected) / kernels.column_sizes)) / max(largest, 1e-300)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=example_names())
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--away", type=float, default=0.0)
    options = parser.parse_args()
    print(f"{'':16}{'recursion':>20}{'matrix':>20}   (median and worst relative error of accelerations)")
    for name in options.names:
        clock = time.perf_counter()
        try:
            with mpmath.workdps(DIGITS):
                found = errors(name, options.count, options.away)
        except NcgenError as refusal:
            print(f"{name:16}{refusal}", flush=True)
            continue
        if found is None or not len(found.matrix):
            print(f"{name:16}{'none' if found is None else 'no position':>20}", flush=True)
            continue
        columns = ("".join(f"{f(x):10.1e}" for f in (np.median, np.max)) if len(x) else f"{'':20}" for x in (found.recursion, found.matrix))
        told = f"{len(found.matrix)} positions"
        told += f", {found.left_out} too near singular ones" * bool(found.left_out)
        told += f", in {found.handed_over} the matrix takes over" * bool(found.handed_over)
        print(f"{name:16}{''.join(columns)}   {told}, {time.perf_counter() - clock:.0f} s", flush=True)


if __name__ == "__main__":
    main()
