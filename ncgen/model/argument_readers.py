"""What the builder's methods take: an argument becomes what its annotation says, or is refused where it is written.

Elements and bodies may be given by their names. A message names the method, the thing that is made where it has a
name, the argument, and what was given.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

import numpy as np

from ncgen.errors import MAX_ECHO, ModelError, UnknownName, foreign, shortened, shown
from ncgen.model.actions import actions_of
from ncgen.model.bodies import Body
from ncgen.model.elements import AXES, Combination, Component, Constant, Element, Point, Relative, Spatial, Vector, as_combination
from ncgen.model.expressions import check_expression, is_symbolic, symbols_in
from ncgen.model.kinks import without_kinks
from ncgen.model.names import LAW, check_name, normal
from ncgen.model.rows import Owner, Row
from ncgen.model.values import MAX_NUMBER, Expression, Parameter, Scalar, Value, as_sympy, as_value, evaluate, is_number

if TYPE_CHECKING:
    from ncgen.model.contents import Contents

E = TypeVar("E", bound=Element)
R = TypeVar("R")

Reader: TypeAlias = "Callable[[Contents, object, str], R]"
"""(model, what was given, where) -> what the builder takes."""

UNNAMED_ARGUMENTS = ("position", "direction", "field")
"""Arguments that go without saying in messages: their axes are named."""


class ArgumentReading(NamedTuple):
    """How an argument of a method is read; is_optional: it may be None; are_many: it stands for any number of them."""

    key: str
    reader: Reader[object]
    is_optional: bool
    are_many: bool


def readings_of(signature: inspect.Signature) -> tuple[ArgumentReading, ...]:
    """How the arguments of a method are read that are brought to what their annotations say."""
    annotated = [(parameter, parameter.annotation) for parameter in signature.parameters.values() if isinstance(parameter.annotation, str)]
    kinds = [(parameter, kind, kind.removesuffix(" | None")) for parameter, kind in annotated if parameter.name != "name"]
    return tuple(
        ArgumentReading(parameter.name, READERS[kind], kind != whole, parameter.kind is parameter.VAR_POSITIONAL)
        for parameter, whole, kind in kinds
        if kind in READERS
    )


def read(model: Contents, word: str, arguments: dict[str, Any], readings: Sequence[ArgumentReading]) -> None:
    """Bring the arguments of a call to what the method's annotations say. Raises ModelError naming method, thing and argument.

    A new name is checked, and kept in its normal form.
    """
    if "name" in arguments:
        name = arguments["name"] = normal(arguments["name"])
        check_name(name, word)
    subject = [arguments["name"]] if "name" in arguments else []
    label = arguments.get("label")
    for key, reader, is_optional, are_many in readings:
        if key not in arguments or (is_optional and arguments[key] is None):
            continue
        argument = arguments[key]
        where = label if isinstance(label, str) and label else " ".join([word, "-".join(subject)]).strip()
        address = where if key in UNNAMED_ARGUMENTS else f"{where}, {key}"
        result = tuple(reader(model, each, address) for each in argument) if are_many else reader(model, argument, address)
        if "name" not in arguments and isinstance(result, (Spatial, Relative, Component, Body)):
            subject.append(result.name)
        arguments[key] = result


def own(model: Contents, reference: object, kind: type[E], where: str) -> E:
    """An element of this model by itself or by its name. Raises ModelError for anything else."""
    if isinstance(reference, str):
        if normal(reference) not in model.elements:
            raise _unknown(kind.word, reference, where)
        reference = model.elements[normal(reference)]
    if not isinstance(reference, kind):
        raise ModelError(f"{where}: {shown(reference)} is not a {kind.word}; give one by itself or by its name")
    if not isinstance(reference, Constant) and model.elements.get(reference.name) is not reference:
        raise foreign(where, repr(reference))
    return reference


def _unknown(kind: str, name: str, where: str) -> UnknownName:
    return UnknownName(f"{where}: there is no {kind} {shortened(name, MAX_ECHO)}; define it first", normal(name))


def own_direction(model: Contents, reference: object, where: str) -> Combination:
    """A vector, a segment, or a combination of them with numbers, as a combination; it may have length zero."""
    direction = reference if isinstance(reference, Combination) else as_combination(own(model, reference, Spatial, where))
    for weight, element in direction.terms:
        own(model, element, Spatial, where)
        if not is_number(weight):
            raise ModelError(f"{where}: the weight {shown(weight)} of {element.name} is not a number; directions are combined with numbers")
    if not direction.is_direction:
        raise ModelError(f"{where}: {direction} is not a direction; give a vector or a difference of points")
    if max(map(abs, direction.initial.tolist())) > MAX_NUMBER:
        raise ModelError(f"{where}: {direction} is longer than {MAX_NUMBER:g}; the weights of its elements are too large")
    return direction


def value(model: Contents, argument: object, where: str) -> Value:
    """A number, or a parameter or an expression of parameters of this model that is a number at their defaults."""
    result = as_value(argument, where)
    if isinstance(result, float):
        return argument if type(argument) is int else result  # an integer stays one, in model files and in expressions
    _refuse_inputs(model, result, where)
    if isinstance(result, Parameter) and model.parameters.get(result.name) is not result:
        raise foreign(where, f"parameter {result.name}")
    evaluate(result, model.parameters, where)
    if is_symbolic(result) and result.is_Symbol:
        (symbol,) = symbols_in(result)
        return model.parameters[symbol.name]
    return result


def _refuse_inputs(model: Contents, given_value: object, where: str) -> None:
    """Raise ModelError where a value mentions an input: its rates would be needed there, or work would be done that nobody counts."""
    names = (
        {given_value.name}
        if isinstance(given_value, Parameter)
        else {s.name for s in symbols_in(given_value)}
        if is_symbolic(given_value)
        else set()
    )
    if driven := [name for name in model.inputs if name in names]:
        remedy = "use a parameter here"
        raise ModelError(f"{where}: {driven[0]} is an input, which stands in forces, torques, couples and outputs only; {remedy}")


def _still(model: Contents, argument: object, where: str) -> Scalar:
    """An expression without inputs."""
    result = expression(argument, where)
    _refuse_inputs(model, result, where)
    return result


def sequence(argument: object, where: str, expected: str) -> tuple[object, ...]:
    """Several things in their order. Raises ModelError for what has no order, and for texts and single things."""
    if isinstance(argument, (str, bytes, Mapping, Set)) or not isinstance(argument, Iterable) or getattr(argument, "ndim", 1) != 1:
        raise ModelError(f"{where}: {shown(argument)} given; give {expected}")
    return tuple(argument)


def expression(argument: object, where: str) -> Scalar:
    """A number, or an expression of sympy. Raises ModelError for NaN, infinity, texts and things that are neither."""
    result = as_sympy(argument)
    if not is_symbolic(result):
        if not is_number(result):
            raise ModelError(
                f"{where}: {shown(argument)} is not an expression; give a number, or one of coordinates, m.time and parameters"
            )
        return as_value(result, where)
    return without_kinks(check_expression(result, where), where)


def _curve(model: Contents, argument: object, where: str) -> object:
    curve = model.curves.get(normal(argument)) if isinstance(argument, str) else argument
    if curve is None or all(each is not curve for each in model.curves.values()):
        raise ModelError(f"{where}: {shown(argument)} is not a spline or a table of this model; make one with m.spline first")
    return curve


def _law(model: Contents, argument: object, where: str) -> Expression:
    """A tension as an expression of the symbols x and v, or as a function of both that returns one."""
    if taken := [name for name in LAW if name in model.numbers]:
        raise ModelError(f"{where}: the model has {model.numbers[taken[0]]!r}, which a law calls {LAW[taken[0]]}; rename it")
    import sympy

    law = argument(*sympy.symbols(" ".join(LAW), real=True)) if callable(argument) else argument
    result = expression(law, where)
    _refuse_inputs(model, result, where)
    return argument if is_number(argument) else sympy.sympify(result)


def coordinate(model: Contents, reference: object, where: str) -> Component | Relative:
    """One scalar coordinate that can move: an angle, a length, or a component such as B.x."""
    if isinstance(reference, str):
        name, reference = reference, model.bearer(normal(reference))
        if reference is None:
            raise _unknown("coordinate", name, where)
    if isinstance(reference, Spatial):
        raise ModelError(f"{where}: {reference!r} has three coordinates; name one, such as {shortened(reference.name, MAX_ECHO)}.x")
    if not isinstance(reference, (Component, Relative)):
        raise ModelError(f"{where}: {shown(reference)} is not a coordinate; give an angle, a length, or one such as B.x")
    bearer = model.bearer(reference.name)
    if not any(each is reference for each in (bearer, *getattr(bearer, "components", ()))):
        raise foreign(where, reference.name)
    return reference


def _body(model: Contents, reference: object, where: str) -> Body:
    if isinstance(reference, str):
        known = {model.ground.name: model.ground, **model.bodies}
        if normal(reference) not in known:
            raise _unknown("body", reference, where)
        reference = known[normal(reference)]
    if not isinstance(reference, Body):
        raise ModelError(f"{where}: {shown(reference)} is not a body; give one by itself or by its name")
    if reference is not model.ground and model.bodies.get(reference.name) is not reference:
        raise foreign(where, f"body {reference.name}")
    return reference


def _owner(model: Contents, reference: object, where: str) -> Owner:
    return reference if isinstance(reference, Owner) else Owner("body", _body(model, reference, where).name)


def row(model: Contents, reference: object, where: str) -> Row:
    """A constraint by itself, or by a label that no other one has."""
    if isinstance(reference, str):
        rows = [each for each in model.rows if each.label == reference]
        if not rows:
            raise ModelError(
                f"{where}: there is no constraint {shortened(reference, MAX_ECHO)}; give the label of one that stands before it"
            )
        if len(rows) > 1:
            raise ModelError(f"{where}: {len(rows)} constraints have the label {shortened(reference, MAX_ECHO)}; give each its own")
        return rows[0]
    if not isinstance(reference, Row):
        raise ModelError(f"{where}: {shown(reference)} is not a constraint; give one that m.constrain returned, or its label")
    if all(each is not reference for each in model.rows):
        raise foreign(where, f"constraint {reference.label}")
    return reference


def _of(kind: type[E]) -> Reader[E]:
    return lambda model, reference, where: own(model, reference, kind, where)


def _several(kind: type[E]) -> Reader[tuple[E, ...]]:
    def reader(model: Contents, references: object, where: str) -> tuple[E, ...]:
        if isinstance(references, Spatial):
            references = (references,)
        return tuple(own(model, each, kind, where) for each in sequence(references, where, f"a list of {kind.word}s, such as [A, B]"))

    return reader


def _text(model: Contents, argument: object, where: str) -> str:
    if not isinstance(argument, str):
        raise ModelError(f"{where}: {shown(argument)} is not a text; give one in quotes")
    return argument


def truth(value: object, where: str) -> bool:
    """Return True or False. Raises ModelError for anything else."""
    if not isinstance(value, (bool, np.bool_)):
        raise ModelError(f"{where}: {shown(value)} given; give True or False")
    return bool(value)


def _truth(model: Contents, argument: object, where: str) -> bool:
    return truth(argument, where)


def _held(model: Contents, argument: object, where: str) -> bool | str:
    if isinstance(argument, str):
        return argument
    if not isinstance(argument, (bool, np.bool_)):
        raise ModelError(f"{where}: {shown(argument)} given; give True, False, or the axes that cannot move, such as 'z'")
    return bool(argument)


def _number(model: Contents, argument: object, where: str) -> float:
    if not is_number(result := as_value(argument, where)):
        raise ModelError(f"{where}: {shown(argument)} depends on parameters; give a number")
    return result


def _numbers(model: Contents, argument: object, where: str) -> tuple[float, ...]:
    return tuple(_number(model, each, f"{where}, {k}") for k, each in enumerate(sequence(argument, where, "a list of numbers"), 1))


def _rows(model: Contents, argument: object, where: str) -> tuple[tuple[float, ...], ...]:
    many = tuple(argument) if isinstance(argument, np.ndarray) and argument.ndim == 2 else sequence(argument, where, "a list of places")
    return tuple(_numbers(model, each, f"{where}, {k}") for k, each in enumerate(many, 1))


def _values(model: Contents, argument: object, where: str) -> tuple[Value, ...]:
    argument = sequence(argument, where, "three numbers")
    marks = AXES if len(argument) <= len(AXES) else map(str, range(1, len(argument) + 1))
    return tuple(value(model, each, f"{where}, {mark}") for each, mark in zip(argument, marks))


READERS: dict[str, Reader[object]] = {
    "Body": _body,
    "Owner": _owner,
    "Point": _of(Point),
    "Vector": _of(Vector),
    "Spatial": _of(Spatial),
    "Relative": _of(Relative),
    "Sequence[Point]": _several(Point),
    "Sequence[Vector]": _several(Vector),
    "Sequence[Spatial]": _several(Spatial),
    "Direction": own_direction,
    "Component | Relative": coordinate,
    "Value": value,
    "Values": _values,
    "Law": _law,
    "Expression": _still,
    "Driven": lambda model, argument, where: expression(argument, where),
    "str": _text,
    "bool": _truth,
    "bool | str": _held,
    "Number": _number,
    "Numbers": _numbers,
    "Doing": actions_of,
    "Curve": _curve,
    "Row": row,
    "Sequence[Numbers]": _rows,
}
"""{annotation: reader(model, what was given, where)}."""
