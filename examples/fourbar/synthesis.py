"""Synthesis of a path: a four-bar whose coupler point passes five given points at five given angles of its crank.

This kind of task, path generation with prescribed timing, is a usual test of optimisation methods. The unknowns are six
lengths. The squares of the ten distances are minimised by scipy's least squares, once with the exact
derivatives ∂q/∂p = −Φ_q⁻¹ Φ_p, which also foresee the positions with the next lengths, once with finite differences.
Times are the processor's.

    python examples/fourbar/synthesis.py [--plot FILE]
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

import ncgen
from ncgen import Model

if TYPE_CHECKING:
    from ncgen.solver.positions.driven import DrivenPositions

TARGETS = np.array([(3.0, 3.0), (2.759, 3.363), (2.372, 3.663), (1.890, 3.862), (1.355, 3.943)])
ANGLES = np.pi / 12 * np.array([2, 3, 4, 5, 6])

START = {"crank": 2.0, "coupler": 4.0, "rocker": 4.0, "ground": 5.0, "near": 2.5, "far": 3.5}
"""Lengths to begin with; near and far are those of the coupler point from the ends of the coupler."""

TURNS = 5
"""How often each way is taken, in turns: the least of its times counts."""


def build() -> Model:
    """The linkage with its crank at the first angle; t is what the crank has turned since (rad)."""
    m = Model("synthesis")
    length = {name: m.parameter(name, value) for name, value in START.items()}
    A = m.point("A", (0.0, 0.0), fixed=True)
    B = m.point("B", 2.0 * np.array([np.cos(ANGLES[0]), np.sin(ANGLES[0])]))
    D = m.point("D", (START["ground"], 0.0), fixed="y")
    C = m.point("C", meeting(B.initial, D.initial, START["coupler"], START["rocker"]))
    P = m.point("P", meeting(B.initial, C.initial, START["near"], START["far"]))
    for start, end, name in ((A, B, "crank"), (B, C, "coupler"), (C, D, "rocker"), (B, P, "near"), (C, P, "far")):
        m.distance(start, end, length[name])
    m.drive(D.x, length["ground"])
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.drive(m.angle("psi", start=x, end=B - A, axis=z), ANGLES[0] + m.time)
    return m


def meeting(first: np.ndarray, second: np.ndarray, near: float, far: float) -> np.ndarray:
    """The point at these distances from two others, on the left of the way between them, in the plane."""
    way = (second - first)[:2]
    long = np.linalg.norm(way)
    along = (near**2 - far**2 + long**2) / (2 * long)
    across = np.sqrt(near**2 - along**2)
    return first[:2] + (along * way + across * np.array([-way[1], way[0]])) / long


class Linkage:
    """Distances of the coupler point from its targets, and their derivatives by the lengths.

    foresees: whether these tell which positions the next ones are near; else they are near the last ones
    """

    def __init__(self, foresees: bool = True) -> None:
        self.foresees = foresees
        self.kernels = ncgen.compile(build())
        self.point = [self.kernels.index["P.x"], self.kernels.index["P.y"]]
        self.last = ncgen.driven_positions(self.kernels, ANGLES - ANGLES[0])
        self.evaluations = 0

    def positions(self, p: np.ndarray) -> DrivenPositions:
        """At the five angles; kept for whoever asks for the same lengths again."""
        if not np.array_equal(p, self.last.p):
            self.evaluations += 1
            near = self.last.foreseen(p) if self.foresees else self.last.q
            self.last = ncgen.driven_positions(self.kernels, self.last.t, p=p, q0=near)
        return self.last

    def misses(self, p: np.ndarray) -> np.ndarray:
        """(10,)"""
        return (self.positions(p).q[:, self.point] - TARGETS).ravel()

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """(10, 6)"""
        return np.concatenate(self.positions(p).q_by[:, self.point])


def synthesise(derivatives: str) -> tuple[OptimizeResult, Linkage, float]:
    """The design found, the linkage with its count of evaluations, and the processor's seconds; derivatives: exact, 2-point or 3-point."""
    linkage = Linkage(foresees=derivatives == "exact")
    jac: Any = linkage.slopes if derivatives == "exact" else derivatives  # scipy takes either, and has no annotations
    linkage.slopes(linkage.kernels.p0)  # the tangent kernels are compiled when first used
    begun = time.process_time()
    found = least_squares(
        linkage.misses, linkage.kernels.p0, jac, bounds=(0.1, 50.0), x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=1000
    )
    return found, linkage, time.process_time() - begun


def main() -> None:
    turns = [{derivatives: synthesise(derivatives) for derivatives in ("exact", "2-point", "3-point")} for _ in range(TURNS)]
    results = turns[-1]
    print(f"{'derivatives':12} {'sum of squares':>20} {'largest gradient':>17} {'steps':>6} {'evaluations':>12} {'ms':>7}")
    for derivatives, (found, linkage, _) in results.items():
        evaluations, seconds = linkage.evaluations, min(turn[derivatives][2] for turn in turns)
        slope = np.max(np.abs(linkage.slopes(found.x).T @ linkage.misses(found.x)))
        print(f"{derivatives:12} {2 * found.cost:20.13e} {slope:17.1e} {found.nfev:6} {evaluations:12} {1e3 * seconds:7.1f}")
    found, linkage, _ = results["exact"]
    print("\nlengths:", ", ".join(f"{name} {value:.6f}" for name, value in zip(linkage.kernels.parameters, found.x, strict=True)))
    print(f"farthest from a target: {np.max(np.hypot(*linkage.misses(found.x).reshape(5, 2).T)):.2e}")
    if "--plot" in sys.argv:
        plot(found.x, sys.argv[sys.argv.index("--plot") + 1])


def plot(p: np.ndarray, file: str) -> None:
    """The linkage at the first angle, the path of its coupler point and the targets."""
    from matplotlib.figure import Figure

    linkage = Linkage()
    kernels, q = linkage.kernels, linkage.positions(p).q[0]
    back, on = (ncgen.driven_positions(kernels, np.linspace(0.0, end, 71), p=p, q0=q).q[:, linkage.point] for end in (-0.6, 2.2))
    curve = np.concatenate([back[::-1], on])
    places = {name: [q[kernels.index[f"{name}.{axis}"]] for axis in "xy"] for name in "BCP"}
    places |= {"A": [0.0, 0.0], "D": [q[kernels.index["D.x"]], 0.0]}
    chart = Figure(figsize=(6, 4.5), layout="constrained")
    axes = chart.add_subplot()
    axes.plot(*np.array([places[name] for name in "ABCD"]).T, "o-", color="0.3", label="linkage")
    axes.plot(*np.array([places[name] for name in "BPC"]).T, "o-", color="0.7")
    axes.plot(*curve.T, label="path of P")
    axes.plot(*TARGETS.T, "x", color="tab:red", label="targets")
    axes.set_aspect("equal")
    axes.legend()
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
