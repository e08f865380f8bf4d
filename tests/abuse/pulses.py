"""Random pulses on mechanisms at rest and in motion, and what they must do in closed form: a pulse that no step sees does nothing.

Each mechanism is one model, in which every kind of law has a time, a width and a size as parameters, so that nothing is compiled for a
pulse. A law of another kind has the size 0 and lies outside the run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.interpolate
import scipy.special
import sympy
from exported_motion import Exported

import ncgen

DURATION = 10.0
"""s"""

MASS, STIFFNESS, LENGTH, GRAVITY = 2.0, 8.0, 1.0, 9.81
"""kg, N/m, m, m/s²"""

NOT_IN_THE_RUN = -1e5
"""s"""

TRIANGLE = (-2.0, -1.0, 0.0, 1.0, 2.0), (0.0, 0.0, 1.0, 0.0, 0.0)

LAWS = {
    "Heaviside": lambda u, m: sympy.Heaviside(u + sympy.Rational(1, 2)) - sympy.Heaviside(u - sympy.Rational(1, 2)),
    "Piecewise": lambda u, m: sympy.Piecewise((0.0, u < -0.5), (1.0, u < 0.5), (0.0, True)),
    "Max and Min": lambda u, m: sympy.Max(0, sympy.Min(1 - u, 1 + u)),
    "smooth_step": lambda u, m: ncgen.smooth_step(u, -1, 0) - ncgen.smooth_step(u, 0, 1),
    "Gaussian": lambda u, m: sympy.exp(-4 * sympy.log(2) * u**2),
    "table": lambda u, m: m.table("triangle", *TRIANGLE)(u),
}
"""Laws of u = (t − at) / width, whose width at half their height is 1."""

GAUSSIAN = math.sqrt(math.pi / (4 * math.log(2)))
"""The area of a Gaussian of height 1, whose width at half its height is 1; that of all other laws is 1."""

SIGNALS = ("zero", "linear", "cubic", "Gaussian function", "rectangular function", "sin² function")
"""Kinds of inputs: three tables and three functions of Python."""

FEW, SOME, MOST = 1e-3, 1e-6, 1e-8

SEEN = 0.1
"""The fraction of what a pulse does by which the motion may differ from the closed form, which takes it for short.
A missed one differs by 1."""

STEPS_ADD_UP = 100.0
"""Times rtol: by how much more it may differ. In a batch rtol is that of a step, and some hundred steps of a swing add up to it."""


@dataclass(frozen=True)
class Pulse:
    """at, width: s; impulse: N s or N m s; speed: what the mechanism starts with, 1/s or m/s; law: a key of `LAWS` or one of `SIGNALS`"""

    mechanism: str
    law: str
    at: float
    width: float
    impulse: float
    speed: float

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters of the model."""
        given = {f"{name}_{k}": value for k in range(len(LAWS)) for name, value in (("at", NOT_IN_THE_RUN), ("width", 1.0), ("size", 0.0))}
        if self.law in LAWS:
            k = [*LAWS].index(self.law)
            area = self.width * (GAUSSIAN if self.law == "Gaussian" else 1.0)
            given |= {f"at_{k}": self.at, f"width_{k}": self.width, f"size_{k}": self.impulse / area}
        return given

    @property
    def inputs(self) -> dict[str, object]:
        """Nothing for a law of the model."""
        return {} if self.law in LAWS else {"F": _signal(self.law, self.at, self.width, self.impulse)}


def _signal(kind: str, at: float, width: float, impulse: float) -> object:
    if kind == "zero":
        return (at - width, at - width / 2, at + width / 2), (0.0, impulse / width, 0.0), "zero"
    if kind == "linear":
        return (at - width, at, at + width), (0.0, impulse / width, 0.0), "linear"
    if kind == "cubic":
        times, values = at + width * np.arange(-3.0, 4.0) / 2, np.array([0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0])
        area = scipy.interpolate.CubicSpline(times, values).integrate(times[0], times[-1])
        return times, values * impulse / area, "cubic"
    if kind == "Gaussian function":
        size, sharp = impulse / (GAUSSIAN * width), 4 * math.log(2) / width**2
        return lambda t: size * math.exp(-sharp * (t - at) ** 2)
    if kind == "rectangular function":
        return lambda t: impulse / width if abs(t - at) < width / 2 else 0.0
    return lambda t: impulse / width * math.cos(math.pi / 2 * (t - at) / width) ** 2 if abs(t - at) < width else 0.0


# -- mechanisms ----------------------------------------------------------------------------------------------------------------------------


def _slider(spring: float) -> ncgen.Model:
    m = ncgen.Model("oscillator" if spring else "slider")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    x = m.slide("x", O, A, axis)
    m.body("block", [A], mass=MASS)
    m.independent(x)
    m.torque(x, _push(m) - spring * x if spring else _push(m))
    return m


