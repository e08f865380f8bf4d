"""A random tree of bodies, closed to loops: every joint there is, and no two seeds the same mechanism.

Dimensions are drawn from the seed: slender boxes of 0.3 to 0.6 m and 0.5 to 1.5 kg, each hanging on the end of an earlier one.
"""

import numpy as np

from ncgen import Model
from ncgen.model.arithmetic import dot, norm, unit
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Vector

FREEDOMS = {"revolute": 1, "prismatic": 1, "screw": 1, "universal": 2, "cylindrical": 2, "spherical": 3, "planar": 3}
"""Of the joints in space."""

FLAT = ("revolute", "revolute", "prismatic")
"""Joints in the plane."""

ROOTS = 0.15
"""The share of bodies that hang on the ground, besides the first one."""

CLEAR = 0.2
"""Sine of the angle by which a body's elements stay away from one line or plane."""

WIDTH, PITCH = 0.06, 0.1
"""Of the boxes (m), and of screws (m per turn)."""


def build(n: int = 9, seed: int = 8, loops: int = 2, flat: bool = False) -> Model:
    """n bodies on joints drawn by a seed, and up to so many loops: two bodies that share one more point, or are held by a rod.

    flat: in the plane, with hinges and sliders
    A loop is left out where the joints around it have too few freedoms.
    """
    m = Model("tree")
    tree = Tree(m, np.random.default_rng([seed, n, loops, flat]), flat)
    for i in range(1, n + 1):
        tree.grow(i)
    for i in range(1, loops + 1):
        tree.close(i)
    m.gravity((0, -9.81, 0) if flat else (0, 0, -9.81))
    m.simulation(duration=0.5)
    return m


