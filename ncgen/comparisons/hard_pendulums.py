"""Pendulums and chains of extreme sizes and masses, and what their motions are compared with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from ncgen.comparisons.case import GRAVITY, Case
from ncgen.exchange.examples import example_module, load
from ncgen.model import Model
from ncgen.solver.trajectories.trajectory import Trajectory


def _scaled_pendulum(size: float) -> tuple[Callable[[], Model], Callable[[Trajectory], float]]:
    """A pendulum of `size` metres in gravity that makes it as quick as one of a metre."""

    def build() -> Model:
        m = Model("scaledpendulum")
        A, B = m.point("A", (0, 0), fixed=True), m.point("B", (-size, 0))
        m.body("bob", points=[B], mass=1.0)
        m.distance(A, B)
        m.gravity((0, -GRAVITY * size, 0))
        return m

    return build, lambda run: _pendulum_error(run, size)


def _pendulum_error(run: Trajectory, size: float = 1.0) -> float:
    """From rest at 90°: sin(θ/2) = √½ sn(K − √g t | ½), relative to the length."""
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(GRAVITY) * run.t, 0.5)
    s = np.sqrt(0.5) * sn
    path = np.column_stack([run["B.x"], run["B.y"]]) / size
    return float(np.max(np.abs(path - np.column_stack([-2 * s * dn, 2 * s * s - 1]))))


def _double(upper: float, lower: float) -> Callable[[], Model]:
    """A double pendulum of point masses."""

    def build() -> Model:
        m = Model("massratio")
        A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (2, 0))
        for name, point, mass in (("upper", B, upper), ("lower", C, lower)):
            m.body(name, points=[point], mass=mass)
        m.distance(A, B)
        m.distance(B, C)
        m.gravity((0, -GRAVITY, 0))
        return m

    return build


def _light_upper_error(run: Trajectory) -> float:
    """The light mass in the middle stays on the line to the heavy one, up to 1e-8: a pendulum of twice the length."""
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(GRAVITY / 2) * run.t, 0.5)
    s = np.sqrt(0.5) * sn
    return float(np.max(np.hypot(run["C.x"] - 4 * s * dn, run["C.y"] - 2 * (2 * s * s - 1))))


def _light_lower_error(run: Trajectory) -> float:
    """The heavy mass does not feel the light one: a pendulum, and a second one that hangs on it, by DOP853 at tight tolerance."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        a, b, da, db = y
        dda = -GRAVITY * np.sin(a)
        return [da, db, dda, -GRAVITY * np.sin(b) + da**2 * np.sin(a - b) - dda * np.cos(a - b)]

    solution = solve_ivp(slope, (0, run.t[-1]), [np.pi / 2, np.pi / 2, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=run.t)
    a, b = solution.y[:2]
    return float(np.max(np.hypot(run["C.x"] - np.sin(a) - np.sin(b), run["C.y"] + np.cos(a) + np.cos(b))))


def _massless() -> Model:
    """A pendulum whose rod is a frame of massless points and bars."""
    m = Model("massless")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (-1, 0))
    C, D = m.point("C", (-0.5, 0.4)), m.point("D", (-0.5, 0.9))
    m.body("bob", points=[B], mass=1.0)
    for start, end in ((A, B), (A, C), (C, B), (A, D), (D, B)):
        m.distance(start, end)
    m.gravity((0, -GRAVITY, 0))
    m.independent(B.y)
    return m


def _chain() -> Model:
    return example_module("chain").build(100)


def _energy(run: Trajectory) -> float:
    return run.energy_drift


def _scaled_case(size: float) -> Case:
    build, error = _scaled_pendulum(size)
    return Case(
        name=f"pendulum-{size:g}",
        breaks=f"{size:g} m long: tolerances and ranks must not know metres",
        build=build,
        duration=5.0,
        error=error,
        against="Jacobi's functions",
    )


PENDULUMS = (
    Case(name="chain-100", breaks="200 degrees of freedom", build=_chain, duration=0.1, error=_energy, against="its own energy", points=3),
    Case(
        name="light-upper",
        breaks="masses 1 : 1e8",
        build=_double(1e-8, 1.0),
        duration=0.7,
        error=_light_upper_error,
        against="the limit of no mass",
    ),
    Case(
        name="light-lower",
        breaks="masses 1e8 : 1",
        build=_double(1.0, 1e-8),
        duration=0.7,
        error=_light_lower_error,
        against="the limit of no mass",
    ),
    *map(_scaled_case, (1e-6, 1e6)),
    Case(
        name="massless",
        breaks="points and bars without mass: M is singular",
        build=_massless,
        duration=5.0,
        error=_pendulum_error,
        against="Jacobi's functions",
    ),
    Case(
        name="violated",
        breaks="the start is open by 10 %",
        build=lambda: load("pendulum"),
        duration=1.0,
        error=_energy,
        against="its own energy",
        violated=0.1,
    ),
)
"""The cases, in the order in which they are listed."""
