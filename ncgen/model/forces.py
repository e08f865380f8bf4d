"""Applied forces as the user wrote them.

Gravity is a property of the model, because it acts on every mass.
"""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.model.bodies import Body
from ncgen.model.elements import Combination, Component, Relative


@dataclass(frozen=True, eq=False)
class Force:
    """Generalised force components: sympy expressions of t, coordinates, rates and parameters.

    components: pairs (coordinate, expression); N for points, N m for angles
    label: the user's words for it, for messages and comments
    """

    label: str
    components: tuple[tuple[Component, object], ...]


@dataclass(frozen=True, eq=False)
class Couple:
    """A couple (N m, global axes) on a body."""

    label: str
    body: Body
    components: tuple[object, object, object]


@dataclass(frozen=True, eq=False)
class Potential:
    """A potential energy (J) whose negative gradient is a generalised force."""

    label: str
    expression: object


@dataclass(frozen=True, eq=False)
class Spring:
    """Spring and damper along a segment; `law` is an expression of x (length) and v (its rate), or None."""

    label: str
    segment: Combination
    stiffness: object
    damping: object
    free: object
    law: object = None


@dataclass(frozen=True, eq=False)
class TorsionSpring:
    """Spring and damper along a relative coordinate; `law` is an expression of x and v, or None."""

    label: str
    coordinate: Relative
    stiffness: object
    damping: object
    free: object
    law: object = None
