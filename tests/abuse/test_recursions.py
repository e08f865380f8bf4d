"""Accelerations of random mechanisms by recursion, judged by R of all coordinates: another formulation, from other equations."""

from __future__ import annotations

import os
import warnings
from collections import Counter

import mpmath
import numpy as np
import pytest
from random_models import Maker

import ncgen
from ncgen.errors import NcgenError
from ncgen.program.algebra.elimination import EliminationError
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions import dynamics
from ncgen.program.motions.motion import RecursiveMotions
from ncgen.program.tree.rates import NoRecursion
from ncgen.program.tree.recursion import assemble_recursions
from ncgen.solver.engines.partition_dynamics import samples, split_of
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.rank import scaled_jacobian

MANY = int(os.environ.get("NCGEN_ABUSE_COUNT", 2000))
LARGEST = 30
"""Degrees of freedom that are looked at."""

APART = 1e-10
SINGULAR = 1e5
"""Condition from which the rounding of a model's own numbers is seen."""

EXACT = {
    name: getattr(mpmath, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "log", "asin", "acos", "atan", "sinh", "cosh", "tanh")
}
EXACT |= {"abs": abs, "sign": mpmath.sign, "atan2": mpmath.atan2, "pow": mpmath.power}


def compare(seed: int, counts: Counter) -> str | None:
    """What is wrong with a seed's mechanism, or None."""
    model = Maker(seed).model
    try:
        kernels = ncgen.compile(model, "numpy")
        q = ncgen.assemble(kernels)
        split = split_of(choose_partitions(kernels, q, independent=model.chosen_independent).velocity)
        if model.callbacks or model.branches or not 0 < len(split.independent) <= LARGEST:
            counts["left out"] += 1
            return None
        given = kernels.programs.equations, split, samples(kernels, q, kernels.p0), kernels.column_sizes
        ways = assemble_recursions(*given)
        ways |= {f"{name} of all": way for name, way in RecursiveMotions(given[0], *given[2:]).derivatives().items()}
        judge, closing = dynamics.by_all_coordinates(*given), dynamics.newton(*given[:3])
    except NoRecursion as reason:
        counts["no recursion: too few positions" if "few" in str(reason) else "no recursion"] += 1
        return None
    except (NcgenError, EliminationError):
        counts["refused"] += 1
        return None
    speeds = np.random.default_rng(seed).standard_normal(len(split.independent)) * kernels.column_sizes[list(split.independent)]
    away = float(np.max(np.abs(q) / kernels.column_sizes, initial=0.0))
    close = APART + 100 * np.finfo(float).eps * away  # so badly are positions known far from the origin
    units = np.array([*kernels.column_sizes, *kernels.column_sizes[list(split.independent)], 1.0])
    for name, program in ways.items():
        counts[name] += 1
        for sample in given[2][1:]:
            inputs = {"t": sample.t, "q": sample.q, "zd": speeds, "p": sample.p}
            try:
                if _condition(kernels, split, sample) > SINGULAR:
                    counts["too near a singular position"] += 1
                    continue
                if _contradicts(kernels, evaluate(judge, inputs)[: kernels.n], sample):
                    counts["drivers that contradict rows"] += 1
                    break
                rates = np.array(evaluate(judge, inputs)[: kernels.n])
                power = _power(kernels, rates, evaluate(judge, inputs)[kernels.n : -2], split.independent, sample)
                apart = _apart(program, judge, inputs, units, split, power)
                if not apart < close:  # rounding, perhaps, or positions that are not quite closed
                    apart = _apart(program, judge, _closed(closing, inputs, split.dependent), units, split, power, EXACT, mpmath.mpf)
            except (ValueError, ArithmeticError, TypeError):
                counts["outside a domain"] += 1
                break
            counts["states"] += 1
            if not apart < close:
                return f"{seed}: {name} is {apart:.2g} apart"
    return None


