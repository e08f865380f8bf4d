"""Random mechanisms, told to the public builder, and what ncgen makes of them held against judges of its own.

    python tests/abuse/random_models.py SEED [COUNT]     the model of a seed as TOML, and everything that is wrong with it

A seed decides everything: one always gives the same model and the same calls. Most models hold together and can move; the rest
is what people try: nothing but ground, single points, rows said twice, parts that do not touch, numbers of 1e-9 and 1e9, odd
names. A call that ncgen refuses with an error of its own is left out and the model goes on, as a user would.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np
from random_expressions import expression

import ncgen
from ncgen.errors import NcgenError
from ncgen.model.elements import Angle, Length

IN_C = 10
"""Every tenth model is compiled."""

LONGEST_MESSAGE = 300

PLAIN = ("A{}", "B{}", "P{}", "r{}", "u{}", "arm{}", "psi{}", "k{}")
ODD = (
    "q", "qd", "p", "t_", "x", "v", "i", "I", "E", "S", "N", "O", "pi", "e", "rate", "sin", "gamma", "beta", "lambda_", "double", "int",
    "return",
    "static", "R", "np", "out", "phi", "mass", "force", "M_PI", "NCGEN_SIN", "ncgen", "inf", "nan", "end_", "main", "errno", "Q", "a.b",
    "a.b.c", "r2.d2", "x.rate", "Ω", "ä", "größe", "ж1", "关节", "é", "a_b", "a__b", "A" * 90, "name", "point", "ground", "aux", "self",
    "Symbol", "sqrt",
)  # fmt: skip

FORMS = ("smooth", "smooth", "paper", "sine", "cosine")

FLAT_JOINTS = ("spherical", "spherical", "spherical", "prismatic", "rigid", "point_on_line", "distance", "distance", None)
JOINTS = (
    "spherical", "revolute", "revolute", "universal", "cylindrical", "prismatic", "planar", "screw", "rigid", "point_on_line",
    "point_in_plane", "distance", None,
)  # fmt: skip


FLAT_SHAPES = ((1, 0), (2, 0), (2, 0), (2, 0), (2, 1), (3, 0), (3, 1), (4, 0), (4, 2))
SHAPES = ((1, 0), (1, 2), (1, 3), (2, 0), (2, 0), (2, 1), (2, 1), (2, 2), (2, 2), (3, 0), (3, 1), (3, 3), (4, 0), (4, 2), (6, 0))
"""Points and vectors of a body: 1 to 6 elements."""


class Finding(Exception):
    """Something wrong with ncgen, in one line."""


def check_message(error: Exception) -> None:
    """Raise Finding where a refusal is not one line of at most 300 characters."""
    text = str(error)
    if not text or "\n" in text:
        raise Finding(f"the message is not one line: {text!r}") from error
    if len(text) > LONGEST_MESSAGE:
        raise Finding(f"a message of {len(text)} characters: {text}") from error


class Maker:
    """One random model while it is made: `model`, of a `kind`, and the calls that were `refused`."""

    kinds: tuple = ()
    """(name, function that makes it) of each kind; `KINDS` where there are none."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng([20070904, seed])
        self.seed = seed
        self.refused: Counter[str] = Counter()
        self.flat = self.chance(0.4)
        self.size = self.scale(0.12)
        self.weight = self.scale(0.12)
        self.odd_names = self.chance(0.15)
        self.used: set[str] = set()
        self.relatives: list = []
        self.bodies: list = []
        self.kind, make = self.pick(self.kinds or KINDS)
        self.options = {"scale": self.chance(0.85), "form": self.pick(FORMS)}
        self.model = self.begin(self.name("model") if self.odd_names else f"random{seed}")
        make(self)

    def begin(self, name: str) -> ncgen.Model:
        """An empty model; under a plain name where the odd one is refused."""
        try:
            return ncgen.Model(name, **self.options)
        except NcgenError as error:
            check_message(error)
            self.refused["Model"] += 1
            return ncgen.Model(f"random{self.seed}", **self.options)

    # -- drawing -------------------------------------------------------------------------------

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def pick(self, things):
        return things[int(self.rng.integers(len(things)))]

    def some(self, low: int, high: int) -> int:
        """A whole number from low to high."""
        return int(self.rng.integers(low, high + 1))

    def scale(self, odd: float) -> float:
        """1 as a rule; with the share `odd` a power of ten from 1e-9 to 1e9."""
        return 10.0 ** self.some(-9, 9) if self.chance(odd) else 1.0

    def number(self, odd: float = 0.02) -> float:
        """A positive number of the order of 1, round or not, rarely an extreme one."""
        plain = float(self.pick((0.5, 1.0, 2.0, 0.1))) if self.chance(0.3) else float(self.rng.uniform(0.2, 3.0))
        return plain * self.scale(odd)

    def name(self, what: str) -> str:
        """A new name; of the odd ones where the model has these."""
        if self.odd_names and self.chance(0.5):
            made = self.pick(ODD)
        else:
            made = self.pick(PLAIN).format(self.some(1, 99))
        while made in self.used:
            made += str(self.some(0, 9))
        self.used.add(made)
        return made

    def place(self) -> np.ndarray:
        """A random position (m)."""
        r = self.size * self.rng.uniform(-1.5, 1.5, 3)
        return np.round(r, 2) if self.size == 1.0 and self.chance(0.3) else r

    def direction(self) -> np.ndarray:
        """A random unit vector, along an axis at times; in the plane for flat models."""
        if self.chance(0.4):
            return np.eye(3)[self.some(0, 1 if self.flat else 2)] * self.pick((1.0, -1.0))
        d = self.rng.standard_normal(3) * (1.0, 1.0, 0.0 if self.flat else 1.0)
        return d / np.linalg.norm(d)

    # -- telling -------------------------------------------------------------------------------

    def tell(self, method: str, *args, **kwargs):
        """Call the builder; None where it refuses."""
        try:
            return getattr(self.model, method)(*args, **kwargs)
        except NcgenError as error:
            check_message(error)
            self.refused[method] += 1
            return None
        except Exception as error:
            raise Finding(f"{method}: {type(error).__name__}: {' '.join(str(error).split())[:300]}") from error

    def value(self, number: float, share: float = 0.2):
        """A number as it is, as a parameter, or as an expression of parameters that has this value."""
        number = float(number)
        if not self.chance(share):
            return number
        if self.parameters() and self.chance(0.3):
            old = self.pick(self.parameters())
            if old.default:
                return old * (number / old.default)
        made = self.tell("parameter", self.name("parameter"), number, self.pick(("", "N/m", "kg")))
        return number if made is None else made

    def parameters(self) -> list:
        """Those that were declared, without the weights of the paper's rows, which change by themselves."""
        weights = {w.name for each in self.model.branches.values() for w in each}
        return [p for p in self.model.parameters.values() if p.name not in weights]

    def leaves(self, rates: bool = False, time: bool = True) -> list:
        """Symbols for an expression, of the order of 1."""
        model = self.model
        scales = {c: self.size for e in model.elements.values() if not isinstance(e, Angle) for c in e.components}
        scales |= {
            c: 1.0
            for e in model.elements.values()
            if len(e.components) == 3 and np.isclose(np.linalg.norm(e.initial), 1)
            for c in e.components
        }
        free = [c for c in model.components if not c.fixed]
        chosen = [self.pick(free) for _ in range(min(3, len(free)))]
        made = [c.symbol / scales.get(c, 1.0) if scales.get(c, 1.0) != 1.0 else c.symbol for c in chosen]
        if rates:
            made += [c.rate / scales.get(c, 1.0) if scales.get(c, 1.0) != 1.0 else c.rate for c in chosen]
        if time:
            made.append(model.time)
        of_order_one = [p for p in self.parameters() if 0.01 < abs(p.default) < 100]
        if of_order_one and self.chance(0.4):
            made.append(self.pick(of_order_one).symbol)
        return made

    def expression(self, depth: int = 3, **of):
        return expression(self.rng, self.leaves(**of), depth)

    def at_start(self, written) -> float:
        """What an expression is in the initial position, at rest at t = 0; nan where it is no number."""
        model = self.model
        numbers = {c.symbol: c.initial for c in model.components} | {p.symbol: p.default for p in model.parameters.values()}
        numbers |= {c.rate: 0.0 for c in model.components} | {model.time: 0.0}
        found = written.subs(numbers).evalf()
        return float(found) if found.is_real else np.nan

    # -- points, vectors, bodies ---------------------------------------------------------------

    def point(self, position=None, fixed=False):
        position = self.place() if position is None else position
        if self.flat:
            position = position[:2]
        made = [float(x) for x in position]
        if fixed is True:
            made = [self.value(x, 0.1) for x in made]
        return self.tell("point", self.name("point"), made, fixed=fixed)

    def vector(self, direction=None, fixed=False):
        d = self.direction() if direction is None else direction
        d = d / np.linalg.norm(d)
        if self.flat and abs(d[2]) < 1e-12:
            return self.tell("vector", self.name("vector"), [float(x) for x in d[:2]], fixed=fixed)
        return self.tell("vector", self.name("vector"), [float(x) for x in d], fixed=fixed)

    def body(self):
        """A body of 1 to 6 elements with inertia of a cloud of points."""
        count, more = self.pick(FLAT_SHAPES if self.flat else SHAPES)
        points = [e for e in (self.point() for _ in range(count)) if e is not None]
        vectors = [e for e in (self.vector() for _ in range(more)) if e is not None]
        name = self.name("body")
        options = self.inertia(points, points + vectors) if self.chance(0.97) else {}
        body = self.tell("body", name, points, vectors, **options)
        if body is None and options:
            body = self.tell("body", name + "_", points, [], mass=self.weight, inertia="point")
        if body is not None:
            self.bodies.append(body)
        return body

    def inertia(self, points, elements) -> dict:
        """Mass, centre and tensor of random mass points; on the line or at the point where a body has no more."""
        places = np.array([p.initial for p in points]).reshape(-1, 3)
        if not len(places):
            return {}
        m = self.weight * self.rng.uniform(0.2, 2.0, 6)
        if len(elements) == 1:
            cloud = np.tile(places[0], (6, 1))
        elif len(elements) == 2 and len(points) == 2 and not self.flat:
            cloud = places[0] + self.rng.uniform(-0.5, 1.5, (6, 1)) * (places[1] - places[0])
        else:
            cloud = places.mean(axis=0) + self.size * self.rng.normal(size=(6, 3)) * (0.5, 0.5, 0.0 if self.flat else 0.5)
        mass = m.sum()
        com = m @ cloud / mass
        d = cloud - com
        tensor = np.einsum("k,k,ij->ij", m, np.einsum("ki,ki->k", d, d), np.eye(3)) - np.einsum("k,ki,kj->ij", m, d, d)
        tensor = (tensor + tensor.T) / 2
        told = {"mass": self.value(mass), "com": com.tolist(), "inertia": tensor.tolist()}
        if self.flat and self.chance(0.6):
            told |= {"com": com[:2].tolist(), "inertia": float(tensor[2, 2])}
        elif self.flat or self.chance(0.1):
            told |= {"inertia": np.diag(tensor).tolist()} if self.chance(0.3) else {}
        if len(elements) == 1:
            told["inertia"] = "point"
        if self.chance(0.08):
            del told["com"]
        if self.chance(0.15):
            told["constant_mass"] = True
        if self.chance(0.1) and len(elements) > 2:
            told["basis"] = [points[0]] + [e for e in elements if e is not points[0] and self.chance(0.8)]
        return told

    # -- joints --------------------------------------------------------------------------------

    def join(self, a, b) -> None:
        """One joint between two bodies, at a random place; None: they do not touch."""
        kind = self.pick(FLAT_JOINTS if self.flat else JOINTS)
        if kind is None:
            return
        if kind == "rigid":
            self.tell("rigid", a, b)
        elif kind == "distance":
            start, end = self.on(a), self.on(b)
            if start is not None and end is not None:
                self.tell(
                    "distance", start, end, *([] if self.chance(0.8) else [self.value(np.linalg.norm(start.initial - end.initial), 0.7)])
                )
        else:
            getattr(self, f"_{kind}")(a, b)

    def on(self, body):
        """A point of a body: one that it has, or a new one."""
        if body.points and self.chance(0.6):
            return self.pick(body.points)
        place = self.place()
        name = self.name("point")
        return self.tell("attach_point", body, name, [float(x) for x in (place[:2] if self.flat else place)])

    def direction_of(self, body):
        """A unit vector of a body: one that it has, or a new one."""
        if body.vectors and self.chance(0.5):
            return self.pick(body.vectors)
        if self.flat:
            made = self.vector(fixed=body is self.model.ground)
            if made is not None:
                self.tell("extend", body, made)
            return made
        return self.tell("attach_vector", body, self.name("vector"), self.direction().tolist())

    def _spherical(self, a, b):
        if (point := self.on(a)) is not None:
            self.tell("spherical", a, b, point)

    def _revolute(self, a, b):
        point, axis = self.on(a), self.direction_of(a)
        if point is None or axis is None:
            return
        if self.tell("revolute", a, b, point, axis) is not None or axis in b.vectors:
            self.turn(a, b, axis)

    def turn(self, a, b, axis) -> None:
        """An angle between two bodies about an axis they share."""
        if not self.chance(0.5):
            return
        first, second = self.segment(a, axis), self.segment(b, axis)
        if first is not None and second is not None:
            self.angle(first, second, self.pick((1.0, -1.0)) * axis if self.chance(0.5) else axis)

    def segment(self, body, axis=None):
        """A direction of a body, as a vector, a reversed one, or a segment."""
        points = list(body.points)
        if len(points) >= 2 and self.chance(0.6):
            start, end = (points[i] for i in self.rng.permutation(len(points))[:2])
            return end - start
        vectors = [v for v in body.vectors if v is not axis]
        if vectors:
            found = self.pick(vectors)
            return -found if self.chance(0.3) else found
        return None

    def angle(self, start, end, axis) -> None:
        options = {} if self.chance(0.6) else {"form": self.pick(FORMS)}
        if self.chance(0.1):
            options["initial"] = float(self.rng.integers(-2, 3) * 2 * np.pi + self.measured(start, end, axis))
        made = self.tell("angle", self.name("angle"), start, end, axis, **options)
        if made is not None:
            self.relatives.append(made)

    @staticmethod
    def measured(start, end, axis) -> float:
        a, b, n = (d.initial for d in (start, end, axis))
        n = n / np.linalg.norm(n)
        return float(np.arctan2(np.cross(a, b) @ n, a @ b - (a @ n) * (b @ n)))

    def _universal(self, a, b):
        point, u, v = self.on(a), self.direction_of(a), self.direction_of(b)
        if None not in (point, u, v):
            self.tell("universal", a, b, point, u, v)

    def _sliding(self, a, b):
        """Two points on a line along an axis of a, one of each body."""
        start, axis = self.on(a), self.direction_of(a)
        if start is None or axis is None:
            return None
        far = start.initial + axis.initial * self.size * float(self.rng.uniform(0.2, 1.0))
        fixed = b is self.model.ground
        end = self.point(far, fixed=fixed) if self.chance(0.9) else self.on(b)
        return None if end is None else (start, end, axis)

    def _cylindrical(self, a, b):
        if found := self._sliding(a, b):
            self.tell("cylindrical", a, b, *found)
            self.slide(*found)

    def _prismatic(self, a, b):
        if found := self._sliding(a, b):
            self.tell("prismatic", a, b, *found)
            self.slide(*found)

    def slide(self, start, end, axis) -> None:
        if self.chance(0.5):
            made = self.tell("slide", self.name("slide"), start, end, axis)
            if made is not None:
                self.relatives.append(made)

    def _screw(self, a, b):
        if found := self._sliding(a, b):
            made = self.tell("screw", a, b, *found, self.value(self.size * self.number()), self.name("screw"))
            self.relatives += made or ()

    def _planar(self, a, b):
        start, normal, end = self.on(a), self.direction_of(a), self.on(b)
        if None not in (start, normal, end):
            self.tell("planar", a, b, start, end, normal)

    def _point_on_line(self, a, b):
        if found := self._sliding(a, b):
            start, end, axis = found
            self.tell("extend", b, end)
            self.tell("point_on_line", a, end, start, axis)

    def _point_in_plane(self, a, b):
        point, start, normal = self.on(b), self.on(a), self.direction_of(a)
        if None not in (point, start, normal):
            self.tell("point_in_plane", a, point, start, normal)

    # -- coordinates between, gears, drivers ---------------------------------------------------

    def points(self) -> list:
        return [e for e in self.model.elements.values() if type(e).__name__ == "Point"]

    def vectors(self) -> list:
        return [e for e in self.model.elements.values() if type(e).__name__ == "Vector"]

    def two_points(self):
        points = self.points()
        return [points[i] for i in self.rng.permutation(len(points))[:2]] if len(points) >= 2 else None

    def add_length(self):
        if pair := self.two_points():
            made = self.tell("length", self.name("length"), *pair)
            if made is not None:
                self.relatives.append(made)

    def add_angle(self):
        directions = list(self.vectors())
        for _ in range(3):
            if pair := self.two_points():
                directions.append(pair[1] - pair[0])
        if len(directions) >= 3:
            self.angle(*(directions[i] for i in self.rng.permutation(len(directions))[:3]))

    def add_gear(self):
        if len(self.relatives) >= 2:
            first, second = (self.relatives[i] for i in self.rng.permutation(len(self.relatives))[:2])
            kinds = (type(first), type(second))
            if kinds == (Length, Angle):
                self.tell("rack", first, second, self.value(self.number(), 0.3))
            else:
                self.tell("gear", first, second, self.value(self.number(), 0.3), self.pick((1, -1)) * self.number())

    def add_driver(self):
        free = [c for e in self.points() for c in e.components if not c.fixed]
        things = [*self.relatives, *(free and [self.pick(free)])]
        if not things:
            return
        thing = self.pick(things)
        start = thing.initial[0] if hasattr(thing, "components") else thing.initial
        law = expression(self.rng, [self.model.time * self.number(0)], 2)
        size = 0.3 * (1.0 if isinstance(thing, Angle) else self.size)
        offset = self.at_start(law)
        self.tell("drive", thing, float(start) + size * (law - (offset if np.isfinite(offset) else 0.0)))

    def add_row(self):
        """An equation of the user's own that holds at the start."""
        written = self.expression(time=self.chance(0.3))
        start = self.at_start(written)
        self.tell("constrain", written - start if np.isfinite(start) else written, *(["my row"] if self.chance(0.3) else []))

    def add_velocity_row(self):
        free = [c for c in self.model.components if not c.fixed]
        chosen = [self.pick(free) for _ in range(min(2, len(free)))]
        self.tell("constrain_velocity", sum((self.expression(2, time=False) * c.rate for c in chosen), 0.0))

    def add_redundant(self):
        """A row that is there already, once more."""
        if pair := self.two_points():
            for _ in range(2):
                self.tell("distance", *pair)

    def add_paper_row(self):
        """One of the paper's rows between any elements."""
        vectors = [v for v in self.vectors() if not v.fixed]
        pair = self.two_points()
        drawn = self.some(0, 3)
        if drawn == 0 and vectors:
            self.tell("unit", self.pick(vectors))
        elif drawn == 1 and vectors and pair:
            self.tell("vector_segment", self.pick(vectors), pair[1] - pair[0])
        elif drawn == 2 and len(vectors) >= 2:
            self.tell("vector_vector", *vectors[:2])
        elif pair:
            self.tell("distance", *pair)

    # -- loads ---------------------------------------------------------------------------------

    @property
    def pull(self) -> float:
        """A force (N) that moves what is there within a second or so."""
        return self.weight * self.size

    def add_gravity(self):
        g = self.size * self.rng.uniform(-10, 10, 3) if self.chance(0.4) else self.size * np.array((0.0, -9.81, 0.0))
        self.tell("gravity", [self.value(x, 0.1) for x in g])

    def add_force(self):
        if points := self.points():
            vector = [
                self.pull * self.expression(2, rates=True) if self.chance(0.7) else self.value(self.pull * self.number()) for _ in range(3)
            ]
            self.tell("force", self.pick(points), vector, **({"label": "wind, from the “west”"} if self.chance(0.1) else {}))

    def add_torque(self):
        if self.relatives:
            self.tell("torque", self.pick(self.relatives), self.pull * self.size * self.expression(2, rates=True))

    def add_couple(self):
        able = [b for b in self.bodies if len(b.frame.directions) == 3] or self.bodies * self.chance(0.1)
        if able:
            self.tell("couple", self.pick(able), [self.value(self.pull * self.size * self.number()) for _ in range(3)])

    def add_potential(self):
        self.tell("potential", self.pull * self.size * self.expression(2, time=self.chance(0.2)))

    def law(self):
        import sympy

        x, v = sympy.symbols("x v", real=True)
        leaves = [x / self.size if self.size != 1 else x, v / self.size if self.size != 1 else v]
        return self.pull * (x / self.size + expression(self.rng, leaves, 2))

    def add_spring(self):
        if pair := self.two_points():
            if self.chance(0.25):
                self.tell("spring", *pair, law=self.law())
            else:
                k, c = self.weight * 30 * self.number(), self.weight * self.number() * self.chance(0.5)
                free = {} if self.chance(0.5) else {"free_length": self.value(self.size * self.number(0))}
                self.tell("spring", *pair, self.value(k), self.value(c), **free)

    def add_torsion_spring(self):
        if self.relatives:
            thing = self.pick(self.relatives)
            if self.chance(0.25):
                self.tell("torsion_spring", thing, law=self.law())
            else:
                k = self.pull * self.number()
                self.tell(
                    "torsion_spring",
                    thing,
                    self.value(k),
                    self.value(k * self.number() * 0.1),
                    *([] if self.chance(0.5) else [self.number()]),
                )

    # -- drawing, choices ----------------------------------------------------------------------

    def add_independent(self):
        free = [c for c in self.model.components if not c.fixed]
        if free:
            self.tell("independent", *{self.pick([*self.relatives, *free]).name: None for _ in range(self.some(1, 3))})

    def add_line(self):
        if points := self.points():
            self.tell("line", *(self.pick(points) for _ in range(self.some(1, 4))))
            if vectors := self.vectors():
                self.tell("arrow", self.pick(points), self.pick(vectors))

    def add_loads(self) -> None:
        if self.chance(0.85):
            self.add_gravity()
        for share, add in (
            (0.3, self.add_spring), (0.25, self.add_force), (0.2, self.add_torque), (0.2, self.add_torsion_spring), (0.1, self.add_couple),
            (0.12, self.add_potential), (0.1, self.add_line), (0.07, self.add_independent),
        ):  # fmt: skip
            if self.chance(share):
                add()


