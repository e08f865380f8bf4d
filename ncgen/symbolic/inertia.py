"""Inertia of a body on its basis, in exact rational arithmetic.

For a base point r and directions x₁…x₃ the kinetic energy is ½ Σ s_kl v_k·v_l over (r, x₁, x₂, x₃) with

    S = [ m    m aᵀ ]    a = X⁻¹ d,  Z = X⁻¹ (J_G + m d dᵀ) X⁻ᵀ,  d = com − r,  J_G = ½ tr(I) 1 − I
        [ m a   Z   ]

(natural coordinates, 2.2), summed over what is fixed to the body. Numbers are doubles taken as fractions, so S is exact and is rounded
once. Where positions, masses or moments have parameters, entries are expressions of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeAlias, cast
from weakref import WeakKeyDictionary

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.bodies import Body, Inertia
from ncgen.model.catalogue import cross, dot
from ncgen.model.elements import Component, Point, Spatial
from ncgen.model.expressions import is_symbolic
from ncgen.model.rigid import NORMAL
from ncgen.model.values import Parameter, Value, as_sympy, evaluate, is_number, vanishes
from ncgen.symbolic.integer_inertia import standard_in_integers

if TYPE_CHECKING:
    import sympy

ROUNDING = 1e-14
"""Relative weights below this are rounding of the user's decimal numbers (a centre meant to be on a line) and count as zero."""

BLUR = 0.1
"""Differences of positions are known no better than those of points that are this share of their distance from the origin apart, which
rounding is the ROUNDING of: a mechanism far from the origin has no masses that are rounding."""

OFF_AXIS = 1e-9
"""How far (relative to the bar's length) a bar's centre of mass may be from its line."""


Exact: TypeAlias = "Fraction | sympy.Expr"
"""A number as the fraction that it is, or an expression where parameters have a say."""

Form: TypeAlias = tuple[tuple[float, tuple[Component, ...]], ...]
"""A linear form of elements: pairs (weight, the element's components)."""


@dataclass(frozen=True)
class StandardInertia:
    """S over base point and directions, and the directions as linear forms.

    directions: the base point is first
    crossed: True if the last row belongs to x₁ × x₂ instead of an element
    """

    directions: tuple[Form, ...]
    matrix: tuple[tuple[Exact, ...], ...]
    crossed: bool = False


_known: WeakKeyDictionary[Inertia, dict[tuple[Spatial, ...], StandardInertia]] = WeakKeyDictionary()
"""{inertia: {elements of its body: the inertia over their basis}}."""


def standard_inertia(body: Body, parameters: dict[str, Parameter]) -> StandardInertia:
    """The inertia of a body over its basis, found once; raises ModelError where a small basis cannot carry it."""
    known, elements = _known.setdefault(body.own_inertia, {}), tuple(body.elements)
    if elements not in known:
        known[elements] = _over_basis(body, body.basis, parameters)
    return known[elements]


def take_standard(body: Body, standard: StandardInertia) -> None:
    """Let this be a body's inertia over its basis."""
    _known.setdefault(body.own_inertia, {})[tuple(body.elements)] = standard


def _over_basis(body: Body, basis: tuple[Spatial, ...], parameters: dict[str, Parameter]) -> StandardInertia:
    inertia = body.own_inertia
    base = next(e for e in basis if isinstance(e, Point))
    elements = [e for e in basis if e is not base]
    forms: list[Form] = [((1.0, base.components),)]
    for element in elements:
        forms.append(((1.0, element.components), (-1.0, base.components)) if isinstance(element, Point) else ((1.0, element.components),))
    axes = [_exact(e.given) for e in elements]
    origin = _exact(base.given)
    axes = [[x - (o if isinstance(e, Point) else 0) for x, o in zip(v, origin, strict=True)] for v, e in zip(axes, elements, strict=True)]
    if len(elements) < 2 and not (elements and _is_planar(base, elements[0])):
        offset = [c - o for c, o in zip(_exact(inertia.com), origin, strict=True)]
        small = _bar(body, inertia, axes[0], offset, forms, parameters) if elements else None
        return small or _point_mass(body, inertia, offset, forms, parameters)
    if len(elements) == 1:
        forms.append(((1.0, NORMAL.components),))
        axes.append(_exact([0.0, 0.0, 1.0]))
    crossed = len(axes) == 2
    if crossed:
        axes.append(list(cross(axes[0], axes[1])))
    matrix, *further = (_standard(part_inertia, axes, origin, parameters) for part_inertia in inertia.parts or (inertia,))
    for other in further:
        matrix = tuple(tuple(_plus(a, b) for a, b in zip(*rows, strict=True)) for rows in zip(matrix, other, strict=True))
    return StandardInertia(tuple(forms), matrix, crossed)


