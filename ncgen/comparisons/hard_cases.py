"""The hard cases: mechanisms on which methods are known to break, each with an independent solution to be measured against.

Errors are the largest difference (m, rad) of named coordinates over the instants of the run, unless a case says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_module, load
from ncgen.model import Model
from ncgen.solver.trajectories.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hard case.

    breaks: what is hard about it; build: the model; error: of a run against an independent solution, which `against` names
    step: of methods with a fixed step (s); rtol: of the others, atol being a hundredth of it times the length
    options: for every run, such as initial velocities
    violated: the start is moved by this share of the mechanism's size
    """

    name: str
    breaks: str
    build: Callable[[], Model]
    duration: float
    error: Callable[[Trajectory], float]
    against: str
    step: float = 1e-3
    rtol: float = 1e-10
    points: int = 21
    options: dict = field(default_factory=dict)
    violated: float = 0.0


GRAVITY = 9.81


def _root(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12) -> float:
    """Where a function is zero."""
    return cast(float, brentq(function, low, high, xtol=xtol))  # it gives more than a number only where it is asked to


# -- the robot ---------------------------------------------------------------------------------------------------------


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


# -- linkages through singular positions -------------------------------------------------------------------------------


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

        return _root(passed, start, start + 100.0, xtol=1e-14)

    angles = np.array([start if t == 0 else angle(t) for t in run.t])
    path = np.column_stack([run["A.x"], run["A.y"], run["B.x"]])
    return float(np.max(np.abs(path - np.column_stack([np.cos(angles), np.sin(angles), 2 * np.cos(angles)]))))


# -- benchmarks --------------------------------------------------------------------------------------------------------


def _squeezer() -> Model:
    return example_module("andrews").build(beta0=-0.0617138900142764496)


def _squeezer_error(run: Trajectory) -> float:
    return abs(run["beta"][-1] - 15.81077119515370709711939) / 15.8


def _bricard_error(run: Trajectory) -> float:
    return float(np.max(np.abs(run.point("P3")[-1] - (0.9992646100894149, -0.9999997297996155, -0.0007351195114248411))))


def _governor_error(run: Trajectory) -> float:
    ends = (run["S.z"][-1], run["alpha1"][-1])
    return float(np.max(np.abs(np.array(ends) - (0.7432494247863, 0.2594913815434))))


# -- tops --------------------------------------------------------------------------------------------------------------


def _top_error(run: Trajectory) -> float:
    """Euler's equations with Euler parameters about the fixed point."""
    inertia = np.array([15.234375, 0.46875, 15.234375])

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        w, (s, v) = y[:3], (y[3], y[4:])
        down = _turned_back(y[3:], np.array([0, 0, -15.0 * GRAVITY]))
        moment = np.cross([0, 1.0, 0], down)
        return np.concatenate([(moment - np.cross(w, inertia * w)) / inertia, [-v @ w / 2], (s * w + np.cross(v, w)) / 2])

    start = [0, 150.0, -4.61538, 1, 0, 0, 0]
    solution = solve_ivp(slope, (0, run.t[-1]), start, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=run.t)
    centre = np.array([_turned(e, np.array([0, 1.0, 0])) for e in solution.y[3:].T])
    return float(np.max(np.abs(sum(run.point(name) for name in "PQR") / 3 - centre)))


def _turned(e: np.ndarray, x: np.ndarray) -> np.ndarray:
    return x + 2 * np.cross(e[1:], np.cross(e[1:], x) + e[0] * x)


def _turned_back(e: np.ndarray, x: np.ndarray) -> np.ndarray:
    return _turned(np.concatenate([e[:1], -e[1:]]), x)


def _disc_error(run: Trajectory) -> float:
    """Newton's and Euler's equations of a disc that rolls, from the same start; of its centre."""
    lean, turning, radius = np.radians(20.0), 0.5, 0.3
    start = [lean, 0, 0, 0, 0, turning, 1.5 / radius]
    solution = solve_ivp(rolling_disc, (0, run.t[-1]), start, method="DOP853", t_eval=run.t, rtol=1e-13, atol=1e-13)
    return float(np.max(np.abs(run.point("C") - disc_centre(solution.y))))


