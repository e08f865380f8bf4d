"""What is looked at from outside while a mechanism moves: a sensor's reading, a signal for a controller."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ncgen.model.bodies import load_names
from ncgen.model.elements import driver_name
from ncgen.model.values import Scalar

if TYPE_CHECKING:
    from ncgen.model.contents import Contents

LOADS = ("force(", "moment(", "driver(")
"""How names of loads begin, and no others."""


@dataclass(frozen=True, eq=False)
class Output:
    """label: the user's words; expression: of time, coordinates and their rates, loads, parameters and inputs; unit: only for people"""

    label: str
    expression: Scalar
    unit: str = ""


def is_load(name: str) -> bool:
    """True if a name in an expression is that of a joint load or of a driver force."""
    return name.startswith(LOADS)


def observable_loads(model: Contents) -> Iterator[str]:
    """The names of all joint loads and driver forces that an output of the model can mention."""
    for body in model.bodies.values():
        for element in body.elements:
            yield from load_names(body, element)
    yield from (driver_name(c.name) for c in model.components if not c.fixed)
