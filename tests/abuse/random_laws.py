"""Random mechanisms with laws: tables and splines of time, coordinates and speeds, inputs that tables and functions drive, forces that
jump, drivers with kinks; and what all public functions that move a mechanism make of each, held against each other.

    python tests/abuse/random_laws.py SEED [COUNT]     the model of a seed as TOML, and everything that is wrong with it
"""

from __future__ import annotations

import math
import sys

import judges
import numpy as np
import random_models
import scipy.interpolate
import sympy
from exported_motion import Exported, Failed
from judges import AGREE, DURATION, FREE_OF_DRIFT, Subject
from random_models import Maker, linkage, pendulum

import ncgen
from ncgen.model.elements import Angle

STEPS = 8
"""Steps of the stepper, through all of a run."""

EQUAL_STEPS = 64
"""Steps of equal length, where derivatives of the motion go through these."""

MOST_IN_PYTHON = 5000
"""Evaluations of the default run up to which the run in Python is made, too."""

LESS = ({"rtol": 1e-7}, {"integrator": "dopri5"})
"""Calls that are less accurate than the default one: by their tolerance, or since that is of every step, as of many motions at once."""

LOOSE = 5e-3
"""Of sizes and of what moves, by which a motion in such steps of rk4 may end elsewhere: a table of a coordinate bends inside them."""


class Lawful(Maker):
    """A mechanism with one law at least; `signals`: {input: signal}, `held`: inputs that keep their values."""

    def __init__(self, seed: int):
        self.signals: dict[str, object] = {}
        super().__init__(seed)

    # -- of one argument -----------------------------------------------------------------------

    def knots(self, low: float, high: float) -> list[float]:
        """Increasing, of which the ends may lie inside of low to high or beyond them."""
        found = np.sort(self.rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), self.some(3, 6)))
        return [float(x) for x in found]

    def curve(self, low: float, high: float):
        """A table or a spline from low to high, with values of the order of 1."""
        knots = self.knots(low, high)
        values = [float(x) for x in self.rng.uniform(-1, 1, len(knots))]
        if self.chance(0.25):
            values[-1] = values[0]
            if self.chance(0.5):
                return self.tell("table", self.name("table"), knots, values, periodic=True)
            return self.tell("spline", self.name("spline"), knots, values, "periodic")
        if self.chance(0.5):
            return self.tell("table", self.name("table"), knots, values)
        return self.tell("spline", self.name("spline"), knots, values, self.pick(("natural", "clamped", "not-a-knot")))

    def moment(self, share: float = 0.5):
        """A time in the run (s): a number or a parameter."""
        return self.value(float(self.rng.uniform(0.05, 0.9)) * DURATION, share)

    def continuous(self, narrowest: float = 1e-3):
        """Of time, without a jump, of the order of 1; with a kink in the run or a change in a part of it, `narrowest` at least."""
        t, at = self.model.time, self.moment()
        width = DURATION * 10.0 ** float(self.rng.uniform(math.log10(narrowest), -0.5))
        u = (t - at) / width
        drawn = self.some(0, 6)
        if drawn == 0:
            return sympy.Max(0, t - at) / DURATION
        if drawn == 1:
            return sympy.Min(1, sympy.Max(0, u))
        if drawn == 2:
            return sympy.Abs(t - at) / DURATION
        if drawn == 3:
            return ncgen.smooth_step(t, at, at + width)
        if drawn == 4:
            return sympy.Piecewise(((t - at) / DURATION, t > at), (0.0, True))
        made = self.curve(0.0, DURATION)
        return sympy.Abs(sympy.sin(t * 30 / DURATION + 1)) if made is None else made(t)

    def jumping(self):
        """Of time, with jumps and pulses in the run."""
        t, at = self.model.time, self.moment()
        width = DURATION * 10.0 ** float(self.rng.uniform(-3, -0.5))
        u = (t - at) / width
        height = math.sqrt(DURATION / width)
        return self.pick(
            (
                lambda: sympy.Heaviside(t - at),
                lambda: height * (sympy.Heaviside(u) - sympy.Heaviside(u - 1)),
                lambda: height * sympy.Piecewise((0.0, u < 0), (1.0, u < 1), (0.0, True)),
                lambda: sympy.sign(sympy.sin(t * self.some(5, 60) / DURATION + 1)),
                lambda: height * sympy.exp(-(u**2)),
                lambda: sympy.Piecewise((sympy.sin(t / DURATION), (t > at) & (t < at + width)), (0.0, True)),
            )
        )()

    def of_the_state(self):
        """A table, a spline or a kink over a coordinate or a speed."""
        leaf = self.pick(self.leaves(rates=True, time=False) or [self.model.time])
        low = self.at_start(leaf) if leaf.is_number or leaf.free_symbols else 0.0
        low = low if np.isfinite(low) else 0.0
        made = self.curve(low - 1.0, low + 1.0) if self.chance(0.7) else None
        if made is not None:
            return made(leaf)
        return self.pick((sympy.Max(leaf, low + 0.05), sympy.Abs(leaf - low - 0.05), ncgen.smooth_step(leaf, low - 0.1, low + 0.1)))

    # -- where they stand ----------------------------------------------------------------------

    def an_input(self):
        made = self.tell("input", self.name("input"), self.pick(("", "N")), float(self.rng.uniform(-1, 1)))
        if made is None:
            return None
        if self.chance(0.75):
            self.signals[made.name] = self.signal()
        return made

    def signal(self):
        """A table with one of the three holds, or a function of Python that is a hundredth of the run narrow or wider."""
        if self.chance(0.25):
            at, width = DURATION * self.rng.uniform(0.1, 0.8), DURATION * self.rng.uniform(0.012, 0.3)
            return self.pick(
                (
                    lambda t: math.exp(-(((t - at) / width) ** 2)),
                    lambda t: 1.0 if at < t < at + width else 0.0,
                    lambda t: math.sin(t / width),
                )
            )
        times = np.sort(self.rng.uniform(0.0, DURATION, self.some(4, 8)))
        times[0] = 0.0
        return times, self.rng.uniform(-1, 1, len(times)), self.pick(("linear", "zero", "cubic"))

    def add_lawful_load(self):
        parts = [self.pick((self.continuous, self.jumping, self.of_the_state))]
        if self.chance(0.3):
            parts.append(self.pick((self.continuous, self.of_the_state, self.expression)))
        written = sympy.prod([part() for part in parts])
        if self.chance(0.4) and (driven := self.an_input()) is not None:
            written = driven.symbol * (written if self.chance(0.5) else 1) if self.chance(0.5) else written + driven.symbol
        self.load(written)

    def load(self, written) -> None:
        if self.relatives and self.chance(0.6):
            self.tell("torque", self.pick(self.relatives), self.pull * self.size * written)
        elif points := [p for p in self.points() if not p.fixed]:
            parts = [self.pull * written, self.value(self.pull * self.number()), 0.0]
            self.tell("force", self.pick(points), [parts[k] for k in self.rng.permutation(2)] + parts[2:])

    def add_kinked_driver(self):
        free = [c for e in self.points() for c in e.components if not c.fixed]
        things = [*self.relatives, *self.relatives, *(free and [self.pick(free)])]
        if not things:
            return
        thing = self.pick(things)
        start = thing.initial[0] if hasattr(thing, "components") else thing.initial
        law = self.continuous(0.1)  # faster ones ask more of equal steps than these can give
        offset = self.at_start(law)
        if np.isfinite(offset):
            size = 0.02 * (1.0 if isinstance(thing, Angle) else self.size)
            self.tell("drive", thing, float(start) + size * (law - offset))


