"""Identification of inertia: how two rods are loaded with mass, from a measured motion.

Mass, centre and moment of inertia of a rod are those of three point masses, at its ends and in its middle. What the mass at A
is does not matter, and those at B add up: four numbers say all that a motion can tell. The measurement is made here: uniform
rods of 1 kg and 0.5 kg, a known motor torque at the shoulder, positions of B and C every 20 ms for 1 s, and noise of 1 mm
from a seeded generator. scipy's least squares finds the numbers again, once with the exact derivatives of the motion, once
with finite differences of simulations. Times are the processor's.

    python examples/doublependulum/identification.py [--plot FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy
from scipy.optimize import OptimizeResult, least_squares

import ncgen
from ncgen import Model
from ncgen.solver.derivatives.sensitivity import Sensitivities

TRUE = {"upper": 4 / 6, "joint": 1 / 6 + 0.5 / 6, "lower": 2 / 6, "tip": 0.5 / 6}
"""Masses (kg) in the middle of the first rod, at B, in the middle of the second rod and at C."""

START = {"upper": 1.0, "joint": 0.4, "lower": 0.2, "tip": 0.2}
DURATION, STEPS, NOISE = 1.0, 50, 1e-3

TURNS = 5
"""How often each way is taken, in turns: the least of its times counts."""


def build() -> Model:
    """Two rods of 1 m and 0.8 m, hanging at rest, and a motor on the first."""
    m = Model("rods")
    mass = {name: m.parameter(name, value, "kg") for name, value in TRUE.items()}
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0, -1.0)), m.point("C", (0, -1.8))
    for name, points in (("upper", [A, B]), ("joint", [B]), ("lower", [B, C]), ("tip", [C])):
        m.body(name, points=points, mass=mass[name], inertia="point")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", start=x, end=B - A, axis=z)
    theta = m.angle("theta", start=B - A, end=C - B, axis=z)
    m.independent(psi, theta)
    m.torque(psi, 6 * sympy.sin(4 * m.time))
    m.gravity((0, -9.81, 0))
    return m


class Experiment:
    """What was measured, and what a choice of parameters says instead: residuals in units of the noise."""

    def __init__(self) -> None:
        self.kernels = ncgen.compile(build())
        self.seen = [self.kernels.index[name] for name in ("B.x", "B.y", "C.x", "C.y")]
        self.runs = 0
        self.last: tuple[bytes, Sensitivities] | None = None
        noise = NOISE * np.random.default_rng(2007).standard_normal((STEPS + 1, len(self.seen)))
        self.measured = self.motion(self.kernels.p0) + noise

    def motion(self, p: Sequence[float] | np.ndarray) -> np.ndarray:
        """Positions (instants, 4) by fixed Runge-Kutta steps in C."""
        self.runs += 1
        return ncgen.simulate(
            self.kernels, DURATION, p=p, z=("psi", "theta"), integrator="rk4", max_step=DURATION / STEPS, points=STEPS + 1
        ).q[:, self.seen]

    def misses(self, p: np.ndarray) -> np.ndarray:
        return ((self.motion(p) - self.measured) / NOISE).ravel()

    def exact_misses(self, p: np.ndarray) -> np.ndarray:
        """The same from the motion that comes with its derivatives."""
        return ((self.differentiated(p).q[:, self.seen] - self.measured) / NOISE).ravel()

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """∂misses/∂p: the same steps, differentiated."""
        return self.differentiated(p).q_by[:, self.seen].reshape(-1, len(p)) / NOISE

    def differentiated(self, p: np.ndarray) -> Sensitivities:
        """The motion with its derivatives, kept for whoever asks for the same p again."""
        if self.last is None or self.last[0] != p.tobytes():
            self.runs += 1
            self.last = p.tobytes(), ncgen.sensitivities(self.kernels, DURATION, STEPS, p=p, z=("psi", "theta"), by=self.kernels.parameters)
        return self.last[1]


def identify(derivatives: str) -> tuple[OptimizeResult, Experiment, float]:
    """What was found, the experiment with its count of simulations, and the processor's seconds; derivatives: exact, 2-point or 3-point."""
    experiment = Experiment()
    start = np.array(list(START.values()))
    experiment.slopes(start)  # derivatives are compiled when first used
    experiment.last, experiment.runs = None, 0
    begun = time.process_time()
    is_exact = derivatives == "exact"
    misses = experiment.exact_misses if is_exact else experiment.misses
    jac: Any = experiment.slopes if is_exact else derivatives  # scipy takes either, and has no annotations
    # scipy's ftol, 1e-8 of the sum of squares, is far above its rounding, and Gauss-Newton steps leave less by as much again
    found = least_squares(misses, start, jac, bounds=(0.0, np.inf), x_scale=start, xtol=1e-12, gtol=1e-12)  # no mass is negative
    return found, experiment, time.process_time() - begun


def main() -> None:
    turns = [{derivatives: identify(derivatives) for derivatives in ("exact", "2-point", "3-point")} for _ in range(TURNS)]
    results = turns[-1]
    found, experiment, _ = results["exact"]
    deviation = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    print(f"{'':6} {'true':>10} {'start':>10} {'found':>10} {'deviation':>10}")
    for name, x, d in zip(experiment.kernels.parameters, found.x, deviation, strict=True):
        print(f"{name:6} {TRUE[name]:10.6f} {START[name]:10.6f} {x:10.6f} {d:10.1e}")
    print(f"\n{'derivatives':12} {'sum of squares':>17} {'error of derivatives':>21} {'steps':>6} {'simulations':>12} {'ms':>6}")
    exact = experiment.slopes(found.x)
    for derivatives, (result, its, _) in results.items():
        runs, seconds = its.runs, min(turn[derivatives][2] for turn in turns)
        error = np.max(np.abs(result.jac - its.slopes(result.x)) / np.max(np.abs(exact), axis=0))
        print(f"{derivatives:12} {2 * result.cost:17.10f} {error:21.1e} {result.nfev:6} {runs:12} {1e3 * seconds:6.1f}")
    if "--plot" in sys.argv:
        plot(experiment, found.x, sys.argv[sys.argv.index("--plot") + 1])


def plot(experiment: Experiment, p: np.ndarray, file: str) -> None:
    """Measured positions of C, those of the start and those of what was found."""
    from matplotlib.figure import Figure

    chart = Figure(figsize=(7, 3.5), layout="constrained")
    axes = chart.add_subplot()
    t = np.linspace(0, DURATION, STEPS + 1)
    axes.plot(t, experiment.measured[:, 2], ".", color="0.6", markersize=3, label="measured")
    axes.plot(t, experiment.motion(list(START.values()))[:, 2], "--", label="start")
    axes.plot(t, experiment.motion(p)[:, 2], label="found")
    axes.set_xlabel("t (s)")
    axes.set_ylabel("x of C (m)")
    axes.legend()
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
