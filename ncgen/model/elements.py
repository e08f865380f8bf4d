"""Points, unit vectors and angles: the coordinates of a mechanism.

The handles returned here are what a user combines: `r4 - r2` is the segment from r2 to r4, `-u` the
reversed vector, `r2.z` the sympy symbol of one component, `psi.rate` the symbol of a velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from ncgen.model.values import Expression, Scalar, Symbolic, Value, as_sympy, is_number, symbol_of, text_of, total

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import sympy

AXES = "xyz"

ROUNDING = 4 * np.finfo(float).eps
"""Share of what is added up by which weights that cancel may miss 0."""

Direction: TypeAlias = "Spatial | Combination"
"""In signatures: a vector, a segment such as `r4 - r2`, or a combination of them with numbers."""


class SymbolicCoordinate(Symbolic):
    """A coordinate that is one number, by its name."""

    @property
    def rate(self) -> sympy.Symbol:
        """The sympy symbol of the coordinate's velocity."""
        return symbol_of(rate_name(self.name))

    @property
    def acceleration(self) -> sympy.Symbol:
        """The sympy symbol of the coordinate's acceleration, for outputs."""
        return symbol_of(rate_name(rate_name(self.name)))

    @property
    def driver(self) -> sympy.Symbol:
        """The sympy symbol of what the driver of the coordinate does (N or N m, positive as the coordinate grows), for outputs."""
        return symbol_of(driver_name(self.name))


@dataclass(frozen=True)
class Component(SymbolicCoordinate):
    """One scalar coordinate: `r2.x`, or the angle `psi1`.

    `value` is what the user gave: a number, a parameter or an expression of parameters;
    `initial` is its number in the initial position, with the parameters' defaults.
    """

    name: str
    fixed: bool
    value: Value
    initial: float

    def __repr__(self) -> str:
        return f"coordinate {self.name}"


def rate_name(coordinate: str) -> str:
    """The name of a coordinate's velocity, e.g. `rate(psi1)`."""
    return f"rate({coordinate})"


def driver_name(coordinate: str) -> str:
    """The name of what the driver of a coordinate does, e.g. `driver(psi1)`."""
    return f"driver({coordinate})"


def coordinate_of(name: str) -> str:
    """The coordinate that a name speaks of: itself, or the one of `rate(name)`."""
    return name[5:-1] if name.startswith("rate(") and name.endswith(")") else name


class Located:
    """What has numbers in the initial position, which are found once."""

    @cached_property
    def _initial(self) -> np.ndarray:
        raise NotImplementedError

    @property
    def initial(self) -> np.ndarray:
        """The numbers of the initial position, shape (3,), of an element with one component (1,); no weight may be a parameter."""
        return self._initial.copy()

    def __getstate__(self) -> dict[str, object]:
        """All but what is found again."""
        return {name: value for name, value in vars(self).items() if name != "_initial"}


@dataclass(frozen=True, eq=False)
class Element(Located):
    """What points, vectors and angles share: a name and one or three components.

    word: what such an element is called in messages
    quantity, unit: what a component of this kind is, for people
    """

    name: str
    components: tuple[Component, ...]
    word: ClassVar[str]
    quantity: ClassVar[str]
    unit: ClassVar[str]

    def __repr__(self) -> str:
        return f"{self.word} {self.name}"

    @cached_property
    def _initial(self) -> np.ndarray:
        return np.array([c.initial for c in self.components])

    @property
    def given(self) -> tuple[Scalar, ...]:
        """The values of the initial position, ready for arithmetic: numbers, or expressions of parameters."""
        return tuple(as_sympy(c.value) for c in self.components)

    @property
    def is_parametric(self) -> bool:
        """True if a parameter has a say in the initial position."""
        return not all(is_number(c.value) for c in self.components)

    @property
    def fixed(self) -> bool:
        """True if no component can move."""
        return all(c.fixed for c in self.components)


class Spatial(Element):
    """An element of three components that can be combined with others."""

    word = "point or vector"

    @property
    def x(self) -> Component:
        return self.components[0]

    @property
    def y(self) -> Component:
        return self.components[1]

    @property
    def z(self) -> Component:
        return self.components[2]

    def __add__(self, other: Direction) -> Combination:
        return as_combination(self) + other

    def __sub__(self, other: Direction) -> Combination:
        return as_combination(self) - other

    def __neg__(self) -> Combination:
        return -as_combination(self)

    def __mul__(self, weight: Expression) -> Combination:
        return as_combination(self) * weight

    __rmul__ = __mul__


