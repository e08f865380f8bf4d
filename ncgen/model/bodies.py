"""Bodies: the elements that move together, and their inertia.

Inertia is given as in Table 6 of the paper: mass, centre of mass and inertia tensor about it, with axes
parallel to the global ones, all in the initial position.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ncgen.errors import ModelError, counted, shown
from ncgen.model.elements import AXES, Point, Spatial, Vector
from ncgen.model.rigid import Frame
from ncgen.model.singular_values import singular_values
from ncgen.model.value_conditions import Bound, Condition, Moments
from ncgen.model.values import (
    Parameter,
    Scalar,
    Value,
    as_number_if_constant,
    as_sympy,
    evaluate,
    is_number,
    mentioned,
    symbol_of,
    total,
    vanishes,
)

if TYPE_CHECKING:
    import sympy

SYMMETRIC = 1e-9
"""Slack, relative to the largest entry, in the symmetry of an inertia tensor."""

LARGEST_BASIS = 4
"""Elements that carry any inertia."""

WORDS_OF_INERTIA = ("point", "rod")
"""What an inertia can be called instead of given in numbers: all mass at the centre, or a uniform rod between the body's two points."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Inertia:
    """Mass (kg), centre of mass (m, global, initial position), inertia tensor about it (kg m², 3×3), and its basis.

    `basis` are the points and vectors whose velocities carry the kinetic energy: one point, and up to three further
    elements; two points are a bar, and three elements get the cross product of their directions for the third.
    Any number may be a value with parameters; a mass that is one
    scales the tensor only if the user writes it so. `assumed` is True where no moments were given: a point mass, which cannot rotate.
    `is_judged` is False where parameters may make it one that no body has: in identification, which finds sums over bodies alone,
    and where moments that no body has are taken as a file says them.
    parts: what it is the sum of, where masses are fixed to the body (`m.payload`); each is judged by itself
    """

    mass: Value
    com: tuple[Value, ...]
    tensor: np.ndarray
    basis: tuple[Spatial, ...] | None = None
    assumed: bool = False
    is_judged: bool = True
    name: str = ""
    parts: tuple[Inertia, ...] = ()

    def plus(self, others: Iterable[Inertia], parameters: dict[str, Parameter]) -> Inertia:
        """All together, on the basis of this one."""
        parts = (*(self.parts or (self,)), *others)
        masses = [as_sympy(inertia.mass) for inertia in parts]
        mass = total(masses)
        if sum(evaluate(m, parameters, self.name) for m in masses) == 0:  # nothing yet: parameters may give it a mass
            masses, mass = [1.0] * len(parts), float(len(parts))
        com = tuple(
            as_number_if_constant(total(m * as_sympy(x) for m, x in zip(masses, column, strict=True)) / mass)
            for column in zip(*(inertia.com for inertia in parts), strict=True)
        )
        tensor = np.array([[total(inertia.about(com)[k][l] for inertia in parts) for l in range(3)] for k in range(3)], dtype=object)
        is_judged = all(inertia.is_judged for inertia in parts)
        return Inertia(
            mass=total(as_sympy(inertia.mass) for inertia in parts),
            com=com,
            tensor=tensor,
            basis=self.basis,
            is_judged=is_judged,
            parts=parts,
        )

    def numbers(self, parameters: dict[str, Parameter]) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, centre of mass (3,) and tensor (3, 3) at the parameters' defaults, found once."""
        if self not in _numbers:
            _numbers[self] = self.at(parameters)
        return _numbers[self]

    def at(self, parameters: dict[str, Parameter]) -> tuple[float, np.ndarray, np.ndarray]:
        """As `numbers`, at these parameters' defaults."""
        if self.parts:
            first, *others = (replace(inertia, mass=m, com=c, tensor=t) for inertia in self.parts for m, c, t in (inertia.at(parameters),))
            whole = first.plus(others, parameters)
            return evaluate(whole.mass, parameters, self.name), np.array(whole.com), whole.tensor.astype(float)
        mass, *rest = (evaluate(x, parameters, self.name) for x in (self.mass, *self.com, *self.tensor.flat))
        return mass, np.array(rest[:3]), np.array(rest[3:]).reshape(3, 3)

    def about(self, point: Sequence[Scalar]) -> list[list[Scalar]]:
        """The tensor (3, 3) about another point (3,) in m: Steiner."""
        d = [as_sympy(c) - x for c, x in zip(self.com, point, strict=True)]
        squared, mass = total(x * x for x in d), as_sympy(self.mass)
        return [
            [as_sympy(self.tensor[k, l]) + mass * ((squared if k == l else 0.0) - x * y) for l, y in enumerate(d)] for k, x in enumerate(d)
        ]


_numbers: WeakKeyDictionary[Inertia, tuple[float, np.ndarray, np.ndarray]] = WeakKeyDictionary()


class BodyFrame(NamedTuple):
    """A frame that moves with a body: rotation (3, 3), its axes as columns, and position (3,) in m, global, in the initial position.

    body: its name; "ground" where it rests; is_output: whether outputs of the model say where it is
    """

    body: str
    rotation: np.ndarray
    position: np.ndarray
    is_output: bool = False


