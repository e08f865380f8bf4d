"""Terms of mass and weight: constant parts are added up in exact arithmetic before they are rounded."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias
from weakref import WeakKeyDictionary

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

InertiaEntry: TypeAlias = tuple[str, int, int]
"""An entry of a body's inertia over its basis: name of the body, row, column."""


@dataclass(frozen=True)
class Amounts:
    """Constant parts of M and of the weights, added up over the bodies.

    offset: the potential energy of what is fixed; alone: {entry of M: the entry of a body's own inertia that is all of it}
    """

    mass: dict[tuple[Component, Component], Amount]
    weight: dict[Component, Amount]
    offset: Amount
    alone: dict[tuple[Component, Component], InertiaEntry] = field(default_factory=dict)


_given: WeakKeyDictionary[Model, Amounts] = WeakKeyDictionary()


def take_amounts(model: Model, amounts: Amounts) -> None:
    """Let these be the amounts of all bodies of a model."""
    _given[model] = amounts


def amounts_of(model: Model, bodies: Sequence[Body], released: Collection[Component], rotors: Sequence[Rotor]) -> Amounts:
    """The amounts of some bodies and rotors, in exact arithmetic where they are numbers.

    released: fixed coordinates that are treated as free
    """
    if model in _given and len(bodies) == sum(body.inertia is not None for body in model.bodies.values()) and not released:
        return _given[model]
    components = model.components
    order = {component: i for i, component in enumerate(components) if not component.fixed or component in released}
    mass: dict[tuple[int, int], Amount] = defaultdict(Fraction)
    alone: dict[tuple[int, int], InertiaEntry | None] = {}
    weight: dict[Component, Amount] = defaultdict(Fraction)
    for body in bodies:
        try:
            standard = standard_inertia(body, model.parameters)
        except OverflowError:
            raise _too_large(f"body {body.name}, inertia") from None
        _add_constant_mass(mass, alone, body.name, standard, order)
        _add_weight(weight, standard, model.gravity_field)
    for rotor in rotors:
        (coordinate,) = rotor.coordinate.components
        alone[order[coordinate], order[coordinate]] = None
        mass[order[coordinate], order[coordinate]] += _field(rotor.inertia, Fraction(0))
    # M is symmetric: a pair stands once, in the order of q.
    pairs = {(components[i], components[j]): m for (i, j), m in mass.items() if m != 0}
    offset: Amount = Fraction(0)
    for component, force in weight.items():
        if component.fixed and component not in released:
            offset -= force * _field(component.value, force)
    moving = {c: force for c, force in weight.items() if force != 0 and (not c.fixed or c in released)}
    return Amounts(pairs, moving, offset, {(components[i], components[j]): entry for (i, j), entry in alone.items() if entry})


def inertia_terms(
    model: Model, bodies: Sequence[Body], released: Collection[Component], rotors: Sequence[Rotor]
) -> tuple[list[Term], list[Term]]:
    """Mass and weight of the bodies, and inertia of rotors, constant parts added up in exact arithmetic before they are rounded."""
    amounts = amounts_of(model, bodies, released, rotors)
    varying: list[Term] = []
    for body in bodies:
        standard = standard_inertia(body, model.parameters)
        if standard.crossed:
            varying += _cross_product_terms(body, standard, model.gravity_field)
    owner = Owner("body", bodies[0].name) if len(bodies) == 1 else Owner("model", model.name)
    masses = [_mass_term(pair, m, owner) for pair, m in amounts.mass.items()] + varying
    return masses, _weight_terms(amounts, owner)


def _add_constant_mass(
    mass: dict[tuple[int, int], Amount],
    alone: dict[tuple[int, int], InertiaEntry | None],
    name: str,
    standard: StandardInertia,
    order: dict[Component, int],
) -> None:
    """Add what a body contributes to M, of each pair of coordinates in the order of q alone: summed over the pairs of its elements, which
    have it in common for all axes. name: of the body; order: of the coordinates that move."""
    known: dict[tuple[Component, ...], int] = {}
    forms = [[(weight, known.setdefault(components, len(known))) for weight, components in form] for form in standard.directions]
    of_elements: dict[tuple[int, int], tuple[Amount, InertiaEntry | None]] = {}
    for k, (form, entries) in enumerate(zip(forms, standard.matrix, strict=False)):  # a crossed direction is no element and has none
        for l, (other, entry) in enumerate(zip(forms, entries, strict=False)):
            if entry.__class__ in (Fraction, float) and not entry:
                continue
            for weight, a in form:
                for factor, b in other:
                    contribution = entry if weight * factor == 1 else entry * _exact(weight * factor, entry)
                    is_alone = (a, b) not in of_elements
                    amount = contribution if is_alone else of_elements[a, b][0] + contribution
                    of_elements[a, b] = amount, (name, k, l) if is_alone and weight * factor == 1 else None
    numbers = [[order.get(component, -1) for component in components] for components in known]
    for (a, b), (amount, entry_alone) in of_elements.items():
        for pair in zip(numbers[a], numbers[b], strict=True):
            if 0 <= pair[0] <= pair[1]:
                alone[pair] = None if pair in alone else entry_alone
                mass[pair] += amount


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
                if is_number(g) and not g:
                    continue
                weight[component] += coefficient * (_exact(w, coefficient) * _field(g, coefficient))


def _field(g: Value, partner: Amount) -> Amount:
    """One component of gravity in the arithmetic of its partner."""
    return Fraction(float(g)) if is_number(g) and isinstance(partner, Fraction) else as_sympy(g)


def _weight_terms(amounts: Amounts, owner: Owner) -> list[Term]:
    terms = [
        Term(
            template=mass_templates.weight(),
            scalars=(((1.0, component),),),
            data=(_rounded(force, f"weight of {component.name}"),),
            owner=owner,
            label=component.name,
        )
        for component, force in amounts.weight.items()
    ]
    if amounts.offset != 0:
        label = "potential of fixed points"
        data = (_rounded(amounts.offset, label),)
        terms.append(Term(template=mass_templates.energy_offset(), scalars=(), data=data, owner=owner, label=label))
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
        return float(value) if isinstance(value, (Fraction, int)) else value
    except OverflowError:
        raise _too_large(where) from None


def _too_large(where: str) -> ModelError:
    return ModelError(f"{where}: it exceeds 1.8e308, the largest double; check the units of mass, inertia and lengths")