def _pendulum() -> ncgen.Model:
    """A hanging rod, with a couple on it."""
    m = ncgen.Model("pendulum")
    m.gravity((0, -GRAVITY, 0))
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -LENGTH))
    down = m.vector("down", (0, -1, 0), fixed=True)
    rod = m.body("rod", [O, A], mass=MASS, inertia="rod")
    x = m.angle("x", down, A - O, m.vector("z", (0, 0, 1), fixed=True))
    m.independent(x)
    m.couple(rod, _push(m))
    return m


def _push(m: ncgen.Model) -> sympy.Expr:
    total = m.input("F", "N")
    for k, law in enumerate(LAWS.values()):
        at, width, size = (m.parameter(f"{name}_{k}", value) for name, value in (("at", NOT_IN_THE_RUN), ("width", 1.0), ("size", 0.0)))
        total = total + size * law((m.time - at) / width, m)
    return total


INERTIA = MASS * LENGTH**2 / 3
"""Of the rod about its end, kg m²."""

MECHANISMS: dict[str, Callable[[], ncgen.Model]] = {
    "slider": lambda: _slider(0.0),
    "oscillator": lambda: _slider(STIFFNESS),
    "pendulum": _pendulum,
}


@cache
def compiled(mechanism: str) -> ncgen.Kernels:
    return ncgen.compile(MECHANISMS[mechanism]())


def error(pulse: Pulse, x: float, rate: float) -> float:
    """How far the end of a run, x and its rate, is from what a short pulse does, over what the pulse does."""
    after = DURATION - pulse.at
    if pulse.mechanism == "slider":
        gained = pulse.impulse / MASS
        return abs(rate - pulse.speed - gained) / abs(gained)
    if pulse.mechanism == "oscillator":
        w, gained = math.sqrt(STIFFNESS / MASS), pulse.impulse / MASS
        there = np.array([pulse.speed / w * math.sin(w * DURATION), pulse.speed * math.cos(w * DURATION)])
        more = np.array([gained / w * math.sin(w * after), gained * math.cos(w * after)])
        return float(np.hypot(*((np.array([x, rate]) - there - more) * [w, 1.0])) / abs(gained))
    before, gained = _rate_of_the_pendulum(pulse.speed, pulse.at), pulse.impulse / INERTIA
    weight = MASS * GRAVITY * LENGTH / 2
    energy = INERTIA * rate**2 / 2 + weight * (1 - math.cos(x))
    expected = INERTIA * pulse.speed**2 / 2 + INERTIA * gained * (before + gained / 2)
    return abs(energy - expected) / (INERTIA * abs(gained) * (abs(before) + abs(gained) / 2))


def _rate_of_the_pendulum(speed: float, t: float) -> float:
    """At a time (s) after it passed its lowest point with a speed (1/s) that does not carry it over: 2 k w cn(w t, k²)."""
    w = math.sqrt(MASS * GRAVITY * LENGTH / 2 / INERTIA)
    k = speed / (2 * w)
    return 2 * k * w * float(scipy.special.ellipj(w * t, k * k)[1])


def random_pulse(rng: np.random.Generator, mechanism: str, laws: Sequence[str]) -> Pulse:
    """Of a width from 1e-4 of the run on, 1e-2 for functions of Python; every other one on a mechanism at rest."""
    law = laws[rng.integers(len(laws))]
    narrowest, widest = (1e-2, 1.2e-2) if law.endswith("function") else (1e-4, 3e-3)
    width = DURATION * math.exp(rng.uniform(math.log(narrowest), math.log(widest)))
    impulse = (MASS if mechanism != "pendulum" else INERTIA) * rng.uniform(0.5, 2.0) * rng.choice((-1.0, 1.0))
    speed = rng.uniform(0.5, 2.0) if rng.integers(2) else 0.0
    return Pulse(mechanism, law, rng.uniform(3 * width, DURATION - 3 * width), width, impulse, speed)


# -- public functions ----------------------------------------------------------------------------------------------------------------------

End = tuple[float, float]
"""x and its rate at the end of a run."""


def by_simulate(pulses: Sequence[Pulse], rtol: float, **options: object) -> Iterator[End]:
    for pulse in pulses:
        given = {"p": pulse.parameters, "zd0": {"x": pulse.speed}, "inputs": pulse.inputs or None}
        run = ncgen.simulate(compiled(pulse.mechanism), DURATION, points=2, rtol=rtol, **given, **options)
        yield run["x"][-1], run["rate(x)"][-1]