def lawful(base):
    def make(maker: Lawful) -> None:
        base(maker)
        if maker.chance(0.45):
            maker.add_kinked_driver()
        for _ in range(maker.some(1, 3)):
            maker.add_lawful_load()

    return make


Lawful.kinds = tuple((f"{base.__name__} with laws", lawful(base)) for base in (linkage,) * 4 + (pendulum,) * 5)


class Driven(Subject):
    """One such model under examination: all runs have the model's signals, and end where others end."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.in_c = True

    def files(self, sources) -> None:
        """The second time of generating C is left to a part of the models."""
        self.in_c = False
        super().files(sources)
        self.in_c = True

    def start(self) -> dict:
        return super().start() | ({"inputs": self.maker.signals} if self.maker.signals else {})

    def energy_matters(self, run) -> bool:
        """False, too, where the energy came and went between instants: more of them see it."""
        if not super().energy_matters(run):
            return False
        closer = self.attempt("simulate", ncgen.simulate, self.used, DURATION, points=401, **self.given)
        return closer is None or closer.energy_drift > FREE_OF_DRIFT

    def p_at(self, run, t: float) -> np.ndarray:
        """Parameters with the inputs of a time, from SciPy's interpolation or the functions themselves."""
        p = np.array(run.p)
        for name, signal in self.maker.signals.items():
            p[self.kernels.parameters.index(name)] = _value(signal, float(t))
        return p

    def motion(self) -> None:
        """As of all models, and then by the other public functions."""
        self.count_laws()
        k = self.used
        found = self.attempt("freedom", ncgen.freedom, k)
        self.run_alone = self.run()
        if found is None or self.run_alone is None:
            return
        run = self.run_alone
        self.count("moved" if np.ptp(run.q, axis=0).max(initial=0.0) > 0 else "stood still")
        if self.said:
            self.count("moved with a warning")
        else:
            for share, function in (
                (0.4, self.by_python), (1.0, self.by_batch), (0.7, self.by_study), (1.0, self.by_stepper), (0.5, self.by_gradient),
                (0.3, self.by_sensitivities), (0.3, self.by_gradients_of_rows), (0.5, self.by_steppers), (0.15, self.by_export),
            ):  # fmt: skip
                if self.rng.random() < share:
                    function(run)
        if self.rng.random() < 0.35:
            self.other_method(run)

    def count_laws(self) -> None:
        model = self.model
        self.report.counts["tables and splines"] += len(model.curves)
        self.report.counts["inputs"] += len(model.inputs)
        self.report.counts["signals"] += len(self.maker.signals)
        self.report.counts["drivers"] += sum(row.owner.kind == "driver" for row in model.rows if row.owner is not None)

    # -- public functions ----------------------------------------------------------------------

    def ends(self, what: str, first, q, qd, agree: float = AGREE) -> None:
        """The end of another call is that of the default call."""
        self.count(what)
        if self.warned:
            return
        for name, one, other in (("position", first.q, np.asarray(q)), ("velocity", first.qd, np.asarray(qd))):
            moved = (
                np.max(np.abs(one / self.sizes), initial=0.0)
                if name == "velocity"
                else np.max(np.ptp(one / self.sizes, axis=0), initial=0.0)
            )
            apart = np.max(np.abs(one[-1] - other) / self.sizes, initial=0.0)
            if not apart <= agree * (1 + moved):
                if self.is_sensitive(agree * (1 + moved) if name == "position" else agree):
                    self.count("sensitive motions")
                    return
                self.find(
                    what, f"the {name} ends elsewhere than by the default call, by {apart:.2g} of the size, {moved:.2g} being what moves"
                )
                return

    def is_sensitive(self, allowed: float) -> bool:
        """True where less accurate calls end elsewhere as well: the motion makes much of little."""
        runs = [self.attempt("simulate", ncgen.simulate, self.used, DURATION, points=3, **self.given, **less) for less in ({}, *LESS)]
        ends = [
            np.concatenate([run.q[-1] / self.sizes, run.qd[-1] / self.sizes / (1 + self.fastest(run))]) for run in runs if run is not None
        ]
        return len(ends) < len(runs) or max(np.max(np.abs(end - ends[0])) for end in ends) > allowed

    def fastest(self, run) -> float:
        """The largest velocity of a run in natural sizes."""
        return float(np.max(np.abs(run.qd / self.sizes), initial=0.0))

    def by_python(self, first) -> None:
        """In Python, where that ends within a minute or so; stiff motions take it an hour."""
        if self.used is self.kernels:
            return
        if first.statistics.evaluations > MOST_IN_PYTHON:
            self.count("engine='python' left out")
            return
        found = self.attempt("engine='python'", ncgen.simulate, self.used, DURATION, points=9, engine="python", **self.given)
        if found is not None:
            self.judge_run("engine='python'", found)
            self.ends("engine='python'", first, found.q[-1], found.qd[-1])

    def by_batch(self, first) -> None:
        given = self.given | {"q0": np.tile(first.q[0], (2, 1))}
        given |= {"qd0": np.tile(first.qd[0], (2, 1))} if "qd0" in given else {}
        found = self.attempt("simulate rows", ncgen.simulate, self.used, DURATION, points=3, **given)
        if found is not None and found.ok.all():
            for k in range(2):
                self.ends("simulate rows", first, found.q[k, -1], found.qd[k, -1])
        elif found is not None:
            self.count("batches that did not go on")

    def by_study(self, first) -> None:
        names = [name for name in self.kernels.parameters if name not in self.maker.signals and name not in self._weights]
        if not names or "qd0" in self.given:
            return
        name = names[int(self.rng.integers(len(names)))]
        value = float(self.kernels.p0[self.kernels.parameters.index(name)])
        keep = [f"{word}{c}{end}" for word, end in (("", ""), ("rate(", ")")) for c in self.kernels.coordinates]
        found = self.attempt(
            "study", ncgen.study, self.used, {name: [value, value]}, design="list", keep=keep, duration=DURATION, **self.given
        )
        if found is not None and all(found["ok"]):
            numbers = np.array([found[word][1] for word in keep])
            self.ends("study", first, numbers[: self.kernels.n], numbers[self.kernels.n :])
        elif found is not None:
            self.count("studies that did not go on")

    @property
    def _weights(self) -> set[str]:
        return {w.name for weights in self.model.branches.values() for w in weights}

    def by_stepper(self, first) -> None:
        """Inputs are held from step to step, so this is a run of its own with such tables."""
        times = np.linspace(0.0, DURATION, STEPS + 1)[:-1]
        held = {name: [_value(signal, t) for t in times.tolist()] for name, signal in self.maker.signals.items()}
        given = {name: value for name, value in self.given.items() if name != "inputs"}
        sim = self.attempt("start", ncgen.start, self.used, **given)
        if sim is None:
            return
        for k in range(STEPS):
            if (
                self.attempt("step", sim.step, DURATION / STEPS, **{n: v[k] for n, v in held.items() if n.isidentifier()}) is None
                and self.refusal
            ):
                return
        if any(not name.isidentifier() for name in held):
            return
        if held:
            tables = {name: (times, np.array(values), "zero") for name, values in held.items()}
            first = self.attempt("simulate", ncgen.simulate, self.used, DURATION, points=9, **given, inputs=tables)
            if first is None or self.warned:
                return
        self.ends("step", first, sim.q, sim.qd)

    def by_gradient(self, first) -> None:
        if not self.kernels.n:
            return
        ends = []

        def objective(q, qd):
            ends[:] = [q[-1].copy(), qd[-1].copy()]
            by_q = np.zeros_like(q)
            by_q[-1, 0] = 1.0
            return float(q[-1, 0]), by_q, None

        for steps, how in ((EQUAL_STEPS, {"integrator": "rk4"}), (1, {"integrator": "dop853", "rtol": 1e-8})):
            found = self.attempt("gradient", ncgen.gradient, self.used, DURATION, steps, objective, **how, **self.given)
            if found is None:
                continue
            if not all(map(math.isfinite, found.derivatives.values())):
                self.find("gradient", f"slopes that are no numbers: {found.derivatives}")
            self.ends(f"gradient by {how['integrator']}", first, *ends, agree=LOOSE if how["integrator"] == "rk4" else AGREE)

    def by_gradients_of_rows(self, first) -> None:
        """Inputs keep their values there."""
        if self.maker.signals or not self.kernels.n:
            return
        ends = []

        def objective(q, qd):
            ends.append((q[-1].copy(), qd[-1].copy()))
            by_q = np.zeros_like(q)
            by_q[-1, 0] = 1.0
            return float(q[-1, 0]), by_q, None

        if "qd0" in self.given:
            return
        given = {"q0": np.tile(first.q[0], (2, 1))}
        found = self.attempt("gradient of rows", ncgen.gradient, self.used, DURATION, EQUAL_STEPS, objective, **given)
        if found is None or not found.ok.all():
            return
        if not np.all(np.isfinite(found.derivatives)):
            self.find("gradient of rows", "slopes that are no numbers")
        for q, qd in ends:
            self.ends("gradient of rows", first, q, qd, agree=LOOSE)

    def by_steppers(self, first) -> None:
        """Many at once, where inputs keep their values."""
        if self.maker.signals:
            return
        sims = self.attempt("start of many", ncgen.start, self.used, 2, **self.given)
        if sims is None:
            return
        for _ in range(STEPS):
            self.attempt("step of many", sims.step, DURATION / STEPS)
            if self.refusal:
                return
        for k in range(2):
            self.ends("start of many", first, sims.q[k], sims.qd[k])

    def by_export(self, first) -> None:
        """In C, in one part and in several, where inputs keep their values."""
        if self.maker.signals or self.model.branches:
            return
        motion = self.attempt("export", Exported, self.model, self.kernels, ("-O0",))
        if motion is None:
            return
        for parts in (1, STEPS):
            try:
                motion.begin(first.q[0], first.qd[0], first.p)
                for part in range(1, parts + 1):
                    motion.advance(DURATION * part / parts, 1e-8)
            except Failed as error:
                self.find("export", error)
                return
            self.warned = []
            self.ends("exported C", first, motion.q, motion.qd)

    def by_sensitivities(self, first) -> None:
        found = self.attempt("sensitivities", ncgen.sensitivities, self.used, DURATION, EQUAL_STEPS, **self.given)
        if found is None:
            return
        if not (np.all(np.isfinite(found.q_by)) and np.all(np.isfinite(found.qd_by))):
            self.find("sensitivities", "derivatives that are no numbers")
        self.ends("sensitivities", first, found.q[-1], found.qd[-1], agree=LOOSE)


def _value(signal, t: float) -> float:
    """Of an input at a time (s); before and after a table its ends hold."""
    if callable(signal):
        return float(signal(t))
    times, values, kind = signal
    t = min(max(t, times[0]), times[-1])
    if kind == "zero":
        return float(values[np.searchsorted(times, t, side="right") - 1])
    if kind == "linear":
        return float(np.interp(t, times, values))
    return float(scipy.interpolate.CubicSpline(times, values)(t))


def examine(seed: int, watch=lambda what: None):
    """As of all models, with the judges of this file."""
    return judges.examine(seed, watch, Lawful, Driven)


if __name__ == "__main__":
    sys.exit(1 if random_models.main(sys.argv[1:], examine) else 0)