def rolling_disc(t: float, y: ArrayLike, mass: float = 2.0, radius: float = 0.3) -> list[float]:
    """Rates of the state of a thin disc in the frame (heading, axle, up the disc), the contact force eliminated.

    y (7,): lean to the left, heading (rad), x, y of the contact point (m); rates of lean and heading, spin about the axle (rad/s)
    """
    lean, heading, _, _, leaning, turning, spin = np.asarray(y)
    s, c = np.sin(lean), np.cos(lean)
    across, along, moment = mass * radius**2 / 4, mass * radius**2 / 2, mass * radius**2
    overturning = mass * GRAVITY * radius * s - (along + moment) * turning * spin * c - across * turning**2 * s * c
    lean_rate = overturning / (across + moment)
    spin_rate = moment * turning * leaning * c / (along + moment)
    turn_rate = leaning * (along * spin + 2 * across * turning * s) / (across * c)
    rolled = radius * (spin + turning * s)  # speed of the contact along its track
    return [leaning, turning, rolled * np.cos(heading), rolled * np.sin(heading), lean_rate, turn_rate, spin_rate]


def disc_centre(y: np.ndarray, radius: float = 0.3) -> np.ndarray:
    """The disc's centre (K, 3) in m from states (7, K) of `rolling_disc`."""
    lean, heading, east, north = y[:4]
    shift = radius * np.sin(lean)
    return np.transpose([east - shift * np.sin(heading), north + shift * np.cos(heading), radius * np.cos(lean)])


PRINCIPAL = np.array([1.0, 2.0, 3.0])
SPIN = np.array([0.6, 0.3, 1.1])


def _free_body(skew: float = np.pi / 2) -> Model:
    """A torque-free body with three different moments of inertia; the angle between two of its vectors may be small."""
    m = Model("freebody")
    centre = m.point("C", (0, 0, 0), fixed=True)
    x, y, z = (m.vector(n, d) for n, d in (("x", (1, 0, 0)), ("y", (np.cos(skew), np.sin(skew), 0)), ("z", (0, 0, 1))))
    m.body("body", points=[centre], vectors=[x, y, z], mass=1.0, com=(0, 0, 0), inertia=PRINCIPAL)
    return m


def _spin_rates(model: Model) -> dict[str, float]:
    vectors = [e for name, e in model.elements.items() if name in "xyz"]
    return {f"{v.name}.{axis}": float(r) for v in vectors for axis, r in zip("xyz", np.cross(SPIN, v.initial), strict=True)}


def _free_body_error(run: Trajectory) -> float:
    """Angular velocity in the body's axes by Jacobi's elliptic functions (Landau & Lifshitz, Mechanics, §37)."""
    rates = run.angular_velocity("body")
    turned = run.rotation("body")
    body_rates = turned.inv().apply(rates)
    return float(np.max(np.abs(body_rates - free_rotation(run.t)))) / float(np.linalg.norm(SPIN))


def free_rotation(t: ArrayLike) -> np.ndarray:
    """ω (K, 3) of the free body in its own axes, by fitting the phase of Jacobi's functions to the start."""
    a, b, c = PRINCIPAL
    energy = PRINCIPAL @ SPIN**2
    momentum = (PRINCIPAL**2) @ SPIN**2
    flipped = momentum < energy * b
    if flipped:
        a, c = c, a
    w1 = np.sqrt((energy * c - momentum) / (a * (c - a)))
    w2 = np.sqrt((energy * c - momentum) / (b * (c - b)))
    w3 = np.sqrt((momentum - energy * a) / (c * (c - a)))
    rate = np.sqrt((c - b) * (momentum - energy * a) / (a * b * c))
    m = (b - a) * (energy * c - momentum) / ((c - b) * (momentum - energy * a))
    first, second, third = SPIN if not flipped else SPIN[::-1]
    signs = np.sign([first, second, third])
    turning = signs[0] * signs[2]
    phase = _root(lambda u: signs[0] * w1 * ellipj(u, m)[1] - first, 0, 2 * ellipk(m))
    u0 = min((phase, -phase), key=lambda u: abs(turning * w2 * ellipj(u, m)[0] - second))
    sn, cn, dn, _ = ellipj(rate * np.asarray(t) + u0, m)
    result = np.column_stack([signs[0] * w1 * cn, turning * w2 * sn, signs[2] * w3 * dn])
    return result if not flipped else result[:, ::-1]


# -- scales and weights ------------------------------------------------------------------------------------------------


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


