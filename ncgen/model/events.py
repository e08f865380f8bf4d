"""Declaring events: conditions that end a smooth part of a motion, and what happens then."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

from ncgen.errors import ModelError, one_of
from ncgen.model.actions import Action, Call, Doing, Impact, Locking, Stop
from ncgen.model.displacements import Displacement
from ncgen.model.expressions import is_symbolic, symbols_in
from ncgen.model.facts import fact
from ncgen.model.loads import Loads
from ncgen.model.value_conditions import Between, Bound
from ncgen.model.values import Driven, Scalar, Value

Direction: TypeAlias = Literal["falling", "either", "rising"]

DIRECTIONS: tuple[Direction, ...] = get_args(Direction)


@dataclass(frozen=True, eq=False)
class Event:
    """A condition, an expression of time, coordinates, velocities, parameters and inputs that passes zero, and what is done then."""

    name: str
    when: Scalar
    direction: Direction
    do: tuple[Action, ...]

    @property
    def impact(self) -> Impact | None:
        """Its impact, if it is one."""
        return next((action for action in self.do if isinstance(action, Impact)), None)

    @property
    def is_last(self) -> bool:
        """True if it may end a run."""
        return any(isinstance(action, Stop) for action in self.do) or (self.impact is not None and self.impact.rest == "end")

    @property
    def is_called(self) -> bool:
        """True if it calls a Python function."""
        return any(isinstance(action, Call) for action in self.do)


@dataclass(frozen=True, eq=False, kw_only=True)
class Lock:
    """A constraint that events switch on and off: a displacement stays where it is.

    held: name of the parameter that says where; closed: whether it is from the start on
    is_declared: False where an event named a coordinate
    """

    name: str
    along: Displacement
    held: str
    closed: bool = False
    is_declared: bool = False


def called_by(events: Iterable[Event]) -> Iterator[Callable[..., object]]:
    """The Python functions that events call."""
    return (action.function for event in events for action in event.do if isinstance(action, Call))


class Events(Loads):
    """The part of a model that owns events."""

    @fact
    def event(self, name: str, when: Driven, direction: str = "falling", do: Doing | None = None) -> Event:
        """Add an event, which happens where an expression passes zero; the run continues unless the event stops it.

        Parameters
        ----------
        name : str
            Name in `run.events`.
        when : expression
            Of m.time, coordinates, velocities, parameters and inputs, such as the gap between two points.
        direction : str
            "falling" (a gap closes), "rising" or "either".
        do : action, optional
            `ncgen.impact(restitution=0.5)`; `ncgen.lock(psi)` or `ncgen.free(psi)`; {name: value} for other inputs, parameters or
            velocities ("rate(psi)"), values being numbers or expressions; "stop"; a function of the state that returns such a dictionary or
            None; or a list of these. Default: the event is only recorded.

        Returns
        -------
        Event
            The event.

        Raises
        ------
        ModelError
            For a name that another event has, and for an impact whose condition is not a falling gap of positions.
        """
        one_of(direction, f"event {name}: direction", DIRECTIONS)
        actions: tuple[Action, ...] = do or ()  # type: ignore[assignment]  # as READERS leave them
        event = Event(name, when, direction, tuple(self._resolved(action, f"event {name}, do") for action in actions))  # type: ignore[arg-type]
        if event.impact:
            self._check_restitution(f"event {name}, do", event.impact.restitution)
        if event.impact and direction != "falling":
            raise ModelError(f"event {name}: an impact happens where a gap closes; its direction is falling")
        if event.impact and (coordinate := self._no_position(event.when)):
            raise ModelError(f"event {name}: {coordinate} stands in the gap of an impact, which is one of positions, time and parameters")
        return self._event(event)

    def _event(self, event: Event) -> Event:
        """Add one. Raises ModelError for a second one of its name."""
        if event.name in self.events:
            raise ModelError(f"event {event.name}: there is one of that name already; choose another")
        self.events[event.name] = event
        return event

    def _resolved(self, action: Action, where: str) -> Action:
        """An action that names a coordinate names its lock, which is made where there is none."""
        if not isinstance(action, Locking) or action.lock in self.locks:
            return action
        from ncgen.model.argument_readers import coordinate

        return replace(action, lock=self._lock(f"{action.lock}.lock", Displacement.of(where, coordinate(self, action.lock, where))).name)

    def _lock(self, name: str, along: Displacement) -> Lock:
        """The lock of this name, which is open where it is new."""
        if name not in self.locks:
            self.locks[name] = Lock(name=name, along=along, held=self.parameter(f"{name}.held", 0.0).name)
        return self.locks[name]

    def _no_position(self, when: Scalar) -> str:
        """The name of a velocity or an input in an expression, or nothing."""
        names = sorted(s.name for s in symbols_in(when)) if is_symbolic(when) else []
        return next((name for name in names if name.startswith("rate(") or name in self.inputs), "")

    def _require_sign(self, where: str, relation: Literal[">", ">="], **values: Value) -> None:
        """Refuse values that are negative, or zero where the relation says so, now and wherever parameters are given."""
        remedy = "give a number above 0" if relation == ">" else "give a number that is not negative"
        for name, value in values.items():
            self._require(Bound(wording=f"{where}: {name} is", value=value, relation=relation, unit="", remedy=remedy))

    def _check_restitution(self, where: str, restitution: Value) -> None:
        """Refuse one outside 0 to 1, now and wherever parameters are given."""
        self._require(Between(f"{where}: restitution", restitution, 0.0, 1.0))
