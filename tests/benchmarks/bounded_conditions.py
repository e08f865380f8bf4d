"""What conditions cost, bounded between the nodes and sampled there: `python tests/benchmarks/bounded_conditions.py`.

A double pendulum swings for 100 s, and a condition that does not happen is watched. Processor times are measured in turns in one process,
and compared pair by pair, each over that of the run without a condition.
"""

from __future__ import annotations

import time
from statistics import median

import sympy as sp

import ncgen
from ncgen.mechanism import conditions_in_c

SECONDS, ROUNDS = 100.0, 15

CONDITIONS = {
    "cubic": lambda A, B: A.x * B.x * B.y - 9,
    "sine": lambda A, B: sp.sin(2 * B.x) + B.y - 9,
    "distance, with its root": lambda A, B: sp.sqrt(B.x**2 + B.y**2 + 0.01) - 2.5,
    "pull of a spring": lambda A, B: 10 * (sp.sqrt((B.x - 3) ** 2 + B.y**2) - 0.5) * (B.x - 3) / sp.sqrt((B.x - 3) ** 2 + B.y**2) - 100,
    "angle between the rods": lambda A, B: sp.atan2(A.x * (B.y - A.y) - A.y * (B.x - A.x), A.x * (B.x - A.x) + A.y * (B.y - A.y)) - 9,
}


def pendulum(name: str) -> ncgen.Kernels:
    m = ncgen.Model("double")
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0)), m.point("B", (2, 0))
    m.body("upper", [O, A], mass=1.0, com=(0.5, 0), inertia=1 / 12)
    m.body("lower", [A, B], mass=1.0, com=(0.5, 0), inertia=1 / 12)
    m.gravity((0, -9.81))
    if name:
        m.event("seen", when=CONDITIONS[name](A, B), direction="either")
    return ncgen.compile(m)


def processor_time(kernels: ncgen.Kernels) -> float:
    begun = time.process_time()
    ncgen.simulate(kernels, SECONDS, points=2)
    return time.process_time() - begun


class Sampled:
    """Conditions without their formulas, for as long as this is open."""

    def __enter__(self) -> None:
        self._begin = begin = conditions_in_c.Watched.__init__

        def begun(watched, conditions, ffi, number):
            begin(watched, conditions_in_c.Conditions(**{**vars(conditions), "formulas": None}), ffi, number)

        conditions_in_c.Watched.__init__ = begun

    def __exit__(self, *raised: object) -> None:
        conditions_in_c.Watched.__init__ = self._begin


def compared(name: str) -> tuple[float, float]:
    """The times of a run with a condition that is sampled, and that is bounded, over that without one."""
    plain, watched = pendulum(""), pendulum(name)
    ratios = []
    for number in range(ROUNDS + 1):
        alone, bounded = processor_time(plain), processor_time(watched)
        with Sampled():
            sampled = processor_time(watched)
        if number:  # the first round compiles
            ratios.append((sampled / alone, bounded / alone))
    first, second = zip(*ratios, strict=True)
    return median(first), median(second)


if __name__ == "__main__":
    print("| condition | sampled | bounded |\n|---|---|---|")
    for name in CONDITIONS:
        print("| {} | {:.2f} | {:.2f} |".format(name, *compared(name)), flush=True)