class JointLoad(NamedTuple):
    """The components of a joint load, global axes, as expressions of sympy for outputs."""

    x: sympy.Expr
    y: sympy.Expr
    z: sympy.Expr


@dataclass(eq=False, kw_only=True)
class Body:
    """A rigid body: its points and vectors, and its inertia if it has mass.

    rigid: whether ncgen chooses the rows that keep it together; frame: the base those rows are written in
    constant_mass: whether an auxiliary vector completes a base of two directions
    """

    name: str
    points: list[Point] = field(default_factory=list)
    vectors: list[Vector] = field(default_factory=list)
    inertia: Inertia | None = None
    rigid: bool = True
    constant_mass: bool = False
    frame: Frame = field(kw_only=True)

    def __repr__(self) -> str:
        return f"body {self.name}"

    def copy(self) -> Body:
        """A body of its own with the same elements."""
        frame = replace(self.frame, directions=list(self.frame.directions), close_points=list(self.frame.close_points))
        return replace(self, points=list(self.points), vectors=list(self.vectors), frame=frame)

    @property
    def elements(self) -> list[Spatial]:
        return [*self.points, *self.vectors]

    @property
    def can_rotate(self) -> bool:
        """True if the elements describe a rotation: a vector, or a segment from the first point, with two components that can change."""
        base = self.points[0].components if self.points else ()
        segments = [tuple(zip(base, point.components, strict=True)) for point in self.points[1:]]
        directions = [*segments, *(tuple((c,) for c in vector.components) for vector in self.vectors)]
        return any(sum(not all(c.fixed for c in ends) for ends in direction) > 1 for direction in directions)

    def force(self, point: Point | str) -> JointLoad:
        """The force (N) of joints on the body at one of its points, as symbols for outputs. Raises ModelError for another point."""
        return self._load(point, self.points, "point")

    def moment(self, vector: Vector | str) -> JointLoad:
        """The moment (N m) of joints on the body through one of its unit vectors, as symbols for outputs. Raises ModelError for another."""
        return self._load(vector, self.vectors, "vector")

    def wrench(self, about: Point) -> tuple[JointLoad, JointLoad]:
        """Force (N) and moment (N m) about a point of all joint loads on the body, as expressions for outputs.

        A couple on an angle acts on the elements that the angle is measured between, by forces at points; a wrench has it as a couple.
        Raises ModelError where `about` is no point.
        """
        import sympy

        if not isinstance(about, Point):
            raise ModelError(f"body {self.name}, wrench: {shown(about)} is not a point; give one by itself")

        force, moment = sympy.zeros(3, 1), sympy.zeros(3, 1)
        position = sympy.Matrix([c.symbol for c in about.components])
        for point in self.points:
            load = sympy.Matrix(self.force(point))
            force += load
            moment += (sympy.Matrix([c.symbol for c in point.components]) - position).cross(load)
        for vector in self.vectors:
            moment += sympy.Matrix(self.moment(vector))
        return JointLoad(*force), JointLoad(*moment)

    def _load(self, element: Spatial | str, candidates: Sequence[Spatial], kind: str) -> JointLoad:
        owner_element = next((e for e in candidates if e is element or e.name == element), None)
        if owner_element is None:
            known = ", ".join(e.name for e in candidates)
            raise ModelError(f"body {self.name} has no {kind} {shown(element)}; give one of its own: {known or 'it has none'}")
        return JointLoad(*map(symbol_of, load_names(self, owner_element)))

    @property
    def basis(self) -> tuple[Spatial, ...]:
        """The elements that carry the inertia: those chosen, else four independent ones, else what there is."""
        return self.own_inertia.basis or choose_basis(self)

    @property
    def own_inertia(self) -> Inertia:
        """The inertia of a body that has one. Raises ModelError for others."""
        if self.inertia is None:
            raise ModelError(f"body {self.name}: it has no inertia; give its mass")
        return self.inertia


def load_names(body: Body, element: Spatial) -> tuple[str, ...]:
    """The names of the components of joints' load on a body: `force(rod,A).x` and others at a point, `moment(rod,u).x` through a vector."""
    kind = "moment" if isinstance(element, Vector) else "force"
    return tuple(f"{kind}({body.name},{element.name}).{axis}" for axis in AXES)


def check_inertia(name: str, mass: float, com: np.ndarray, tensor: np.ndarray, as_given: bool = False) -> None:
    """Raise ModelError with what makes an inertia (3, 3) impossible, if anything does. as_given: whatever its principal moments are"""
    if com.shape != (3,):
        raise ModelError(f"body {name}: the centre of mass has shape {com.shape}; give three numbers, or two for a body of the plane")
    of_mass, of_moments = conditions(name, mass, tensor)
    of_mass.check([mass])
    gap = np.max(np.abs(tensor - tensor.T))
    if gap > SYMMETRIC * np.max(np.abs(tensor)):
        raise ModelError(f"body {name}: the inertia tensor is not symmetric, by {gap:.3g}; its off-diagonal entries must be equal in pairs")
    if not as_given:
        of_moments.check(tensor.ravel())