def _cases() -> Iterator[Case]:
    for count in (1, 2, 10, 40):
        build, error = _four_bars(count)
        name = "parallelogram" if count == 1 else f"nfourbar-{count}"
        yield Case(
            name=name,
            breaks=f"flattens twice a turn, where its freedom is {count + 1}",
            build=build,
            duration=10.0,
            error=error,
            against="Jacobi's functions",
            step=5e-4,
            options={"qd0": {f"B{i}.x": 1.0 for i in range(count + 1)}},
        )
    yield Case(
        name="robot",
        breaks="starts where cosines and sines of its angles vanish",
        build=lambda: load("robot"),
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
    )
    yield Case(
        name="robot-float",
        breaks="24 bits: computed with float, at rtol 1e-6",
        build=lambda: load("robot"),
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
        rtol=1e-6,
        options={"number": "float"},
    )
    yield Case(
        name="robot-sine",
        breaks="the paper's sine rows are singular at its own start",
        build=_sine_robot,
        duration=0.5,
        error=_robot_error,
        against="hand-written programs",
    )
    yield Case(
        name="equal-crank",
        breaks="at dead centre the slider may stay or go through",
        build=_equal_crank,
        duration=4.0,
        error=_equal_crank_error,
        against="the energy integral",
        options={"qd0": {"A.x": -np.sin(0.5) * 2.0}},
    )
    yield Case(
        name="bricard",
        breaks="a redundant row everywhere",
        build=lambda: load("bricard"),
        duration=10.0,
        error=_bricard_error,
        against="the energy integral, 34 digits",
    )
    yield Case(
        name="squeezer",
        breaks="seven bodies within milliseconds",
        build=_squeezer,
        duration=0.03,
        error=_squeezer_error,
        against="the energy integral, 40 digits",
        step=1e-5,
    )
    yield Case(
        name="governor",
        breaks="springs of 8e5 N/m: stiff",
        build=lambda: load("flyball"),
        duration=0.5,
        error=_governor_error,
        against="minimal coordinates",
        options={k: v for k, v in load("flyball").simulation_options.items() if k == "zd0"},
        step=2e-4,
    )
    yield Case(
        name="heavy-top",
        breaks="24 turns a second",
        build=lambda: load("heavytop"),
        duration=1.0,
        error=_top_error,
        against="Euler's equations",
        step=1e-4,
        options={k: v for k, v in load("heavytop").simulation_options.items() if k == "zd0"},
    )
    yield Case(
        name="disc",
        breaks="rolls: no coordinates stay independent for a turn",
        build=lambda: example_module("disc").build(spokes=0),
        duration=3.0,
        error=_disc_error,
        against="Newton's and Euler's equations",
        options={k: v for k, v in load("disc").simulation_options.items() if k == "zd0"},
    )
    yield Case(
        name="free-body",
        breaks="turns a thousand times: errors add up",
        build=_free_body,
        duration=5000.0,
        error=_free_body_error,
        against="Jacobi's functions",
        step=1e-2,
        rtol=1e-13,
        options={"qd0": _spin_rates(_free_body())},
    )
    skewed = partial(_free_body, 0.01)
    yield Case(
        name="near-parallel",
        breaks="two vectors of a body 0.6° apart",
        build=skewed,
        duration=10.0,
        error=_free_body_error,
        against="Jacobi's functions",
        step=2e-3,
        options={"qd0": _spin_rates(skewed())},
    )
    yield Case(
        name="chain-100", breaks="200 degrees of freedom", build=_chain, duration=0.1, error=_energy, against="its own energy", points=3
    )
    yield Case(
        name="light-upper",
        breaks="masses 1 : 1e8",
        build=_double(1e-8, 1.0),
        duration=0.7,
        error=_light_upper_error,
        against="the limit of no mass",
    )
    yield Case(
        name="light-lower",
        breaks="masses 1e8 : 1",
        build=_double(1.0, 1e-8),
        duration=0.7,
        error=_light_lower_error,
        against="the limit of no mass",
    )
    for size in (1e-6, 1e6):
        build, error = _scaled_pendulum(size)
        yield Case(
            name=f"pendulum-{size:g}",
            breaks=f"{size:g} m long: tolerances and ranks must not know metres",
            build=build,
            duration=5.0,
            error=error,
            against="Jacobi's functions",
        )
    yield Case(
        name="massless",
        breaks="points and bars without mass: M is singular",
        build=_massless,
        duration=5.0,
        error=_pendulum_error,
        against="Jacobi's functions",
    )
    yield Case(
        name="violated",
        breaks="the start is open by 10 %",
        build=lambda: load("pendulum"),
        duration=1.0,
        error=_energy,
        against="its own energy",
        violated=0.1,
    )


CASES: dict[str, Case] = {case.name: case for case in _cases()}
"""Every case by its name."""
