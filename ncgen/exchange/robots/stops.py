"""Limits and dry friction of joints as springs and couples, where they are asked for: smooth enough for every integrator, and not rigid.

A stop is a spring k s (1 + tanh(d ṡ)) where the joint is s beyond its limit: as that of Hunt & Crossley (1975) it begins with no force and
loses energy, and it never pulls. Dry friction F is F tanh(v / v₀), so a
joint that stands under less than F creeps at up to v₀. k, d and v₀ are parameters of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias

from ncgen.errors import ModelError
from ncgen.exchange.robots.accounting import parted
from ncgen.exchange.robots.robot import Joint
from ncgen.model import Model
from ncgen.model.elements import Relative

if TYPE_CHECKING:
    import sympy

Law: TypeAlias = "Callable[[sympy.Expr, sympy.Expr], sympy.Expr]"
"""Torque against growth, or tension, from a value and its rate."""

STIFFNESS, LOSS = 1e4, 0.5
"""Of stops: N m/rad or N/m, and s/rad or s/m."""

FRICTION_RATE = 1e-2
"""The rate up to which dry friction is a damper (rad/s or m/s)."""

LIMITS, FRICTION = "limits of joints", "friction of joints"
"""The words for both among what is left out."""


def not_built(joints: Iterable[Joint]) -> list[str]:
    """The words for limits and friction of joints, once for each that has some."""
    return [words for joint in joints for words, has in ((LIMITS, joint.limits is not None), (FRICTION, joint.friction)) if has]


def add_stops(model: Model, joints: Iterable[tuple[Joint, Relative]]) -> int:
    """Stops of the joints that have limits; how many there are."""
    limited = [(joint, coordinate) for joint, coordinate in joints if joint.limits is not None]
    if not limited:
        return 0
    k, d = model.parameter("stop_stiffness", STIFFNESS, "N/m or N m/rad"), model.parameter("stop_loss", LOSS, "s/m or s/rad")
    for joint, coordinate in limited:
        assert joint.limits is not None, "a joint without limits among those with"
        lower, upper = joint.limits
        if lower > upper:
            raise ModelError(
                f"{joint.where}: joint {joint.name}: its lower limit {lower:g} is beyond the upper one {upper:g}; exchange them"
            )
        model.torsion_spring(coordinate, law=_stop(lower, upper, k.symbol, d.symbol), label=f"stops of {coordinate.name}")
    return len(limited)


def _stop(lower: float, upper: float, k: sympy.Expr, d: sympy.Expr) -> Law:
    """The torque against growth between two limits, of a value x and its rate v."""
    import sympy

    return lambda x, v: k * (beyond(x - upper) * (1 + sympy.tanh(d * v)) - beyond(lower - x) * (1 - sympy.tanh(d * v)))


def add_friction(model: Model, joints: Iterable[tuple[Joint, Relative]]) -> int:
    """Dry friction of the joints that have some; how many there are."""
    rough = [(joint, coordinate) for joint, coordinate in joints if joint.friction]
    if not rough:
        return 0
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
        what, count = parted(sentence)
        rest = count - done if what == words else None
        if rest is None:
            remaining.append(sentence)
        elif rest:
            remaining.append(f"{words} ({rest})")
    return tuple(remaining)
