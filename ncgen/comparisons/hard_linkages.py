"""Hard linkages: through singular positions, with redundant constraints, stiff, or fast; and what their motions are compared with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import ellipj

from ncgen.comparisons.case import GRAVITY, Case, root
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_module, load
from ncgen.model import Model
from ncgen.solver.trajectories.trajectory import Trajectory


def _sine_robot() -> Model:
    """The paper's own rows, sines alone: singular at its own start."""
    robot = example_module("robot")
    return robot.build(form="sine")


def _robot_error(run: Trajectory) -> float:
    from ncgen.comparisons.rivals import handwritten

    module = handwritten(run.kernels)
    if module is None:
        raise NcgenError(f"{run.name}: there are no hand-written functions for it; choose robot")
    return max(abs(run[name][-1] - value) for name, value in module.END.items())


def _four_bars(count: int) -> tuple[Callable[[], Model], Callable[[Trajectory], float]]:
    """N four-bars, against `four_bars_position`."""

    def error(run: Trajectory) -> float:
        x, y = four_bars_position(count, run.t).T
        return float(np.max(np.hypot(run["B0.x"] - x, run["B0.y"] - y)))

    return lambda: example_module("nfourbar").build(count), error


def four_bars_position(count: int, t: ArrayLike) -> np.ndarray:
    """B0 of N four-bars, (len(t), 2): x = 2 sn cn, y = 1 − 2 sn² of (t/2 | −4c), c = g ((N+1)/2 + N)/((N+1)/3 + N)."""
    c = GRAVITY * ((count + 1) / 2 + count) / ((count + 1) / 3 + count)
    return np.column_stack(_jacobi_circle(np.asarray(t) / 2, -4 * c))


def _jacobi_circle(u: np.ndarray, parameter: float) -> tuple[np.ndarray, np.ndarray]:
    """2 sn cn and 1 − 2 sn² of (u | m) for a negative m, by sn(u|m) = sd(u √(1−m) | −m/(1−m))/√(1−m) (DLMF 22.17)."""
    scale = np.sqrt(1 - parameter)
    sn, cn, dn, _ = ellipj(scale * u, -parameter / (1 - parameter))
    s, c = sn / dn / scale, cn / dn
    return 2 * s * c, 1 - 2 * s * s


def _equal_crank() -> Model:
    """A slider-crank of two equal uniform rods: at dead centre the slider may also stay where the crank turns."""
    m = Model("equalcrank")
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (np.cos(0.5), np.sin(0.5))), m.point("B", (2 * np.cos(0.5), 0), fixed="y")
    m.body("crank", points=[O, A], mass=1.0, inertia=1 / 12)
    m.body("rod", points=[A, B], mass=1.0, inertia=1 / 12)
    m.body("slider", points=[B], mass=1.0)
    m.independent(A.x)
    return m


def _equal_crank_error(run: Trajectory) -> float:
    """Without gravity I(θ) θ̇² stays, so t is an integral over θ; A is at (cos θ, sin θ), the slider at 2 cos θ."""

    def inertia(theta: float) -> float:
        return 1 / 3 + 1 / 12 + (2.25 * np.sin(theta) ** 2 + 0.25 * np.cos(theta) ** 2) + 4 * np.sin(theta) ** 2

    start = np.arctan2(run["A.y"][0], run["A.x"][0])
    speed = -run["rate(A.x)"][0] / np.sin(start)
    momentum = speed * np.sqrt(inertia(start))

    def angle(t: float) -> float:
        def passed(theta: float) -> float:
            return quad(lambda x: np.sqrt(inertia(x)), start, theta, epsabs=1e-13, epsrel=1e-13, limit=200)[0] / momentum - t

        return root(passed, start, start + 100.0, xtol=1e-14)

    angles = np.array([start if t == 0 else angle(t) for t in run.t])
    path = np.column_stack([run["A.x"], run["A.y"], run["B.x"]])
    return float(np.max(np.abs(path - np.column_stack([np.cos(angles), np.sin(angles), 2 * np.cos(angles)]))))


def _squeezer() -> Model:
    return example_module("andrews").build(beta0=-0.0617138900142764496)


def _squeezer_error(run: Trajectory) -> float:
    return abs(run["beta"][-1] - 15.81077119515370709711939) / 15.8


def _bricard_error(run: Trajectory) -> float:
    return float(np.max(np.abs(run.point("P3")[-1] - (0.9992646100894149, -0.9999997297996155, -0.0007351195114248411))))


def _governor_error(run: Trajectory) -> float:
    ends = (run["S.z"][-1], run["alpha1"][-1])
    return float(np.max(np.abs(np.array(ends) - (0.7432494247863, 0.2594913815434))))


def _four_bar_case(count: int) -> Case:
    build, error = _four_bars(count)
    return Case(
        name="parallelogram" if count == 1 else f"nfourbar-{count}",
        breaks=f"flattens twice a turn, where its freedom is {count + 1}",
        build=build,
        duration=10.0,
        error=error,
        against="Jacobi's functions",
        step=5e-4,
        options={"qd0": {f"B{i}.x": 1.0 for i in range(count + 1)}},
    )


LINKAGES = (
    *map(_four_bar_case, (1, 2, 10, 40)),
    Case(
        name="robot",
        breaks="starts where cosines and sines of its angles vanish",
        build=lambda: load("robot"),
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
    ),
    Case(
        name="robot-float",
        breaks="24 bits: computed with float, at rtol 1e-6",
        build=lambda: load("robot"),
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
        rtol=1e-6,
        options={"number": "float"},
    ),
    Case(
        name="robot-sine",
        breaks="the paper's sine rows are singular at its own start",
        build=_sine_robot,
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
    ),
    Case(
        name="equal-crank",
        breaks="at dead centre the slider may stay or go through",
        build=_equal_crank,
        duration=4.0,
        error=_equal_crank_error,
        against="the energy integral",
        options={"qd0": {"A.x": -np.sin(0.5) * 2.0}},
    ),
    Case(
        name="bricard",
        breaks="a redundant row everywhere",
        build=lambda: load("bricard"),
        duration=10.0,
        error=_bricard_error,
        against="the energy integral, 34 digits",
    ),
    Case(
        name="squeezer",
        breaks="seven bodies within milliseconds",
        build=_squeezer,
        duration=0.03,
        error=_squeezer_error,
        against="the energy integral, 40 digits",
        step=1e-5,
    ),
    Case(
        name="governor",
        breaks="springs of 8e5 N/m: stiff",
        build=lambda: load("flyball"),
        duration=0.5,
        error=_governor_error,
        against="minimal coordinates",
        options={k: v for k, v in load("flyball").simulation_options.items() if k == "zd0"},
        step=2e-4,
    ),
)
"""The cases, in the order in which they are listed."""
