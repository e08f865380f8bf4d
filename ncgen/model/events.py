"""Declaring events: conditions that end a smooth part of a motion, and what happens then."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from ncgen.errors import ModelError, shown
from ncgen.model.actions import Action, Call, Doing, Impact
from ncgen.model.coordinates import Coordinates
from ncgen.model.facts import fact
from ncgen.model.values import Driven, Scalar

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
    def is_called(self) -> bool:
        """True if it calls a Python function."""
        return any(isinstance(action, Call) for action in self.do)


def called_by(events: Iterable[Event]) -> Iterator[Callable[..., object]]:
    """The Python functions that events call."""
    return (action.function for event in events for action in event.do if isinstance(action, Call))


class Events(Coordinates):
    """The part of a model that owns events."""

    @fact
    def event(self, name: str, when: Driven, direction: str = "falling", do: Doing | None = None) -> Event:
        """Something that happens where an expression passes zero; the run goes on unless the event stops it.

        when: an expression of m.time, coordinates, velocities, parameters and inputs, such as the gap between two points
        direction: "falling" (a gap closes), "rising" or "either"
        do: `ncgen.impact(restitution=0.5)`; {name: value} for other inputs, parameters or velocities ("rate(psi)"), values being numbers or
            expressions; "stop"; a function of the state, which returns such a dictionary or None; or several of these in a list. Without
            it the event is only recorded, in `run.events`
        """
        if name in self.events:
            raise ModelError(f"event {name}: there is one of that name already; choose another")
        if direction not in DIRECTIONS:
            raise ModelError(f"event {name}: direction {shown(direction)} is unknown; choose one of {', '.join(DIRECTIONS)}")
        actions: tuple[Action, ...] = do  # type: ignore[assignment]  # as READERS leave it
        event = Event(name, when, direction, () if do is None else actions)  # type: ignore[arg-type]
        if event.impact and direction != "falling":
            raise ModelError(f"event {name}: an impact happens where a gap closes; its direction is falling")
        self.events[name] = event
        return event
