"""The equations of a mechanism: every template bound to its places in q, with its owner.

This is what the symbolic side hands on: a list of `Term`s. Fixed coordinates have become values here;
what they fold away is decided later, on programs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, TypeAlias

from ncgen.errors import SHOWN, ModelError, shortened, shown
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.catalogue import RowType
from ncgen.model.elements import Combination, Component, rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.forces import Couple, Force, Load, Potential, Rotor
from ncgen.model.names import LAW, TIME
from ncgen.model.rows import Owner, Row, describe
from ncgen.model.values import Parameter, Scalar, Value, as_sympy, is_number, told
from ncgen.symbolic import templates
from ncgen.symbolic.inertia import Exact, StandardInertia, centre_weights, standard_inertia
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.omissions import Pairs, angle_row_type, perpendicular_pairs
from ncgen.symbolic.templates import Template

if TYPE_CHECKING:
    import sympy

LinearForm: TypeAlias = tuple[tuple[Scalar, Component], ...]
"""Pairs (weight, coordinate); a weight is a value."""

Amount: TypeAlias = "Exact | float"
"""What is added up before it is rounded."""


MANY = 16
"""Forces written alike from which they share a template: as many equal terms make a loop."""


@dataclass(frozen=True, eq=False)
class Term:
    """A template at its place.

    scalars: a linear form of coordinates per scalar of the template
    data: a value per constant of the template
    row: the number of the constraint row, or None; equation: that of a row or of a load, for people
    """

    template: Template
    scalars: tuple[LinearForm, ...]
    data: tuple[Value, ...]
    owner: Owner
    label: str
    row: int | None = None
    equation: str = ""


@dataclass(frozen=True, eq=False)
class Equations(Terms):
    """All terms of a mechanism, and the numbering of what they refer to.

    released: fixed coordinates that are treated as free, to see what holds them
    """

    model: Model
    rows: tuple[Term, ...]
    masses: tuple[Term, ...]
    forces: tuple[Term, ...]
    omitted: tuple[str, ...] = ()
    released: frozenset[Component] = frozenset()

    def __repr__(self) -> str:
        return f"<Equations {self.model.name}: {len(self.rows)} rows, {len(self.masses)} masses, {len(self.forces)} forces>"


def build_equations(model: Model, owner: Owner | None = None, massless: Collection[Body] = ()) -> Equations:
    """Bind every row, mass and force of the model.

    With `owner`, only what that owner, a body, is responsible for: rows keep their numbers, the others' stay empty, and
    the body's fixed elements are released, so that what holds them can be seen.
    massless: bodies whose masses and weights are left out
    """
    omitted: list[str] = []
    perpendicular, names = perpendicular_pairs(model), ModelNames(model)
    its_own = [(number, row) for number, row in enumerate(model.rows) if owner is None or row.owner == owner]
    rows = [_row(names, number, row, perpendicular, omitted) for number, row in its_own]
    bodies = [body for body in model.bodies.values() if body.inertia and body not in massless]
    if owner is not None:
        bodies = [body for body in bodies if Owner("body", body.name) == owner]
    released = _released(model, owner)
    masses, forces = _inertia_terms(model, bodies, released, model.rotors if owner is None else ())
    borne = model.forces if owner is None else _borne_by(model, owner)
    forces += _alike([_load(names, force) if isinstance(force, Load) else _force(names, force, released) for force in borne])
    forces += build_springs(model).forces if owner is None else ()
    return Equations(model, tuple(rows), tuple(masses), tuple(forces), tuple(omitted), released)


def build_bonds(model: Model) -> Equations:
    """The rows that no body owns, with all fixed coordinates released: what they do to fixed elements can be seen."""
    omitted: list[str] = []
    perpendicular, names = perpendicular_pairs(model), ModelNames(model)
    rows = [_row(names, number, row, perpendicular, omitted) for number, row in enumerate(model.rows) if row.owner.kind != "body"]
    fixed = frozenset(c for e in model.elements.values() for c in e.components if c.fixed)
    return Equations(model, tuple(rows), (), (), tuple(omitted), fixed)


def build_springs(model: Model) -> Equations:
    """The springs and potentials of a model alone: what pulls without belonging to a body."""
    names = ModelNames(model)
    springs, potentials = (_load(names, spring) for spring in model.springs), (_potential(names, each) for each in model.potentials)
    return Equations(model, (), (), (*springs, *potentials))


def _released(model: Model, owner: Owner | None) -> frozenset[Component]:
    body = model.bodies.get(owner.name) if owner is not None else None
    return frozenset(c for e in body.elements for c in e.components if c.fixed) if body else frozenset()


# -- rows ---------------------------------------------------------------------------------------


def _row(names: ModelNames, number: int, row: Row, perpendicular: Pairs, omitted: list[str]) -> Term:
    if row.type is None:
        import sympy

        where = f"row {number + 1} ({row.label})"
        scalars, data = names.mentioned(row.written, where)
        if row.level == "position":
            _refuse_rates(row.written, scalars, f"{where}: an equation of position", "use m.constrain_velocity")
        make = templates.velocity_row_template if row.level == "velocity" else templates.expression_row_template
        try:
            template = make(f"row-{number + 1}", sympy.sympify(row.written), _words(scalars), _words(data))
        except ValueError as error:
            raise ModelError(
                f"{where}: {shown(row.written)}: {error}; a velocity constraint is a sum of coefficients times rates"
            ) from None
        return Term(template, _forms(scalars), tuple(data), row.owner, row.label, number, row.equation)
    row_type = angle_row_type(row, row.type, perpendicular, omitted)
    template = templates.row_template(row_type.key)
    forms = _forms([row.arguments[name] for name in (*row_type.vectors, *row_type.scalars)])
    data = (*(row.data[name] for name in row_type.data), _scale(row, row_type))
    equation = describe(f"{row_type.equation} = 0", {**row.arguments, **row.data})
    return Term(template, forms, data, row.owner, row.label, number, equation)


def _forms(arguments: Iterable[Combination | Component]) -> tuple[LinearForm, ...]:
    """A linear form of coordinates per scalar: three of a vector, one of a component."""
    forms: list[LinearForm] = []
    for argument in arguments:
        if isinstance(argument, Component):
            forms.append(((1.0, argument),))
        else:
            forms += [tuple((weight, element.components[axis]) for weight, element in argument.terms) for axis in range(3)]
    return tuple(forms)


def _scale(row: Row, kind: RowType) -> Scalar:
    """What a row is multiplied by: factor / product of its natural lengths, or 1 for raw rows."""
    if not row.scaled:
        return 1.0
    product: Scalar = 1.0
    for name in kind.scale_data:
        product = product * as_sympy(row.data[name])
    return kind.scale_factor / product


# -- what users write ---------------------------------------------------------------------------


class ModelNames:
    """What expressions can mention of a model, by name."""

    def __init__(self, model: Model) -> None:
        self.model = model
        components = list(enumerate(model.components))
        self._coordinates = {c.name: (k, c) for k, c in components} | {rate_name(c.name): (k, c) for k, c in components}
        self._numbers = {p.name: (k, p) for k, p in enumerate(model.numbers.values())}

    def mentioned(self, expression: Scalar | sympy.Tuple, where: str) -> tuple[list[Component], list[Parameter]]:
        """The coordinates (by themselves or by their rates) and parameters an expression mentions, in model order."""
        import sympy

        names = {s.name for s in symbols_in(sympy.sympify(expression))}
        if unknown := sorted(names - self._coordinates.keys() - self._numbers.keys() - {TIME}):
            raise ModelError(
                f"{where}: {shortened(unknown[0], SHOWN)} is neither a coordinate, a rate, a parameter, an input nor m.time; correct the "
                "expression"
            )
        coordinates = dict(self._coordinates[name] for name in names if name in self._coordinates)
        numbers = dict(self._numbers[name] for name in names if name in self._numbers)
        return [c for _, c in sorted(coordinates.items())], [p for _, p in sorted(numbers.items())]


def _refuse_rates(expression: Scalar, coordinates: Iterable[Component], what: str, remedy: str) -> None:
    """Raise ModelError where an expression of positions mentions a velocity."""
    import sympy

    mentioned = {s.name for s in symbols_in(sympy.sympify(expression))}
    rates = [rate_name(c.name) for c in coordinates if rate_name(c.name) in mentioned]
    if rates:
        raise ModelError(f"{what} does not depend on velocities, here on {rates[0]}; {remedy}")


def _words(things: Iterable[Component | Parameter]) -> tuple[str, ...]:
    return tuple(thing.name for thing in things)


def _load(names: ModelNames, load: Load) -> Term:
    """A force type of the catalogue at its place."""
    kind, make = load.type, templates.force_template
    arguments, data = load.given()
    if load.law is not None:
        used = {s.name for s in symbols_in(load.law)} - {*LAW, TIME}
        data = [p for p in names.model.parameters.values() if p.name in used]
        if used - set(_words(data)):
            raise ModelError(f"{load.label}: {sorted(used)[0]} is not a parameter; a law is made of length, rate, m.time and parameters")
        kind, make = templates.law_type(kind, load.label, load.law, _words(data)), templates.derived_force
    if not all(map(is_number, data)) and _varies(names, load, data):
        return _varying(names, load, arguments, data)
    equation = describe(kind.equation, dict(zip((*kind.vectors, *kind.scalars, *kind.data), (*arguments, *data), strict=True)))
    return Term(make(kind), _forms(arguments), tuple(data), Owner("user", load.label), load.label, equation=equation)


def _varies(names: ModelNames, load: Load, data: Sequence[Value]) -> bool:
    """Whether coordinates or time occur in the constants of a force type."""
    import sympy

    written = sympy.Tuple(*map(as_sympy, data))
    return bool(names.mentioned(written, load.label)[0]) or templates.time() in written.free_symbols


def _varying(names: ModelNames, load: Load, arguments: Sequence[Combination | Component], data: Sequence[Value]) -> Term:
    """A force type of the catalogue whose constants are expressions of time, coordinates and rates, such as a couple's components."""
    import sympy

    kind, written = load.type, [sympy.sympify(as_sympy(x)) for x in data]
    coordinates, numbers = names.mentioned(sympy.Tuple(*written), load.label)
    template = templates.varying_force(kind, load.label, written, _words(coordinates), _words(numbers))
    equation = describe(kind.equation, dict(zip((*kind.vectors, *kind.scalars, *kind.data), (*arguments, *data), strict=True)))
    forms = _forms([*arguments, *coordinates])
    return Term(template, forms, tuple(numbers), Owner("user", load.label), load.label, equation=equation)


