"""Mechanisms that runs compile when they need them. The compiler comes after the solver, so it is looked up here, when it is called."""

from __future__ import annotations

import copy
from importlib import import_module
from typing import Any

from ncgen.emit.sources import Sources
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model


def compiled(mechanism: Model | Sources, **options: Any) -> Kernels:
    """As `ncgen.compile`."""
    return import_module("ncgen.compiler").compile(mechanism, **options)


def generated(model: Model) -> Sources:
    """As `ncgen.generate`."""
    return import_module("ncgen.compiler").generate(model)


def without_events(model: Model) -> Model:
    """A copy to which held constraints can be added: the mechanism alone, without what happens to it and with no choice of coordinates."""
    other = copy.deepcopy(model)
    other.events, other.frictions, other.contacts, other.ratchets, other.locks, other.chosen_independent = {}, {}, {}, {}, {}, ()
    return other
