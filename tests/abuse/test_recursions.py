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
from ncgen.program import dynamics
from ncgen.program.elimination import EliminationError
from ncgen.program.evaluate import evaluate
from ncgen.program.rates import NoRecursion
from ncgen.program.recursion import assemble_recursions
from ncgen.solver.compiled import samples, split_of
from ncgen.solver.partition import choose_partitions

MANY = int(os.environ.get("NCGEN_ABUSE_COUNT", 2000))
LARGEST = 30
"""Degrees of freedom that are looked at."""

APART = 1e-10
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
        judge = dynamics.by_all_coordinates(*given)
    except NoRecursion as reason:
        counts["no recursion: too few positions" if "few" in str(reason) else "no recursion"] += 1
        return None
    except (NcgenError, EliminationError):
        counts["refused"] += 1
        return None
    speeds = np.random.default_rng(seed).standard_normal(len(split.independent))
    for name, program in ways.items():
        counts[name] += 1
        for sample in given[2][1:]:
            inputs = {"t": sample.t, "q": sample.q, "zd": speeds, "p": sample.p}
            try:
                apart = _apart(program, judge, inputs, kernels.n)
                apart = apart if apart < APART else _apart(program, judge, inputs, kernels.n, exact=True)  # the judge's rounding, perhaps
            except (ValueError, ArithmeticError, TypeError):
                counts["outside a domain"] += 1
                break
            counts["states"] += 1
            if not apart < APART:
                return f"{seed}: {name} is {apart:.2g} apart"
    return None


def _apart(program, judge, inputs: dict, n: int, exact: bool = False) -> float:
    """The largest difference of rates, of accelerations and of powers, relative to the largest of each."""
    number = mpmath.mpf if exact else float
    given = {k: number(v) if k == "t" else [number(float(x)) for x in v] for k, v in inputs.items()}
    a, b = (np.array([float(x) for x in evaluate(p, given, EXACT if exact else None, number)][:-1]) for p in (program, judge))
    parts = (slice(0, n), slice(n, -1), slice(-1, None))
    return max(float(np.max(np.abs(a[p] - b[p]), initial=0.0) / max(np.max(np.abs(b[p]), initial=0.0), 1e-6)) for p in parts)


def look(seeds: range) -> tuple[Counter, list[str]]:
    counts: Counter = Counter()
    found = []
    with warnings.catch_warnings(), np.errstate(all="ignore"), mpmath.workdps(50):
        warnings.simplefilter("ignore")
        found = [said for seed in seeds if (said := compare(seed, counts))]
    return counts, found


def test_a_few_random_mechanisms():
    counts, found = look(range(1, 25))
    assert not found and counts["composite"] > 8


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_thousands_of_random_mechanisms(record_property):
    """So many as NCGEN_ABUSE_COUNT says, from seed 1 on."""
    counts, found = look(range(1, MANY + 1))
    record_property("counts", f"seeds 1 to {MANY}: {dict(counts)}")
    assert not found, "\n".join(found)
    assert counts["composite"] > MANY / 3