def _force(names: ModelNames, force: Force, released: Collection[Component]) -> Term:
    import sympy

    components = {c: sympy.sympify(e) for c, e in force.components if not c.fixed or c in released}
    scalars, data = names.mentioned(sympy.Tuple(*components.values()), force.label)
    scalars = list(dict.fromkeys([*scalars, *components]))
    along = {scalars.index(c): e for c, e in components.items()}
    template = templates.user_force(force.label, _words(scalars), _words(data), along)
    equation = ", ".join(f"{told(e)} along {c.name}" for c, e in components.items())
    return Term(template, _forms(scalars), tuple(data), Owner("user", force.label), force.label, equation=equation)


def _alike(forces: Sequence[Term]) -> list[Term]:
    """Forces that the user wrote in the same words but for names share a template where they are many, so that they become a loop."""
    shared: dict[tuple[object, ...], list[int]] = defaultdict(list)
    plain: dict[int, Template] = {}
    for k, term in enumerate(forces):
        if term.template.equation == templates.USER_FORCE:
            plain[k] = templates.without_names(term.template)
            shared[tuple(plain[k].outputs.items())].append(k)
    terms = list(forces)
    for numbers in shared.values():
        for k in numbers if len(numbers) >= MANY else ():
            terms[k] = replace(forces[k], template=plain[numbers[0]])
    return terms


