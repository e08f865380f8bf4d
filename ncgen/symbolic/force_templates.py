"""Templates of forces: of the catalogue's types, with laws of the user's in their place, and from the user's own expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from typing import TYPE_CHECKING

from ncgen.model.forces import ForceType
from ncgen.model.names import LAW
from ncgen.symbolic.templates import (
    DeferredOutputs,
    Outputs,
    Template,
    TemplateOutput,
    beside_kinks,
    rates,
    replaced,
    symbols,
    time,
    vector,
)

if TYPE_CHECKING:
    import sympy


USER_FORCE = "user force"


def derived_force(kind: ForceType) -> Template:
    """Generalised forces, energy and power of a force type, a user's own among them."""
    import sympy

    scalars = sum(map(vector, kind.vectors), ()) + kind.scalars
    data = {name: sympy.Symbol(name, real=True) for name in kind.data}
    if kind.energy is not None:
        return replace(user_potential(kind.key, scalars, kind.data, kind.energy(sympy, **_vectors(kind), **data)), equation=kind.equation)
    if kind.forces is not None:
        outputs = _working(dict(enumerate(chain.from_iterable(kind.forces(sympy, **_vectors(kind), **data)))), scalars)
        return Template(key=kind.key, equation=kind.equation, scalars=scalars, data=kind.data, outputs=outputs)
    x, v, direction = _stretch(scalars)
    at = sympy.Dummy("x", real=True)
    derivative = sympy.factor_terms(kind.potential(sympy, at, **data).diff(at))  # of k (x - L0)^2/2 it is k (2 x - 2 L0)/2 before
    friction = kind.friction(sympy, x, v, **data)
    parts = (replaced(derivative, {at: x}), friction)
    tension = parts if kind.regular else (sympy.Add(*parts),)
    outputs = {TemplateOutput("force", (k,)): sympy.Add(*(-term * along for term in tension)) for k, along in enumerate(direction)}
    outputs |= {TemplateOutput("potential"): kind.potential(sympy, x, **data), TemplateOutput("power"): -friction * v}
    return Template(key=kind.key, equation=kind.equation, scalars=scalars, data=kind.data, outputs=outputs)


def _vectors(kind: ForceType) -> dict[str, list[sympy.Symbol]]:
    """The vectors of a force type by their names, and their rates where it takes them."""
    vectors = {name: symbols(vector(name)) for name in kind.vectors}
    return vectors | ({f"d{name}": rates(vector(name)) for name in kind.vectors} if kind.takes_rates else {})


def varying_force(
    kind: ForceType, key: str, written: Sequence[sympy.Expr], coordinates: tuple[str, ...], numbers: tuple[str, ...]
) -> Template:
    """A force type of forces along vectors whose constants are expressions of coordinates, their rates, time and numbers.

    The scalars are those of the type, then the coordinates; a coordinate and a number may be called like an argument of the type.
    """
    import sympy

    assert kind.forces is not None, f"{kind.key} has a tension"
    law_scalars, data = tuple(f"law.{name}" for name in coordinates), tuple(f"law.{name}" for name in numbers)
    old = [*symbols(coordinates), *rates(coordinates), *symbols(numbers)]
    rules = dict(zip(old, [*symbols(law_scalars), *rates(law_scalars), *symbols(data)], strict=True))
    constants = {name: replaced(e, rules) for name, e in zip(kind.data, written, strict=True)}
    outputs = kind.forces(sympy, **_vectors(kind), **constants)
    scalars = (*sum(map(vector, kind.vectors), ()), *law_scalars)
    return Template(
        key=key,
        equation=kind.equation,
        scalars=scalars,
        data=data,
        outputs=_working(dict(enumerate(chain.from_iterable(outputs))), scalars),
    )


@cache
def force_template(kind: ForceType) -> Template:
    """The derivation of one force type of the catalogue."""
    scalars = sum(map(vector, kind.vectors), ()) + kind.scalars
    derived = DeferredOutputs(partial(_derived_force, kind))
    return Template(key=kind.key, equation=kind.equation, scalars=scalars, data=kind.data, outputs=derived, is_catalogued=True)


def _derived_force(kind: ForceType) -> Outputs:
    return dict(derived_force(kind).outputs)


def _stretch(scalars: tuple[str, ...]) -> tuple[sympy.Expr, sympy.Expr, list[sympy.Expr]]:
    """What a tension pulls along, the length of a vector or one scalar: its value, its rate and its gradient."""
    import sympy

    s, ds = symbols(scalars), rates(scalars)
    if len(s) == 1:
        return s[0], ds[0], [sympy.Integer(1)]
    length = sympy.sqrt(sum(c * c for c in s))
    return length, sum((c * d for c, d in zip(s, ds, strict=True)), sympy.Integer(0)) / length, [c / length for c in s]


def law_type(kind: ForceType, key: str, law: sympy.Expr, names: tuple[str, ...]) -> ForceType:
    """A force type with the user's tension of x and v in place of its own, whose whole work is counted as power."""

    def friction(f: object, x: sympy.Expr, v: sympy.Expr, **data: sympy.Expr) -> sympy.Expr:
        return replaced(law, dict(zip(symbols([*LAW, *names]), (x, v, *data.values()), strict=True)))

    data = tuple(f"law.{name}" for name in names)  # a parameter may be called like a scalar
    return ForceType(key=key, vectors=kind.vectors, scalars=kind.scalars, data=data, equation=f"tension {law}", friction=friction)


def _working(components: dict[int, sympy.Expr], scalars: tuple[str, ...]) -> Outputs:
    """Forces by the numbers of their scalars, and their power, which is counted as work."""
    import sympy

    speeds = rates(scalars)
    outputs: Outputs = {TemplateOutput("force", (k,)): expression for k, expression in components.items()}
    return outputs | {TemplateOutput("power"): sympy.Add(*(expression * speeds[k] for k, expression in components.items()))}


def user_force(key: str, scalars: tuple[str, ...], data: tuple[str, ...], components: dict[int, sympy.Expr]) -> Template:
    """A force the user wrote out; components: expression by the number of its scalar."""
    return Template(key=key, equation=USER_FORCE, scalars=scalars, data=data, outputs=_working(components, scalars))


def without_names(template: Template) -> Template:
    """The same with numbers for the names of its scalars and data."""
    scalars, data = tuple(f"x{k}" for k in range(len(template.scalars))), tuple(f"c{k}" for k in range(len(template.data)))
    old = [*symbols(template.scalars), *rates(template.scalars), *symbols(template.data)]
    rules = dict(zip(old, [*symbols(scalars), *rates(scalars), *symbols(data)], strict=True))
    return Template(
        key="user-forces",
        equation=template.equation,
        scalars=scalars,
        data=data,
        outputs={key: replaced(e, rules) for key, e in template.outputs.items()},
    )


def user_potential(key: str, scalars: tuple[str, ...], data: tuple[str, ...], potential: sympy.Expr) -> Template:
    """A potential the user wrote out; its force is the negative gradient, and what it changes by itself in time is power."""
    smooth, whole = beside_kinks(potential)
    outputs: Outputs = {TemplateOutput("force", (k,)): whole(-smooth.diff(s)) for k, s in enumerate(symbols(scalars))}
    outputs[TemplateOutput("potential")] = potential
    if time() in potential.free_symbols:
        outputs[TemplateOutput("power")] = whole(smooth.diff(time()))
    return Template(key=key, equation="user potential", scalars=scalars, data=data, outputs=outputs)
