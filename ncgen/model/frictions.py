"""Declaring dry friction that sticks."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError
from ncgen.model.catalogue import ROW_TYPES
from ncgen.model.displacements import Displacement
from ncgen.model.elements import Component, Relative
from ncgen.model.expressions import is_symbolic, symbols_in
from ncgen.model.facts import fact
from ncgen.model.kinks import without_kinks
from ncgen.model.one_sided import OneSided
from ncgen.model.rows import Row
from ncgen.model.value_conditions import Ordered
from ncgen.model.values import Driven, Scalar, Value, as_sympy, is_number

MOST_LOADED = 4
"""Frictions of one model that follow loads: their loads depend on each other, and all 2⁴ combinations of signs are looked at."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Friction:
    """Dry friction along a displacement, by its name. static: N or N m; with a load the coefficient that this is multiplied by

    slip, held: names of the input that says in which direction it slips, and of the parameter that says where it sticks
    load: number of the constraint that presses, None where friction depends on none; across: of another one, with which the load is the
    root of the sum of both squares
    """

    name: str
    along: Displacement
    static: Scalar
    slip: str
    held: str
    load: int | None = None
    across: int | None = None

    @property
    def pressed(self) -> tuple[int, ...]:
        """Numbers of the constraints that press."""
        return tuple(each for each in (self.load, self.across) if each is not None)