def _borne_by(model: Model, owner: Owner) -> list[Force | Couple]:
    """The forces of which a body is the first one that has the point they act on; forces along angles act between bodies and have none."""
    first: dict[Component, int] = {}
    for number, body in enumerate(model.bodies.values()):
        for component in (c for element in body.elements for c in element.components):
            first.setdefault(component, number)
    names = list(model.bodies)

    def bearer(force: Force | Couple) -> str | None:
        if isinstance(force, Couple):
            return force.body.name
        bodies = [first[component] for component, _ in force.components if component in first]
        return names[min(bodies)] if bodies else None

    return [force for force in model.forces if owner.kind == "body" and bearer(force) == owner.name]


def _potential(names: ModelNames, potential: Potential) -> Term:
    import sympy

    scalars, data = names.mentioned(potential.expression, potential.label)
    _refuse_rates(potential.expression, scalars, f"{potential.label}: a potential", "use m.force or m.torque")
    expression = sympy.sympify(potential.expression)
    template = templates.user_potential(potential.label, _words(scalars), _words(data), expression)
    return Term(template, _forms(scalars), tuple(data), Owner("user", potential.label), potential.label, equation=told(expression))


# -- inertia and gravity ------------------------------------------------------------------------


def _inertia_terms(
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
        (own,) = rotor.coordinate.components
        mass[own, own] += Fraction(float(rotor.inertia)) if is_number(rotor.inertia) else as_sympy(rotor.inertia)
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
                    share = standard.matrix[k][l] * _exact(wk * wl, standard.matrix[k][l])
                    for a, b in zip(ck, cl, strict=True):
                        if all(not c.fixed or c in released for c in (a, b)):
                            mass[a, b] += share


def _exact(weight: float, partner: Exact) -> Fraction | float:
    """±1 as a type that multiplies fractions and sympy expressions alike without losing digits."""
    return int(weight) if weight == int(weight) else Fraction(weight) if isinstance(partner, Fraction) else weight


def _mass_term(pair: tuple[Component, Component], amount: Amount, owner: Owner) -> Term:
    a, b = pair
    label = a.name if a is b else f"{a.name} {b.name}"
    value = _rounded(amount, f"mass of {label}")
    if a is b:
        return Term(templates.mass_diagonal(), (((1.0, a),),), (value,), owner, label)
    return Term(templates.mass_pair(), (((1.0, a),), ((1.0, b),)), (value,), owner, label)


def _add_weight(weight: dict[Component, Amount], standard: StandardInertia, gravity: Sequence[Value]) -> None:
    for k in range(len(standard.directions)):
        share = centre_weights(standard)[k]
        for w, components in standard.directions[k]:
            for component, g in zip(components, gravity, strict=True):
                weight[component] += share * (_exact(w, share) * _field(g, share))


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
                Term(templates.weight(), (((1.0, component),),), (_rounded(force, f"weight of {component.name}"),), owner, component.name)
            )
    if offset != 0:
        terms.append(
            Term(templates.energy_offset(), (), (_rounded(offset, "potential of fixed points"),), owner, "potential of fixed points")
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
    return [Term(templates.cross_product_body(), tuple(forms), data, Owner("body", body.name), body.name)]


def _rounded(value: Amount, what: str) -> Scalar:
    """A Fraction as the nearest double; expressions of parameters stay."""
    try:
        return float(value) if isinstance(value, (Fraction, int, float)) else value
    except OverflowError:
        raise _too_large(what) from None


def _too_large(what: str) -> ModelError:
    return ModelError(f"{what}: it exceeds 1.8e308, the largest double; check the units of mass, inertia and lengths")
