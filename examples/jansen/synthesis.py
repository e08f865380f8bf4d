"""Synthesis of a walking leg: twelve lengths with which the toe passes twelve given points at twelve angles of the crank.

The points are those of Theo Jansen's own leg, to tenths of a millimetre as somebody would measure them on a drawing; the search begins with
lengths that are wrong by up to 4 %. Of his thirteen numbers d is held: with others for d, e, f, g and h the toe walks nearly the same way.
The squares of the 24 distances are minimised by scipy's least squares, once with the exact derivatives ∂q/∂p = −Φ_q⁻¹ Φ_p, which
also foresee the positions with the next lengths, once with finite differences. Times are the processor's.

    python examples/jansen/synthesis.py [--plot FILE]
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

import ncgen
from ncgen import Model
from ncgen.exchange.examples import example_module

if TYPE_CHECKING:
    from ncgen.solver.positions.driven import DrivenPositions

JANSEN = example_module("jansen")
TRUE = np.array(list(JANSEN.LENGTHS.values())) / 100
"""Jansen's numbers a to m (m)."""

FREE = [k for k, letter in enumerate(JANSEN.LENGTHS) if letter != "d"]
"""Those that are looked for."""

ANGLES = 2 * np.pi / 12 * np.arange(12)
BETWEEN = 4
"""Positions on the way from one angle to the next, where none is known near it."""

WRONG, ROUNDED = 0.04, 4
"""How wrong lengths are at first, at most and relative; digits of the points, in m."""

TURNS = 5
"""How often each way is taken, in turns: the least of its times counts."""


def build() -> Model:
    """The leg with its thirteen numbers as parameters, its crank at the angle t (rad)."""
    m = Model("leg")
    number = {letter: m.parameter(letter, value / 100) for letter, value in JANSEN.LENGTHS.items()}
    place = JANSEN.closed_position()
    place["P"] = (-number["a"], -number["l"])
    points = {name: m.point(name, where, fixed=name in "OP") for name, where in place.items()}
    for letter, (start, end) in JANSEN.RODS.items():
        m.distance(points[start], points[end], number[letter])
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.drive(m.angle("psi", start=x, end=points["M"] - points["O"], axis=z), m.time)
    return m


class Leg:
    """Distances of the toe from the points, and their derivatives by the lengths that are free, x (12,)."""

    def __init__(self, foresees: bool = True) -> None:
        self.foresees = foresees
        self.kernels = ncgen.compile(build())
        self.toe = [self.kernels.index["T.x"], self.kernels.index["T.y"]]
        self.evaluations = 0
        self.last = self.turned(TRUE)
        self.points = np.round(self.last.q[:, self.toe], ROUNDED)

    def turned(self, p: np.ndarray) -> DrivenPositions:
        """At the angles, from one to the next in small turns."""
        turns = np.linspace(0.0, 2 * np.pi, len(ANGLES) * BETWEEN, endpoint=False)
        return ncgen.driven_positions(self.kernels, ANGLES, p=p, q0=ncgen.driven_positions(self.kernels, turns, p=p).q[::BETWEEN])

    def positions(self, p: np.ndarray) -> DrivenPositions:
        """At the angles; kept for whoever asks for the same numbers again."""
        if not np.array_equal(p, self.last.p):
            self.evaluations += 1
            near = self.last.foreseen(p) if self.foresees else self.last.q
            self.last = ncgen.driven_positions(self.kernels, ANGLES, p=p, q0=near)
        return self.last

    def misses(self, x: np.ndarray) -> np.ndarray:
        """(24,)"""
        return (self.positions(whole(x)).q[:, self.toe] - self.points).ravel()

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """(24, 12)"""
        return np.concatenate(self.positions(whole(x)).q_by[:, self.toe][..., FREE])


def whole(x: np.ndarray) -> np.ndarray:
    """All thirteen numbers."""
    p = TRUE.copy()
    p[FREE] = x
    return p


def guess() -> np.ndarray:
    """Lengths x to begin with."""
    return (TRUE * (1 + WRONG * np.random.default_rng(2).uniform(-1, 1, len(TRUE))))[FREE]


def synthesise(derivatives: str) -> tuple[OptimizeResult, Leg, float]:
    """The leg found, with its count of evaluations, and the processor's seconds; derivatives: exact, 2-point or 3-point."""
    leg = Leg(foresees=derivatives == "exact")
    jac: Any = leg.slopes if derivatives == "exact" else derivatives  # scipy takes either, and has no annotations
    leg.slopes(TRUE[FREE])  # the tangent kernels are compiled when first used
    leg.last = leg.turned(whole(guess()))
    leg.evaluations = 0
    begun = time.process_time()
    found = least_squares(leg.misses, guess(), jac, xtol=1e-9, ftol=1e-9, gtol=1e-14, max_nfev=60)
    return found, leg, time.process_time() - begun


def main() -> None:
    turns = [{derivatives: synthesise(derivatives) for derivatives in ("exact", "2-point", "3-point")} for _ in range(TURNS)]
    results = turns[-1]
    print(f"{'derivatives':12} {'sum of squares':>20} {'largest gradient':>17} {'steps':>6} {'evaluations':>12} {'ms':>7}")
    for derivatives, (found, leg, _) in results.items():
        evaluations, seconds = leg.evaluations, min(turn[derivatives][2] for turn in turns)
        slope = np.max(np.abs(leg.slopes(found.x).T @ leg.misses(found.x)))
        print(f"{derivatives:12} {2 * found.cost:20.13e} {slope:17.1e} {found.nfev:6} {evaluations:12} {1e3 * seconds:7.1f}")
    found, leg, _ = results["exact"]
    print(f"\nfarthest from a point: {1e3 * np.max(np.hypot(*leg.misses(found.x).reshape(-1, 2).T)):.3f} mm\n")
    print(f"{'':2} {'Jansen':>7} {'start':>8} {'found':>8}  cm")
    for letter, true, start, x in zip(leg.kernels.parameters, TRUE, whole(guess()), whole(found.x), strict=True):
        print(f"{letter:2} {100 * true:7.2f} {100 * start:8.3f} {100 * x:8.3f}")
    if "--plot" in sys.argv:
        plot(leg, whole(found.x), sys.argv[sys.argv.index("--plot") + 1])


def plot(leg: Leg, p: np.ndarray, file: str) -> None:
    """The points, and the toe's path by the lengths at the start and by those found."""
    from matplotlib.figure import Figure

    chart = Figure(figsize=(6, 3.6), layout="constrained")
    axes = chart.add_subplot()
    for numbers, label, style in ((whole(guess()), "start", "--"), (p, "found", "-")):
        path = ncgen.driven_positions(leg.kernels, np.linspace(0, 2 * np.pi, 121), p=numbers).q[:, leg.toe]
        axes.plot(*path.T, style, label=label)
    axes.plot(*leg.points.T, "x", color="tab:red", label="points")
    axes.set_xlabel("x of T (m)")
    axes.set_ylabel("y of T (m)")
    axes.set_aspect("equal")
    axes.legend()
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
