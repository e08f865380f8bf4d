"""Sobol' indices: which share of a result's variance comes from what varied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import NcgenError

MIN_POINTS = 8
"""Points of a design below which shares of a variance mean nothing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Indices:
    """Of what varied, in the order of `names`: first (k,), its own share, and total (k,), with all in which it takes part.

    points: of the design that they come from, `of` as many as there were; the others have a variant that failed, or are cut to a power of 2
    """

    names: tuple[str, ...]
    first: np.ndarray
    total: np.ndarray
    points: int
    of: int

    def __repr__(self) -> str:
        return f"<Indices of {len(self.names)} numbers from {self.points} of {self.of} points>"

    def __str__(self) -> str:
        width = max(map(len, self.names))
        lines = [f"{'':<{width}}  first  total"]
        lines += [f"{n:<{width}}  {a:5.3f}  {b:5.3f}" for n, a, b in zip(self.names, self.first, self.total, strict=True)]
        return "\n".join([*lines, f"from {self.points} of {self.of} points"])


def indices(names: tuple[str, ...], values: np.ndarray) -> Indices:
    """From the values (points (k + 2),) of Saltelli's design. Raises NcgenError where too few points have all their values."""
    from scipy.stats import sobol_indices

    parts = values.reshape(len(names) + 2, -1)
    points = np.flatnonzero(np.isfinite(parts).all(axis=0))
    count = 1 << (len(points).bit_length() - 1) if len(points) else 0
    if count < MIN_POINTS:
        raise NcgenError(
            f"Sobol' indices: {len(points)} of {parts.shape[1]} points have all their variants; at least {MIN_POINTS} are needed"
        )
    a, b, *mixed = parts[:, points[:count]]
    sobol = sobol_indices(func={"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}, n=count)
    shape = (len(names),)
    return Indices(
        names=names, first=np.reshape(sobol.first_order, shape), total=np.reshape(sobol.total_order, shape), points=count, of=parts.shape[1]
    )
