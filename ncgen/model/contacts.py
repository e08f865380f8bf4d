"""Declaring contacts: two surfaces of bodies that touch, slide, roll and stick, or bounce."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError, one_of, shown
from ncgen.model.actions import impact
from ncgen.model.bodies import Body
from ncgen.model.curves import Curve
from ncgen.model.elements import Direction, Point
from ncgen.model.events import Event
from ncgen.model.facts import fact
from ncgen.model.frictions import Frictions
from ncgen.model.touching import ContactSurface, Tip, Touching, touching
from ncgen.model.value_conditions import Between, Bound
from ncgen.model.values import Expression, Number, Scalar, Value, as_sympy, is_number, symbol_of

LAWS = ("newton", "poisson")
"""Of impact: the velocity of the gap is reversed times the restitution, or the impulse of the compression is returned times it."""

REST = 1e-11
"""A contact in space comes to rest at this share of the largest velocity of its slide, in as much of the time that the slide takes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact:
    """A rigid contact with friction, by the name of its event.

    place: of what touches, three expressions (m); none of a contact that is given by expressions
    sliding: m/s, one expression in the plane, two in space; friction: coefficient; tangential: restitution of the sliding velocity
    slip: names of the parameters that say in which direction it slides: 1 or −1 in the plane; in space a vector of that direction, as long
    as the largest velocity (m/s) of the present slide is known to be
    """

    name: str
    position: tuple[Scalar, ...]
    sliding: tuple[Scalar, ...]
    friction: Value
    tangential: Value
    law: str
    slip: tuple[str, ...]

    @property
    def along(self) -> Scalar:
        """The sliding velocity in the direction in which it slides, times the length of `slip`."""
        return sum(as_sympy(w) * symbol_of(name) for w, name in zip(self.sliding, self.slip, strict=True))

    @property
    def forward(self) -> Scalar:
        """Positive as long as it slides on. In space friction has no direction at rest, and an integrator comes near that only."""
        if len(self.slip) == 1:
            return self.along
        return self.along - REST * sum(symbol_of(name) ** 2 for name in self.slip)

    @property
    def kept(self) -> Scalar:
        """In space: positive as long as the sliding velocity has turned by less than 45° from the direction in which it slid, and where
        it is so small that it may be rounding."""
        w, d = [as_sympy(x) for x in self.sliding], [symbol_of(name) for name in self.slip]
        length = sum(x * x for x in d)
        return 2 * self.along**2 + length * (REST**2 * length - sum(x * x for x in w))


