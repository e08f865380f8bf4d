"""Hard rotations: a heavy top, a disc that rolls, and a body that turns freely; and the equations that their motions are compared with."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from ncgen.comparisons.case import GRAVITY, Case, root
from ncgen.exchange.examples import example_module, load
from ncgen.model import Model
from ncgen.solver.trajectories.trajectory import Trajectory

PRINCIPAL = np.array([1.0, 2.0, 3.0])


SPIN = np.array([0.6, 0.3, 1.1])


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
    phase = root(lambda u: signs[0] * w1 * ellipj(u, m)[1] - first, 0, 2 * ellipk(m))
    u0 = min((phase, -phase), key=lambda u: abs(turning * w2 * ellipj(u, m)[0] - second))
    sn, cn, dn, _ = ellipj(rate * np.asarray(t) + u0, m)
    result = np.column_stack([signs[0] * w1 * cn, turning * w2 * sn, signs[2] * w3 * dn])
    return result if not flipped else result[:, ::-1]


_skewed = partial(_free_body, 0.01)

TOPS = (
    Case(
        name="heavy-top",
        breaks="24 turns a second",
        build=lambda: load("heavytop"),
        duration=1.0,
        error=_top_error,
        against="Euler's equations",
        step=1e-4,
        options={k: v for k, v in load("heavytop").simulation_options.items() if k == "zd0"},
    ),
    Case(
        name="disc",
        breaks="rolls: no coordinates stay independent for a turn",
        build=lambda: example_module("disc").build(spokes=0),
        duration=3.0,
        error=_disc_error,
        against="Newton's and Euler's equations",
        options={k: v for k, v in load("disc").simulation_options.items() if k == "zd0"},
    ),
    Case(
        name="free-body",
        breaks="turns a thousand times: errors add up",
        build=_free_body,
        duration=5000.0,
        error=_free_body_error,
        against="Jacobi's functions",
        step=1e-2,
        rtol=1e-13,
        options={"qd0": _spin_rates(_free_body())},
    ),
    Case(
        name="near-parallel",
        breaks="two vectors of a body 0.6° apart",
        build=_skewed,
        duration=10.0,
        error=_free_body_error,
        against="Jacobi's functions",
        step=2e-3,
        options={"qd0": _spin_rates(_skewed())},
    ),
)
"""The cases, in the order in which they are listed."""
