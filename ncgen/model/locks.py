"""Declaring locks and clutches: constraints that events switch on and off."""

from __future__ import annotations

from dataclasses import replace

from ncgen.errors import ModelError
from ncgen.model.actions import Locking
from ncgen.model.contacts import Contacts
from ncgen.model.displacements import Displacement
from ncgen.model.elements import Component, Relative
from ncgen.model.events import Event, Lock
from ncgen.model.facts import fact
from ncgen.model.values import Driven, Value


class Locks(Contacts):
    """The part of a model that owns locks."""

    @fact
    def lock(self, coordinate: Component | Relative, when: Driven | None = None, until: Driven | None = None, name: str = "") -> Lock:
        """Lock a coordinate where it is, from the start or from an event on; its velocity ends there by an impulse.

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, a length or an angle.
        when : expression, optional
            Of m.time, coordinates, velocities, parameters and inputs: the coordinate is locked where it falls below zero. Without it it is
            locked from the start on.
        until : expression, optional
            The coordinate is freed where this one falls below zero.
        name : str, optional
            By which events lock and free it (`ncgen.lock`, `ncgen.free`). Default: the coordinate with .lock.

        Returns
        -------
        Lock
            The lock.

        Raises
        ------
        ModelError
            For a coordinate that is fixed, and a second lock of a name.
        """
        where = name or f"{coordinate.name}.lock"
        return self._switched(where, Displacement.of(where, coordinate), when, until, when is None)

    @fact
    def clutch(
        self,
        coordinate: Component | Relative,
        other: Component | Relative,
        ratio: Value = 1.0,
        when: Driven | None = None,
        until: Driven | None = None,
        closed: bool = False,
        name: str = "",
    ) -> Lock:
        """Add a clutch, which makes two coordinates move as one while it is closed, coordinate − ratio · other staying what it is.

        Where it closes, an impulse makes their velocities equal: momentum is kept, and the energy that is lost is reported. A clutch that
        slips up to a torque is `friction` between two coordinates.

        Parameters
        ----------
        coordinate, other : Component or Relative
            Two coordinates, lengths or angles.
        ratio : float or expression of parameters
            Velocity of the coordinate over that of the other one while it is closed.
        when, until : expression, optional
            Of m.time, coordinates, velocities, parameters and inputs: it closes where `when` falls below zero, and opens where `until`
            does.
        closed : bool
            Whether it is closed at the start.
        name : str, optional
            By which events close and open it (`ncgen.lock`, `ncgen.free`). Default: both coordinates with .clutch.

        Returns
        -------
        Lock
            The clutch.

        Raises
        ------
        ModelError
            For coordinates that are fixed, and a second clutch of a name.
        """
        where = name or f"{coordinate.name}.{other.name}.clutch"
        return self._switched(where, Displacement.of(where, coordinate, other, ratio), when, until, closed)

    def _switched(self, name: str, along: Displacement, when: Driven | None, until: Driven | None, closed: bool) -> Lock:
        """A lock with its events."""
        if name in self.locks and (self.locks[name].is_declared or len(along.terms) > 1):
            raise ModelError(f"{name}: there is one of that name already; give another name")
        self._lock(name, along)
        self.locks[name] = replace(self.locks[name], closed=closed, is_declared=True)
        for each, condition, closes in ((name, when, True), (f"{name}.free", until, False)):
            if condition is not None:
                self._event(Event(each, condition, "falling", (Locking(name, closes),)))  # type: ignore[arg-type]
        return self.locks[name]
