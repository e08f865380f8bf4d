"""Declaring events: conditions that end a smooth part of a motion, and what happens then."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from ncgen.errors import ModelError, one_of
from ncgen.model.actions import Action, Call, Doing, Impact, actions_of
from ncgen.model.conditions import Bound
from ncgen.model.elements import Component, Point, Relative
from ncgen.model.expressions import is_symbolic, symbols_in
from ncgen.model.facts import fact
from ncgen.model.loads import Loads
from ncgen.model.values import Driven, Number, Scalar, Value, as_sympy

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


@dataclass(frozen=True, eq=False)
class Friction:
    """Dry friction along a coordinate, by its name. static: N or N m; slip, held: names of the input that says in which direction it slips,
    and of the parameter that says where it sticks"""

    name: str
    coordinate: str
    static: Value
    slip: str
    held: str


def called_by(events: Iterable[Event]) -> Iterator[Callable[..., object]]:
    """The Python functions that events call."""
    return (action.function for event in events for action in event.do if isinstance(action, Call))


class Events(Loads):
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
        one_of(direction, f"event {name}: direction", DIRECTIONS)
        actions: tuple[Action, ...] = do  # type: ignore[assignment]  # as READERS leave it
        event = Event(name, when, direction, () if do is None else actions)  # type: ignore[arg-type]
        if event.impact and direction != "falling":
            raise ModelError(f"event {name}: an impact happens where a gap closes; its direction is falling")
        if event.impact and (found := self._no_position(event.when)):
            raise ModelError(f"event {name}: {found} stands in the gap of an impact, which is one of positions, time and parameters")
        self.events[name] = event
        return event

    def _no_position(self, when: Scalar) -> str:
        """The name of a velocity or an input in an expression, or nothing."""
        names = sorted(s.name for s in symbols_in(when)) if is_symbolic(when) else []
        return next((name for name in names if name.startswith("rate(") or name in self.inputs), "")

    @fact
    def stop(
        self,
        coordinate: Component | Relative,
        lower: Value | None = None,
        upper: Value | None = None,
        restitution: Value = 0.0,
        stiffness: Value | None = None,
        damping: Value = 0.0,
        exponent: Number = 1.0,
        name: str = "",
    ) -> None:
        """Add end stops of a coordinate, rigid, or compliant where a stiffness is given.

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, a length or an angle.
        lower, upper : float or expression of parameters, optional
            Where the stops are, in m or rad.
        restitution : float or expression of parameters
            Of rigid stops. A coordinate that comes to rest at its stop is held as long as it is pushed.
        stiffness, damping, exponent : float
            k, d and n of compliant stops, whose force is k δⁿ (1 + d δ̇) where the coordinate is δ beyond them (Hunt and Crossley): N/mⁿ or
            N m/radⁿ, and s/m or s/rad.
        name : str, optional
            Its events have .lower and .upper behind it. Default: the coordinate with .stop.

        Raises
        ------
        ModelError
            Without a stop, and for names that the model has already.
        """
        where, x = name or f"{coordinate.name}.stop", as_sympy(coordinate)
        self._check_moving(coordinate, where)
        if lower is None and upper is None:
            raise ModelError(f"{where}: neither lower nor upper is given; give one of them")
        if lower is not None and upper is not None and not (low := self._number(lower, where)) < (high := self._number(upper, where)):
            raise ModelError(f"{where}: lower is {low:g} and upper {high:g}; lower must be less")
        self._require_sign(where, ">=", damping=damping)
        self._require_sign(where, ">", exponent=exponent, **({} if stiffness is None else {"stiffness": stiffness}))
        rigid = actions_of(self, Impact(restitution), where)
        gaps = (("lower", lower, lambda v: x - v, 1.0), ("upper", upper, lambda v: v - x, -1.0))
        for side, limit, gap, way in gaps:
            if limit is None:
                continue
            if stiffness is None:
                self.event(f"{where}.{side}", gap(as_sympy(limit)), "falling", rigid)
                continue
            touches, depth, rate = self.input(f"{where}.{side}.touches"), -gap(as_sympy(limit)), -way * coordinate.rate
            push = as_sympy(touches) * as_sympy(stiffness) * abs(depth) ** exponent * (1 + as_sympy(damping) * rate)
            self._apply(f"{where}, {side}", [(_component(coordinate), way * push)])
            self.event(f"{where}.{side}", gap(as_sympy(limit)), "falling", {touches.name: 1.0})
            self.event(f"{where}.{side}.left", gap(as_sympy(limit)), "rising", {touches.name: 0.0})

    @fact
    def rope(self, start: Point, end: Point, length: Value, restitution: Value = 0.0, name: str = "") -> Event:
        """Add a rope between two points, which only pulls: taut it is a constraint, until it would push.

        Parameters
        ----------
        start, end : Point
            Its ends.
        length : float or expression of parameters
            Length in m.
        restitution : float or expression of parameters
            e of the impact where it becomes taut, u⁺ = −e u⁻.
        name : str, optional
            Name of its event. Default: rope with both points.

        Returns
        -------
        Event
            The event at which it becomes taut.
        """
        where = name or f"rope.{start.name}.{end.name}"
        self._require_sign(where, ">", length=length)
        square = sum((as_sympy(b) - as_sympy(a)) ** 2 for a, b in zip(start.components, end.components, strict=True))
        return self.event(where, as_sympy(length) ** 2 - square, "falling", actions_of(self, Impact(restitution), where))

    @fact
    def friction(
        self,
        coordinate: Component | Relative,
        coulomb: Value,
        static: Value | None = None,
        viscous: Value = 0.0,
        stribeck: Value | None = None,
        name: str = "",
    ) -> Friction:
        """Add dry friction along a coordinate, which sticks exactly: as a constraint, until its force exceeds static friction.

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, a length or an angle.
        coulomb : float or expression of parameters
            Sliding friction in N, or N m about an angle.
        static : float or expression of parameters, optional
            Static friction. Default: coulomb.
        viscous : float or expression of parameters
            Viscous friction in N s/m, or N m s.
        stribeck : float or expression of parameters, optional
            Velocity in m/s or rad/s over which sliding friction falls from static to coulomb, by exp(−|v|/stribeck). Without it it falls at
            once.
        name : str, optional
            Default: the coordinate with .friction.

        Returns
        -------
        Friction
            The friction, whose name run.events has.
        """
        from sympy import exp

        where = name or f"{coordinate.name}.friction"
        if where in self.frictions:
            raise ModelError(f"friction {where}: there is one of that name already; give another name")
        self._check_moving(coordinate, where)
        most = coulomb if static is None else static
        self._require_sign(where, ">=", coulomb=coulomb, viscous=viscous)
        if stribeck is not None:
            self._require_sign(where, ">", stribeck=stribeck)
        if (least := self._number(coulomb, where)) > (largest := self._number(most, where)):
            raise ModelError(f"{where}: static is {largest:g}, less than coulomb, {least:g}; give at least as much")
        slip, held = self.input(f"{where}.slip"), self.parameter(f"{where}.held", 0.0)
        sliding = as_sympy(coulomb)
        if stribeck is not None:
            sliding += (as_sympy(most) - as_sympy(coulomb)) * exp(-as_sympy(slip) * coordinate.rate / as_sympy(stribeck))
        component = _component(coordinate)
        self._apply(where, [(component, -as_sympy(slip) * sliding - as_sympy(viscous) * coordinate.rate)])
        self.frictions[where] = Friction(where, component.name, most, slip.name, held.name)
        return self.frictions[where]

    def _require_sign(self, where: str, relation: Literal[">", ">="], **values: Value) -> None:
        """Refuse values that are negative, or zero where the relation says so, now and wherever parameters are given."""
        remedy = "give a number above 0" if relation == ">" else "give a number that is not negative"
        for name, value in values.items():
            self._require(Bound(f"{where}: {name} is", value, relation, "", remedy))

    def _check_moving(self, coordinate: Component | Relative, where: str) -> None:
        """Raise ModelError for a fixed coordinate."""
        if getattr(coordinate, "fixed", False):
            raise ModelError(f"{where}: the coordinate is fixed; name one that moves")


def _component(coordinate: Component | Relative) -> Component:
    return coordinate if isinstance(coordinate, Component) else coordinate.components[0]
