"""A Kalman filter on the double pendulum: both angles and their rates from a noisy camera that sees the free end alone.

Between two pictures, 20 ms apart, the filter moves its estimate by the mechanism's own equations, and the estimate's covariance by the
exact derivative of that very motion by where it began, ∂x'/∂x, from `ncgen.sensitivities`. (The extended Kalman filter: Jazwinski 1970.)
The real pendulum is pushed a little at random, which the filter knows as an acceleration of so much noise and no more. The motion is
chaotic; without pictures the same start is worth nothing after some seconds.

    python examples/doublependulum/kalman.py [--plot FILE]
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

import ncgen
from ncgen import Model
from ncgen.mechanism.kernels import Kernels

PERIOD, PICTURES = 0.02, 300
"""s between two pictures, and how many there are."""

STEPS = 2
"""Of dop853, from one picture to the next."""

CAMERA = 5e-3
"""Noise of a coordinate of C in a picture (m)."""

PUSH = 0.3
"""Noise of both angles' accelerations, held from one picture to the next (rad/s²)."""

START = np.array([np.pi / 2, np.pi / 2, 0.0, 0.0])
DOUBT = np.array([0.1, 0.1, 0.5, 0.5])
"""Angles of the rods from below and their rates at the start, and standard deviations of what the filter begins with."""

COORDINATES = ("psi", "theta")