def centre_weights(standard: StandardInertia) -> tuple[Exact, ...]:
    """m (1, a): how the body's weight is shared between base point and directions."""
    return standard.matrix[0]


def _standard(
    inertia: Inertia, axes: Sequence[Sequence[Exact]], origin: Sequence[Exact], parameters: dict[str, Parameter]
) -> tuple[tuple[Exact, ...], ...]:
    mass, lever, tensor = _mass(inertia.mass), [*_exact(inertia.com), *origin], [x for row in inertia.tensor for x in _exact(row)]
    offset = [c - o for c, o in zip(lever[:3], origin, strict=True)]
    blur = BLUR * max(abs(evaluate(x, parameters, "")) for x in lever)
    if not any(map(is_symbolic, (mass, *offset, *tensor, *chain(*axes)))):
        return standard_in_integers(*cast(Any, (mass, offset, tensor, axes)), rounding=ROUNDING, blur=blur)
    inverse = _inverse(axes)
    sizes = [_norm(row, parameters) for row in inverse]
    half = sum((tensor[4 * k] for k in range(3)), Fraction(0)) / 2
    planar = [[(half if k == l else 0) - tensor[3 * k + l] for l in range(3)] for k in range(3)]
    is_numeric = not any(is_symbolic(x) for row in inverse for x in row)

    def along(i: int) -> Exact:
        """An entry of X⁻¹ d."""
        if is_numeric:
            return _combined([*inverse[i], *(-x for x in inverse[i])], lever, sizes[i])
        return dot(inverse[i], offset)

    def moment(i: int, j: int) -> Exact:
        """An entry of X⁻¹ J_G X⁻ᵀ, by the entries of I where X is of numbers."""
        if is_numeric:
            even = dot(inverse[i], inverse[j]) / 2
            shares = [(even if k == l else 0) - inverse[i][k] * inverse[j][l] for k in range(3) for l in range(3)]
            return _combined(shares, tensor, sizes[i] * sizes[j])
        return dot(inverse[i], [dot(planar[k], inverse[j]) for k in range(3)])

    # Directions have sizes of their own, so every entry has its scale.
    away, whole = max(_norm(offset, parameters), blur), evaluate(half, parameters, "") * max(1.0, blur * max(sizes))
    a = [_cleaned(along(i), sizes[i] * away) for i in range(3)]
    spread: list[list[Exact]] = [[Fraction(0)] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i + 1):
            spread[i][j] = spread[j][i] = _cleaned(moment(i, j), whole * sizes[i] * sizes[j])
    top = (mass, *(_times(mass, x) for x in a))
    rows = [(_times(mass, a[k]), *(_plus(spread[k][l], _times(mass, a[k] * a[l])) for l in range(3))) for k in range(3)]
    return (top, *map(tuple, rows))


def _combined(shares: Sequence[Exact], values: Sequence[Exact], size: float) -> Exact:
    """Σ share · value, of shares that are numbers, with each term of the values once and none whose share is rounding next to `size`."""
    number, coefficients = Fraction(0), defaultdict["sympy.Expr", Fraction](Fraction)
    for coefficient, value in zip(shares, values, strict=True):
        assert isinstance(coefficient, Fraction | int)
        if isinstance(value, Fraction):
            number += coefficient * value
            continue
        for term, factor in value.as_coefficients_dict().items():
            if term == 1:
                number += coefficient * Fraction(float(factor))
            else:
                coefficients[term] += coefficient * Fraction(float(factor))
    if not coefficients:
        return number
    import sympy

    terms = [
        sympy.Float(float(coefficient)) * term if coefficient != 1 else term
        for term, coefficient in coefficients.items()
        if abs(coefficient) > ROUNDING * size
    ]
    return sympy.Add(*terms, *([sympy.Float(float(number))] if number else [])) if terms else number


def _norm(vector: Iterable[Exact], parameters: dict[str, Parameter]) -> float:
    """The length of a vector at the parameters' defaults."""
    return sum(evaluate(x, parameters, "") ** 2 for x in vector) ** 0.5


def _cleaned(value: Exact, scale: float) -> Exact:
    """A value, 0 where it is a number that is rounding; parameters that cancel leave a number."""
    if is_symbolic(value) and value.free_symbols:
        return value
    number = Fraction(float(value)) if is_symbolic(value) else value
    return number if abs(number) > ROUNDING * scale else Fraction(0)


