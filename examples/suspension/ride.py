"""Design of a suspension for ride: spring, damper and where they hold the chassis, by a gradient that goes back through the motion once.

A quarter of a car on the wishbones of `model.py` drives over a rough road. What passengers feel is the chassis' vertical acceleration, what
holds the car on the road is the tyre's force, and the wheel's travel has an end. The cost adds mean squares of all three. Seven numbers are
free: stiffness, preload, damping, and how far in and up spring and damper are fixed. `ncgen.gradient` gives the cost with all its
derivatives for little more than the motion alone, and scipy's minimize does the rest.

    python examples/suspension/ride.py [--plot FILE]
"""

from __future__ import annotations

import sys
import time

import numpy as np
import sympy as sp
from scipy.optimize import OptimizeResult, minimize

import ncgen
from ncgen import Model
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.derivatives.sensitivity import Gradient

CAR = example_module("suspension")

SPRUNG = CAR.LOAD / 9.81 - CAR.RACK_MASS - sum(mass for mass, _, _ in CAR.BODIES.values())
"""What of the car this wheel carries beside its own parts (kg): all is in balance at the drawing's height."""

PRELOAD = CAR.SPRING * (CAR.FREE_LENGTH - float(np.linalg.norm(np.subtract(CAR.CHASSIS["C"], CAR.LOWER["S"]))))

DESIGN = {"stiffness": CAR.SPRING, "preload": PRELOAD, "damping": CAR.DAMPER, "spring in": 0.0, "spring up": 0.0}
DESIGN |= {"damper in": 0.0, "damper up": 0.0}
UNITS = np.array([CAR.SPRING, PRELOAD, CAR.DAMPER, 0.1, 0.1, 0.1, 0.1])
"""The design to begin with (N/m, N, N s/m, and m from the drawing), and what its numbers are counted in."""

BOUNDS = [(0.15, 2.0), (0.8, 1.2), (0.1, 2.0), *[(-0.3, 0.3)] * 4]
"""In these units."""

DURATION, STEPS = 3.0, 900
"""s; of rk4."""

WAVES = ((1.1, 0.018, 0.3), (2.3, 0.010, 1.9), (4.7, 0.005, 4.0), (9.1, 0.0022, 5.2), (13.7, 0.0012, 2.6))
"""Of the road as the wheel meets it: frequency (Hz), height (m), phase."""

ACCELERATION, GRIP, TRAVEL = 1.0, 800.0, 0.015
"""What costs as much as each other: accelerations (m/s²), changes of the tyre's force (N), and wheel travel (m), all in the mean."""


def road(t: np.ndarray) -> np.ndarray:
    """Its height at times (s); it begins level."""
    return sum(height * (np.sin(2 * np.pi * f * t + phase) - np.sin(phase)) for f, height, phase in WAVES) + np.zeros_like(t)


def build() -> Model:
    """The suspension on a chassis that moves up and down; the rack is held."""
    m = Model("ride")
    p = {name: m.parameter(name.replace(" ", "_"), value) for name, value in DESIGN.items()}
    held = {name: place for part in (CAR.UPPER, CAR.LOWER) for name, place in part.items() if name in ("UF", "UB", "LF", "LB")}
    x, y, z = CAR.CHASSIS["C"]
    held["C"] = (x, y - p["spring in"], z + p["spring up"])
    x, y, z = CAR.CHASSIS["D"]
    held["D"] = (x, y - p["damper in"], z + p["damper up"])
    held["R"] = CAR.RACK
    chassis = {name: m.point(name, place, fixed="xy") for name, place in held.items()}
    base = chassis["UF"]
    for name, point in chassis.items():
        if point is not base:
            m.constrain(point.z - base.z - (held[name][2] - held["UF"][2]), f"{name} on the chassis")
    m.body("chassis", [base], mass=SPRUNG + CAR.RACK_MASS, rigid=False)

    free = {name: place for part in (CAR.UPPER, CAR.LOWER, CAR.UPRIGHT) for name, place in part.items() if name not in held}
    points = chassis | {name: m.point(name, place) for name, place in free.items()}
    U, L, T, W, S = (points[name] for name in "ULTWS")
    CAR.heavy(m, "upper", [points["UF"], points["UB"], U])
    CAR.heavy(m, "lower", [points["LF"], points["LB"], L, S])
    CAR.heavy(m, "upright", [L, U, T, W])
    CAR.heavy(m, "spindle", [L, U, T, W])
    m.distance(points["R"], T)
    m.independent(base.z, W.z)

    m.gravity((0, 0, -9.81))
    length = sp.sqrt(sum((a - b) ** 2 for a, b in zip(held["C"], CAR.LOWER["S"], strict=True)))
    m.spring(points["C"], S, p["stiffness"], free_length=length + p["preload"] / p["stiffness"])
    m.spring(points["D"], S, damping=p["damping"])
    height = sum(a * (sp.sin(2 * sp.pi * f * m.time + phase) - np.sin(phase)) for f, a, phase in WAVES)
    m.force(W, (0, 0, CAR.LOAD - CAR.TYRE * (W.z - W.initial[2] - height)), "tyre")
    return m


