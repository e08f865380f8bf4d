"""Whole runs of random arms, called from Python, by an evaluation, beside CasADi's articulated-body algorithm, without a run around it.

python tests/benchmarks/random_arms.py [SEEDS [JOINTS ...]]

A line an arm: ns, ratios and the error of the end of the run; median and worst ratio of each number of joints.
"""

from __future__ import annotations

import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import arms
from benchmarks.arms import Contender, Posture
from benchmarks.rivals import articulated
from ncgen.report.clock import measure
from ncgen.report.repeat import runner

SEEDS = 10


def casadi(place: Posture) -> Contender:
    """Raises RuntimeError where it is not installed."""
    found = articulated.rival(place.kernels, place.split)
    if found is None:
        raise RuntimeError("casadi is not installed; pip install casadi")
    call = found[0]
    return Contender("CasADi", runner(0.0, place.q, place.rates, place.kernels.p0, [], call), call.out.copy)


def ratios(count: int, seed: int) -> list[float]:
    """Of the whole runs of an arm, in the order of `arms.whole_runs`, to CasADi; prints them."""
    place = arms.posture(count, seed)
    runs, rival = list(arms.whole_runs(place)), casadi(place)
    spent = measure({c.name: c.run for c in [*runs, rival]}, arms.ROUNDS)
    least = [1e9 * spent[c.name].least / c.states for c in [*runs, rival]]
    found = [each / least[-1] for each in least[:-1]]
    errors = [arms.relative_error(c.values(), c.expected) for c in runs if c.expected is not None]
    told = (
        f"{c.name[13:]} {ns:.0f} ns ({ratio:.2f}), error {error:.1e}"
        for c, ns, ratio, error in zip(runs, least, found, errors, strict=False)
    )
    print(f"{count} joints, seed {seed}: CasADi {least[-1]:.0f} ns; {'; '.join(told)}", flush=True)
    return found


def main(seeds: int, counts: list[int]) -> None:
    for count in counts:
        found = [ratios(count, seed) for seed in range(1, seeds + 1)]
        for k, name in enumerate(("rk4, 1 ms", "default")):
            column = [row[k] for row in found]
            print(f"{count} joints, {name}: median {statistics.median(column):.2f}, worst {max(column):.2f} of CasADi's", flush=True)


if __name__ == "__main__":
    given = [int(x) for x in sys.argv[1:]]
    main(given[0] if given else SEEDS, given[1:] or list(arms.COUNTS))
