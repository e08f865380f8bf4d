"""Limits and dry friction of joints, where they are asked for: smooth ones for every integrator, or rigid stops and friction that sticks.

A smooth stop is a spring k s (1 + tanh(d ṡ)) where the joint is s beyond its limit: as that of Hunt and Crossley (1975) it begins with no
force and loses energy, and it never pulls. Smooth dry friction F is F tanh(v / v₀), so a joint that stands under less than F creeps at up
to v₀. k, d and v₀ are parameters of the model. Rigid stops and friction that sticks are elements of events.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.accounting import parted
from ncgen.exchange.robots.robot import Joint
from ncgen.model import Model
from ncgen.model.elements import Relative
from ncgen.model.values import Parameter

if TYPE_CHECKING:
    import sympy

Law: TypeAlias = "Callable[[sympy.Expr, sympy.Expr], sympy.Expr]"
"""Torque against growth, or tension, from a value and its rate."""

STIFFNESS, LOSS = 1e4, 0.5
"""Of stops: N m/rad or N/m, and s/rad or s/m."""

UNLIMITED = 1e6
"""Limits beyond this (rad or m) are no stops: files write large numbers for joints that turn without end."""

FRICTION_RATE = 1e-2
"""The rate up to which dry friction is a damper (rad/s or m/s)."""

RIGID_WORD, EXACT_WORD = "rigid", "exact"
SMOOTH_OR = {"limits": RIGID_WORD, "friction": EXACT_WORD}
"""Words of `ncgen.load` for stops and friction of events, by its arguments."""

RESTITUTION = "stop_restitution"
"""The parameter of rigid stops."""

LIMITS, FRICTION = "limits of joints", "friction of joints"
"""The words for both among what is left out."""


def not_built(joints: Iterable[Joint]) -> list[str]:
    """The words for limits and friction of joints, once for each that has some."""
    return [words for joint in joints for words, has in ((LIMITS, joint.limits is not None), (FRICTION, joint.friction)) if has]


def check_smooth(value: object, argument: str) -> None:
    """Raise ModelError for anything but True, False and the word of an argument."""
    word = SMOOTH_OR[argument]
    if not isinstance(value, (bool, np.bool_)) and not (isinstance(value, str) and value == word):
        raise ModelError(f'{argument}: {shown(value)} given; give True (smooth), "{word}" or False')


def add_stops(model: Model, joints: Iterable[tuple[Joint, Relative]], wanted: bool | str = True) -> int:
    """Stops of the joints that have limits; how many there are. wanted: True for smooth ones, or the word RIGID_WORD"""
    limited = [(joint, coordinate) for joint, coordinate in joints if joint.limits is not None]
    if not limited:
        return 0
    _check_order(limited)
    if wanted == RIGID_WORD:
        restitution = model.parameter(RESTITUTION, 0.0)
        for joint, coordinate in limited:
            _add_rigid(model, joint, coordinate, restitution)
        return len(limited)
    k, d = model.parameter("stop_stiffness", STIFFNESS, "N/m or N m/rad"), model.parameter("stop_loss", LOSS, "s/m or s/rad")
    for joint, coordinate in limited:
        assert joint.limits is not None, "a joint without limits among those with"
        lower, upper = joint.limits
        model.torsion_spring(coordinate, law=_stop(lower, upper, k.symbol, d.symbol), label=f"stops of {coordinate.name}")
    return len(limited)


def _check_order(limited: Iterable[tuple[Joint, Relative]]) -> None:
    """Raise ModelError for a joint whose lower limit is above the upper one."""
    for joint, _ in limited:
        lower, upper = joint.limits or (0.0, 0.0)
        if lower > upper:
            raise ModelError(
                f"{joint.where}: joint {joint.name}: its lower limit {lower:g} is beyond the upper one {upper:g}; exchange them"
            )


def _add_rigid(model: Model, joint: Joint, coordinate: Relative, restitution: Parameter) -> None:
    """Rigid stops; a joint whose limits are the same number is locked there."""
    assert joint.limits is not None, "a joint without limits among those with"
    lower, upper = joint.limits
    if lower == upper:
        model.lock(coordinate)
        return
    bounds = [limit if math.isfinite(limit) and abs(limit) < UNLIMITED else None for limit in (lower, upper)]
    if any(bound is not None for bound in bounds):
        model.stop(coordinate, *bounds, restitution=restitution, order="simultaneous")


def _stop(lower: float, upper: float, k: sympy.Expr, d: sympy.Expr) -> Law:
    """The torque against growth between two limits, of a value x and its rate v."""
    import sympy

    return lambda x, v: k * (beyond(x - upper) * (1 + sympy.tanh(d * v)) - beyond(lower - x) * (1 - sympy.tanh(d * v)))


def add_friction(model: Model, joints: Iterable[tuple[Joint, Relative]], wanted: bool | str = True) -> int:
    """Dry friction of the joints that have some; how many there are. wanted: True for smooth couples, or the word EXACT_WORD"""
    rough = [(joint, coordinate) for joint, coordinate in joints if joint.friction]
    if not rough:
        return 0
    if wanted == EXACT_WORD:
        for joint, coordinate in rough:
            model.friction(coordinate, joint.friction)
        return len(rough)
    creep = model.parameter("friction_creep", FRICTION_RATE, "m/s or rad/s")
    for joint, coordinate in rough:
        model.torsion_spring(coordinate, law=_rough(joint.friction, creep.symbol), label=f"friction of {coordinate.name}")
    return len(rough)


def _rough(force: float, creep: sympy.Expr) -> Law:
    """The torque against growth of dry friction, of a value and its rate v."""
    import sympy

    return lambda x, v: force * sympy.tanh(v / creep)


def beyond(s: sympy.Expr) -> sympy.Expr:
    """s where it is positive, else 0."""
    import sympy

    return (s + sympy.Abs(s)) / 2


def left(omitted: Iterable[str], words: str, done: int) -> tuple[str, ...]:
    """What is left out, less so many of a kind."""
    remaining = []
    for sentence in omitted:
        kind, count = parted(sentence)
        rest = count - done if kind == words else None
        if rest is None:
            remaining.append(sentence)
        elif rest:
            remaining.append(f"{words} ({rest})")
    return tuple(remaining)
