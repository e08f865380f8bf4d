"""Declaring dry friction that sticks."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError
from ncgen.model.conditions import Ordered
from ncgen.model.elements import Component, Relative
from ncgen.model.events import component_of
from ncgen.model.facts import fact
from ncgen.model.one_sided import OneSided
from ncgen.model.values import Value, as_sympy


@dataclass(frozen=True, eq=False)
class Friction:
    """Dry friction along a coordinate, by its name. static: N or N m; slip, held: names of the input that says in which direction it slips,
    and of the parameter that says where it sticks"""

    name: str
    coordinate: str
    static: Value
    slip: str
    held: str


class Frictions(OneSided):
    """The part of a model that owns dry friction."""

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
        if static is not None:
            self._require(Ordered(coulomb, "<=", static, f"{where}: static is {{1}}, less than coulomb, {{0}}; give at least as much"))
        slip, held = self.input(f"{where}.slip"), self.parameter(f"{where}.held", 0.0)
        sliding = as_sympy(coulomb)
        if stribeck is not None:
            sliding += (as_sympy(most) - as_sympy(coulomb)) * exp(-as_sympy(slip) * coordinate.rate / as_sympy(stribeck))
        component = component_of(coordinate)
        self._apply(where, [(component, -as_sympy(slip) * sliding - as_sympy(viscous) * coordinate.rate)])
        self.frictions[where] = Friction(where, component.name, most, slip.name, held.name)
        return self.frictions[where]