class Contacts(Frictions):
    """The part of a model that owns contacts."""

    @fact
    def contact(
        self,
        name: str,
        body: Body,
        point: Point,
        on: Body,
        at: Point,
        *,
        radius: Value = 0.0,
        edge: Direction | None = None,
        normal: Direction | None = None,
        axis: Direction | None = None,
        around: Value | None = None,
        curve: Curve | None = None,
        start: Direction | None = None,
        inside: bool = False,
        friction: Value = 0.0,
        restitution: Value = 0.0,
        tangential: Value = 0.0,
        law: str = "newton",
        order: str = "",
        rest: str = "hold",
        stiffness: Value | None = None,
        damping: Value = 0.0,
        exponent: Number = 1.0,
    ) -> Event:
        """Add a contact of a point, a sphere or the rim of a disc of one body with a surface of another body.

        Parameters
        ----------
        name : str
            Name of the contact in run.events.
        body, point : Body, Point
            The first body, and its point that touches; or the centre of its sphere (radius) or of its disc (radius and edge).
        on, at : Body, Point
            The second body, which may be the ground, and a point of it: one of the plane, or of the cylinder's axis, or the centre of the
            sphere or of the curve. In the plane a sphere is a circle.
        radius : float or expression of parameters
            Radius in m of the sphere about point; 0 for the point itself.
        edge : Direction, optional
            Axis of a disc, whose rim of that radius touches.
        normal : Direction, optional
            Of the plane, towards the first body.
        axis : Direction, optional
            Of the cylinder, whose radius is around.
        around : float or expression of parameters, optional
            Radius in m of the sphere about at, or of the cylinder.
        curve, start : Curve, Direction, optional
            The distance in m of point from at where they touch, over the angle in rad from the direction start, such as the profile of a
            cam; for a sphere this is the path of its centre, the pitch curve.
        inside : bool
            True where the first body is inside the sphere or cylinder.
        friction : float or expression of parameters
            Coefficient of Coulomb's friction. Where a contact does not slide it sticks or rolls exactly.
        restitution, tangential : float or expression of parameters
            Factors e of the gap's velocity and of the sliding velocity, w⁺ = −e w⁻ where the impulse sticks.
        law : str
            "newton" (u⁺ = −e u⁻) or "poisson" (impulses of compression and restitution, Λ = e Λ).
        order, rest : str
            As of `ncgen.impact`: order says what holds where several contacts close at one instant.
        stiffness, damping, exponent : float
            Constants k, d and n of a compliant contact without friction, whose force is k δⁿ (1 + d δ̇): N/mⁿ, and s/m.

        Returns
        -------
        Event
            The event at which it closes.

        Raises
        ------
        ModelError
            For surfaces that cannot touch, numbers out of range, and compliant contacts with friction or restitution.
        """
        where = f"contact {name}"
        ways = [normal is not None, around is not None, curve is not None]
        if sum(ways) != 1 or (axis is not None and around is None) or (start is None) != (curve is None):
            raise ModelError(
                f"{where}: one surface is needed at {at.name}; give normal (plane), around (sphere), axis and around (cylinder), or curve "
                "and start"
            )
        self._check_sizes(where, radius, edge, around, inside)
        self._check_bearers(where, body, point, on, at)
        tip = Tip(body, point, radius, edge)
        surface = ContactSurface(
            body=on,
            point=at,
            normal=normal,
            axis=axis,
            radius=0.0 if around is None else around,
            inside=inside,
            curve=curve,
            start=start,
            is_ground=on is self.ground,
        )
        numbers = {c.name: c.initial for c in self.components} | {p.name: p.default for p in self.parameters.values()}
        contact_pair = touching(tip, surface, numbers, where)
        if stiffness is not None:
            coefficients = {"friction": friction, "restitution": restitution, "tangential": tangential}
            self._comply(name, contact_pair.gap, stiffness, damping, exponent, coefficients)
            return self.events[name]
        if not (is_number(damping) and damping == 0.0 and exponent == 1.0):
            raise ModelError(f"{where}: damping and exponent belong to a compliant contact; give its stiffness, or leave them out")
        self._rub(name, contact_pair, friction, tangential, law)
        return self.event(name, contact_pair.gap, "falling", impact(restitution, order, rest))

    @fact
    def gap_contact(
        self,
        name: str,
        gap: Expression,
        sliding: Expression,
        friction: Value = 0.0,
        restitution: Value = 0.0,
        tangential: Value = 0.0,
        law: str = "newton",
        order: str = "",
        rest: str = "hold",
    ) -> Event:
        """Add a rigid contact that is given by expressions: of surfaces that `contact` does not have, or of coordinates of any meaning.

        Parameters
        ----------
        name : str
            Name of the contact in run.events.
        gap : expression of coordinates and parameters
            The gap in m, negative where the bodies overlap. Friction is the coefficient times its load, so its slope by the distance of the
            surfaces should be 1 where it vanishes.
        sliding : expression of coordinates, rates and parameters
            The velocity in m/s at which the surfaces slide past each other, linear in rates. Friction acts on the coordinates as its power
            says.
        friction, restitution, tangential, law, order, rest : float, str
            As of `contact`.

        Returns
        -------
        Event
            The event at which it closes.

        Raises
        ------
        ModelError
            For numbers out of range, and for a sliding velocity that is not linear in rates.
        """
        import sympy

        where, velocity = f"contact {name}", sympy.Add(as_sympy(sliding))
        rates = [c.rate for c in self.components if not c.fixed and c.rate in velocity.free_symbols]
        if not rates or any(velocity.diff(a, b) != 0 for a in rates for b in rates) or velocity.subs(dict.fromkeys(rates, 0)) != 0:
            raise ModelError(f"{where}: the sliding velocity is {shown(sliding)}; give a sum of coefficients times rates")
        self._rub(name, Touching(as_sympy(gap), (), (velocity,)), friction, tangential, law)
        return self.event(name, gap, "falling", impact(restitution, order, rest))

    # -- helpers -------------------------------------------------------------------------------

    def _check_sizes(self, where: str, radius: Value, edge: Direction | None, around: Value | None, inside: bool) -> None:
        self._require(
            Bound(
                wording=f"{where}: radius is", value=radius, relation=">=" if edge is None else ">", unit="m", remedy="give a positive one"
            )
        )
        if around is None:
            if inside:
                raise ModelError(f"{where}: inside is of a sphere or a cylinder; give around, or leave it out")
            return
        self._require(Bound(wording=f"{where}: around is", value=around, relation=">", unit="m", remedy="give a positive radius"))
        if inside:
            room = as_sympy(around) - as_sympy(radius)
            self._require(
                Bound(
                    wording=f"{where}: around less radius is", value=room, relation=">", unit="m", remedy="what is inside must be smaller"
                )
            )

    def _check_bearers(self, where: str, body: Body, point: Point, on: Body, at: Point) -> None:
        if body is self.ground:
            raise ModelError(f"{where}: the ground is its first body; give the one that moves first")
        if body is on:
            raise ModelError(f"{where}: both sides belong to body {body.name}, whose points keep their distances; give two bodies")
        for each, touching_point in ((body, point), (on, at)):
            if touching_point not in each.elements and not (each is self.ground and touching_point.fixed):
                raise ModelError(f"{where}: {touching_point.name} is not a point of {each.name}; give one of its points")

    def _rub(self, name: str, contact_pair: Touching, friction: Value, tangential: Value, law: str) -> None:
        """Keep the friction of a rigid contact, unless it has none."""
        where = f"contact {name}"
        one_of(law, f"{where}: law", LAWS)
        self._require_sign(where, ">=", friction=friction)
        self._require(Between(f"{where}: tangential restitution", tangential, 0.0, 1.0))
        if is_number(friction) and friction == 0.0:
            if not (is_number(tangential) and tangential == 0.0):
                raise ModelError(f"{where}: tangential restitution needs friction, which is 0; give friction, or leave tangential out")
            if law != "poisson":
                return
        if law == "poisson" and not (is_number(tangential) and tangential == 0.0):
            raise ModelError(f'{where}: tangential restitution goes with law="newton" only; leave one of the two out')
        marks = ("slip",) if len(contact_pair.sliding) == 1 else ("slip1", "slip2")
        slip = tuple(self.parameter(f"{name}.{mark}", 0.0).name for mark in marks)
        self.contacts[name] = Contact(
            name=name,
            position=contact_pair.position,
            sliding=contact_pair.sliding,
            friction=friction,
            tangential=tangential,
            law=law,
            slip=slip,
        )

    def _comply(self, name: str, gap: Scalar, stiffness: Value, damping: Value, exponent: Number, coefficients: dict[str, Value]) -> None:
        """A compliant contact: a force while it touches, with a break of the step where it does and where it no longer does."""
        where = f"contact {name}"
        for word, value in coefficients.items():
            if not (is_number(value) and value == 0.0):
                raise ModelError(
                    f"{where}: {word} and stiffness do not go together; {word} is of rigid contacts, so leave one of the two out"
                )
        self._require_sign(where, ">", stiffness=stiffness, exponent=exponent)
        self._require_sign(where, ">=", damping=damping)
        moving = {c.name: c for c in self.components if not c.fixed}
        slopes = {c: gap.diff(c.symbol) for n, c in moving.items() if c.symbol in gap.free_symbols}  # type: ignore[union-attr]
        rate = sum(slope * c.rate for c, slope in slopes.items())
        push = self._compliant_push(name, gap, rate, stiffness, damping, exponent)
        self._apply(where, [(c, push * slope) for c, slope in slopes.items()])
