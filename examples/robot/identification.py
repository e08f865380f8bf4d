"""Identification of a robot: which combinations of its masses, centres and moments of inertia a motion can tell at all, and what they are.

Ten numbers say what a body's inertia is: its mass, three first and six second moments. The forces that a motion needs are linear in all
of them, Y π, but most do not matter by themselves: what lies on a hinge's axis belongs to both bodies, and what never turns has no moment
of inertia to be seen. The columns of Y over many states say which are left, the base parameters, and how the others add to them. Then they
are found: motors turn the joints after a plan while their angles are measured with noise, and scipy's least squares goes through the
motion with its exact derivatives by every base parameter.

    python examples/robot/identification.py [--times] [--plot FILE] | arm
"""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import sympy
from scipy.optimize import OptimizeResult, least_squares

import ncgen
from ncgen import Model
from ncgen.model.elements import Relative
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import choose_partition

if TYPE_CHECKING:
    from ncgen.mechanism.kernels import Kernels
    from ncgen.model.bodies import Body
    from ncgen.solver.derivatives.sensitivity import Sensitivities

MOMENTS = tuple((i, j) for i in range(3) for j in range(i, 3))

DEPENDENT = 1e-7
"""A column of Y whose part apart from those before is smaller than this, relative to the largest column, depends on them."""

STATES, REACH = 60, 0.5
"""Positions at which Y is looked at, and how far their angles are from the initial ones (rad)."""

DURATION, STEPS, NOISE = 4.0, 400, 1e-4
"""s; of rk4, at every one of which the angles are measured; rad."""

STIFF, DAMPED = 15.0, 0.1
"""Of the motors: the frequency of a joint on its spring while the others are held (rad/s), and damping over stiffness (s)."""

GUESS = 0.2
"""How wrong the bodies' inertias are from which the search begins, at most and relative."""


def with_moments(model: Model) -> tuple[Model, tuple[str, ...]]:
    """A copy whose bodies' inertias are ten parameters each, about the first point that carries it, and the parameters' names."""
    copy: Model = pickle.loads(pickle.dumps(model))
    names: list[str] = []
    for body in copy.bodies.values():
        if body.inertia is not None:
            names += _with_moments(copy, body)
    return copy, tuple(names)


def _with_moments(model: Model, body: Body) -> list[str]:
    own: Any = body.own_inertia  # plain numbers here
    place = body.basis[0].initial
    mass, arm = float(own.mass), np.array(own.com, dtype=float) - place
    second = np.array(own.tensor, dtype=float) + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    values = {f"J{'xyz'[i]}{'xyz'[j]}": second[i, j] for i, j in MOMENTS}
    values |= {f"h{axis}": mass * x for axis, x in zip("xyz", arm, strict=True)} | {"m": mass}
    number = {what: model.parameter(f"{body.name}_{what}", float(value)) for what, value in values.items()}
    m, h = number["m"], np.array([number[f"h{axis}"] for axis in "xyz"], dtype=object)
    tensor = np.empty((3, 3), dtype=object)
    for i, j in MOMENTS:
        shifted = (h @ h if i == j else 0) - h[i] * h[j]
        tensor[i, j] = tensor[j, i] = number[f"J{'xyz'[i]}{'xyz'[j]}"] - shifted / m
    com = tuple(float(x) + entry / m for x, entry in zip(place, h, strict=True))
    body.inertia = replace(own, mass=m, com=com, tensor=tensor, is_judged=False)  # a search for sums passes through all numbers
    return [f"{body.name}_{what}" for what in values]


class Base(NamedTuple):
    """names: of all inertial parameters; kept: places of those that are left; sums (kept, names): what adds up to each base parameter.

    gap: the smallest part of a column that was kept over the largest of one that was not
    """

    names: tuple[str, ...]
    kept: tuple[int, ...]
    sums: np.ndarray
    gap: float

    def text(self, k: int) -> str:
        """The k-th base parameter in words."""
        terms = [(self.sums[k, i], self.names[i]) for i in np.argsort(-np.abs(self.sums[k]), kind="stable") if i != self.kept[k]]
        rest = "".join(f" {'-' if x < 0 else '+'} {'' if abs(abs(x) - 1) < 5e-7 else f'{abs(x):.6g} '}{name}" for x, name in terms if x)
        return self.names[self.kept[k]] + rest