def by_python(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    yield from by_simulate(pulses, rtol, engine="python")


def _columns(pulses: Sequence[Pulse]) -> dict[str, list[float]]:
    rows = [pulse.parameters for pulse in pulses]
    return {name: [row[name] for row in rows] for name in rows[0]}


def by_batch(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    """Laws of the model side by side; an input is that of all states."""
    kernels, inputs = compiled(pulses[0].mechanism), pulses[0].inputs
    if inputs:
        pulses = pulses[:1]
    batch = ncgen.simulate(
        kernels, DURATION, points=2, rtol=rtol, p=_columns(pulses), zd0={"x": [pulse.speed for pulse in pulses]}, inputs=inputs or None
    )
    assert batch.ok.all()
    x = kernels.index["x"]
    yield from zip(batch.q[:, -1, x].tolist(), batch.qd[:, -1, x].tolist(), strict=True)


def by_study(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    vary = _columns(pulses) | {"start(rate(x))": [pulse.speed for pulse in pulses]}
    found = ncgen.study(compiled(pulses[0].mechanism), vary, design="list", keep=["x", "rate(x)"], duration=DURATION, rtol=rtol)
    assert found["ok"].all()
    yield from zip(found["x"].tolist(), found["rate(x)"].tolist(), strict=True)


def by_stepper(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    for k, pulse in enumerate(pulses):
        sim = ncgen.start(compiled(pulse.mechanism), p=pulse.parameters, zd0={"x": pulse.speed}, rtol=rtol)
        steps = (1, 7, 50, 400)[k % 4]
        for _ in range(steps):
            sim.step(DURATION / steps)
        yield sim["x"], sim["rate(x)"]


def by_gradient(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    """The motion that is differentiated; its derivatives have to be there, too. What rests takes equal steps: where a push moves it
    steps with error control are repeated until their stages are settled, and such steps have no derivatives."""
    for pulse in pulses:
        kernels, ends = compiled(pulse.mechanism), []

        def end(q, qd, kernels=kernels, ends=ends):
            ends.extend((q[-1, kernels.index["x"]], qd[-1, kernels.index["x"]]))
            by_q = np.zeros_like(q)
            by_q[-1, kernels.index["x"]] = 1.0
            return ends[0], by_q, None

        given = {"p": pulse.parameters, "zd0": {"x": pulse.speed}, "inputs": pulse.inputs or None}
        steps, tolerance = (1, {"rtol": rtol}) if pulse.speed else (100, {})
        found = ncgen.gradient(kernels, DURATION, steps, end, integrator="dop853", **tolerance, **given)
        assert all(map(math.isfinite, found.derivatives.values()))
        yield ends[0], ends[1]


@cache
def exported(mechanism: str) -> Exported:
    return Exported(MECHANISMS[mechanism](), compiled(mechanism))


def by_export(pulses: Sequence[Pulse], rtol: float) -> Iterator[End]:
    """In one part, in many, and by steps of fixed length: the length of a wide pulse, and ten times that of the narrowest."""
    for k, pulse in enumerate(pulses):
        parts, motion = (1, 7, 50, 1000)[k % 4], exported(pulse.mechanism)
        begun = ncgen.start(motion.kernels, p=pulse.parameters, zd0={"x": pulse.speed})
        motion.begin(begun.q, begun.qd, begun.p)
        for part in range(1, parts + 1):
            if parts == 1000:
                motion.step(DURATION / parts)
            else:
                motion.advance(DURATION * part / parts, rtol)
        x = motion.kernels.index["x"]
        yield motion.q[x], motion.qd[x]


@dataclass(frozen=True)
class Door:
    """A public function: its fraction of all pulses, how many it is given at once, the mechanisms and laws that it takes."""

    run: Callable[[Sequence[Pulse], float], Iterator[End]]
    fraction: float
    together: int = 1
    mechanisms: tuple[str, ...] = tuple(MECHANISMS)
    laws: tuple[str, ...] = (*LAWS, *SIGNALS)


DOORS = {
    "simulate": Door(by_simulate, 0.4),
    "engine='python'": Door(by_python, 0.01),
    "simulate rows": Door(by_batch, 0.25, 100, laws=tuple(LAWS)),
    "simulate rows with an input": Door(by_batch, 0.03, 1, laws=SIGNALS),
    "study": Door(by_study, 0.2, 100, laws=tuple(LAWS)),
    "start": Door(by_stepper, 0.05, 12, laws=tuple(LAWS)),
    "exported C": Door(by_export, 0.05, 12, laws=tuple(LAWS)),
    "gradient": Door(by_gradient, 0.01, mechanisms=("pendulum",)),
}


def hunt(count: int, seed: int) -> tuple[Counter, list[str]]:
    """Pulses of all kinds through all public functions: how many of each, and those that were missed; prints how far it has come."""
    rng = np.random.default_rng(seed)
    counts, findings = Counter(missed=0), []
    for name, door in DOORS.items():
        left = round(count * door.fraction)
        while left > 0:
            mechanism = door.mechanisms[rng.integers(len(door.mechanisms))]
            pulses = [random_pulse(rng, mechanism, door.laws) for _ in range(min(left, door.together))]
            rtol = (FEW, SOME, MOST)[rng.integers(3)]
            left -= len(pulses)
            for pulse, (x, rate) in zip(pulses, door.run(pulses, rtol), strict=True):
                kind = f"{pulse.law} ({'model' if pulse.law in LAWS else 'input'})"
                counts.update([name, kind, mechanism, "at rest" if pulse.speed == 0.0 else "in motion"])
                if not (off := error(pulse, x, rate)) < SEEN + STEPS_ADD_UP * rtol:
                    counts["missed"] += 1
                    findings.append(f"{name}, rtol {rtol:g}: {pulse} ends at {x!r}, {rate!r}: off by {off:.3g} of what it does")
        print(f"{name}: {counts[name]} pulses, {counts['missed']} missed so far", flush=True)
    return counts, findings