def _point_mass(
    body: Body, inertia: Inertia, offset: Sequence[Exact], forms: Sequence[Form], parameters: dict[str, Parameter]
) -> StandardInertia:
    size = max(abs(evaluate(x, parameters, "")) for x in inertia.com)
    away = not all(_vanishes(x, parameters, ROUNDING * size) for x in offset)
    if away or not all(_vanishes(x, parameters, 0.0) for x in inertia.tensor.flat):
        raise ModelError(
            f"body {body.name}: on one point only a point mass is possible; give com at the point{_with_parameters(offset)} "
            "and no inertia, or more elements"
        )
    return StandardInertia(tuple(forms), ((_mass(inertia.mass),),))


def _bar(
    body: Body, inertia: Inertia, axis: Sequence[Exact], offset: Sequence[Exact], forms: Sequence[Form], parameters: dict[str, Parameter]
) -> StandardInertia:
    """Two elements in space: the rotational inertia across their line counts, spin about it cannot be described."""
    squared = dot(axis, axis)
    along = dot(axis, offset) / squared
    length = evaluate(squared, parameters, "") ** 0.5 if not isinstance(squared, Fraction) else float(squared) ** 0.5
    across = [o - along * x for o, x in zip(offset, axis, strict=True)]
    if not all(_vanishes(x, parameters, OFF_AXIS * length) for x in across):
        raise ModelError(
            f"body {body.name}: its centre of mass is not on the line of its two elements{_with_parameters(across)}; "
            "add a vector to the basis"
        )
    tensor = [_exact(row) for row in inertia.tensor]
    spin = dot(axis, [dot(row, axis) for row in tensor]) / squared
    transverse = (sum((tensor[k][k] for k in range(3)), Fraction(0)) - spin) / 2
    ideal = [
        [transverse * (int(k == l) - x * y / squared) + spin * x * y / squared for l, y in enumerate(axis)] for k, x in enumerate(axis)
    ]
    size = max(abs(evaluate(x, parameters, "")) for x in inertia.tensor.flat)
    gaps = [tensor[k][l] - ideal[k][l] for k in range(3) for l in range(3)]
    if not all(_vanishes(x, parameters, OFF_AXIS * size) for x in gaps):
        raise ModelError(
            f"body {body.name}: a body on two elements must be symmetric about their line{_with_parameters(gaps)}; "
            "add a vector to the basis"
        )
    mass = _mass(inertia.mass)
    ma = _times(mass, along)
    return StandardInertia(tuple(forms), ((mass, ma), (ma, _plus(transverse / squared, _times(mass, along * along)))))


def _vanishes(value: Value, parameters: dict[str, Parameter], bound: float) -> bool:
    return vanishes(float(value) if isinstance(value, Fraction) else value, parameters, bound)


def _with_parameters(values: Iterable[Exact]) -> str:
    """What a message adds where parameters are the reason."""
    return " at all values of its parameters" if any(map(is_symbolic, values)) else ""


def _is_planar(base: Point, other: Spatial) -> bool:
    """True if both stay in one plane of constant z: then the plane's normal is the body's third direction."""
    height, level = other.components[2], base.components[2]
    return height.fixed and level.fixed and height.value == (level.value if isinstance(other, Point) else 0.0)


def _exact(values: Iterable[Value] | np.ndarray) -> list[Exact]:
    """Numbers as the fractions that they are; expressions of parameters stay."""
    return [Fraction(float(v)) if is_number(v) else as_sympy(v) for v in values]


def _inverse(axes: Sequence[Sequence[Exact]]) -> list[list[Exact]]:
    """Rows of X⁻¹, the reciprocal basis, of the columns `axes`."""
    volume = dot(axes[0], cross(axes[1], axes[2]))
    return [[x / volume for x in cross(axes[(k + 1) % 3], axes[(k + 2) % 3])] for k in range(3)]


def _mass(mass: Value) -> Exact:
    return _exact([mass])[0]


def _times(mass: Exact, factor: Exact) -> Exact:
    """mass·factor: exact for numbers, a sympy expression for parameters."""
    if isinstance(mass, Fraction):
        return mass * factor
    import sympy

    return mass * (sympy.Float(float(factor)) if isinstance(factor, Fraction) else factor) if factor else Fraction(0)


def _plus(number: Exact, term: Exact) -> Exact:
    if isinstance(term, Fraction) or not isinstance(number, Fraction):
        return number + term
    import sympy

    return term + sympy.Float(float(number)) if number else term
