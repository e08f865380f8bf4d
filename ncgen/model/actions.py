"""What an event does: an impact, a lock, other velocities, inputs or parameters, the end of the run, or a Python function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, cast

from ncgen.errors import ModelError, one_of, shown
from ncgen.model.elements import SymbolicCoordinate, coordinate_of
from ncgen.model.names import normal
from ncgen.model.values import Driven, Scalar, Value

if TYPE_CHECKING:
    from ncgen.model.contents import Contents

ORDERS = ("simultaneous", "in turn")
"""Laws of several impacts at one instant: all at once, with impulses that only push; or the fastest one first, until no gap closes."""

AT_REST = ("hold", "end")
"""What a run does where bounces accumulate: the gap is held closed as long as it is pushed, or the run ends."""

STOP = "stop"


@dataclass(frozen=True, eq=False)
class Impact:
    """Newton's law of impact along the gradient of the event's own condition, a gap.

    restitution: from 0 to 1; order: one of `ORDERS`, "" where several at one instant are refused; rest: one of `AT_REST`
    """

    restitution: Value = 0.0
    order: str = ""
    rest: str = "hold"


@dataclass(frozen=True, eq=False)
class Change:
    """Other values of inputs and parameters, or of velocities, by their names ("rate(psi)")."""

    values: Mapping[str, Scalar]


@dataclass(frozen=True)
class Stop:
    """The end of the run."""


@dataclass(frozen=True, eq=False)
class Call:
    """A function of the state that returns None or other values as a `Change` has them."""

    function: Callable[..., Mapping[str, float] | None]


@dataclass(frozen=True)
class Locking:
    """A lock that closes or opens, by its name or that of its coordinate."""

    lock: str
    closes: bool


Action: TypeAlias = "Impact | Change | Stop | Call | Locking"

Doing: TypeAlias = "Action | str | Mapping[str, Driven] | Callable[..., object] | list[object] | tuple[object, ...]"
"""In signatures: one or several of them, as a user writes them."""


def impact(restitution: Value = 0.0, order: str = "", rest: str = "hold") -> Impact:
    """Return the impact that an event does: `m.event("floor", when=ball.y, do=ncgen.impact(restitution=0.5))`.

    Parameters
    ----------
    restitution : float or expression of parameters
        Coefficient e of Newton's law, from 0 to 1: u⁺ = −e u⁻ for the velocity u at which the gap, the event's condition, changes. The
        impulse acts along the gradient of the gap; with the constraints' own impulses velocities satisfy all constraints after it.
    order : str, optional
        Law for several impacts at one instant, since the laws give different answers: "simultaneous" (all together, impulses only push) or
        "in turn" (the fastest one first, until no gap closes). Without it several impacts at one instant are refused.
    rest : str
        What follows where bounces accumulate: "hold" (the gap stays closed as long as it is pushed) or "end" (the run ends).

    Returns
    -------
    Impact
        The action.

    Raises
    ------
    ModelError
        For an unknown word.
    """
    one_of(rest, "impact: rest", AT_REST)
    return Impact(restitution, check_order(order, "impact"), rest)


def check_order(order: str, where: str) -> str:
    """A law of several impacts, or "". Raises ModelError for another word."""
    return one_of(order, f"{where}: order", ORDERS) if order != "" else order


def lock(coordinate: str | SymbolicCoordinate) -> Locking:
    """Return the action of an event that locks a coordinate or closes a clutch: `m.event("grip", when=…, do=ncgen.lock("psi"))`.

    Parameters
    ----------
    coordinate : str or coordinate
        A coordinate, or the name of a lock or clutch of the model. It stays where it is at that instant until it is freed.

    Returns
    -------
    Locking
        The action.
    """
    return Locking(_name_of(coordinate), True)


def free(coordinate: str | SymbolicCoordinate) -> Locking:
    """Return the action of an event that frees what `lock` locks.

    Parameters
    ----------
    coordinate : str or coordinate
        A coordinate, or the name of a lock or clutch of the model.

    Returns
    -------
    Locking
        The action.
    """
    return Locking(_name_of(coordinate), False)


def _name_of(target: object) -> str:
    name = target if isinstance(target, str) else getattr(target, "name", None)
    if not isinstance(name, str):
        raise ModelError(f"lock, free: {shown(target)} is neither a coordinate nor the name of a lock; give one of them")
    return normal(name)


LOCKINGS: dict[str, Callable[[str], Locking]] = {"lock": lock, "free": free}
"""Words of model files."""


def actions_of(model: Contents, argument: object, where: str) -> tuple[Action, ...]:
    """The actions that a user wrote. Raises ModelError for anything else, and for names that the model does not have."""
    if argument is None:
        return ()
    if isinstance(argument, (list, tuple, Mapping)) and not argument:
        raise ModelError(f"{where}: {shown(argument)} holds no action; leave it out where the event is only recorded")
    if isinstance(argument, (list, tuple)):
        return tuple(action for each in argument for action in actions_of(model, each, where))
    if isinstance(argument, (Change, Stop, Call, Locking)):
        return (argument,)
    if isinstance(argument, Impact):
        from ncgen.model.argument_readers import value

        return (Impact(value(model, argument.restitution, f"{where}, restitution"), argument.order, argument.rest),)
    if isinstance(argument, str) and argument == STOP:
        return (Stop(),)
    if isinstance(argument, Mapping):
        if set(argument) == {"impact"} and isinstance(argument["impact"], Mapping):
            return actions_of(model, impact(**argument["impact"]), where)
        if len(argument) == 1 and (word := next(iter(argument))) in LOCKINGS and isinstance(argument[word], str):
            return (LOCKINGS[word](argument[word]),)
        return (Change({normal(name): _changed(model, name, value, where) for name, value in argument.items()}),)
    if callable(argument):
        return (Call(cast("Callable[..., Mapping[str, float] | None]", argument)),)
    raise ModelError(
        f'{where}: {shown(argument)} is no action; give "stop", ncgen.impact(…), ncgen.lock(…), ncgen.free(…), '
        "{name: value} or a function"
    )


def _changed(model: Contents, name: object, value: object, where: str) -> Scalar:
    """The new value of something that an event may change."""
    from ncgen.model.argument_readers import expression

    moving = {component.name for component in model.components if not component.fixed}
    if not isinstance(name, str) or (normal(name) not in model.numbers and _rated(normal(name)) not in moving):
        raise ModelError(f"{where}: {shown(name)} cannot be changed; name an input, a parameter or a velocity such as rate(psi)")
    return expression(value, f"{where}, {name}")


def _rated(name: str) -> str:
    """The coordinate whose velocity has this name, or nothing."""
    inner = coordinate_of(name)
    return inner if inner != name else ""
