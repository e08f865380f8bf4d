"""Declaring elements that act in one direction: stops and ropes."""

from __future__ import annotations

from ncgen.errors import ModelError
from ncgen.model.actions import Impact
from ncgen.model.conditions import Ordered
from ncgen.model.elements import Component, Point, Relative
from ncgen.model.events import Event, Events, component_of
from ncgen.model.facts import fact
from ncgen.model.values import Number, Scalar, Value, as_sympy


class OneSided(Events):
    """The part of a model that owns what holds in one direction only."""

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
        if lower is not None and upper is not None:
            self._require(Ordered(lower, "<", upper, f"{where}: lower is {{0}} and upper {{1}}; lower must be less"))
        self._check_restitution(where, restitution)
        self._require_sign(where, ">=", damping=damping)
        self._require_sign(where, ">", exponent=exponent, **({} if stiffness is None else {"stiffness": stiffness}))
        gaps = (("lower", lower, lambda v: x - v, 1.0), ("upper", upper, lambda v: v - x, -1.0))
        for side, limit, gap, way in gaps:
            if limit is None:
                continue
            if stiffness is None:
                self._hit(f"{where}.{side}", gap(as_sympy(limit)), restitution)
                continue
            touches, depth, rate = self.input(f"{where}.{side}.touches"), -gap(as_sympy(limit)), -way * coordinate.rate
            push = as_sympy(touches) * as_sympy(stiffness) * abs(depth) ** exponent * (1 + as_sympy(damping) * rate)
            self._apply(f"{where}, {side}", [(component_of(coordinate), way * push)])
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
        self._check_restitution(where, restitution)
        square = sum((as_sympy(b) - as_sympy(a)) ** 2 for a, b in zip(start.components, end.components, strict=True))
        return self._hit(where, as_sympy(length) ** 2 - square, restitution)

    def _hit(self, name: str, gap: Scalar, restitution: Value) -> Event:
        """An event that hits where a gap closes."""
        return self._event(Event(name, gap, "falling", (Impact(restitution),)))