def base_parameters(kernels: Kernels, names: Sequence[str]) -> Base:
    """By the columns of Y from the first one on: one that those before make up is added to them."""
    Y = regressor(kernels, names)
    kept: list[int] = []
    apart = np.zeros(Y.shape[1])
    directions = np.empty((len(Y), 0))
    largest = np.max(np.linalg.norm(Y, axis=0))
    for k, column in enumerate(Y.T):
        rest = column - directions @ (directions.T @ column)
        rest -= directions @ (directions.T @ rest)
        apart[k] = np.linalg.norm(rest) / largest
        if apart[k] > DEPENDENT:
            kept.append(k)
            directions = np.column_stack([directions, rest / np.linalg.norm(rest)])
    sums = np.linalg.lstsq(Y[:, kept], Y, rcond=None)[0]
    sums[np.abs(sums) < 1e-8] = 0.0
    return Base(tuple(names), tuple(kept), sums, float(np.min(apart[kept]) / np.max(np.delete(apart, kept), initial=0.0)))


def regressor(kernels: Kernels, names: Sequence[str], states: int = STATES) -> np.ndarray:
    """Y (states · freedoms, names): the motors' forces by the parameters, at positions, rates and accelerations that are drawn."""
    draw = np.random.default_rng(18)
    z = kernels.model.chosen_independent
    columns = [kernels.parameters.index(name) for name in names]
    partition = choose_partition(kernels, kernels.q0, independent=z)
    rows = []
    for _ in range(states):
        places = {name: kernels.q0[kernels.index[name]] + REACH * x for name, x in zip(z, draw.uniform(-1, 1, len(z)), strict=True)}
        q = ncgen.move(kernels, None, places, steps=10).q
        frame = kinematics(kernels, partition, q)
        qd = frame.R @ draw.standard_normal(len(z))
        qdd = frame.R @ draw.standard_normal(len(z)) + frame.particular(kernels.gamma(q, qd))
        balance = kernels.balance_p(q, qd, qdd, np.zeros(kernels.m)).toarray()[:, columns]
        rows.append(frame.R.T @ balance)
    return np.vstack(rows)


# -- the experiment --------------------------------------------------------------------------------


def planned(model: Model) -> Model:
    """The model with motors that turn every angle about its initial one after a sum of sines, by the law of a spring and a damper."""
    kernels = ncgen.compile(model, "numpy")
    draw = np.random.default_rng(7)
    z = model.chosen_independent
    partition = choose_partition(kernels, kernels.q0, independent=z)
    R = kinematics(kernels, partition, kernels.q0).R
    inertia = np.diag(R.T @ kernels.mass_matrix(kernels.q0, 0.0, kernels.p0) @ R)
    for name, J in zip(z, inertia, strict=True):
        angle = model.elements[name]
        assert isinstance(angle, Relative), f"{name} is an angle"
        t = model.time
        waves = sum(a * sympy.sin(w * t) for a, w in zip(draw.uniform(0.1, 0.25, 3), draw.uniform(2.0, 9.0, 3), strict=True))
        plan = kernels.q0[kernels.index[name]] + waves
        stiff = round(float(J) * STIFF**2, 3)
        model.torque(angle, stiff * (plan - angle) + round(DAMPED * stiff, 4) * (sympy.diff(waves, t) - angle.rate))
    return model