# -- kinds of models ---------------------------------------------------------------------------------


def linkage(maker: Maker) -> None:
    """Bodies hung on the ground or on each other by joints; loops closed by rods; drivers, gears and rows on top."""
    model = maker.model
    for _ in range(maker.pick((1, 1, 2, 2, 3, 3, 4))):
        parent = maker.pick([model.ground, *maker.bodies])
        body = maker.body()
        if body is not None:
            maker.join(parent, body)
    for share, add in (
        (0.15, maker.add_length), (0.1, maker.add_angle), (0.3, maker.add_gear), (0.12, maker.add_driver), (0.06, maker.add_row),
        (0.05, maker.add_redundant), (0.04, maker.add_velocity_row),
    ):  # fmt: skip
        if maker.chance(share):
            add()
    if len(maker.bodies) >= 2 and maker.chance(0.2):
        maker.join(*(maker.bodies[i] for i in maker.rng.permutation(len(maker.bodies))[:2]))
    maker.add_loads()


def pendulum(maker: Maker) -> None:
    """Point masses on rods, in a row or a net: what moves for certain."""
    before = maker.point(fixed=True)
    for _ in range(maker.some(1, 4)):
        following = maker.point()
        if before is None or following is None:
            continue
        body = maker.tell("body", maker.name("body"), [following], mass=maker.value(maker.weight * maker.number()))
        if body is not None:
            maker.bodies.append(body)
        if maker.chance(0.85):
            maker.tell(
                "distance",
                before,
                following,
                *([maker.value(np.linalg.norm(before.initial - following.initial), 0.8)] if maker.chance(0.3) else []),
            )
        else:
            maker.tell("spring", before, following, maker.value(maker.weight * 100 * maker.number()), maker.weight * maker.number())
        before = maker.pick(maker.points())
    for share, add in ((0.2, maker.add_length), (0.2, maker.add_driver), (0.08, maker.add_row), (0.06, maker.add_velocity_row)):
        if maker.chance(share):
            add()
    maker.add_loads()