class Ride:
    """The cost of a design and its gradient, by numbers in UNITS."""

    def __init__(self) -> None:
        self.kernels: Kernels = ncgen.compile(build())
        self.base, self.wheel = (self.kernels.index[name] for name in ("UF.z", "W.z"))
        self.levels = CAR.UPPER["UF"][2], CAR.UPRIGHT["W"][2]
        self.road = road(np.linspace(0, DURATION, STEPS + 1))
        self.runs = 0

    def parts(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Accelerations of the chassis, changes of the tyre's force and travel of the wheel, each over what counts as one."""
        acceleration = np.diff(qd[:, self.base]) * STEPS / DURATION
        force = -CAR.TYRE * (q[:, self.wheel] - self.levels[1] - self.road)
        travel = q[:, self.wheel] - self.levels[1] - (q[:, self.base] - self.levels[0])
        return acceleration / ACCELERATION, force / GRIP, travel / TRAVEL

    def objective(self, q: np.ndarray, qd: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """The cost, and its derivatives by all positions and velocities."""
        acceleration, force, travel = self.parts(q, qd)
        by_q, by_qd = np.zeros_like(q), np.zeros_like(qd)
        share = 2 / STEPS
        by_rate = share * acceleration * STEPS / DURATION / ACCELERATION
        by_qd[1:, self.base] += by_rate
        by_qd[:-1, self.base] -= by_rate
        by_q[:, self.wheel] = share * (travel / TRAVEL - force * CAR.TYRE / GRIP)
        by_q[:, self.base] = -share * travel / TRAVEL
        return float(acceleration @ acceleration + force @ force + travel @ travel) / STEPS, by_q, by_qd

    def gradient(self, x: np.ndarray) -> Gradient:
        self.runs += 1
        return ncgen.gradient(self.kernels, DURATION, STEPS, self.objective, p=x * UNITS, z=("UF.z", "W.z"))

    def cost(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """With its gradient, for `minimize`."""
        found = self.gradient(x)
        return found.value, np.array([found.derivatives[name] for name in self.kernels.parameters]) * UNITS


def begin() -> np.ndarray:
    return np.array(list(DESIGN.values())) / UNITS


def designed(ride: Ride) -> tuple[OptimizeResult, float]:
    """The design, and the seconds it took."""
    ride.cost(begin())  # derivatives are compiled when first used
    ride.runs, clock = 0, time.perf_counter()
    found = minimize(ride.cost, begin(), jac=True, bounds=BOUNDS, method="L-BFGS-B", options={"ftol": 1e-12, "gtol": 1e-7, "maxiter": 300})
    return found, time.perf_counter() - clock


def histories(ride: Ride, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three parts of the cost over time, in m/s², N and m."""
    options = {"formalism": "lagrange", "integrator": "rk4", "max_step": DURATION / STEPS, "points": STEPS + 1}
    run = ncgen.simulate(ride.kernels, DURATION, p=x * UNITS, **options)
    acceleration, force, travel = ride.parts(run.q, run.qd)
    return acceleration * ACCELERATION, force * GRIP, travel * TRAVEL


def main() -> None:
    ride = Ride()
    found, seconds = designed(ride)
    print(f"{ride.runs} motions with their gradients in {seconds:.1f} s: {found.message}\n")
    print(f"{'':12} {'begin':>12} {'design':>12}")
    for name, a, b in zip(DESIGN, begin() * UNITS, found.x * UNITS, strict=True):
        print(f"{name:12} {a:12.5g} {b:12.5g}")
    before, after = (histories(ride, x) for x in (begin(), found.x))
    for name, unit, a, b in zip(("acceleration", "tyre's force", "wheel travel"), ("m/s2", "N", "m"), before, after, strict=True):
        print(f"{name:12} {np.sqrt(np.mean(a**2)):12.5g} {np.sqrt(np.mean(b**2)):12.5g} {unit} (root of the mean square)")
    print(f"{'cost':12} {ride.cost(begin())[0]:12.6f} {found.fun:12.6f}")
    if "--plot" in sys.argv:
        plot(before, after, sys.argv[sys.argv.index("--plot") + 1])


def plot(before: tuple[np.ndarray, ...], after: tuple[np.ndarray, ...], file: str) -> None:
    from matplotlib.figure import Figure

    chart = Figure(figsize=(7.5, 5), layout="constrained")
    names = ("chassis (m/s²)", "tyre's force, change (N)", "wheel travel (m)")
    for axis, name, a, b in zip(chart.subplots(3, 1, sharex=True), names, before, after, strict=True):
        t = np.linspace(0, DURATION, len(a))
        axis.plot(t, a, color="0.65", label="begin")
        axis.plot(t, b, label="design")
        axis.set_ylabel(name)
        axis.grid(alpha=0.3)
    chart.axes[0].legend(fontsize="small", ncols=2)
    chart.axes[-1].set_xlabel("t (s)")
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
