"""Declaring elements that act in one direction: stops, backlash, ropes and ratchets."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError, one_of
from ncgen.model.actions import Impact, check_order
from ncgen.model.displacements import Displacement
from ncgen.model.elements import Component, Point, Relative
from ncgen.model.events import Event, Events
from ncgen.model.facts import fact
from ncgen.model.kinks import without_kinks
from ncgen.model.value_conditions import Ordered
from ncgen.model.values import Number, Scalar, Value, as_sympy


@dataclass(frozen=True, eq=False)
class Ratchet:
    """What holds a displacement that would fall, by its name. held: name of the parameter that says where it is held"""

    name: str
    along: Displacement
    held: str


@dataclass(frozen=True, eq=False, kw_only=True)
class _Law:
    """Of stops, as `stop` has it."""

    restitution: Value
    stiffness: Value | None
    damping: Value
    exponent: Number
    order: str


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
        order: str = "",
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
            Constants k, d and n of compliant stops, whose force is k δⁿ (1 + d δ̇) where the coordinate is δ beyond them (Hunt and
            Crossley): N/mⁿ or N m/radⁿ, and s/m or s/rad.
        order : str, optional
            Of rigid stops, the law of several impacts at one instant, as of `ncgen.impact`.
        name : str, optional
            Its events have .lower and .upper behind it. Default: the coordinate with .stop.

        Raises
        ------
        ModelError
            Without a stop, and for names that the model has already.
        """
        where = name or f"{coordinate.name}.stop"
        if lower is None and upper is None:
            raise ModelError(f"{where}: neither lower nor upper is given; give one of them")
        if lower is not None and upper is not None:
            self._require(Ordered(lower, "<", upper, f"{where}: lower is {{0}} and upper {{1}}; lower must be less"))
        law = self._law_of_stops(where, restitution, stiffness, damping, exponent, order)
        self._stops(where, Displacement.of(where, coordinate), lower, upper, law)

    @fact
    def backlash(
        self,
        coordinate: Component | Relative,
        other: Component | Relative,
        width: Value,
        ratio: Value = 1.0,
        restitution: Value = 0.0,
        stiffness: Value | None = None,
        damping: Value = 0.0,
        order: str = "",
        name: str = "",
    ) -> None:
        """Add play between two coordinates, such as that of two gears: they move freely within it and carry each other at its ends.

        Parameters
        ----------
        coordinate, other : Component or Relative
            Two coordinates, lengths or angles.
        width : float or expression of parameters
            Of the play, by which coordinate − ratio · other changes from one side to the other (m or rad). Its middle is the initial
            position.
        ratio : float or expression of parameters
            Velocity of the coordinate over that of the other one, where they carry each other; negative for external gears.
        restitution, stiffness, damping, order : float, str
            As of `stop`.
        name : str, optional
            Its events have .lower and .upper behind it. Default: both coordinates with .backlash.

        Raises
        ------
        ModelError
            For a width that is not positive, and for names that the model has already.
        """
        where = name or f"{coordinate.name}.{other.name}.backlash"
        along = Displacement.of(where, coordinate, other, ratio)
        self._require_sign(where, ">", width=width)
        law = self._law_of_stops(where, restitution, stiffness, damping, 1.0, order)
        middle, half = along.initial, as_sympy(width) / 2
        self._stops(where, along, middle - half, middle + half, law)

    @fact
    def ratchet(
        self,
        coordinate: Component | Relative,
        other: Component | Relative | None = None,
        ratio: Value = 1.0,
        direction: str = "rising",
        pitch: Value | None = None,
        order: str = "",
        name: str = "",
    ) -> Ratchet | None:
        """Add a ratchet or freewheel, which lets a coordinate move in one direction and holds it against the other one.

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, a length or an angle.
        other : Component or Relative, optional
            The ratchet lets the coordinate run ahead of ratio · other: an overrunning clutch.
        ratio : float or expression of parameters
            Of the other coordinate.
        direction : str
            In which it moves freely, "rising" or "falling".
        pitch : float or expression of parameters, optional
            Distance of its teeth (m or rad); the first one is where the coordinate is at the start. The coordinate moves back to the last
            tooth that it has passed. Without it it is held wherever it would turn back, as by a freewheel.
        order : str, optional
            As of `ncgen.impact`; with teeth only.
        name : str, optional
            Default: the coordinates with .ratchet.

        Returns
        -------
        Ratchet or None
            The ratchet without teeth; with teeth None, and its events are the name, where a tooth is hit, and the name with .tooth, where
            one is passed.

        Raises
        ------
        ModelError
            For an unknown direction, a pitch that is not positive, and names that the model has already.
        """
        ways = {"rising": 1, "falling": -1}
        along = Displacement.of(name or "ratchet", coordinate, other, ratio, ways[one_of(direction, "ratchet: direction", tuple(ways))])
        where = name or f"{along.name}.ratchet"
        if pitch is None:
            held = self.parameter(f"{where}.held", 0.0)
            self.ratchets[where] = Ratchet(where, along, held.name)
            return self.ratchets[where]
        self._require_sign(where, ">", pitch=pitch)
        tooth = self.parameter(f"{where}.at", 0.0)
        self.beginnings[tooth.name] = along.position
        self._hit(where, along.position - as_sympy(tooth), 0.0, order)
        passed = along.position - as_sympy(tooth) - as_sympy(pitch)
        self.event(f"{where}.tooth", passed, "rising", {tooth.name: as_sympy(tooth) + as_sympy(pitch)})
        return None

    @fact
    def rope(self, start: Point, end: Point, length: Value, restitution: Value = 0.0, order: str = "", name: str = "") -> Event:
        """Add a rope between two points, which only pulls: taut it is a constraint, until it would push.

        Parameters
        ----------
        start, end : Point
            Its ends.
        length : float or expression of parameters
            Length in m.
        restitution : float or expression of parameters
            Factor e of the impact where it becomes taut, u⁺ = −e u⁻.
        order : str, optional
            Law of several impacts at one instant, as of `ncgen.impact`.
        name : str, optional
            Name of its event. Default: rope with both points.

        Returns
        -------
        Event
            The event at which it becomes taut.
        """
        where = name or f"rope.{start.name}.{end.name}"
        gap = -self._excess(where, start, end, length)
        self._check_restitution(where, restitution)
        return self._hit(where, gap, restitution, check_order(order, where))

    @fact
    def strut(self, start: Point, end: Point, length: Value, restitution: Value = 0.0, order: str = "", name: str = "") -> Event:
        """Add a strut between two points, which only pushes: pressed it is a constraint, until it would pull.

        Parameters
        ----------
        start, end : Point
            Its ends.
        length : float or expression of parameters
            Length in m, below which the points do not come.
        restitution : float or expression of parameters
            Factor e of the impact where the points come to this distance, u⁺ = −e u⁻.
        order : str, optional
            Law of several impacts at one instant, as of `ncgen.impact`.
        name : str, optional
            Name of its event. Default: strut with both points.

        Returns
        -------
        Event
            The event at which it begins to push.
        """
        where = name or f"strut.{start.name}.{end.name}"
        gap = self._excess(where, start, end, length)
        self._check_restitution(where, restitution)
        return self._hit(where, gap, restitution, check_order(order, where))

    def _excess(self, where: str, start: Point, end: Point, length: Value) -> Scalar:
        """By how much the square of the distance of two points exceeds that of a length (m²)."""
        self._require_sign(where, ">", length=length)
        square = sum((as_sympy(b) - as_sympy(a)) ** 2 for a, b in zip(start.components, end.components, strict=True))
        return square - as_sympy(length) ** 2

    def _law_of_stops(self, where: str, restitution: Value, stiffness: Value | None, damping: Value, exponent: Number, order: str) -> _Law:
        """What stops do. Raises ModelError for numbers and words that are not theirs."""
        self._check_restitution(where, restitution)
        self._require_sign(where, ">=", damping=damping)
        self._require_sign(where, ">", exponent=exponent, **({} if stiffness is None else {"stiffness": stiffness}))
        return _Law(restitution=restitution, stiffness=stiffness, damping=damping, exponent=exponent, order=check_order(order, where))

    def _stops(self, where: str, along: Displacement, lower: Value | None, upper: Value | None, law: _Law) -> None:
        """Rigid or compliant stops of a displacement."""
        for side, limit, way in (("lower", lower, 1), ("upper", upper, -1)):
            if limit is None:
                continue
            name, gap = f"{where}.{side}", way * (along.position - as_sympy(limit))
            if law.stiffness is None:
                self._hit(name, gap, law.restitution, law.order)
                continue
            push = self._compliant_push(name, gap, way * along.rate, law.stiffness, law.damping, law.exponent)
            self._apply(name, along.forces(way * push))

    def _compliant_push(self, name: str, gap: Scalar, rate: Scalar, stiffness: Value, damping: Value, exponent: Number) -> Scalar:
        """The load k δⁿ (1 + d δ̇) of a gap that is −δ, while it is closed, at the start as well (Hunt and Crossley).

        With the events that begin and end it, where steps end. rate: of the gap
        """
        from sympy import Piecewise

        touches = self.input(f"{name}.touches")
        self.beginnings[touches.name] = without_kinks(Piecewise((1.0, gap < 0), (0.0, True)), name)  # type: ignore[operator]
        self.event(name, gap, "falling", {touches.name: 1.0})
        self.event(f"{name}.left", gap, "rising", {touches.name: 0.0})
        return as_sympy(touches) * as_sympy(stiffness) * abs(gap) ** exponent * (1 - as_sympy(damping) * rate)

    def _hit(self, name: str, gap: Scalar, restitution: Value, order: str) -> Event:
        """An event that hits where a gap closes."""
        return self._event(Event(name, gap, "falling", (Impact(restitution, order),)))
