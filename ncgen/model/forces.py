"""Applied forces as the user wrote them.

Gravity is a property of the model, because it acts on every mass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.elements import Combination, Component, Relative
from ncgen.model.values import Scalar, Value

if TYPE_CHECKING:
    import sympy

Callback: TypeAlias = Callable[..., Sequence[float] | np.ndarray]
"""function(t, q, qd, kernels) -> generalised forces (n,)."""


@dataclass(frozen=True, eq=False)
class Force:
    """Generalised force components: sympy expressions of t, coordinates, rates and parameters.

    components: pairs (coordinate, expression); N for points, N m for angles
    label: the user's words for it, for messages and comments
    """

    label: str
    components: tuple[tuple[Component, Scalar], ...]


@dataclass(frozen=True, eq=False)
class Couple:
    """A couple (N m, global axes) on a body."""

    label: str
    body: Body
    components: tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True, eq=False)
class Potential:
    """A potential energy (J) whose negative gradient is a generalised force."""

    label: str
    expression: Scalar


@dataclass(frozen=True, eq=False)
class Spring:
    """Spring and damper along a segment; `law` is an expression of x (length) and v (its rate), or None."""

    label: str
    segment: Combination
    stiffness: Value
    damping: Value
    free: Value
    law: sympy.Expr | None = None


@dataclass(frozen=True, eq=False)
class TorsionSpring:
    """Spring and damper along a relative coordinate; `law` is an expression of x and v, or None."""

    label: str
    coordinate: Relative
    stiffness: Value
    damping: Value
    free: Value
    law: sympy.Expr | None = None