class Tree:
    """A tree that grows.

    parent: of every body, None for the ground; left: freedoms of its joint that no loop has taken; end: where others hang on it
    base: where it begins, and the normal of what its first elements span in space
    """

    def __init__(self, m: Model, rng: np.random.Generator, flat: bool) -> None:
        self.m, self.rng, self.flat = m, rng, flat
        self.parent: dict[Body, Body | None] = {}
        self.left: dict[Body, int] = {}
        self.end: dict[Body, Point] = {}
        self.base: dict[Body, tuple[np.ndarray, np.ndarray]] = {}

    def grow(self, i: int) -> None:
        """Body number i, on the ground or on the end of an earlier body."""
        m, rng, bodies = self.m, self.rng, list(self.parent)
        if not bodies or rng.random() < ROOTS:
            parent, base = None, m.point(f"A{i}", self.place(0.3 * i), fixed=True)
        else:
            parent = bodies[max(0, len(bodies) - 1 - int(rng.integers(4)))]
            base = self.end[parent]
        kind = str(rng.choice(FLAT)) if self.flat else str(rng.choice(list(FREEDOMS)))
        body, start = getattr(self, f"_{kind}")(i, parent or m.ground, base)
        self.parent[body], self.left[body] = parent, FREEDOMS[kind]
        m.line(*([base] if base is not start else []), start, self.end[body])
        m.bar(start, self.end[body], WIDTH / 2)
        if base is not start:
            m.bar(base, start, WIDTH / 6)

    def close(self, i: int) -> None:
        """Loop number i, by a point that belongs to both bodies or by a rod, where the joints around it leave at least one freedom."""
        bodies = list(self.parent)
        first, second = (bodies[k] for k in self.rng.permutation(len(bodies))[:2]) if len(bodies) > 1 else (None, None)
        if first is None or second is None:
            return
        around = self.around(first, second)
        shared = 2 if self.flat else 3
        is_free = self.end[first] not in second.elements and self.is_clear(second, self.end[first].initial - self.base[second][0])
        rows = shared if self.rng.random() < 0.6 and is_free else 1
        if sum(self.left[body] for body in around) <= rows:
            return
        if rows == shared:
            self.m.spherical(first, second, self.end[first])
            self.m.line(self.end[first], self.end[second])
        else:
            tip = self.m.attach_point(second, f"D{i}", self.base[second][0][: 2 if self.flat else 3] + 0.3 * self.direction(second))
            self.m.distance(self.end[first], tip)
            self.m.line(self.end[first], tip, self.end[second])
            self.m.bar(self.end[first], tip, WIDTH / 6)
            self.m.bar(tip, self.end[second], WIDTH / 6)
        for body in around:
            taken = min(rows, self.left[body])
            self.left[body], rows = self.left[body] - taken, rows - taken

    def around(self, first: Body, second: Body) -> list[Body]:
        """The bodies whose joints a loop between two bodies goes through."""
        ways = [self.way(first), self.way(second)]
        return [body for body in ways[0] + ways[1] if (body in ways[0]) != (body in ways[1])]

    def way(self, body: Body | None) -> list[Body]:
        """From a body to the ground."""
        return [] if body is None else [body, *self.way(self.parent[body])]

    # -- numbers -------------------------------------------------------------------------------

    def direction(self, body: Body | None = None) -> np.ndarray:
        """A random unit vector, which does not nearly lie in the plane of a body's first elements."""
        while True:
            d = self.rng.standard_normal(2 if self.flat else 3)
            if body is None or self.is_clear(body, d):
                return unit(d)

    def is_clear(self, body: Body, d: np.ndarray) -> bool:
        return bool(self.flat or body not in self.base or abs(dot(d, self.base[body][1])) > CLEAR * norm(d))

    def step(self, size: float) -> np.ndarray:
        return size * self.direction()

    def place(self, aside: float) -> np.ndarray:
        return self.step(0.2) + aside * np.eye(3)[0, : 2 if self.flat else 3]

    def across(self, axis: np.ndarray) -> np.ndarray:
        """A random unit vector at right angles to another one."""
        return unit(np.cross(axis, self.direction()))

    # -- bodies and joints ----------------------------------------------------------------------

    def body(self, i: int, start: Point, vectors: list[Vector]) -> Body:
        """A box from a point to a new one, its end."""
        m, length, mass = self.m, self.rng.uniform(0.3, 0.6), self.rng.uniform(0.5, 1.5)
        while True:  # downward rather than upward, and not nearly along the body's vector
            along = unit(self.direction() - 0.5 * np.eye(3)[1 if self.flat else 2, : 2 if self.flat else 3])
            normal = np.zeros(3) if self.flat else np.cross(along, vectors[0].initial)
            if self.flat or norm(normal) > CLEAR:
                break
        end = m.point(f"B{i}", start.initial[: len(along)] + length * along)
        if self.flat:
            body = m.body(f"body{i}", [start, end], vectors, mass, inertia=mass * (length**2 + WIDTH**2) / 12)
        else:
            tensor = mass / 12 * ((length**2 + WIDTH**2) * np.eye(3) + (WIDTH**2 - length**2) * np.outer(along, along))
            body = m.body(f"body{i}", [start, end], vectors, mass, inertia=tensor)
        self.end[body], self.base[body] = end, (start.initial, normal / max(norm(normal), CLEAR))
        return body

    def vector(self, name: str, direction: np.ndarray, parent: Body) -> Vector:
        """A vector of a parent, which rests on the ground."""
        return self.m.vector(name, direction, fixed=parent is self.m.ground)

    def _revolute(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        if self.flat:
            return self._spherical(i, parent, base)
        u = self.vector(f"u{i}", self.direction(parent), parent)
        body = self.body(i, base, [u])
        self.m.revolute(parent, body, base, u)
        return body, base

    def _spherical(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        body = self.body(i, base, [] if self.flat else [self.m.vector(f"u{i}", self.direction())])
        self.m.spherical(parent, body, base)
        return body, base

    def _universal(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        u = self.vector(f"u{i}", self.direction(parent), parent)
        v = self.m.vector(f"v{i}", self.across(u.initial))
        body = self.body(i, base, [v])
        self.m.universal(parent, body, base, u, v)
        return body, base

    def _sliding(self, i: int, parent: Body, base: Point, aside: bool = False) -> tuple[Body, Point, Vector]:
        """A body whose own point slides along a direction of its parent, or in the plane across it."""
        u = self.vector(f"u{i}", self.direction(parent), parent)
        way = self.across(u.initial) if aside else u.initial[: 2 if self.flat else 3]
        start = self.m.point(f"C{i}", base.initial[: len(way)] + self.rng.uniform(0.1, 0.3) * way)
        return self.body(i, start, [u]), start, u

    def _prismatic(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        body, start, u = self._sliding(i, parent, base)
        self.m.prismatic(parent, body, base, start, u)
        return body, start

    def _cylindrical(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        body, start, u = self._sliding(i, parent, base)
        self.m.cylindrical(parent, body, base, start, u)
        return body, start

    def _planar(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        body, start, u = self._sliding(i, parent, base, aside=True)
        self.m.planar(parent, body, base, start, u)
        return body, start

    def _screw(self, i: int, parent: Body, base: Point) -> tuple[Body, Point]:
        body, start, u = self._sliding(i, parent, base)
        self.m.screw(parent, body, base, start, u, PITCH, f"screw{i}")
        return body, start
