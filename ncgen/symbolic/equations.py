"""The equations of a mechanism: every template bound to its places in q, with its owner.

This is what the symbolic side hands on: a list of `Term`s. Fixed coordinates have become values here;
what they fold away is decided later, on programs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ncgen.errors import MAX_ECHO, ModelError, shortened, shown
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.catalogue import RowType
from ncgen.model.elements import Combination, Component, rate_name
from ncgen.model.expressions import symbols_in
from ncgen.model.forces import BodyLoad, Force, Load, Potential
from ncgen.model.names import LAW, TIME
from ncgen.model.rows import Owner, Row, describe
from ncgen.model.values import Parameter, Scalar, Value, as_sympy, is_number, text_of
from ncgen.symbolic import force_templates, templates
from ncgen.symbolic.inertia_terms import inertia_terms
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.omissions import Pairs, angle_row_type, perpendicular_pairs
from ncgen.symbolic.templates import Template
from ncgen.symbolic.term import LinearForm, Term

if TYPE_CHECKING:
    import sympy

MIN_EQUAL_FORCES = 16
"""Forces written alike from which they share a template: as many equal terms make a loop."""


@dataclass(frozen=True, eq=False, kw_only=True)
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
    masses, forces = inertia_terms(model, bodies, released, model.rotors if owner is None else ())
    borne = model.forces if owner is None else _borne_by(model, owner)
    forces += _alike([_load(names, force) if isinstance(force, Load) else _force(names, force, released) for force in borne])
    forces += build_springs(model).forces if owner is None else ()
    return Equations(model=model, rows=tuple(rows), masses=tuple(masses), forces=tuple(forces), omitted=tuple(omitted), released=released)


def build_bonds(model: Model) -> Equations:
    """The rows that no body owns, with all fixed coordinates released: what they do to fixed elements can be seen."""
    omitted: list[str] = []
    perpendicular, names = perpendicular_pairs(model), ModelNames(model)
    rows = [_row(names, number, row, perpendicular, omitted) for number, row in enumerate(model.rows) if row.owner.kind != "body"]
    fixed = frozenset(c for e in model.elements.values() for c in e.components if c.fixed)
    return Equations(model=model, rows=tuple(rows), masses=(), forces=(), omitted=tuple(omitted), released=fixed)


def build_springs(model: Model) -> Equations:
    """The springs and potentials of a model alone: what pulls without belonging to a body."""
    names = ModelNames(model)
    loads = [_load(names, each) if isinstance(each, Load) else _potential(names, each) for each in (*model.springs, *model.potentials)]
    return Equations(model=model, rows=(), masses=(), forces=tuple(loads))


def _released(model: Model, owner: Owner | None) -> frozenset[Component]:
    body = model.bodies.get(owner.name) if owner is not None else None
    return frozenset(c for e in body.elements for c in e.components if c.fixed) if body else frozenset()


# -- rows ---------------------------------------------------------------------------------------


def _row(names: ModelNames, number: int, row: Row, perpendicular: Pairs, omitted: list[str]) -> Term:
    if row.type is None:
        import sympy

        where = f"constraint {number + 1} ({row.label})"
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
        return Term(
            template=template,
            scalars=_forms(scalars),
            data=tuple(data),
            owner=row.owner,
            label=row.label,
            row=number,
            equation=row.equation,
        )
    row_type = angle_row_type(row, row.type, perpendicular, omitted)
    template = templates.row_template(row_type.key)
    forms = _forms([row.arguments[name] for name in (*row_type.vectors, *row_type.scalars)])
    data = (*(row.data[name] for name in row_type.data), _scale(row, row_type))
    equation = describe(f"{row_type.equation} = 0", {**row.arguments, **row.data})
    return Term(template=template, scalars=forms, data=data, owner=row.owner, label=row.label, row=number, equation=equation)


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
                f"{where}: {shortened(unknown[0], MAX_ECHO)} is neither a coordinate, a rate, a parameter, an input nor m.time; "
                "correct the "
                "expression"
            )
        coordinates = dict(self._coordinates[name] for name in names if name in self._coordinates)
        numbers = dict(self._numbers[name] for name in names if name in self._numbers)
        return [c for _, c in sorted(coordinates.items())], [p for _, p in sorted(numbers.items())]


def _refuse_rates(expression: Scalar, coordinates: Iterable[Component], quantity: str, remedy: str) -> None:
    """Raise ModelError where an expression of positions mentions a velocity."""
    import sympy

    mentioned = {s.name for s in symbols_in(sympy.sympify(expression))}
    rates = [rate_name(c.name) for c in coordinates if rate_name(c.name) in mentioned]
    if rates:
        raise ModelError(f"{quantity} does not depend on velocities, here on {rates[0]}; {remedy}")


def _words(named: Iterable[Component | Parameter]) -> tuple[str, ...]:
    return tuple(each.name for each in named)


def _load(names: ModelNames, load: Load) -> Term:
    """A force type of the catalogue at its place."""
    kind, make = load.type, force_templates.force_template
    arguments, data = load.given()
    if load.law is not None:
        used = {s.name for s in symbols_in(load.law)} - {*LAW, TIME}
        data = [p for p in names.model.parameters.values() if p.name in used]
        if used - set(_words(data)):
            raise ModelError(f"{load.label}: {sorted(used)[0]} is not a parameter; a law is made of length, rate, m.time and parameters")
        kind, make = force_templates.law_type(kind, load.label, load.law, _words(data)), force_templates.derived_force
    if not all(map(is_number, data)) and _varies(names, load, data):
        return _varying(names, load, arguments, data)
    equation = describe(kind.equation, dict(zip((*kind.vectors, *kind.scalars, *kind.data), (*arguments, *data), strict=True)))
    return Term(
        template=make(kind),
        scalars=_forms(arguments),
        data=tuple(data),
        owner=Owner("user", load.label),
        label=load.label,
        equation=equation,
    )


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
    template = force_templates.varying_force(kind, load.label, written, _words(coordinates), _words(numbers))
    equation = describe(kind.equation, dict(zip((*kind.vectors, *kind.scalars, *kind.data), (*arguments, *data), strict=True)))
    forms = _forms([*arguments, *coordinates])
    return Term(template=template, scalars=forms, data=tuple(numbers), owner=Owner("user", load.label), label=load.label, equation=equation)


def _force(names: ModelNames, force: Force, released: Collection[Component]) -> Term:
    import sympy

    components = {c: sympy.sympify(e) for c, e in force.components if not c.fixed or c in released}
    scalars, data = names.mentioned(sympy.Tuple(*components.values()), force.label)
    scalars = list(dict.fromkeys([*scalars, *components]))
    along = {scalars.index(c): e for c, e in components.items()}
    template = force_templates.user_force(force.label, _words(scalars), _words(data), along)
    equation = ", ".join(f"{text_of(e)} along {c.name}" for c, e in components.items())
    return Term(
        template=template, scalars=_forms(scalars), data=tuple(data), owner=Owner("user", force.label), label=force.label, equation=equation
    )


def _alike(forces: Sequence[Term]) -> list[Term]:
    """Forces that the user wrote in the same words but for names share a template where they are many, so that they become a loop."""
    shared: dict[tuple[object, ...], list[int]] = defaultdict(list)
    plain: dict[int, Template] = {}
    for k, term in enumerate(forces):
        if term.template.equation == force_templates.USER_FORCE:
            plain[k] = force_templates.without_names(term.template)
            shared[tuple(plain[k].outputs.items())].append(k)
    terms = list(forces)
    for numbers in shared.values():
        for k in numbers if len(numbers) >= MIN_EQUAL_FORCES else ():
            terms[k] = replace(forces[k], template=plain[numbers[0]])
    return terms


def _borne_by(model: Model, owner: Owner) -> list[Force | BodyLoad]:
    """The forces of which a body is the first one that has the point they act on; forces along angles act between bodies and have none."""
    first: dict[Component, int] = {}
    for number, body in enumerate(model.bodies.values()):
        for component in (c for element in body.elements for c in element.components):
            first.setdefault(component, number)
    names = list(model.bodies)

    def bearer(force: Force | BodyLoad) -> str | None:
        if isinstance(force, BodyLoad):
            return force.body.name
        bodies = [first[component] for component, _ in force.components if component in first]
        return names[min(bodies)] if bodies else None

    return [force for force in model.forces if owner.kind == "body" and bearer(force) == owner.name]


def _potential(names: ModelNames, potential: Potential) -> Term:
    import sympy

    scalars, data = names.mentioned(potential.expression, potential.label)
    _refuse_rates(potential.expression, scalars, f"{potential.label}: a potential", "use m.force or m.torque")
    expression = sympy.sympify(potential.expression)
    template = force_templates.user_potential(potential.label, _words(scalars), _words(data), expression)
    return Term(
        template=template,
        scalars=_forms(scalars),
        data=tuple(data),
        owner=Owner("user", potential.label),
        label=potential.label,
        equation=text_of(expression),
    )