class Experiment:
    """What was measured, and what a choice of base parameters says instead: residuals in units of the noise."""

    def __init__(self, kernels: Kernels, base: Base) -> None:
        self.kernels, self.base, self.runs = kernels, base, 0
        self.z = kernels.model.chosen_independent
        self.seen = [kernels.index[name] for name in self.z]
        self.places = np.array([kernels.parameters.index(base.names[k]) for k in base.kept])
        self.wanted = [base.names[k] for k in base.kept]
        self.last: tuple[bytes, Sensitivities] | None = None
        self.measured = self.angles(kernels.p0[self.places])
        self.measured = self.measured + NOISE * np.random.default_rng(2018).standard_normal(self.measured.shape)

    def guess(self) -> np.ndarray:
        """Base parameters of bodies whose inertias are all wrong by shares of their own, so that bodies could have them."""
        own = self.kernels.p0[[self.kernels.parameters.index(name) for name in self.base.names]]
        wrong = 1 + GUESS * np.repeat(np.random.default_rng(4).uniform(-1, 1, len(own) // 10), 10)
        return self.kernels.p0[self.places] + self.base.sums @ ((wrong - 1) * own)

    def rest(self) -> np.ndarray:
        """What the parameters that are held add to the base parameters."""
        own = self.kernels.p0[[self.kernels.parameters.index(name) for name in self.base.names]]
        return self.base.sums @ own - self.kernels.p0[self.places]

    def numbers(self, base: np.ndarray) -> np.ndarray:
        p = self.kernels.p0.copy()
        p[self.places] = base
        return p

    def angles(self, base: np.ndarray) -> np.ndarray:
        """(instants, angles) by the run alone."""
        self.runs += 1
        options: dict[str, Any] = {"integrator": "rk4", "formalism": "lagrange", "max_step": DURATION / STEPS, "points": STEPS + 1}
        return ncgen.simulate(self.kernels, DURATION, p=self.numbers(base), z=self.z, zd0=0.0 * base[: len(self.z)], **options).q[
            :, self.seen
        ]

    def differentiated(self, base: np.ndarray) -> Sensitivities:
        """The motion with its derivatives, kept for whoever asks for the same numbers again."""
        if self.last is None or self.last[0] != base.tobytes():
            self.runs += 1
            self.last = base.tobytes(), ncgen.sensitivities(self.kernels, DURATION, STEPS, p=self.numbers(base), z=self.z, by=self.wanted)
        return self.last[1]

    def misses(self, base: np.ndarray) -> np.ndarray:
        return ((self.angles(base) - self.measured) / NOISE).ravel()

    def exact_misses(self, base: np.ndarray) -> np.ndarray:
        return ((self.differentiated(base).q[:, self.seen] - self.measured) / NOISE).ravel()

    def slopes(self, base: np.ndarray) -> np.ndarray:
        return self.differentiated(base).q_by[:, self.seen].reshape(-1, len(self.places)) / NOISE


def experiment() -> Experiment:
    """That of the paper's robot."""
    model, names = with_moments(ncgen.load("robot"))
    base = base_parameters(ncgen.compile(model), names)
    return Experiment(ncgen.compile(planned(model)), base)


def identify(its: Experiment, derivatives: str = "exact") -> tuple[OptimizeResult, float]:
    """What was found from a wrong guess, and the seconds it took; derivatives: exact or 2-point."""
    start = its.guess()
    its.slopes(start)  # derivatives are compiled when first used
    its.last, its.runs = None, 0
    began = time.perf_counter()
    is_exact = derivatives == "exact"
    jac: Any = its.slopes if is_exact else derivatives  # scipy takes either, and has no annotations
    found = least_squares(its.exact_misses if is_exact else its.misses, start, jac, x_scale="jac", xtol=1e-10, ftol=1e-10, gtol=1e-10)
    return found, time.perf_counter() - began


def deviations(found: OptimizeResult) -> np.ndarray:
    """Standard deviations of what was found, from the noise."""
    return np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))


def told(base: Base, columns: np.ndarray | None = None, rest: np.ndarray | None = None) -> None:
    """Print the base parameters; columns: what they are, what was found and how sure that is, where `rest` is held."""
    print(f"{len(base.names)} inertial parameters make {len(base.kept)} base parameters\n")
    if columns is None or rest is None:
        print("\n".join(base.text(k) for k in range(len(base.kept))))
        return
    print(f"{'true':>11} {'found':>11} {'deviation':>10}  base parameter")
    for k, (true, found, deviation) in enumerate(columns):
        print(f"{true + rest[k]:11.5f} {found + rest[k]:11.5f} {deviation:10.1e}  {base.text(k)}")


def main() -> None:
    if "arm" in sys.argv[1:]:
        model, names = with_moments(ncgen.load("arm"))
        told(base_parameters(ncgen.compile(model), names))
        return
    its = experiment()
    base, true = its.base, its.kernels.p0[its.places]
    found, seconds = identify(its)
    told(base, np.column_stack([true, found.x, deviations(found)]), its.rest())
    left = 2 * found.cost / (found.fun.size - len(true))
    print(f"\n{found.nfev} motions of {DURATION:g} s in {seconds:.1f} s; the mean square of what is left is {left:.3f} of the noise's")
    if "--times" in sys.argv:
        rough, seconds = identify(its, "2-point")
        print(
            f"{its.runs} motions in {seconds:.1f} s with 2-point differences; sum of squares {2 * rough.cost:.4f}, not {2 * found.cost:.4f}"
        )
    if "--plot" in sys.argv:
        plot(its, found, sys.argv[sys.argv.index("--plot") + 1])


def plot(its: Experiment, found: OptimizeResult, file: str) -> None:
    """The angles, and every base parameter's error in standard deviations beside the bounds of 95 %."""
    from matplotlib.figure import Figure

    chart = Figure(figsize=(8, 3.6), layout="constrained")
    angles, errors = chart.subplots(1, 2)
    for name, history in zip(its.z, its.measured.T, strict=True):
        angles.plot(np.linspace(0, DURATION, STEPS + 1), history - history[0], label=name)
    angles.set_xlabel("t (s)")
    angles.set_ylabel("angles measured (rad)")
    angles.legend(fontsize="small", ncols=2)
    off = (found.x - its.kernels.p0[its.places]) / deviations(found)
    errors.stem(np.arange(1, len(off) + 1), off, basefmt=" ")
    errors.axhspan(-1.96, 1.96, alpha=0.15)
    errors.set_xlabel("base parameter")
    errors.set_ylabel("error / standard deviation")
    chart.savefig(file, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
