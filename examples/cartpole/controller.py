"""A controller at 1 kHz for the inverted pendulum on a cart: gains from the linearised model, tried on the whole one.

The state space of `ncgen.linearise` with the input held over a step gives the gains of a linear-quadratic regulator. They hold the pole
upright from 0.3 rad, though the mechanism is not linear; `ncgen.start` moves it from millisecond to millisecond.

    python examples/cartpole/controller.py [--time] [--plot FILE]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.linalg import expm, solve_discrete_are

import ncgen
from ncgen.mechanism.kernels import Kernels

PERIOD = 1e-3
"""s between two decisions of the controller."""

COSTS = np.diag([20.0, 50.0, 1.0, 1.0])
"""Of being off the place (m), the vertical (rad), and of both rates; a newton costs 0.05."""

LEAN = 0.3
"""rad at the start"""

SECONDS = 4.0


def gains(kernels: Kernels) -> np.ndarray:
    """F = −gains · [s, phi, rate(s), rate(phi)] in N: the regulator with the input held for a period."""
    near = ncgen.linearise(kernels)
    n = len(near.A)
    held = expm(PERIOD * np.vstack([np.hstack([near.A, near.B]), np.zeros((1, n + 1))]))
    A, B = held[:n, :n], held[:n, n:]
    X = solve_discrete_are(A, B, COSTS, [[0.05]])
    return np.linalg.solve(B.T @ X @ B + 0.05, B.T @ X @ A)[0]


def balance(kernels: Kernels, lean: float = LEAN, integrator: str = "auto") -> dict[str, np.ndarray]:
    """Histories of the time, the input, and the four states under the controller."""
    k = gains(kernels)
    length = float(kernels.q0[kernels.index["B.y"]])
    start = {"phi": lean, "B.x": -length * np.sin(lean), "B.y": length * np.cos(lean)}
    sim = ncgen.start(kernels, q0=start, integrator=integrator)
    names = ("s", "phi", "rate(s)", "rate(phi)")
    rows = []
    for _ in range(round(SECONDS / PERIOD)):
        state = np.array([sim[name] for name in names])
        F = float(-k @ state)
        rows.append([sim.t, F, *state])
        sim.step(PERIOD, F=F)
    return dict(zip(("t", "F", *names), np.array(rows).T, strict=True))


def cost(kernels: Kernels, integrator: str) -> tuple[float, int]:
    """Microseconds of a step of 1 ms with an input, the best of 20 seconds of motion, and how many state derivatives it takes."""
    sim = ncgen.start(kernels, integrator=integrator)
    began, best = sim.state, np.inf
    for _ in range(20):
        sim.reset(began)
        clock = time.perf_counter()
        for _ in range(1000):
            sim.step(PERIOD, F=0.5)
        best = min(best, time.perf_counter() - clock)
    return 1e3 * best, sim.evaluations


def cost_together(kernels: Kernels, integrator: str, count: int = 256) -> float:
    """Microseconds of a step of 1 ms by every state, of so many that move together, the best of 20 times 20 steps."""
    sims, force, best = ncgen.start(kernels, count, integrator=integrator), np.full(count, 0.5), np.inf
    for _ in range(20):
        sims.reset()
        clock = time.perf_counter()
        for _ in range(20):
            sims.step(PERIOD, F=force)
        best = min(best, time.perf_counter() - clock)
    return 1e6 * best / (20 * count)


def plot(found: dict[str, np.ndarray], file: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7, 5), layout="constrained")
    for axis, name, unit in zip(axes, ("phi", "s", "F"), ("rad", "m", "N"), strict=True):
        axis.plot(found["t"], found[name])
        axis.set_ylabel(f"{name} ({unit})")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("t (s)")
    figure.savefig(file, dpi=110)


if __name__ == "__main__":
    kernels = ncgen.compile(ncgen.load("cartpole"))
    found = balance(kernels)
    print("gains", *(f"{gain:.4g}" for gain in gains(kernels)))
    for t in (0.0, 0.5, 1.0, 2.0, SECONDS - PERIOD):
        k = round(t / PERIOD)
        print(f"t = {t:5.3f} s  phi = {found['phi'][k]:9.6f} rad  s = {found['s'][k]:9.6f} m  F = {found['F'][k]:9.4f} N")
    if "--time" in sys.argv:
        for integrator in ("auto", "dopri5", "rk4"):
            microseconds, evaluations = cost(kernels, integrator)
            together = cost_together(kernels, integrator)
            told = f"{microseconds:6.2f} µs a step, of {evaluations} state derivatives; {together:6.2f} µs where 256 move together"
            print(f"{integrator:7s} {told}")
    if "--plot" in sys.argv:
        plot(found, sys.argv[sys.argv.index("--plot") + 1])
