"""What is looked at from outside while a mechanism moves: a sensor's reading, a signal for a controller."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.model.values import Scalar


@dataclass(frozen=True, eq=False)
class Output:
    """label: the user's words; expression: of time, coordinates, rates, accelerations, parameters and inputs; unit: only for people"""

    label: str
    expression: Scalar
    unit: str = ""
