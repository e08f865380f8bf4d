"""Terms of mass and weight: constant parts are added up in exact arithmetic before they are rounded."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from ncgen.errors import ModelError
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Component
from ncgen.model.forces import Rotor
from ncgen.model.rows import Owner
from ncgen.model.values import Scalar, Value, as_sympy, is_number
from ncgen.symbolic import mass_templates
from ncgen.symbolic.inertia import Exact, StandardInertia, centre_weights, standard_inertia
from ncgen.symbolic.term import LinearForm, Term

Amount: TypeAlias = "Exact | float"
"""What is added up before it is rounded."""


def inertia_terms(
    model: Model, bodies: Sequence[Body], released: Collection[Component], rotors: Sequence[Rotor]
) -> tuple[list[Term], list[Term]]:
    """Mass and weight of the bodies, and inertia of rotors, constant parts added up in exact arithmetic before they are rounded."""
    order = {component: i for i, component in enumerate(model.components)}
    mass: dict[tuple[Component, Component], Amount] = defaultdict(Fraction)
    weight: dict[Component, Amount] = defaultdict(Fraction)
    varying: list[Term] = []
    for body in bodies:
        try:
            standard = standard_inertia(body, model.parameters)
        except OverflowError:
            raise _too_large(f"body {body.name}, inertia") from None
        _add_constant_mass(mass, standard, released)
        _add_weight(weight, standard, model.gravity_field)
        if standard.crossed:
            varying += _cross_product_terms(body, standard, model.gravity_field)
    for rotor in rotors:
        (coordinate,) = rotor.coordinate.components
        mass[coordinate, coordinate] += Fraction(float(rotor.inertia)) if is_number(rotor.inertia) else as_sympy(rotor.inertia)
    owner = Owner("body", bodies[0].name) if len(bodies) == 1 else Owner("model", model.name)
    # M is symmetric: a pair stands once, in the order of q.
    pairs = {pair: m for pair, m in mass.items() if m != 0 and order[pair[0]] <= order[pair[1]]}
    masses = [_mass_term(pair, m, owner) for pair, m in pairs.items()] + varying
    forces = _weight_terms(weight, owner, released)
    return masses, forces


def _add_constant_mass(mass: dict[tuple[Component, Component], Amount], standard: StandardInertia, released: Collection[Component]) -> None:
    count = len(standard.directions)  # a crossed direction is no element and has none
    for k in range(count):
        for l in range(count):
            for wk, ck in standard.directions[k]:
                for wl, cl in standard.directions[l]:
                    contribution = standard.matrix[k][l] * _exact(wk * wl, standard.matrix[k][l])
                    for a, b in zip(ck, cl, strict=True):
                        if all(not c.fixed or c in released for c in (a, b)):
                            mass[a, b] += contribution


def _exact(weight: float, partner: Exact) -> Fraction | float:
    """±1 as a type that multiplies fractions and sympy expressions alike without losing digits."""
    return int(weight) if weight == int(weight) else Fraction(weight) if isinstance(partner, Fraction) else weight


def _mass_term(pair: tuple[Component, Component], amount: Amount, owner: Owner) -> Term:
    a, b = pair
    label = a.name if a is b else f"{a.name} {b.name}"
    value = _rounded(amount, f"mass of {label}")
    if a is b:
        return Term(template=mass_templates.mass_diagonal(), scalars=(((1.0, a),),), data=(value,), owner=owner, label=label)
    return Term(template=mass_templates.mass_pair(), scalars=(((1.0, a),), ((1.0, b),)), data=(value,), owner=owner, label=label)


def _add_weight(weight: dict[Component, Amount], standard: StandardInertia, gravity: Sequence[Value]) -> None:
    for k in range(len(standard.directions)):
        coefficient = centre_weights(standard)[k]
        for w, components in standard.directions[k]:
            for component, g in zip(components, gravity, strict=True):
                weight[component] += coefficient * (_exact(w, coefficient) * _field(g, coefficient))


def _field(g: Value, partner: Exact) -> Amount:
    """One component of gravity in the arithmetic of its partner."""
    return Fraction(float(g)) if is_number(g) and isinstance(partner, Fraction) else as_sympy(g)


def _weight_terms(weight: Mapping[Component, Amount], owner: Owner, released: Collection[Component]) -> list[Term]:
    terms: list[Term] = []
    offset: Amount = Fraction(0)
    for component, force in weight.items():
        if force == 0:
            continue
        if component.fixed and component not in released:
            offset -= force * (Fraction(float(component.value)) if is_number(component.value) else as_sympy(component.value))
        else:
            terms.append(
                Term(
                    template=mass_templates.weight(),
                    scalars=(((1.0, component),),),
                    data=(_rounded(force, f"weight of {component.name}"),),
                    owner=owner,
                    label=component.name,
                )
            )
    if offset != 0:
        terms.append(
            Term(
                template=mass_templates.energy_offset(),
                scalars=(),
                data=(_rounded(offset, "potential of fixed points"),),
                owner=owner,
                label="potential of fixed points",
            )
        )
    return terms


def _cross_product_terms(body: Body, standard: StandardInertia, gravity: Sequence[Value]) -> list[Term]:
    base, first, second = standard.directions
    forms: list[LinearForm] = []
    for direction in (base, first, second):
        forms += [tuple((w, components[axis]) for w, components in direction) for axis in range(3)]
    last = standard.matrix[3]
    pull = [last[0] * _field(g, last[0]) for g in gravity]
    data = tuple(_rounded(v, f"body {body.name}, inertia") for v in (*last, *pull))
    if not any(v != 0 for v in data):
        return []
    return [
        Term(template=mass_templates.cross_product_body(), scalars=tuple(forms), data=data, owner=Owner("body", body.name), label=body.name)
    ]


def _rounded(value: Amount, where: str) -> Scalar:
    """A Fraction as the nearest double; expressions of parameters stay."""
    try:
        return float(value) if isinstance(value, (Fraction, int, float)) else value
    except OverflowError:
        raise _too_large(where) from None


def _too_large(where: str) -> ModelError:
    return ModelError(f"{where}: it exceeds 1.8e308, the largest double; check the units of mass, inertia and lengths")