def scatter(maker: Maker) -> None:
    """Points and vectors with any components fixed, and rows of every type among them."""
    for _ in range(maker.some(2, 5)):
        maker.point(fixed=maker.pick((False, False, True, "x", "xy", "yz")))
    for _ in range(maker.some(0, 3)):
        maker.vector(fixed=maker.pick((False, False, True, "z")))
    for point in maker.points():
        if not point.fixed and maker.chance(0.8):
            body = maker.tell("body", maker.name("body"), [point], mass=maker.value(maker.weight * maker.number()))
            maker.bodies += [body] * (body is not None)
    adds = (
        maker.add_paper_row,
        maker.add_paper_row,
        maker.add_angle,
        maker.add_length,
        maker.add_row,
        maker.add_velocity_row,
        maker.add_gear,
    )
    for _ in range(maker.some(1, 5)):
        maker.pick(adds)()
    maker.add_loads()


def disc(maker: Maker) -> None:
    """A disc that rolls on a plane, alone or with a load on it."""
    maker.flat = False
    normal = np.eye(3)[maker.some(0, 2)] if maker.chance(0.6) else maker.direction()
    radius = maker.size * maker.number(0)
    frame = np.linalg.qr(np.column_stack([normal, maker.rng.standard_normal((3, 2))]))[0]
    tilt = float(maker.rng.uniform(-0.6, 0.6))
    axle = np.cos(tilt) * frame[:, 1] + np.sin(tilt) * normal
    centre = maker.point(maker.place())
    u = maker.vector(axle)
    across = maker.vector(frame[:, 2])
    if None in (centre, u, across):
        return
    moment = 0.25 * maker.weight * radius**2
    tensor = moment * (np.eye(3) + np.outer(axle, axle))
    third = maker.vector(np.cross(axle, frame[:, 2])) if maker.chance(0.7) else None
    vectors = [u, across] + [third] * (third is not None)
    body = maker.tell(
        "body",
        maker.name("body"),
        [centre],
        vectors,
        mass=maker.value(maker.weight),
        inertia=((tensor + tensor.T) / 2).tolist(),
        constant_mass=True,
    )
    if body is not None:
        maker.bodies.append(body)
        maker.tell("rolling", body, centre, u, across, maker.value(radius, 0.2), normal=normal.tolist())
    maker.add_loads()


