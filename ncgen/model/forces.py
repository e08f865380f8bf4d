"""Applied forces: what acts along which coordinates, as expressions the user wrote.

Gravity is a property of the model, because it acts on every mass.
"""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.model.elements import Component


@dataclass(frozen=True, eq=False)
class Force:
    """Generalised force components: sympy expressions of t, coordinates, rates and parameters.

    components: pairs (coordinate, expression); N for points, N m for angles
    label: the user's words for it, for messages and comments
    """

    label: str
    components: tuple[tuple[Component, object], ...]


@dataclass(frozen=True, eq=False)
class Potential:
    """A potential energy (J) whose negative gradient is a generalised force."""

    label: str
    expression: object
