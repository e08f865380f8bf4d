"""Exact arithmetic at 50 digits that also remembers the size of what was added up.

A `Series` holds the Taylor coefficients of a quantity along the straight motion q + s q̇, and beside each
coefficient its *scale*: the sum of the absolute values of the terms that make it up. One ulp of a row is
2⁻⁵² of its scale, the best that any order of summation in double precision can be held to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpmath import MPContext

EPSILON = 2.0**-52

mp = MPContext()
mp.dps = 50


@dataclass(frozen=True)
class Series:
    """Coefficients (mpf) of 1, s, s² …, and their scales (float); operands have the same number of coefficients."""

    values: tuple
    scales: tuple[float, ...]

    def __add__(self, other: Series) -> Series:
        values = tuple(a + b for a, b in zip(self.values, other.values, strict=True))
        return Series(values, tuple(a + b for a, b in zip(self.scales, other.scales, strict=True)))

    def __neg__(self) -> Series:
        return Series(tuple(-v for v in self.values), self.scales)

    def __sub__(self, other: Series) -> Series:
        return self + (-other)

    def __mul__(self, other) -> Series:
        """The product with another series, or with a number."""
        if not isinstance(other, Series):
            return Series(tuple(v * other for v in self.values), tuple(s * abs(float(other)) for s in self.scales))
        return Series(_product(self.values, other.values), _product(self.scales, other.scales))

    __rmul__ = __mul__

    @property
    def start(self) -> Series:
        """The constant coefficient alone: the quantity at q."""
        return Series(self.values[:1], self.scales[:1])


def _product(a, b) -> tuple:
    return tuple(sum((a[j] * b[k - j] for j in range(1, k + 1)), a[0] * b[k]) for k in range(len(a)))


def series(*values) -> Series:
    """A series of single terms: each coefficient is its own scale."""
    return Series(tuple(map(mp.mpf, values)), tuple(abs(float(v)) for v in values))


def sine_and_cosine(angle, rate) -> tuple[Series, Series]:
    """sin and cos of angle + rate s, to s²."""
    s, c = mp.sin(angle), mp.cos(angle)
    return series(s, c * rate, -s * rate**2 / 2), series(c, -s * rate, -c * rate**2 / 2)


@dataclass(frozen=True)
class Exact:
    """Numbers to about 100 bits, as nearest doubles and remainders, with their scales; arrays of one shape."""

    high: np.ndarray
    low: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, values, scales) -> Exact:
        high = np.array([float(v) for v in values])
        low = np.array([float(v - mp.mpf(h)) for v, h in zip(values, high.tolist(), strict=True)])
        return cls(high, low, np.array(scales, dtype=float))

    @classmethod
    def stack(cls, items) -> Exact:
        return cls(*(np.stack([getattr(item, name) for item in items]) for name in ("high", "low", "scale")))

    def ulps(self, computed) -> np.ndarray:
        """The error of `computed` in ulps of the scale; infinite where anything but zero was expected to be nothing."""
        error = np.abs((computed - self.high) - self.low)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(error == 0.0, 0.0, error / (self.scale * EPSILON))
