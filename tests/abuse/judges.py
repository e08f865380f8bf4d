"""What judges a random model: each judge from something that took no part in making what it judges.

Rows are evaluated from the catalogue's formulas and the user's own expressions, derivatives by differences in long double,
energies from the velocities of bodies, forces from potentials and from what the user wrote, C by NumPy, a run by the equations
of motion at its instants and by its energy, one method by another.
"""

from __future__ import annotations

import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import sympy
from random_models import IN_C, LONGEST_MESSAGE, Finding, Maker, check_message

import ncgen
from ncgen.emit.sources import Sources
from ncgen.errors import NcgenError
from ncgen.exchange.toml_writer import to_toml
from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, partners
from ncgen.model.catalogue import ROW_TYPES
from ncgen.model.elements import Combination, Component, Length, Point
from ncgen.model.forces import Couple, Spring
from ncgen.model.values import Parameter, is_number

LONG = np.longdouble
EPS = np.finfo(float).eps

ENOUGH = 0.7
"""Seconds of processor time after which a run that listens is told to end: long, but no hang."""

DURATION = 0.05
STEPS = 16

FREE_OF_DRIFT = 1e-4
"""Energy drift of a run with error control, at tolerances of 1e-8, that is worth a warning."""

AGREE = 1e-5
"""Two methods at tolerances of 1e-8 end nearer than this, relative to sizes and to what moves."""


@dataclass
class Report:
    """What became of one seed: findings as (judge, text), counts of what was done, and what was refused with what words."""

    seed: int
    kind: str = "?"
    findings: list[tuple[str, str]] = field(default_factory=list)
    counts: Counter = field(default_factory=Counter)
    refusals: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0
    model: object = None

    def __str__(self):
        lines = [f"seed {self.seed} ({self.kind}): {dict(self.counts)}"]
        return "\n".join(lines + [f"  {judge}: {text}" for judge, text in self.findings])


def examine(seed: int, watch=lambda what: None, make=Maker, judge=None) -> Report:
    """Make the model of a seed and let all judges look at it; `watch` is told of every call before it is made.

    make, judge: a maker and a subject of another kind
    """
    start = process_time()
    report = Report(seed)
    try:
        watch("building")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            maker = make(seed)
        report.kind, report.model = maker.kind, maker.model
        report.counts["calls refused"] += sum(maker.refused.values())
        subject = (judge or Subject)(maker, report, watch)
        subject.judge_warnings("building", caught)
        subject.judged()
    except Finding as found:
        report.findings.append(("building", str(found)))
    except Exception as error:
        report.findings.append(("judging", _where(error)))
    report.seconds = process_time() - start
    return report


def warm() -> None:
    """Compile what all models in C share: the runtime."""
    from ncgen.mechanism import runtime_library
    from ncgen.toolchain.compilers import find_compiler

    if find_compiler() is not None:
        runtime_library.prepare(ncgen.compile(ncgen.load("fourbar"), "c"))