def conditions(name: str, mass: Value, tensor: np.ndarray) -> tuple[Condition, Condition]:
    """What a body's mass (kg) and its inertia tensor (3, 3) (kg m²) must satisfy."""
    return Bound(wording=f"body {name}: the mass is", value=mass, relation=">=", unit="kg", remedy="give a positive number"), Moments(
        name, tensor
    )


def check_moments(body: Body) -> None:
    """Raise ModelError where a body with mass can rotate and nothing is known about its moments of inertia."""
    inertia = body.inertia
    if inertia is None or not inertia.assumed or not body.can_rotate or (is_number(inertia.mass) and inertia.mass == 0):
        return
    remedies = ['inertia="rod" for a uniform rod between its two points'] if len(body.points) == 2 else []
    remedies += ['inertia="point" for all mass at the centre']
    raise ModelError(f"body {body.name}: it has mass and can rotate, but no inertia; give inertia= (kg m2), {', or '.join(remedies)}")


def rod_tensor(mass: Value, start: Sequence[Scalar], end: Sequence[Scalar]) -> np.ndarray:
    """The tensor (3, 3) (kg m²) of a uniform rod about its centre, m/12 (d·d 1 − d dᵀ) with d from its start to its end (m)."""
    d = [b - a for a, b in zip(start, end, strict=True)]
    squared = total(x * x for x in d)
    twelfth = as_sympy(mass) / 12
    rows = [[twelfth * ((squared if k == l else 0.0) - x * y) for l, y in enumerate(d)] for k, x in enumerate(d)]
    return np.array(rows, dtype=object)


def check_pairs(name: str, tensor: np.ndarray, parameters: dict[str, Parameter]) -> None:
    """Raise ModelError where entries of an inertia (3, 3) that make a pair are equal at the parameters' defaults alone."""
    for i, j in ((0, 1), (0, 2), (1, 2)):
        pair = tensor[i, j], tensor[j, i]
        size = max(abs(evaluate(x, parameters, f"body {name}")) for x in pair)
        if not vanishes(as_sympy(pair[0]) - as_sympy(pair[1]), parameters, SYMMETRIC * (size or 1.0)):
            raise ModelError(
                f"body {name}: the inertia's entries {AXES[i]}{AXES[j]} and {AXES[j]}{AXES[i]} are equal only at the default of "
                f"{mentioned(pair, parameters)}; give the same for both"
            )


def symmetric(tensor: np.ndarray) -> np.ndarray:
    """A tensor (3, 3) of values with the mean of what differs by rounding."""
    mean = [
        [a if a == b else (as_sympy(a) + as_sympy(b)) / 2 for a, b in zip(*rows, strict=True)]
        for rows in zip(tensor, tensor.T, strict=True)
    ]
    return np.array(mean, dtype=object if not all(map(is_number, tensor.flat)) else float)


def choose_basis(body: Body) -> tuple[Spatial, ...]:
    """A point and up to three independent directions, in the order in which the body's elements were given."""
    points = [point for point in body.points if point not in body.frame.close_points]
    if body.frame.planar:
        # With the plane's normal, two points carry any planar inertia, and so do a point and a vector.
        across = [v for v in body.vectors if v.components[2].value == 0.0]
        return tuple((points + across)[:2])
    chosen: list[Spatial] = [body.points[0]]
    directions: list[np.ndarray] = []
    for least in (0.2, 1e-3):
        for element in (*points, *body.vectors):
            if element in chosen or len(directions) == 3:
                continue
            direction = element.initial - (body.points[0].initial if isinstance(element, Point) else 0.0)
            trial = directions + [direction / max(np.linalg.norm(direction), 1e-300)]
            if singular_values(np.array(trial))[-1] > least:
                chosen.append(element)
                directions = trial
    return tuple([e for e in chosen if isinstance(e, Point)] + [e for e in chosen if isinstance(e, Vector)])


def check_basis(name: str, basis: tuple[Spatial, ...]) -> None:
    """Refuse a basis that is not one of the supported shapes or is degenerate in the initial position."""
    points = [e for e in basis if isinstance(e, Point)]
    if not points or len(basis) > LARGEST_BASIS:
        raise ModelError(
            f"body {name}: {counted(len(points), 'point')} and {counted(len(basis) - len(points), 'vector')} are no basis for inertia; "
            "give one point and "
            "up to three further points and vectors"
        )
    directions = [e.initial - points[0].initial for e in points[1:]] + [e.initial for e in basis if e not in points]
    if not directions:
        return
    unit = [d / (np.linalg.norm(d) or 1.0) for d in directions]
    smallest = singular_values(np.array(unit))[-1]
    if smallest < 1e-6:
        names = ", ".join(e.name for e in basis)
        raise ModelError(f"body {name}: the elements {names} are parallel or coplanar ({smallest:.1e}); choose other ones as basis")