class Point(Spatial):
    word, quantity, unit = "point", "position", "m"


class Vector(Spatial):
    """A unit vector."""

    word, quantity, unit = "vector", "direction", "1"


class Constant(Vector):
    """A direction that never moves and is no coordinate, such as the normal of the plane; its numbers are constants."""

    @classmethod
    def of(cls, name: str, values: Sequence[Scalar] | np.ndarray, numbers: Iterable[float] | None = None) -> Constant:
        """A constant direction; what is zero but for rounding is zero. `numbers` are those of values with parameters."""
        numbers = [0.0 if abs(v) < 1e-15 else float(v) for v in (values if numbers is None else numbers)]
        pairs = [(number if is_number(value) else value, number) for value, number in zip(values, numbers, strict=True)]
        return cls(name, tuple(Component(f"{name}.{axis}", True, *pair) for axis, pair in zip(AXES, pairs, strict=True)))


class Relative(SymbolicCoordinate, Element):
    """A scalar coordinate between elements: it can be driven, loaded, and used in expressions by itself."""

    word = "relative angle or distance"


@dataclass(frozen=True, eq=False, repr=False)
class Angle(Relative):
    """A relative angle (rad): from `start` to `end`, counted positively about `axis`."""

    start: Combination
    end: Combination
    axis: Combination

    word, quantity, unit = "angle", "angle", "rad"


class Length(Relative):
    """A relative distance (m): between two points, or along an axis."""

    word, quantity, unit = "length", "length", "m"


@dataclass(frozen=True, eq=False)
class Combination(Located):
    """A linear combination of points and vectors, such as the segment `r4 - r2`.

    `terms` holds (weight, element) pairs; a weight is a number or an expression of parameters.
    """

    terms: tuple[tuple[Scalar, Spatial], ...]

    def __add__(self, other: Direction) -> Combination:
        terms = dict((element, weight) for weight, element in self.terms)
        for weight, element in as_combination(other).terms:
            terms[element] = terms[element] + weight if element in terms else weight
        kept = {element: weight for element, weight in terms.items() if not (is_number(weight) and weight == 0.0)}
        return Combination(tuple((weight, element) for element, weight in (kept or terms).items()))

    def __sub__(self, other: Direction) -> Combination:
        return self + (-as_combination(other))

    def __neg__(self) -> Combination:
        return self * -1.0

    def __mul__(self, weight: Expression) -> Combination:
        return Combination(tuple((factor * as_sympy(weight), element) for factor, element in self.terms))

    __rmul__ = __mul__

    @cached_property
    def _initial(self) -> np.ndarray:
        position = np.zeros(3)
        for weight, element in self.terms:
            position += float(weight) * element._initial
        return position

    @property
    def given(self) -> tuple[Scalar, ...]:
        """The same as three values: numbers, or expressions of parameters where positions have some."""
        parts = [[weight * value for value in element.given] if weight != 1.0 else element.given for weight, element in self.terms]
        return tuple(total(x for x in column if x != 0.0) for column in zip(*parts, strict=True))

    @property
    def is_parametric(self) -> bool:
        """True if a parameter has a say in the initial position."""
        return any(not is_number(weight) or element.is_parametric for weight, element in self.terms)

    @property
    def elements(self) -> tuple[Spatial, ...]:
        return tuple(element for _, element in self.terms)

    @property
    def is_direction(self) -> bool:
        """True if the points' weights cancel, so that the combination does not depend on the origin."""
        weights = [weight for weight, element in self.terms if isinstance(element, Point)]
        return all(map(is_number, weights)) and abs(sum(weights)) <= ROUNDING * sum(map(abs, weights))

    def __repr__(self) -> str:
        return f"direction {self}"

    def __str__(self) -> str:
        if len(self.terms) == 2 and [w for w, _ in self.terms] == [1.0, -1.0]:
            return f"{self.terms[0][1].name}-{self.terms[1][1].name}"
        parts = []
        for weight, element in self.terms:
            sign = "-" if weight == -1.0 else "" if weight == 1.0 else f"{weight:g}*" if is_number(weight) else f"{text_of(weight)}*"
            parts.append(f"{sign}{element.name}")
        return "+".join(parts).replace("+-", "-")


def as_combination(direction: Direction) -> Combination:
    """A point, a vector or a combination as a combination."""
    return direction if isinstance(direction, Combination) else Combination(((1.0, direction),))