def _condition(kernels, split, sample) -> float:
    """Of the rows over the dependent coordinates, in natural units."""
    jacobian = scaled_jacobian(kernels, sample.q, sample.t, sample.p)[np.ix_(split.rows, split.dependent)]
    return float(np.linalg.cond(jacobian)) if jacobian.size else 1.0


def _contradicts(kernels, rates: list[float], sample) -> bool:
    """True if no velocities satisfy all rows, so that each formulation leaves another one open."""
    jacobian, nu = kernels.jacobian(sample.q, sample.t, sample.p), kernels.nu(sample.q, sample.t, sample.p)
    terms = np.abs(jacobian) @ np.abs(rates) + np.abs(nu)
    return bool(np.any(nu)) and bool(np.max(np.abs(jacobian @ rates - nu) / kernels.row_sizes) > 1e-6 * np.max(terms / kernels.row_sizes))


def _power(kernels, rates: np.ndarray, zdd: list[float], independent, sample) -> float:
    """The size of what power is the sum of: forces and inertia times velocities."""
    forces = np.abs(kernels.force(sample.q, rates, sample.t, sample.p))
    inertia = np.abs(kernels.mass_matrix(sample.q, sample.t, sample.p))[:, list(independent)] @ np.abs(zdd)
    return float((forces + inertia) @ np.abs(rates))


def _closed(closing, inputs: dict, dependent) -> dict:
    """The inputs with 50 digits, at a position that is closed to as many."""
    exact = {k: mpmath.mpf(v) if k == "t" else [mpmath.mpf(float(x)) for x in v] for k, v in inputs.items()}
    for _ in range(40):
        steps = evaluate(closing, exact, EXACT, mpmath.mpf)[: len(dependent)]
        for c, step in zip(dependent, steps, strict=True):
            exact["q"][c] += step
        if max(map(abs, steps), default=0) < mpmath.mpf(10) ** -35:
            return exact
    raise ArithmeticError("too near a singular position")


def _apart(program, judge, inputs: dict, units: np.ndarray, split, power: float, functions=None, number=float) -> float:
    """The largest difference of rates and of accelerations, in natural units, relative to the largest; of power relative to `power`."""
    given = {k: v if k == "t" else list(v) for k, v in inputs.items()}
    right = evaluate(judge, given, functions, number)[:-1]
    n = len(given["q"])
    found = evaluate(program, given | {"qd": right[:n]}, functions, number)[:-1]
    if "qd" in program.inputs:  # accelerations of all coordinates
        found = [*found[:n], *(found[n + c] for c in split.independent), found[-1]]
    a, b = (np.array([float(x) for x in values]) / units for values in (found, right))
    sizes = [max(float(np.max(np.abs(b[part]), initial=0.0)), 1e-3) for part in (slice(0, n), slice(n, -1))]
    apart = [float(np.max(np.abs(a[p] - b[p]), initial=0.0)) / size for p, size in zip((slice(0, n), slice(n, -1)), sizes, strict=True)]
    return max(*apart, abs(a[-1] - b[-1]) / max(abs(b[-1]), power, 1e-300))


def look(seeds: range) -> tuple[Counter, list[str]]:
    counts: Counter = Counter()
    found = []
    with warnings.catch_warnings(), np.errstate(all="ignore"), mpmath.workdps(50):
        warnings.simplefilter("ignore")
        found = [said for seed in seeds if (said := compare(seed, counts))]
    return counts, found


def test_a_few_random_mechanisms():
    counts, found = look(range(1, 13))
    assert not found and counts["composite"] > 3


@pytest.mark.slow
def test_thousands_of_random_mechanisms(record_property):
    """So many as NCGEN_ABUSE_COUNT says, from seed 1 on."""
    counts, found = look(range(1, MANY + 1))
    record_property("counts", f"seeds 1 to {MANY}: {dict(counts)}")
    assert not found, "\n".join(found)
    assert counts["composite"] > MANY / 3