def odd(maker: Maker) -> None:
    """Nothing but ground, single points, fixed things, bodies without mass, forces on what cannot move."""
    model = maker.model
    adds = (
        lambda: maker.point(), lambda: maker.point(fixed=True), lambda: maker.vector(), lambda: maker.vector(fixed=True), maker.body,
        maker.add_force, maker.add_row, maker.add_redundant, maker.add_length, maker.add_angle, maker.add_driver, maker.add_velocity_row,
        maker.add_gravity, maker.add_spring, maker.add_potential, maker.add_couple, maker.add_line,
        lambda: maker.value(maker.number(0.3), 1.0),
        lambda: maker.on(model.ground), lambda: maker.direction_of(model.ground),
    )  # fmt: skip
    for _ in range(maker.some(0, 6)):
        maker.pick(adds)()


def tables(maker: Maker) -> None:
    """The paper's tables with random points and rows: a chain of triangles and vectors."""
    count = maker.some(2, 5)
    vectors = maker.some(1, 3)
    places = np.array([maker.size * maker.rng.uniform(-1, 1, 3) for _ in range(count)])
    directions = maker.rng.standard_normal((vectors, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    order = maker.rng.permutation(count + vectors)
    positions = np.empty(count + vectors, dtype=int)
    positions[order] = 1 + 3 * np.arange(count + vectors)
    P = [[*map(float, r), int(positions[i])] for i, r in enumerate(places)]
    U = [[*map(float, u), int(positions[count + i])] for i, u in enumerate(directions)]
    rows, angles = [], 0

    def length(i, j):
        return float(np.linalg.norm(places[i - 1] - places[j - 1]))

    for _ in range(maker.some(1, 6)):
        code = maker.pick((1000, 1000, 1001, 1002, 1003, 1010, 1011, 1012, 1013, 1014, 1015))
        i, j, *_ = 1 + maker.rng.permutation(count)
        r = [int(x) for x in 1 + maker.rng.integers(0, count, 6)]
        k, l, m = (int(x) for x in 1 + maker.rng.integers(0, vectors, 3))
        i, j = int(i), int(j)
        if code == 1000:
            rows.append([code, i, j, *[0] * 8, length(i, j)])
        elif code == 1001:
            rows.append([code, k, *[0] * 10])
        elif code == 1002:
            rows.append([code, k, i, j, *[0] * 6, length(i, j), float(directions[k - 1] @ (places[i - 1] - places[j - 1])) / length(i, j)])
        elif code == 1003:
            rows.append([code, k, l, *[0] * 8, float(directions[k - 1] @ directions[l - 1])])
        else:
            angles += 1
            shapes = {
                1010: [i, j, r[0], r[1], m, 0, 0, 0, length(i, j), length(r[0], r[1]), angles],
                1011: [i, j, r[0], r[1], r[2], r[3], 0, length(i, j), length(r[0], r[1]), length(r[2], r[3]), angles],
                1012: [k, l, maker.pick((m, -m)), *[0] * 7, angles],
                1013: [k, l, i, j, *[0] * 5, length(i, j), angles],
                1014: [k, i, j, l, *[0] * 5, length(i, j), angles],
                1015: [k, i, j, r[0], r[1], 0, 0, 0, length(i, j), length(r[0], r[1]), angles],
            }
            rows.append([code, *shapes[code]])
    inertia = (
        {1: {"m": maker.weight * maker.number(0), "cog": places[0].tolist(), "IT": [[0.0] * 3] * 3, "r": [1]}}
        if maker.chance(0.7)
        else None
    )
    fixed = sorted({int(x) for x in 1 + maker.rng.integers(0, 3 * (count + vectors), maker.some(0, 6))})
    try:
        maker.model = ncgen.Model.from_tables(P, U, rows, inertia=inertia, fixed=fixed, name=maker.model.name, **maker.options)
    except NcgenError as error:
        check_message(error)
        maker.refused["from_tables"] += 1
    maker.relatives += [e for e in maker.model.elements.values() if isinstance(e, Angle)]
    maker.bodies += maker.model.bodies.values()
    maker.add_loads()


KINDS = (
    (("linkage", linkage),) * 9
    + (("pendulum", pendulum),) * 5
    + (("scatter", scatter),) * 2
    + (("disc", disc), ("odd", odd), ("tables", tables), ("tables", tables))
)


def examine(seed: int, watch=lambda what: None):
    """The report of a seed."""
    import judges

    return judges.examine(seed, watch)


def main(arguments: list[str], examine=examine) -> int:
    """Print the models of seeds and what is wrong with them, by a search's own way to examine; returns how many findings there are."""
    from ncgen.exchange.toml_writer import to_toml

    first, count = int(arguments[0]), int(arguments[1]) if len(arguments) > 1 else 1
    found = 0
    for seed in range(first, first + count):
        report = examine(seed)
        if count == 1 and report.model is not None:
            try:
                print(to_toml(report.model))
            except NcgenError as error:
                print(f"# no TOML: {error}")
        print(report)
        found += len(report.findings)
    return found


if __name__ == "__main__":
    sys.exit(1 if main(sys.argv[1:]) else 0)