def _where(error: BaseException) -> str:
    """An exception in one line, with the place in ncgen or here where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "ncgen" in f.filename or "abuse" in f.filename] or frames
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]} [{Path(own[-1].filename).name}:{own[-1].lineno}]"


class TooLong(Exception):
    """A run that listens was told to end."""


def _listener():
    start = process_time()

    def progress(_):
        if process_time() - start > ENOUGH:
            raise TooLong

    return progress


class Subject:
    """One model under examination."""

    def __init__(self, maker: Maker, report: Report, watch):
        self.maker, self.model, self.report, self.watch = maker, maker.model, report, watch
        self.rng = np.random.default_rng([maker.seed, 1])
        self.in_c = maker.seed % IN_C == 0
        self.refusal: str | None = None
        self.warned: list[str] = []

    # -- calls ---------------------------------------------------------------------------------

    def find(self, judge: str, text: str) -> None:
        self.report.findings.append((judge, " ".join(str(text).split())[:600]))

    def count(self, what: str) -> None:
        self.report.counts[what] += 1

    def attempt(self, what: str, function, /, *args, **kwargs):
        """The result of a call of ncgen; None where it refuses. Anything else that comes out of it is a finding."""
        self.watch(what)
        self.refusal, self.warned = None, []
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                return function(*args, **kwargs)
            except NcgenError as error:
                self.refusal = str(error)
                self.count(f"{what.split(':')[0]} refused")
                self.report.refusals.append((what, str(error)))
                try:
                    check_message(error)
                except Finding as found:
                    self.find(what, found)
            except TooLong:
                self.refusal = "too long"
                self.count(f"{what.split(':')[0]} told to end")
            except Exception as error:
                self.refusal = "failed"
                self.find(what, _where(error))
            finally:
                self.judge_warnings(what, caught)
        return None

    def judge_warnings(self, what: str, caught) -> None:
        for warning in caught:
            text = str(warning.message)
            self.warned.append(text)
            foreign = any(name in warning.filename for name in ("site-packages", "dist-packages"))
            if warning.category is not UserWarning and not warning.category.__module__.startswith("ncgen") or foreign:
                self.find(what, f"warning {warning.category.__name__}: {text} [{Path(warning.filename).name}:{warning.lineno}]")
            elif "\n" in text or len(text) > LONGEST_MESSAGE:
                self.find(what, f"warning of {len(text)} characters: {text}")
        if self.warned:
            self.count("warnings")

    def judged(self) -> None:
        """All judges, one after the other; without sources there is nothing to judge."""
        self.count("models")
        sources = self.attempt("generate", ncgen.generate, self.model)
        self.files(sources)
        if sources is None:
            return
        self.sources: Sources = sources
        self.kernels = self.attempt("numpy", ncgen.compile, sources, "numpy")
        if self.kernels is None:
            return
        with np.errstate(all="ignore"):
            self.prepare()
            for judge in (self.rows, self.row_derivatives, self.mass, self.loads):
                self.watch(judge.__name__)
                judge()
            self.used = self.kernels
            if self.in_c:
                self.used = self.attempt("compile", ncgen.compile, sources, "c") or self.kernels
                self.agreement()
        self.motion()

    # -- files ---------------------------------------------------------------------------------

    def files(self, sources) -> None:
        """TOML read back gives the same TOML and the same code."""
        text = self.attempt("to_toml", to_toml, self.model)
        if text is None:
            return
        with TemporaryDirectory() as folder:
            path = Path(folder) / "model.toml"
            path.write_text(text, encoding="utf-8")
            again = self.attempt("load", ncgen.load, path)
        if again is None:
            self.find("load", f"what was written is refused: {self.refusal}")
            return
        if (second := self.attempt("to_toml", to_toml, again)) != text:
            lines = [(a, b) for a, b in zip(text.splitlines(), (second or "").splitlines()) if a != b]
            self.find("load", f"the TOML written again differs: {lines[:1]}")
        if sources is None or not (self.in_c or self.rng.random() < 0.15):
            return
        other = self.attempt("generate", ncgen.generate, again)
        if other is None or other.c != sources.c:
            self.find("load", "the model read back gives other C")

    # -- numbers -------------------------------------------------------------------------------

    def prepare(self) -> None:
        """A random state beside the initial one, and random parameters beside their defaults."""
        k, rng = self.kernels, self.rng
        fixed_at = {w.name for weights in self.model.branches.values() for w in weights}
        free = [name not in fixed_at for name in k.parameters]
        self.p = np.where(free, k.p0 * (1 + 0.05 * rng.uniform(-1, 1, len(k.p0))), k.p0)
        far = {c.name for e in self.model.elements.values() if isinstance(e, (Point, Length)) for c in e.components}
        self.sizes = np.array([self.maker.size if name in far else 1.0 for name in k.coordinates])
        self.q = k.q0 + 0.1 * self.sizes * rng.standard_normal(k.n)
        self.qd = self.sizes * rng.standard_normal(k.n)
        self.t = float(rng.uniform(0, 1))

    def number(self, value):
        """The number of a value at the random parameters."""
        return LONG(float(self._value(value)))

    def _value(self, value) -> float:
        p = dict(zip(self.kernels.parameters, self.p.tolist(), strict=True))
        if isinstance(value, Parameter):
            return p[value.name]
        if is_number(value):
            return float(value)
        return float(value.subs({s: p[s.name] for s in value.free_symbols}))

    def places(self, q) -> dict[Component, object]:
        """{coordinate: number or batch}, fixed ones included."""
        return {c: q[..., self.kernels.index[c.name]] if not c.fixed else self.number(c.value) for c in self.model.components}

    def written(self, expression, q, qd, t, extra: dict | None = None):
        """An expression of the user's, evaluated by sympy's own NumPy code; the batch shape of q."""
        expression = sympy.sympify(expression)
        index, p = self.kernels.index, dict(zip(self.kernels.parameters, self.p.tolist(), strict=True))
        numbers = {}
        for c in self.model.components:
            free = not c.fixed
            numbers[c.name] = q[..., index[c.name]] if free else self.number(c.value)
            numbers[f"rate({c.name})"] = qd[..., index[c.name]] if free else LONG(0)
        numbers |= {name: LONG(x) for name, x in p.items()} | {"t": t} | (extra or {})
        used = sorted(expression.free_symbols, key=lambda s: s.name)
        plain = [sympy.Symbol(f"z{i}", real=True) for i in range(len(used))]
        function = sympy.lambdify(plain, expression.xreplace(dict(zip(used, plain))), "numpy")
        return np.broadcast_to(np.asarray(function(*(numbers[s.name] for s in used)), dtype=LONG), q.shape[:-1])

    def combined(self, combination: Combination, places) -> tuple:
        return tuple(
            sum(
                LONG(float(self._value(w))) * places[e.components[k]]
                if e in self.known
                else LONG(float(self._value(w))) * LONG(e.initial[k])
                for w, e in combination.terms
            )
            for k in range(3)
        )

    @cached_property
    def known(self) -> set:
        return set(self.model.elements.values())

    # -- rows ----------------------------------------------------------------------------------

    def row_value(self, i: int, q, qd, t):
        """Row i from its formula or its expression."""
        row = self.model.rows[i]
        if row.type is None:
            return self.written(row.expression, q, qd, t)
        form = ROW_TYPES[self.kernels.programs.equations.rows[i].template.key]
        places = self.places(q)
        arguments = {name: self.combined(row.arguments[name], places) for name in form.vectors}
        arguments |= {name: places[row.arguments[name]] for name in form.scalars}
        data = {name: self.number(value) for name, value in row.data.items()}
        value = form.formula(np, **arguments, **{name: data[name] for name in form.data})
        if row.scaled:
            value = value * LONG(form.scale_factor) / np.prod([data[name] for name in form.scale_data], initial=LONG(1))
        return np.broadcast_to(value, q.shape[:-1])

    def rows(self) -> None:
        """Φ of position rows, and B q̇ − ν of velocity rows, are what they were told to be."""
        k = self.kernels
        if not k.m:
            return
        q, qd = self.q.astype(LONG), self.qd.astype(LONG)
        states = np.concatenate([q[None], q + LONG(1e-3) * self.sizes * self.rng.standard_normal((3, k.n))])
        rates = np.broadcast_to(qd, states.shape)
        phi = self.phi(states, self.t)
        slip = self.speed(states, rates, self.t)
        for i, row in enumerate(self.model.rows):
            told = self.row_value(i, states, rates, LONG(self.t))
            made = phi[:, i] if row.level == "position" else slip[:, i]
            size = np.max(np.abs(told - told.mean())) * 1e3 + np.max(np.abs(told))
            if np.all(np.isfinite(told)) and not np.all(np.abs(told - made) <= 1e-12 * size + self.doubt(i)):
                self.find("rows", f"row {i + 1} ({row.label}) is {made[0]:.17g}, told to be {told[0]:.17g}")

    def phi(self, q, t):
        """Φ of a batch (B, n)."""
        return np.broadcast_to(self.kernels.phi(q, t, self.p), (len(q), self.kernels.m))

    def speed(self, q, qd, t):
        """Φ_q q̇ − ν of a batch (B, n)."""
        k = self.kernels
        jacobian = np.broadcast_to(k.jacobian(q, t, self.p), (len(q), k.m, k.n))
        return np.einsum("bij,bj->bi", jacobian, qd) - k.nu(q, t, self.p)

    def momentum(self, q, qd, t):
        """M q̇ of a batch (B, n)."""
        k = self.kernels
        return np.einsum("bij,bj->bi", np.broadcast_to(k.mass_matrix(q, t, self.p), (len(q), k.n, k.n)), qd)

    def energies(self, q, qd, t):
        """T, V and power of a batch (B, n)."""
        return np.broadcast_to(self.kernels.energy(q, np.broadcast_to(qd, q.shape), t, self.p), (len(q), 3))

    def doubt(self, i: int) -> float:
        """The rounding of constants in a row: of an expression what its plain numbers may cancel."""
        row = self.model.rows[i]
        if row.type is None:
            plain = [abs(float(x)) for x in sympy.sympify(row.expression).atoms(sympy.Number) if x.is_finite]
            return 1e-13 * max(plain, default=1.0)
        return 1e-13

    # -- derivatives ---------------------------------------------------------------------------

    @staticmethod
    def _slope(values, h):
        """From values at −2, −1, −½, ½, 1, 2 times h: the derivative, and how far two estimates are apart or rounding takes them."""
        wide = (8 * (values[4] - values[1]) - (values[5] - values[0])) / (12 * h)
        near = (8 * (values[3] - values[2]) - (values[4] - values[1])) / (6 * h)
        return near, np.abs(near - wide) + 4 * np.finfo(LONG).eps * np.max(np.abs(values), axis=0) / h

    OFFSETS = np.array([-2, -1, -0.5, 0.5, 1, 2], dtype=LONG)
    STEP = LONG(2e-4)

    def gradient(self, f, q):
        """∂f/∂q (n, …) in units of sizes, with doubts; f takes batches of q."""
        n = len(q)
        moved = q + self.OFFSETS[:, None, None] * self.STEP * np.eye(n, dtype=LONG) * self.sizes
        values = f(moved.reshape(-1, n))
        slope, doubt = self._slope(values.reshape(6, n, *values.shape[1:]), self.STEP)
        lost = 4 * np.finfo(LONG).eps * np.abs(q) / (self.STEP * self.sizes)  # of the steps themselves, where q is large beside them
        return slope, doubt + np.abs(slope) * lost.reshape(n, *(1,) * (slope.ndim - 1))

    def along(self, f, q, qd, with_time: bool = True):
        """d/dε f(q + ε q̇, t + ε), with doubts."""
        h = self.STEP * LONG(min(1.0, float(1 / max(np.max(np.abs(qd / self.sizes), initial=0.0), 1e-30))))
        steps = self.OFFSETS * h
        return self._slope(f(q + steps[:, None] * qd, LONG(self.t) + steps * with_time), h)

    def compare(self, judge: str, what, made, found, doubt, size) -> None:
        """Numbers of ncgen beside those found by differences; `what` names an entry by its index."""
        made, found, doubt = (np.atleast_1d(a) for a in (made, found, doubt))
        size = np.broadcast_to(size, made.shape)
        known = np.isfinite(found) & (doubt <= 1e-6 * (size + np.abs(found))) & np.isfinite(size)
        self.report.counts["numbers judged"] += int(known.sum())
        self.report.counts["numbers in doubt"] += int((~known).sum())
        wrong = known & ~(np.abs(made - found) <= 20 * doubt + 1e-9 * size)
        if np.any(wrong):
            i = np.unravel_index(np.argmax(wrong), wrong.shape)
            self.find(
                judge, f"{what(*i)} is {made[i]:.12g}, by differences {found[i]:.12g} ± {doubt[i]:.1g}; {wrong.sum()} of {wrong.size} wrong"
            )

    def row_derivatives(self) -> None:
        """Φ_q, ν and γ by differences of what they are derivatives of."""
        k, p = self.kernels, self.p
        if not k.m or not k.n:
            return
        q, qd, t = self.q.astype(LONG), self.qd.astype(LONG), LONG(self.t)
        jacobian = k.jacobian(q, t, p)
        position = k.holonomic
        slope, doubt = self.gradient(lambda x: self.phi(x, t), q)
        doubt = doubt + np.array([np.finfo(LONG).eps * self.doubt(i) / 1e-13 / self.STEP for i in range(k.m)])
        scaled = (jacobian * self.sizes)[position]
        phi = np.abs(k.phi(q, t, p))[position, None]
        size = np.max(np.abs(slope.T[position]), axis=1, keepdims=True, initial=0.0) + 1e-4 * phi
        names = [self.model.rows[i].label for i in position]
        self.compare("phi_q", lambda i, j: f"∂({names[i]})/∂{k.coordinates[j]}", scaled, slope.T[position], doubt.T[position], size)
        rest = np.zeros_like(qd)
        rate, doubt = self.along(self.phi, q, rest)
        self.compare(
            "nu",
            lambda i: f"ν of {names[i]}",
            k.nu(q, t, p)[position],
            -rate[position],
            doubt[position],
            np.abs(rate[position]) + phi[:, 0],
        )

        change, doubt = self.along(lambda x, s: self.speed(x, np.broadcast_to(qd, x.shape), s), q, qd)
        size = np.abs(change) + np.max(np.abs(jacobian * qd), axis=1) + np.abs(k.nu(q, t, p))
        self.compare("gamma", lambda i: f"γ of {self.model.rows[i].label}", k.gamma(q, qd, t, p), -change, doubt, size)
        together = k.constraints(q, qd, t, p)
        parts = (k.phi(q, t, p), k.phi_q(q, t, p).data, k.gamma(q, qd, t, p))
        for name, one, alone in zip(("phi", "phi_q", "gamma"), (together[0], together[1].data, together[2]), parts, strict=True):
            rounding = 1e-12 * np.max(np.abs(alone), initial=0.0) + max(map(self.doubt, range(k.m)))
            if not np.allclose(one, alone, rtol=1e-10, atol=rounding, equal_nan=True):
                self.find("constraints", f"{name} is not what the kernel of its own gives")

    # -- inertia -------------------------------------------------------------------------------

    @cached_property
    def motions(self) -> np.ndarray:
        """Velocities that the rows allow at the initial position, columns, in units of sizes; empty where rows are no numbers."""
        k = self.kernels
        jacobian = k.jacobian(k.q0, 0.0, k.p0) * self.sizes
        norms = np.linalg.norm(jacobian, axis=1, keepdims=True)
        if not np.all(np.isfinite(jacobian)):
            return np.zeros((k.n, 0))
        _, values, right = np.linalg.svd(jacobian / np.where(norms > 0, norms, 1.0))
        return right[int(np.sum(values > 1e-9)) :].T

    def mass(self) -> None:
        """M is symmetric and positive, and ½ q̇ᵀMq̇ is what the bodies' own velocities give."""
        k, p = self.kernels, self.p
        mass = k.mass_matrix(self.q, self.t, p)
        if not np.all(np.isfinite(mass)):
            self.find("mass", "M has entries that are no numbers")
            return
        if not np.array_equal(mass, mass.T):
            self.find("mass", f"M is not symmetric, by {np.max(np.abs(mass - mass.T)):.3g}")
        diagonal = np.sqrt(np.maximum(np.diag(mass), 0.0))
        unit = mass / np.where(diagonal > 0, diagonal, 1.0) / np.where(diagonal > 0, diagonal, 1.0)[:, None]
        if np.linalg.eigvalsh(unit)[0] < -1e-9 if k.n else False:
            self.find("mass", f"M is not positive semidefinite: {np.linalg.eigvalsh(unit)[0]:.3g} of its diagonal")
        kinetic = k.energy(self.q, self.qd, self.t, p)[0]
        if not np.isclose(
            kinetic, self.qd @ mass @ self.qd / 2, rtol=1e-9, atol=1e-12 * np.sum(np.abs(mass) * np.abs(np.outer(self.qd, self.qd)))
        ):
            self.find("mass", f"T is {kinetic:.12g}, ½ q̇ᵀMq̇ is {self.qd @ mass @ self.qd / 2:.12g}")
        self.rigid_energy()

    def rigid_energy(self) -> None:
        """Kinetic energy, and power of gravity and couples, in a motion that the rows allow at the start."""
        k, model = self.kernels, self.model
        if not self.motions.shape[1]:
            return
        qd = self.sizes * (self.motions @ self.rng.standard_normal(self.motions.shape[1]))
        kept, self.p = self.p, k.p0
        kinetic = weight = couples = heights = 0.0
        sizes = [0.0, 0.0]
        gravity = np.array([float(self.number(g)) for g in model.gravity_field])
        for body in model.bodies.values():
            found = self.rigid_motion(body, qd)
            loaded = [f for f in model.forces if isinstance(f, Couple) and f.body is body]
            if found is None and (body.inertia or loaded):
                self.count("bodies that are not rigid")
                self.p = kept
                return
            if body.inertia:
                m, com = float(self.number(body.inertia.mass)), np.asarray(body.inertia.com)
                v, omega, origin = found
                vg = v + np.cross(omega, com - origin)
                kinetic += m * vg @ vg / 2 + omega @ body.inertia.tensor @ omega / 2
                weight += m * gravity @ vg
                heights -= m * gravity @ com
                sizes[0] += m * np.linalg.norm(gravity) * (np.linalg.norm(v) + np.linalg.norm(omega) * np.linalg.norm(com - origin))
                sizes[1] += m * np.abs(gravity) @ np.abs(com)
            for load in loaded:
                torque = np.array([float(self.number(x)) for x in load.components])
                couples += torque @ found[1]
                sizes[0] += np.abs(torque) @ np.abs(found[1])
        made = k.energy(k.q0, qd, 0.0, k.p0)
        if not np.isclose(made[0], kinetic, rtol=1e-6, atol=1e-300):
            self.find("mass", f"T is {made[0]:.12g} J, of the bodies' own velocities {kinetic:.12g}")
        q, speed = k.q0.astype(LONG), qd.astype(LONG)
        if not np.isfinite(self.potential(q[None], LONG(0))[0]):
            self.report.counts["numbers in doubt"] += 1  # the user's own potential is no number here
            self.p = kept
            return
        height = k.energy(q, 0 * q, LONG(0), k.p0)[1] - self.potential(q[None], LONG(0))[0]
        slope, doubt = self._slope_of_height(q, speed)
        if not np.isfinite(slope):
            self.report.counts["numbers in doubt"] += 1  # nor a short way from here
            self.p = kept
            return
        rounding = 1e-9 * abs(self.potential(q[None], LONG(0))[0]) + 2 * self.potential_doubt(q[None])[0]
        if not abs(height - heights) <= 1e-9 * sizes[1] + rounding:
            self.find("gravity", f"V of gravity is {float(height):.12g} J, of the centres {heights:.12g}")
        if not abs(slope + weight) <= 1e-6 * sizes[0] + 20 * doubt:
            self.find("gravity", f"gravity takes {-float(slope):.12g} W, of the centres {weight:.12g}")
        applied = self.applied(q[None], speed[None] * 0, LONG(0))[0]
        self.p = kept
        power = float(k.force(q, 0 * q, LONG(0), k.p0) @ speed + self.height_rate - applied @ speed)
        allowed = 1e-6 * sizes[0] + 1e-9 * abs(applied) @ abs(speed) + 20 * doubt
        if any(isinstance(f, Couple) for f in model.forces) and not abs(power - couples) <= allowed:
            self.find("couple", f"couples give {power:.12g} W, of the bodies' angular velocities {couples:.12g}")

    def _slope_of_height(self, q, speed):
        h = self.STEP * LONG(1 / max(np.max(np.abs(speed / self.sizes)), 1e-30))
        steps = self.OFFSETS * h
        states = q + steps[:, None] * speed
        whole = self.energies(states, 0 * states, LONG(0))[:, 1]
        slope, _ = self._slope(whole, h)
        self.height_rate = slope
        slope, doubt = self._slope(whole - self.potential(states, LONG(0)), h)
        unsure = self._slope(self.potential_doubt(states), h)[0]
        return slope, doubt + abs(unsure) + np.max(self.potential_doubt(states)) / h

    def rigid_motion(self, body, qd):
        """(velocity of the first point, angular velocity, that point) of a body whose elements move so; None if they do not."""
        if not body.points:
            return None
        index = self.kernels.index

        def rate(element):
            return np.array([qd[index[c.name]] if c.name in index else 0.0 for c in element.components])

        origin, start = body.points[0].initial, rate(body.points[0])
        arms = [(p.initial - origin, rate(p) - start) for p in body.points[1:]] + [(v.initial, rate(v)) for v in body.vectors]
        if not arms:
            return start, np.zeros(3), origin
        scales = [max(np.linalg.norm(r), 1e-300) for r, _ in arms]
        A = np.concatenate([_skew(-r / s) for (r, _), s in zip(arms, scales)])
        b = np.concatenate([v / s for (_, v), s in zip(arms, scales)])
        omega = np.linalg.lstsq(A, b, rcond=1e-9)[0]
        if np.max(np.abs(A @ omega - b)) > 1e-7 * np.max(np.abs(b), initial=0.0):
            return None
        return start, omega, origin

    # -- loads ---------------------------------------------------------------------------------

    def potential(self, q, t):
        """Potential energy of springs and of the user's potentials, (batch,)."""
        places, total = self.places(q), np.zeros(q.shape[:-1], dtype=LONG)
        for spring in self.model.springs:
            if spring.law is None:
                x, *_ = self.stretch(spring, places, places)
                total = total + self.number(spring.stiffness) * (x - self.number(spring.free)) ** 2 / 2
        for potential in self.model.potentials:
            total = total + self.written(potential.expression, q, 0 * q, t)
        return total

    def potential_doubt(self, q):
        """What the rounding of numbers given as doubles may change in `potential`, (batch,): a stretch is a difference of lengths."""
        places, total = self.places(q), np.zeros(q.shape[:-1], dtype=LONG)
        for spring in self.model.springs:
            if spring.law is None:
                x, free = self.stretch(spring, places, places)[0], self.number(spring.free)
                lost = 1e-15 * (max(np.max(np.abs(place)) for place in places.values()) + np.abs(x) + np.abs(free))
                total = total + np.abs(self.number(spring.stiffness)) * (np.abs(x - free) + lost) * lost
        for potential in self.model.potentials:
            here, beside = (self.written(potential.expression, x, 0 * q, LONG(0)) for x in (q, q * (1 + LONG(1e-15))))
            total = total + np.abs(beside - here)
        return total

    def stretch(self, spring, places, rates):
        """(length, rate, [(coordinate, ∂length/∂coordinate)]) of a spring."""
        if not isinstance(spring, Spring):
            c = spring.coordinate.components[0]
            return places[c], rates[c], [(c, LONG(1))]
        a, v = self.combined(spring.segment, places), self.combined(spring.segment, rates)
        length = np.sqrt(sum(x * x for x in a))
        slopes = [(e.components[k], LONG(float(w)) * a[k] / length) for w, e in spring.segment.terms for k in range(3)]
        return length, sum(x * y for x, y in zip(a, v)) / length, slopes

    def applied(self, q, qd, t):
        """Forces without a potential, as the user wrote them, (batch, n); couples on bodies are left out."""
        k, total = self.kernels, np.zeros(q.shape, dtype=LONG)
        places = self.places(q)
        rates = {c: qd[..., k.index[c.name]] if not c.fixed else LONG(0) for c in self.model.components}
        for force in self.model.forces:
            for c, written in () if isinstance(force, Couple) else force.components:
                if not c.fixed:
                    total[..., k.index[c.name]] += self.written(written, q, qd, t)
        for spring in self.model.springs:
            x, v, slopes = self.stretch(spring, places, rates)
            tension = self.number(spring.damping) * v if spring.law is None else self.written(spring.law, q, qd, t, {"x": x, "v": v})
            for c, slope in slopes:
                if not c.fixed:
                    total[..., k.index[c.name]] -= tension * slope
        return total

    def loads(self) -> None:
        """Q from the potential's gradient, the user's forces and the change of M; power as the energies say."""
        k, p, t = self.kernels, self.p, LONG(self.t)
        if not k.n:
            return
        q, qd = self.q.astype(LONG), self.qd.astype(LONG)
        slope, doubt = self.gradient(lambda x: self.energies(x, 0 * qd, t)[:, 1], q)
        applied = self.applied(q[None], qd[None], t)[0]
        kinetic, doubt_of_kinetic = self.gradient(lambda x: self.energies(x, qd, t)[:, 0], q)
        carried, doubt_of_carried = self.along(lambda x, s: self.momentum(x, np.broadcast_to(qd, x.shape), s), q, qd)
        expected = (applied - carried) * self.sizes - slope + kinetic
        doubts = doubt + doubt_of_kinetic + doubt_of_carried * self.sizes
        sizes = np.abs(slope) + np.abs(kinetic) + (np.abs(applied) + np.abs(carried)) * self.sizes
        force = k.force(q, qd, t, p) * self.sizes
        if not any(isinstance(f, Couple) for f in self.model.forces):
            size = sizes + 1e-4 * np.max(sizes)
            self.compare("force", lambda i: f"Q of {k.coordinates[i]} (times its size)", force, expected, doubts, size)
        change, doubt = self.along(lambda x, s: self.energies(x, qd, s)[:, :2], q, qd)
        inertial = np.einsum("i,i", qd, carried) - change[0]  # q̇ᵀ d(Mq̇) − dT along the straight motion: ½ q̇ᵀ Ṁ q̇
        power = k.energy(q, qd, t, p)[2]
        told = force / self.sizes @ qd + inertial + change[1]
        size = np.abs(force / self.sizes) @ np.abs(qd) + np.abs(change).sum()
        self.compare(
            "power",
            lambda i: "the power of forces without a potential",
            power,
            told,
            doubt.sum() + np.abs(doubt_of_carried) @ np.abs(qd),
            size,
        )

    # -- C -------------------------------------------------------------------------------------

    def agreement(self) -> None:
        """C and NumPy differ by what roundings of that size change NumPy's own results."""
        if self.used is self.kernels:
            return
        k, p = self.kernels, self.p
        states = self.q * (1 + 4 * EPS * self.rng.uniform(-1, 1, (7, k.n)))
        for name, program in k.programs.programs.items():
            self.watch(f"agreement:{name}")
            takes = [states] + [np.broadcast_to(self.qd, states.shape)] * ("qd" in program.inputs)
            exact = k.values(name, LONG(self.t), states.astype(LONG), takes[-1].astype(LONG) if len(takes) > 1 else None, p.astype(LONG))
            plain = k.values(name, self.t, states, takes[-1] if len(takes) > 1 else None, p)
            try:
                compiled = np.array([self.used.values(name, self.t, x, self.qd if len(takes) > 1 else None, p) for x in states])
            except NcgenError:
                self.count("kernels refused in C")
                continue
            noise = np.max(np.abs(plain - exact), axis=0) + np.max(np.abs(exact - exact[:1]), axis=0)
            bound = 50 * noise + 64 * EPS * np.max(np.abs(plain), axis=0)
            same = (np.abs(compiled - plain) <= bound) | (np.isnan(compiled) & np.isnan(plain)) | (compiled == plain)
            self.report.counts["numbers of C judged"] += same.size
            if not np.all(same) and not np.all(same | (np.abs(compiled - plain) <= 64 * EPS * self.added_up(name))):
                i = np.unravel_index(np.argmin(same), same.shape)
                self.find(
                    "agreement",
                    f"{name}[{i[1]}] is {compiled[i]:.17g} in C, {plain[i]:.17g} in NumPy, {float(exact[i]):.17g} in long double",
                )

    def added_up(self, name: str) -> np.ndarray:
        """The size of what is added up in each number of a kernel."""
        from ncgen.comparisons.rivals import Inputs, scale

        return np.nan_to_num(np.asarray(scale(self.kernels, name, Inputs(self.q, self.qd, self.p, self.t)), dtype=float), nan=0.0)

    # -- motion --------------------------------------------------------------------------------

    def motion(self) -> None:
        """Freedom, runs and what builds on them."""
        k, rng = self.used, self.rng
        with np.errstate(all="ignore"):
            usable = bool(np.all(np.isfinite(self.kernels.phi(k.q0))) and np.all(np.isfinite(self.kernels.jacobian(k.q0))))
        found = self.attempt("freedom", ncgen.freedom, k)
        if found is not None and usable:
            self.judge_freedom(found)
        drawn = rng.random()
        extras = (self.linearised, self.balanced, self.inspected, self.differentiated, self.assembled, self.batched)
        run = self.run()
        if run is not None:
            self.count("moved" if np.ptp(run.q, axis=0).max(initial=0.0) > 0 else "stood still")
            if drawn < 0.35:
                self.other_method(run)
            if rng.random() < 0.15:
                self.reactions(run)
        if rng.random() < 0.4:
            extras[int(rng.integers(len(extras)))]()

    def judge_freedom(self, found) -> None:
        """The rank at the start by singular values of our own, where it is clear."""
        k = self.kernels
        jacobian = k.jacobian(k.q0) * self.sizes
        norms = np.linalg.norm(jacobian, axis=1, keepdims=True)
        values = np.linalg.svd(jacobian / np.where(norms > 0, norms, 1.0), compute_uv=False)
        clear = not np.any((values > 1e-13) & (values < 1e-5))
        if clear and np.all((norms == 0) | (norms > 1e-5)) and int(np.sum(values >= 1e-5)) != found.rank_here:
            self.find("freedom", f"rank at the start is {found.rank_here}, by singular values {int(np.sum(values >= 1e-5))}")
        if found.dof != k.n - found.rank or len(found.kept_rows) != found.rank:
            self.find("freedom", f"{k.n} coordinates, rank {found.rank}, {found.dof} degrees of freedom, {len(found.kept_rows)} rows kept")

    def start(self) -> dict:
        """Initial velocities that the rows allow, as they are given by hand; none for a part of the models."""
        k = self.kernels
        if not self.motions.shape[1] or self.rng.random() < 0.3 or np.any(k.nu(k.q0)):
            return {}
        return {"qd0": self.sizes * (self.motions @ (0.5 * self.rng.standard_normal(self.motions.shape[1])))}

    def run(self):
        """The default call."""
        with np.errstate(all="ignore"):
            self.given = self.start()
        run = self.attempt("simulate", ncgen.simulate, self.used, DURATION, points=9, progress=_listener(), **self.given)
        self.said = list(self.warned)
        if run is not None:
            self.judge_run("simulate", run)
        return run

    def judge_run(self, what: str, run, loose: bool = False, fixed: bool = False) -> None:
        """Finite, closed, in balance at every instant, and with its energy."""
        self.watch(what)
        if not (np.all(np.isfinite(run.q)) and np.all(np.isfinite(run.qd)) and np.all(np.isfinite(run.work))):
            self.find(what, "the run has numbers that are none")
            return
        if len(run.t) != 9 or not np.isclose(run.t[-1], DURATION, rtol=1e-12):
            self.find(what, f"{len(run.t)} instants to {run.t[-1]:g} s where 9 to {DURATION:g} s were asked for")
        violation = self.attempt(f"{what}: violation", run.violation)
        if violation is not None and not loose and not np.max(violation, initial=0.0) <= 1e-8:
            self.find(what, f"the constraints are open by {np.max(violation):.2g}")
        energy = self.attempt(f"{what}: energy", lambda: run.energy_drift)
        if energy is not None and not (loose or fixed) and not self.said and not energy <= FREE_OF_DRIFT and self.energy_matters(run):
            self.find(what, f"the energy drifts by {energy:.2g} of what moves, without a warning")
        if loose:
            return
        qdd, lam = self.attempt(f"{what}: qdd", lambda: run.qdd), self.attempt(f"{what}: lam", lambda: run.lam)
        if qdd is None or lam is None:
            return
        if not (np.all(np.isfinite(qdd)) and np.all(np.isfinite(lam))):
            self.find(what, "accelerations or multipliers are no numbers")
            return
        with np.errstate(all="ignore"):
            self.balance(what, run, qdd, lam)

    def energy_matters(self, run) -> bool:
        """False at rest: where nothing but rounding moves, a share of it says nothing."""
        energies = run.energy()
        moved = max(np.max(energies[:, 0]), np.ptp(energies[:, 1]), np.max(np.abs(run.work)))
        total = energies[:, 0] + energies[:, 1] - run.work
        return bool(np.max(np.abs(total - total[0])) > 1e-9 * (np.max(np.abs(energies[:, 1])) + moved) and moved > 0)

    def p_at(self, run, t: float) -> np.ndarray:
        """The parameters of a run at a time (s)."""
        return run.p

    def balance(self, what: str, run, qdd, lam) -> None:
        """M q̈ + Φ_qᵀ λ = Q, Φ_q q̈ = γ and Φ_q q̇ = ν at every instant."""
        k = self.kernels
        for t, q, qd, a, l in zip(run.t, run.q, run.qd, qdd, lam, strict=True):
            p = self.p_at(run, t)
            mass, jacobian, force = k.mass_matrix(q, t, p), k.jacobian(q, t, p), k.force(q, qd, t, p)
            if k.model.branches:
                from ncgen.solver.positions.branches import refresh_branches

                jacobian = k.jacobian(q, t, refresh_branches(k, q, p))
            rest = (mass @ a + jacobian.T @ l - force) * self.sizes
            jump = np.abs(k.force(q, qd * (1 + 1e-9) + 1e-12 * self.sizes, t, p) - force) * self.sizes  # of a law with sign(v)
            size = (np.abs(mass) @ np.abs(a) + np.abs(jacobian.T) @ np.abs(l) + np.abs(force)) * self.sizes
            # Of accelerations of a size a second squared; multipliers that are iterated end there at their tolerance, not at rounding.
            rounding = (1e-9 if "augmented" in what else 1e-12) * np.max(np.abs(mass) @ self.sizes * self.sizes, initial=0.0)
            if not np.all(np.abs(rest) <= (1e-4 if "augmented" in what else 1e-6) * np.max(size, initial=0.0) + rounding + jump):
                i = int(np.argmax(np.abs(rest)))
                self.find(
                    what, f"at t = {t:.3g} s forces on {k.coordinates[i]} are not in balance by {np.max(np.abs(rest)) / np.max(size):.2g}"
                )
                return
            if k.model.branches:
                continue
            if any(name in what for name in ("generalized-alpha", "energy-momentum")):
                continue  # which keep the rows themselves alone
            moving = (jacobian * qd).sum(axis=1)
            after = t + 1e-12 * (t == run.t[0])  # where a driver's velocity jumps at the start, that behind it counts
            speed = min((moving - k.nu(q, each, p) for each in (t, after)), key=lambda speed: np.max(np.abs(speed), initial=0.0))
            size = np.abs(jacobian) @ np.abs(qd) + np.abs(k.nu(q, t, p))
            contradicted = any("no velocities satisfy" in said for said in self.said)
            # Where the gradient of a row vanishes, as that of a sine at a right angle does, rounding of its natural size is left.
            rounding = 1e-12 * k.row_sizes * (1.0 + np.max(np.abs(qd) / self.sizes, initial=0.0))
            allowed = 1e-6 * size + np.maximum(1e-9 * np.abs(jacobian) @ self.sizes, rounding)
            if not contradicted and not np.all(np.abs(speed) <= allowed):
                worst = int(np.argmax(np.abs(speed) / allowed))
                self.find(what, f"at t = {t:.3g} s velocities break row {self.model.rows[worst].label} by {abs(speed[worst]):.2g}")
                return
            if contradicted or any("the position is singular" in said for said in self.said):
                continue  # where accelerations need not exist, and ncgen has said so
            gamma = k.gamma(q, qd, t, p)
            gap, size = jacobian @ a - gamma, np.abs(jacobian) @ np.abs(a) + np.abs(gamma)
            if not np.all(np.abs(gap) <= 1e-6 * np.max(size, initial=0.0) + 1e-12 * np.max(np.abs(jacobian) @ self.sizes, initial=0.0)):
                self.find(what, f"at t = {t:.3g} s accelerations break row {self.model.rows[int(np.argmax(np.abs(gap)))].label}")
                return

    def other_method(self, first) -> None:
        """The same motion by a method drawn at random; in another engine at times."""
        rng = self.rng
        formalism = list(FORMALISMS)[int(rng.integers(len(FORMALISMS)))]
        names = [n for n in partners(FORMALISMS[formalism]) if not n.startswith("cvode")]
        integrator = names[int(rng.integers(len(names)))]
        what = f"simulate: {formalism} with {integrator}"
        options = {}
        if self.used is not self.kernels and rng.random() < 0.5:
            options["engine"] = "python"
            what += " in Python"
        method = self.attempt(what, Method.of, formalism, integrator)
        if method is None:
            return
        fixed = method.has_fixed_step
        options |= {"max_step": DURATION / STEPS} if fixed else {}
        second = self.attempt(
            what,
            ncgen.simulate,
            self.used,
            DURATION,
            formalism=formalism,
            integrator=integrator,
            points=9,
            progress=_listener(),
            **self.given,
            **options,
        )
        self.said = [*self.said, *self.warned]
        if second is None:
            return
        self.count("runs by another method")
        loose = formalism == "penalty"
        self.judge_run(what, second, loose, fixed)
        if loose or fixed or self.said or not np.all(np.isfinite(second.q)):
            return
        moved = np.max(np.ptp(first.q / self.sizes, axis=0), initial=0.0)
        apart = np.max(np.abs(first.q - second.q) / self.sizes, initial=0.0)
        if not apart <= AGREE * (1 + moved):
            self.find(what, f"ends elsewhere than the default call, by {apart:.2g} of the size, {moved:.2g} being what moves")

    def reactions(self, run) -> None:
        loads = self.attempt("reactions", run.reactions)
        if loads is not None and not all(np.all(np.isfinite(x)) for each in loads.loads.values() for x in each.values()):
            self.find("reactions", "loads that are no numbers")

    def linearised(self) -> None:
        found = self.attempt("linearise", ncgen.linearise, self.used)
        if found is not None and not np.all(np.isfinite(found.matrix)):
            self.find("linearise", "the matrix has entries that are no numbers")
        elif found is not None:
            self.attempt("linearise", lambda: (found.eigenvalues, found.frequencies, found.damping_ratios, found.stable))
            self.count("linearised")

    def balanced(self) -> None:
        found = self.attempt("equilibrium", ncgen.equilibrium, self.used)
        if found is not None and not np.all(np.isfinite(found.q)):
            self.find("equilibrium", "a position that is no number")
        self.report.counts["equilibria"] += found is not None

    def inspected(self) -> None:
        if self.attempt("inspect", ncgen.inspect, self.used) is not None:
            self.count("inspected")

    def differentiated(self) -> None:
        found = self.attempt("sensitivities", ncgen.sensitivities, self.used, DURATION / 5, 3)
        if found is not None and not (np.all(np.isfinite(found.q_by)) and np.all(np.isfinite(found.qd_by))):
            self.find("sensitivities", "derivatives that are no numbers")
        self.report.counts["sensitivities"] += found is not None

    def assembled(self) -> None:
        k = self.used
        guess = k.q0 + 0.02 * self.sizes * self.rng.standard_normal(k.n)
        found = self.attempt("assemble", ncgen.assemble, k, guess)
        if found is not None:
            with np.errstate(all="ignore"):
                open_by = np.max(np.abs(self.kernels.phi(found)) / k.row_sizes, initial=0.0)
            if not open_by <= 1e-9:
                self.find("assemble", f"open by {open_by:.2g}")
            self.count("assembled")

    def batched(self) -> None:
        k = self.used
        with np.errstate(all="ignore"):
            motions = self.motions
        if not motions.shape[1]:
            return
        q0 = np.tile(k.q0, (3, 1))
        found = self.attempt("simulate rows", ncgen.simulate, k, DURATION / 5, q0=q0, points=3)
        if found is not None:
            self.count("batches")


def _skew(r) -> np.ndarray:
    """The matrix of r × ."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