class Frictions(OneSided):
    """The part of a model that owns dry friction."""

    @fact
    def friction(
        self,
        coordinate: Component | Relative,
        coulomb: Driven | None = None,
        static: Driven | None = None,
        viscous: Value = 0.0,
        stribeck: Value | None = None,
        other: Component | Relative | None = None,
        ratio: Value = 1.0,
        name: str = "",
        coefficient: Value | None = None,
        load: Row | None = None,
        across: Row | None = None,
    ) -> Friction:
        """Add dry friction along a coordinate or between two, which sticks exactly: as a constraint, until it exceeds static friction.

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, a length or an angle.
        coulomb : float or expression, optional
            Sliding friction in N, or N m about an angle, of parameters, or of inputs, time, coordinates and velocities: a brake. Where
            such an expression is negative, there is no friction.
        static : float or expression, optional
            Static friction; no less than coulomb. Default: coulomb.
        viscous : float or expression of parameters
            Viscous friction in N s/m, or N m s.
        stribeck : float or expression of parameters, optional
            Velocity in m/s or rad/s over which sliding friction falls from static to coulomb, by exp(−|v|/stribeck). Without it it falls at
            once.
        other : Component or Relative, optional
            Another coordinate; friction then acts between both, along coordinate − ratio · other: a clutch that slips.
        ratio : float or expression of parameters
            Of the other coordinate.
        name : str, optional
            Default: the coordinates with .friction.
        coefficient : float or expression of parameters, optional
            Friction over the size of the load, sliding and static: μ along a length, μ times the radius in m about an angle. It takes the
            place of coulomb.
        load : Row, optional
            What presses: a constraint that `m.constrain` or `m.constrain_velocity` returned, or its label. Its load is in N where its
            expression is a length in m, or a velocity in m/s, across the surfaces.
        across : Row, optional
            Another such constraint, at a right angle to the first: what presses is √(load² + across²), as in a pin.

        Returns
        -------
        Friction
            The friction, whose name run.events has.

        Raises
        ------
        ModelError
            For numbers out of range, for a load without coefficient or with a friction of its own, and for what has no single load.
        """
        from sympy import exp

        where = name or f"{coordinate.name if other is None else f'{coordinate.name}.{other.name}'}.friction"
        if where in self.frictions:
            raise ModelError(f"friction {where}: there is one of that name already; give another name")
        along = Displacement.of(where, coordinate, other, ratio)
        self._require_sign(where, ">=", viscous=viscous)
        if load is not None or coefficient is not None or across is not None:
            others = {"coulomb": coulomb, "static": static, "stribeck": stribeck}
            return self._pressed(where, along, viscous, coefficient, (load, across), others)
        if coulomb is None:
            raise ModelError(f"{where}: there is no friction; give coulomb, or coefficient and load")
        if stribeck is not None:
            self._require_sign(where, ">", stribeck=stribeck)
        least, most = self._limits(where, as_sympy(coulomb), None if static is None else as_sympy(static))
        slip, held = self.input(f"{where}.slip"), self.parameter(f"{where}.held", 0.0)
        sliding = least
        if stribeck is not None:
            sliding += (most - least) * exp(-as_sympy(slip) * along.rate / as_sympy(stribeck))
        self._apply(where, along.forces(-as_sympy(slip) * sliding - as_sympy(viscous) * along.rate))
        self.frictions[where] = Friction(name=where, along=along, static=most, slip=slip.name, held=held.name)
        return self.frictions[where]

    def _pressed(
        self,
        where: str,
        along: Displacement,
        viscous: Value,
        coefficient: Value | None,
        pressing: tuple[Row | None, Row | None],
        others: dict[str, object],
    ) -> Friction:
        """Friction that follows the load of a constraint, or of two."""
        load, across = pressing
        if coefficient is None or load is None:
            raise ModelError(f"{where}: coefficient and load belong together; give both, or coulomb")
        if conflicts := [word for word, value in others.items() if value is not None]:
            raise ModelError(f"{where}: {conflicts[0]} does not go with the friction of a load; leave it out, or coefficient and load")
        rows = [row for row in (load, across) if row is not None]
        for row in rows:
            if row.type is not None and row.type is not ROW_TYPES["follow"]:
                raise ModelError(
                    f"{where}: load {row.label} is a scaled constraint, whose multiplier is no force; write it by m.constrain, in m"
                )
        if load is across:
            raise ModelError(f"{where}: load and across are the same constraint {load.label}; leave across out")
        self._require_sign(where, ">=", coefficient=coefficient)
        self._require_room(where, across is not None)
        slip, held = self.input(f"{where}.slip"), self.parameter(f"{where}.held", 0.0)
        if not (is_number(viscous) and viscous == 0.0):
            self._apply(where, along.forces(-as_sympy(viscous) * along.rate))
        numbers = [next(k for k, row in enumerate(self.rows) if row is each) for each in rows]
        loads = dict(zip(("load", "across"), numbers, strict=False))
        self.frictions[where] = Friction(name=where, along=along, static=as_sympy(coefficient), slip=slip.name, held=held.name, **loads)
        return self.frictions[where]

    def _require_room(self, where: str, is_of_two: bool) -> None:
        """Raise ModelError where the loads of another friction could not be solved with those of the ones that the model has."""
        loaded = [each for each in self.frictions.values() if each.load is not None]
        if len(loaded) == MOST_LOADED:
            raise ModelError(f"{where}: {MOST_LOADED} frictions follow loads already, as many as a model can have; give coulomb")
        if alone := next((each.name for each in loaded if is_of_two or each.across is not None), None):
            raise ModelError(
                f"{where}: friction {alone} follows loads as well, and one with across must be the only such friction of a model; "
                "leave across out, or give coulomb"
            )

    def _limits(self, where: str, coulomb: Scalar, static: Scalar | None) -> tuple[Scalar, Scalar]:
        """Sliding and static friction. What parameters alone determine is checked; other expressions count as 0 where they are
        negative, and static friction as no less than sliding friction."""
        from sympy import Max

        most = coulomb if static is None else static
        if self._is_constant(coulomb) and self._is_constant(most):
            self._require_sign(where, ">=", coulomb=coulomb)
            if static is not None:
                self._require(Ordered(coulomb, "<=", static, f"{where}: static is {{1}}, less than coulomb, {{0}}; give at least as much"))
            return coulomb, most
        least = Max(0, coulomb)
        return without_kinks(least, where), without_kinks(least if static is None else Max(least, static), where)

    def _is_constant(self, value: Scalar) -> bool:
        """Whether it is a number or an expression of parameters."""
        return not is_symbolic(value) or {s.name for s in symbols_in(value)} <= set(self.parameters)
