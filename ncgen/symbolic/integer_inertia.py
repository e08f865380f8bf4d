"""Inertia of a body whose numbers are all known, over its basis, in integers.

Doubles are integers over powers of two, so what stands over these and over the volume of the basis is a polynomial of integers. A fraction
is reduced once for each entry, and not after each operation, which takes ten times as long.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

Integers = list[int]


def standard_in_integers(
    mass: Fraction,
    offset: Sequence[Fraction],
    tensor: Sequence[Fraction],
    axes: Sequence[Sequence[Fraction]],
    rounding: float,
    blur: float = 0.0,
) -> tuple[tuple[Fraction, ...], ...]:
    """S of a part of a body (`ncgen.symbolic.inertia`), shape (4, 4), exact, where all denominators are powers of two.

    mass (kg); offset: d (m), from the base point to the centre of mass; tensor: I by rows (kg m²); axes: the directions x₁…x₃
    rounding: entries of a and of X⁻¹ J_G X⁻ᵀ below this fraction of their scales count as zero; blur: the length (m) that differences of
        positions are known to that fraction of, at best
    """
    x, per_axis = _over_one([component for axis in axes for component in axis])
    d, per_offset = _over_one(offset)
    inertia, per_tensor = _over_one(tensor)
    m, per_mass = mass.as_integer_ratio()
    x0, x1, x2 = x[:3], x[3:6], x[6:]
    crossed = (_cross(x1, x2), _cross(x2, x0), _cross(x0, x1))  # rows of X⁻¹ times volume / per_axis
    volume = _dot(x0, crossed[0])
    sizes = [_norm(c * per_axis / volume for c in row) for row in crossed]
    away, trace = max(_norm(map(float, offset)), blur), inertia[0] + inertia[4] + inertia[8]
    half = trace / (2 * per_tensor) * max(1.0, blur * max(sizes))

    def cleaned(numerator: int, denominator: int, scale: float) -> int:
        return 0 if abs(numerator / denominator) <= rounding * scale else numerator

    unit = volume * per_offset  # of a, over per_axis
    a = [cleaned(_dot(row, d) * per_axis, unit, size * away) // per_axis for row, size in zip(crossed, sizes, strict=True)]
    turned = [[_dot(row, inertia[k::3]) for k in range(3)] for row in crossed]
    whole, rows = 2 * per_tensor * volume**2, [[Fraction(0)] * 4 for _ in range(4)]
    rows[0][0] = mass
    for i in range(3):
        rows[0][i + 1] = rows[i + 1][0] = Fraction(m * a[i] * per_axis, per_mass * unit)
        for j in range(i + 1):
            spread = _dot(crossed[i], crossed[j]) * trace - 2 * _dot(turned[i], crossed[j])
            spread = cleaned(spread * per_axis**2, whole, half * sizes[i] * sizes[j]) // per_axis**2
            numerator = spread * per_mass * per_offset**2 + 2 * per_tensor * m * a[i] * a[j]
            rows[i + 1][j + 1] = rows[j + 1][i + 1] = Fraction(numerator * per_axis**2, whole * per_mass * per_offset**2)
    return tuple(map(tuple, rows))


def _over_one(values: Sequence[Fraction]) -> tuple[Integers, int]:
    """Numerators over the largest of the denominators, and that."""
    denominator = max(value.denominator for value in values)
    return [value.numerator * (denominator // value.denominator) for value in values], denominator


def _norm(vector: Iterable[float]) -> float:
    """Raises OverflowError where it is no double."""
    return sum(x**2 for x in vector) ** 0.5


def _dot(a: Integers, b: Integers) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Integers, b: Integers) -> Integers:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