def build() -> Model:
    """Two rods of 1 m and 0.8 m by their angles from below."""
    m = Model("pendulum")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1.0, 0)), m.point("C", (1.8, 0))
    for name, ends, length, mass in (("upper", (A, B), 1.0, 1.0), ("lower", (B, C), 0.8, 0.5)):
        m.body(name, ends, mass=mass, inertia=mass * length**2 / 12)
    down, z = m.vector("down", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.independent(*(m.angle(name, down, way, z) for name, way in zip(COORDINATES, (B - A, C - B), strict=True)))
    m.gravity((0, -9.81, 0))
    return m


class Pendulum:
    """From states x = [ψ, θ, ψ̇, θ̇] to states, and to what the camera sees."""

    def __init__(self) -> None:
        self.kernels: Kernels = ncgen.compile(build())
        self.places = [self.kernels.index[name] for name in COORDINATES]

    def moved(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state a period later, and its derivative by x (4, 4)."""
        q0 = {"psi": x[0], "theta": x[1]} | dict(zip(("B.x", "B.y", "C.x", "C.y"), corners(x[:2]), strict=True))
        found = ncgen.sensitivities(self.kernels, PERIOD, STEPS, integrator="dop853", q0=q0, zd0=x[2:], z=COORDINATES)
        state = np.concatenate([found.q[-1, self.places], found.qd[-1, self.places]])
        return state, np.vstack([found.q_by[-1, self.places], found.qd_by[-1, self.places]])

    @staticmethod
    def seen(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C, and its derivative by x (2, 4)."""
        slope = np.array([[np.cos(x[0]), 0.8 * np.cos(x[1]), 0, 0], [np.sin(x[0]), 0.8 * np.sin(x[1]), 0, 0]])
        return corners(x[:2])[2:], slope


def corners(angles: np.ndarray) -> np.ndarray:
    """B and C for both angles."""
    B = np.array([np.sin(angles[0]), -np.cos(angles[0])])
    return np.concatenate([B, B + 0.8 * np.array([np.sin(angles[1]), -np.cos(angles[1])])])


HELD = np.vstack([PERIOD**2 / 2 * np.eye(2), PERIOD * np.eye(2)])
"""How a state changes with accelerations that are held for a period (4, 2)."""


class Histories(NamedTuple):
    """states, alone, estimates, pictures: what the pendulum does, what the filter's start does without pictures, what the filter says, and
    what the camera sees; covariances of the estimates (K, 4, 4)"""

    states: np.ndarray
    alone: np.ndarray
    estimates: np.ndarray
    pictures: np.ndarray
    covariances: np.ndarray

    @property
    def consistency(self) -> np.ndarray:
        """Squared errors in units of the covariance, (K,): 4 in the mean where the filter knows how sure it is."""
        off = self.states - self.estimates
        return np.einsum("ki,kij,kj->k", off, np.linalg.inv(self.covariances), off)


def experiment(pendulum: Pendulum, pictures: int = PICTURES, seed: int = 3) -> Histories:
    """The pendulum, its pictures, and the filter beside it."""
    draw = np.random.default_rng(seed)
    state, estimate, covariance = START, START + DOUBT * draw.standard_normal(4), np.diag(DOUBT**2)
    alone, kept = estimate, []
    for _ in range(pictures):
        state = pendulum.moved(state)[0] + HELD @ (PUSH * draw.standard_normal(2))
        alone = pendulum.moved(alone)[0]
        picture = pendulum.seen(state)[0] + CAMERA * draw.standard_normal(2)
        estimate, covariance = filtered(pendulum, estimate, covariance, picture)
        kept.append((state, alone, estimate, picture, covariance))
    return Histories(*map(np.array, zip(*kept, strict=True)))


def filtered(pendulum: Pendulum, estimate: np.ndarray, covariance: np.ndarray, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and covariance a period later, with the picture taken then."""
    estimate, F = pendulum.moved(estimate)
    covariance = F @ covariance @ F.T + PUSH**2 * HELD @ HELD.T
    expected, H = pendulum.seen(estimate)
    gain = np.linalg.solve(H @ covariance @ H.T + CAMERA**2 * np.eye(2), H @ covariance).T
    left = np.eye(4) - gain @ H
    return estimate + gain @ (picture - expected), left @ covariance @ left.T + CAMERA**2 * gain @ gain.T


def main() -> None:
    found = experiment(Pendulum())
    print(f"{'t (s)':>6} {'psi':>8} {'estimate':>9} {'deviation':>10} {'alone':>8}   rate(psi) estimate deviation")
    for k in range(PICTURES // 6 - 1, PICTURES, PICTURES // 6):
        deviation = np.sqrt(np.diag(found.covariances[k]))
        state, alone, estimate = found.states[k], found.alone[k], found.estimates[k]
        angle = f"{state[0]:8.4f} {estimate[0]:9.4f} {deviation[0]:10.1e} {alone[0]:8.4f}"
        print(f"{PERIOD * (k + 1):6.2f} {angle}   {state[2]:9.4f} {estimate[2]:8.4f} {deviation[2]:9.1e}")
    settled = slice(PICTURES // 6, None)
    error = np.sqrt(np.mean((found.states - found.estimates)[settled] ** 2, axis=0))
    print(f"\nerrors after 1 s: {error[0]:.4f} and {error[1]:.4f} rad, {error[2]:.3f} and {error[3]:.3f} rad/s")
    print(f"squared errors in units of the covariance, in the mean: {np.mean(found.consistency[settled]):.2f} (4 if the filter is right)")
    if "--plot" in sys.argv:
        plot(found, sys.argv[sys.argv.index("--plot") + 1])


def plot(found: Histories, file: str) -> None:
    """Both angles, as they are, as estimated, and without pictures; the error of one rate within its bounds."""
    from matplotlib.figure import Figure

    chart = Figure(figsize=(7.5, 5), layout="constrained")
    axes = chart.subplots(3, 1, sharex=True)
    t = PERIOD * np.arange(1, len(found.states) + 1)
    for k, (axis, name) in enumerate(zip(axes[:2], COORDINATES, strict=True)):
        axis.plot(t, found.alone[:, k], color="0.7", label="the filter's start alone")
        axis.plot(t, found.states[:, k], label="pendulum")
        axis.plot(t, found.estimates[:, k], "--", label="filter")
        axis.set_ylabel(f"{name} (rad)")
    axes[0].legend(fontsize="small", ncols=3)
    bound = 1.96 * np.sqrt(found.covariances[:, 2, 2])
    axes[2].fill_between(t, -bound, bound, alpha=0.2, label="95 %")
    axes[2].plot(t, (found.estimates - found.states)[:, 2])
    axes[2].set_ylabel("error of rate(psi) (rad/s)")
    axes[2].set_xlabel("t (s)")
    axes[2].legend(fontsize="small")
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
