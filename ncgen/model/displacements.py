"""What one-dimensional elements act along: a coordinate, or how far one coordinate is ahead of another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ncgen.errors import ModelError
from ncgen.model.elements import Component, Relative
from ncgen.model.values import Scalar, Value, as_sympy, total

Coordinate: TypeAlias = "Component | Relative"


@dataclass(frozen=True, eq=False)
class Displacement:
    """A sum of weights times coordinates. terms: (coordinate, weight) pairs"""

    name: str
    terms: tuple[tuple[Component, Scalar], ...]

    @classmethod
    def of(cls, where: str, coordinate: Coordinate, other: Coordinate | None = None, ratio: Value = 1.0, sign: int = 1) -> Displacement:
        """A coordinate, less the ratio times another one. Raises ModelError for fixed coordinates and for the same one twice."""
        pairs = [(coordinate, as_sympy(sign))] + ([] if other is None else [(other, -sign * as_sympy(ratio))])
        if fixed := [each.name for each, _ in pairs if getattr(each, "fixed", False)]:
            raise ModelError(f"{where}: {fixed[0]} is fixed; name a coordinate that moves")
        if other is coordinate:
            raise ModelError(f"{where}: {coordinate.name} is given twice; name two coordinates")
        name = coordinate.name if other is None else f"{coordinate.name}.{other.name}"
        return cls(name, tuple((component_of(each), weight) for each, weight in pairs))

    @property
    def position(self) -> Scalar:
        """It as an expression."""
        return total(weight * as_sympy(component) for component, weight in self.terms)

    @property
    def rate(self) -> Scalar:
        """Its velocity as an expression."""
        return total(weight * component.rate for component, weight in self.terms)

    @property
    def initial(self) -> Scalar:
        """What it is in the initial position: a number, or an expression of parameters."""
        return total(weight * as_sympy(component.value) for component, weight in self.terms)

    def forces(self, along: Scalar) -> list[tuple[Component, Scalar]]:
        """The generalised forces of one along it."""
        return [(component, weight * along) for component, weight in self.terms]


def component_of(coordinate: Coordinate) -> Component:
    """The coordinate itself, or the one that a relative angle or length consists of."""
    return coordinate if isinstance(coordinate, Component) else coordinate.components[0]
