"""What varies: the numbers of every variant, found from its number alone.

A variant is the same in every chunk, process and restart: sequences are entered at its number, random numbers come in blocks that
have seeds of their own.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ncgen.errors import ModelError, counted, one_of
from ncgen.model.elements import coordinate_of
from ncgen.solver.argument_checks import count as whole
from ncgen.solver.argument_checks import echo, finite, offer, positive

if TYPE_CHECKING:
    from scipy.stats.qmc import QMCEngine

Varied: TypeAlias = "Mapping[str, Any]"
"""In signatures: {name: numbers, {"low": …, "high": …} or {"mean": …, "deviation": …}}."""

BLOCK = 4096
"""Random variants that have a seed in common."""

RANGE, NORMAL = ("low", "high"), ("mean", "deviation")
WORDS = (*RANGE, "scale", "count", *NORMAL)
SCALES = ("linear", "log")

MAX_VARIANTS = 2**52
"""Variants that can be counted."""

MOST_AT_ONCE = 50_000_000
"""Numbers of a Latin square, which exists only as a whole."""


@dataclass(frozen=True)
class VariedAxis:
    """How one number varies: `values`, or a distribution ("linear" or "log" between `ends`, "normal" with `ends` = mean, deviation)."""

    name: str
    values: tuple[float, ...] = ()
    kind: str = "list"
    ends: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, name: str, argument: object) -> VariedAxis:
        """From what the caller says. Raises ModelError naming what varies."""
        where = f"vary, {name}"
        if not isinstance(argument, Mapping):
            return cls(name, _numbers(argument, where))
        if unknown := [word for word in argument if word not in WORDS]:
            raise ModelError(f"{where}: {echo(unknown[0])} is unknown; {offer(unknown[0], WORDS, 'there are')}")
        if set(argument) == set(NORMAL):
            ends = finite(argument["mean"], f"{where}: mean"), positive(argument["deviation"], f"{where}: deviation")
            return cls(name, kind="normal", ends=ends)
        if not set(RANGE) <= set(argument) or set(argument) & set(NORMAL):
            raise ModelError(f"{where}: {echo(dict(argument))} given; give a list of numbers, low and high, or mean and deviation")
        low, high = (finite(argument[word], f"{where}: {word}") for word in RANGE)
        scale = argument.get("scale", SCALES[0])
        one_of(scale, f"{where}: scale", SCALES)
        if not low < high or (scale == "log" and low <= 0):
            raise ModelError(f"{where}: from {low:g} to {high:g} given; low is below high{', and above 0' if scale == 'log' else ''}")
        axis = cls(name, kind=scale, ends=(low, high))
        if "count" not in argument:
            return axis
        return cls(name, tuple(axis.at(np.linspace(0, 1, whole(argument["count"], f"{where}: count"))).tolist()))

    def at(self, shares: np.ndarray) -> np.ndarray:
        """The numbers below which these shares, from 0 to 1, of all variants lie; of a list each with the same probability."""
        low, high = self.ends
        if self.kind == "linear":
            return low + shares * (high - low)
        if self.kind == "log":
            return np.exp(math.log(low) + shares * (math.log(high) - math.log(low)))
        if self.kind == "normal":
            from scipy.special import ndtri

            return low + high * ndtri(np.clip(shares, 2.0**-53, 1 - 2.0**-53))
        return np.array(self.values)[np.minimum((shares * len(self.values)).astype(int), len(self.values) - 1)]


def _numbers(argument: object, where: str) -> tuple[float, ...]:
    """A list of real numbers, NaN included: their variants will say so."""
    try:
        array = np.asarray(argument)
        fits = array.ndim == 1 and array.size > 0 and array.dtype.kind in "iuf"
    except ValueError:
        fits, array = False, np.empty(0)
    if not fits:
        raise ModelError(f"{where}: {echo(argument)} given; give a list of numbers, low and high, or mean and deviation")
    return tuple(array.astype(float).tolist())


@dataclass(frozen=True, kw_only=True)
class Design:
    """All variants: axes, and the kind of design, with its size and seed where it has them."""

    axes: tuple[VariedAxis, ...]
    kind: str = "grid"
    count: int | None = None
    seed: int = 0
    _engines: dict[str, Any] = field(default_factory=dict, repr=False, compare=False, hash=False)

    @classmethod
    def of(cls, vary: Varied, kind: str = "grid", count: int | None = None, seed: int = 0) -> Design:
        """From what the caller says. Raises ModelError with one sentence."""
        if not isinstance(vary, Mapping) or not vary:
            raise ModelError(f"vary: {echo(vary)} given; give {{name: numbers}} for at least one parameter or start")
        one_of(kind, "design", KINDS)
        design = cls(axes=tuple(VariedAxis.of(str(name), argument) for name, argument in vary.items()), kind=kind)
        design._check()
        if kind in LISTED:
            if count is not None:
                raise ModelError(
                    f"count: {echo(count)} given, but a {kind} has {counted(design.size, 'variant')} by itself; leave count out"
                )
            return design
        if count is None:
            counted_things = "points its indices come from" if kind == "saltelli" else "variants there are"
            raise ModelError(f"design {kind!r} needs count: how many {counted_things}")
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise ModelError(f"seed: {echo(seed)} given; give a whole number from 0 on")
        made = cls(axes=design.axes, kind=kind, count=whole(count, "count"), seed=seed)
        if kind == "saltelli" and len(made.axes) < 2:
            raise ModelError(f"vary: {made.names[0]} alone varies, so all of the variance is its own; Sobol' indices need two names")
        if kind == "saltelli" and made._points & (made._points - 1):
            raise ModelError(f"count: {count} given; Sobol' indices need a power of 2, such as {2 ** made._points.bit_length()}")
        if kind == "latin" and made.size * len(made.axes) > MOST_AT_ONCE:
            raise ModelError(f"count: a Latin square of {count} variants does not fit into memory; take design='sobol'")
        if made.size > MAX_VARIANTS:
            raise ModelError(f"count: {made.size:.3g} variants cannot be counted; take fewer")
        return made

    def _check(self) -> None:
        if self.kind not in LISTED:
            return
        if endless := [axis.name for axis in self.axes if axis.kind != "list"]:
            raise ModelError(f"vary, {endless[0]}: in a {self.kind} it is a list of numbers, or low, high and count")
        if self.kind == "list" and len({len(axis.values) for axis in self.axes}) > 1:
            sizes = ", ".join(f"{axis.name} has {len(axis.values)}" for axis in self.axes)
            raise ModelError(f"vary: in a list all have as many numbers, one a variant; {sizes}")
        if self.size > MAX_VARIANTS:
            raise ModelError(f"vary: a grid of {self.size:.3g} variants cannot be counted; take fewer")

    @property
    def names(self) -> tuple[str, ...]:
        """What varies, in order."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of a grid how many numbers each name has, the last varying fastest; else the number of variants."""
        return tuple(len(axis.values) for axis in self.axes) if self.kind == "grid" else (self.size,)

    @property
    def _points(self) -> int:
        return self.count or 0

    @property
    def size(self) -> int:
        """How many variants there are."""
        if self.kind == "grid":
            return math.prod(len(axis.values) for axis in self.axes)
        if self.kind == "list":
            return len(self.axes[0].values)
        return self._points * (len(self.axes) + 2 if self.kind == "saltelli" else 1)

    def rows(self, first: int, count: int) -> np.ndarray:
        """The numbers (count, names) of the variants from `first` on."""
        if self.kind == "grid":
            indices = np.unravel_index(np.arange(first, first + count), self.shape)
            return np.column_stack([np.array(axis.values)[index] for axis, index in zip(self.axes, indices, strict=True)])
        if self.kind == "list":
            return np.column_stack([axis.values[first : first + count] for axis in self.axes])
        shares = KINDS[self.kind](self, first, count)
        return np.column_stack([axis.at(column) for axis, column in zip(self.axes, shares.T, strict=True)])

    def __getstate__(self) -> dict[str, Any]:
        """Pickled without the place that a sequence has come to."""
        return {**vars(self), "_engines": {}}

    # -- shares (count, names) from 0 to 1 -------------------------------------------------------------------------------------------------

    def _random(self, first: int, count: int) -> np.ndarray:
        blocks = range(first // BLOCK, (first + count - 1) // BLOCK + 1)
        drawn = [np.random.default_rng([self.seed, block]).random((BLOCK, len(self.axes))) for block in blocks]
        start = first - blocks[0] * BLOCK
        return np.concatenate(drawn)[start : start + count]

    @cached_property
    def _square(self) -> np.ndarray:
        from scipy.stats.qmc import LatinHypercube

        return LatinHypercube(len(self.axes), **_seeded(LatinHypercube, self.seed)).random(self.size)

    def _latin(self, first: int, count: int) -> np.ndarray:
        return self._square[first : first + count]

    def _sobol(self, first: int, count: int) -> np.ndarray:
        from scipy.stats.qmc import Sobol

        return self._sequence(Sobol, len(self.axes), first, count)

    def _halton(self, first: int, count: int) -> np.ndarray:
        from scipy.stats.qmc import Halton

        return self._sequence(Halton, len(self.axes), first, count)

    def _saltelli(self, first: int, count: int) -> np.ndarray:
        """Saltelli's design: A, B, then A with one column of B, for every name: in the order of `scipy.stats.sobol_indices`."""
        from scipy.stats.qmc import Sobol

        names, blocks = len(self.axes), []
        while count:
            matrix, start = divmod(first, self._points)
            size = min(count, self._points - start)
            both = self._sequence(Sobol, 2 * names, start, size)
            rows = both[:, names:] if matrix == 1 else both[:, :names].copy()
            if matrix > 1:
                rows[:, matrix - 2] = both[:, names + matrix - 2]
            blocks.append(rows)
            first, count = first + size, count - size
        return np.concatenate(blocks)

    def _sequence(self, kind: Callable[..., QMCEngine], width: int, first: int, count: int) -> np.ndarray:
        """Members of a scrambled sequence; the engine stays where it is, since entering a sequence takes time."""
        engine = self._engines.pop("engine", None)
        if engine is None or engine.num_generated > first:
            engine = kind(width, **_seeded(kind, self.seed))
        if first > engine.num_generated:
            engine.fast_forward(first - engine.num_generated)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a first part that is no power of 2
            rows_drawn = engine.random(count)
        self._engines["engine"] = engine
        return rows_drawn


def _seeded(kind: Callable[..., Any], seed: int) -> dict[str, Any]:
    """The seed by the name that this SciPy has for it."""
    from inspect import signature

    return {"rng" if "rng" in signature(kind).parameters else "seed": np.random.default_rng(seed)}


KINDS: dict[str, Callable[[Design, int, int], np.ndarray]] = {
    "grid": Design.rows,
    "list": Design.rows,
    "random": Design._random,
    "latin": Design._latin,
    "sobol": Design._sobol,
    "halton": Design._halton,
    "saltelli": Design._saltelli,
}
"""{design: shares of its variants}; a grid and a list have numbers of their own."""

LISTED = ("grid", "list")


def started(name: str) -> str | None:
    """The coordinate or velocity whose start `start(…)` is; None for a parameter."""
    return name[6:-1] if name.startswith("start(") and name.endswith(")") else None


def argument_of(name: str) -> tuple[str, str]:
    """The argument of `simulate` that a varied name is part of, and its name there."""
    inner = started(name)
    if inner is None:
        return "p", name
    coordinate = coordinate_of(inner)
    return ("q0" if coordinate == inner else "zd0"), coordinate


def table(path: str, text: str) -> dict[str, Sequence[float]]:
    """What varies from the text of a CSV file: a header line of names, then a line a variant. Raises ModelError with the line."""
    import csv

    try:
        lines = [(number, line) for number, line in enumerate(csv.reader(text.splitlines()), 1) if line]
    except csv.Error as error:
        raise ModelError(f"{path}: no table of comma-separated values ({error})") from None
    if len(lines) < 2:
        raise ModelError(f"{path}: a table has a line of names and at least one line of numbers")
    names = [name.strip() for name in lines[0][1]]
    if len(set(names)) < len(names) or not all(names):
        raise ModelError(f"{path}, line {lines[0][0]}: every column has a name of its own")
    columns: list[list[float]] = [[] for _ in names]
    for number, line in lines[1:]:
        if len(line) != len(names):
            raise ModelError(f"{path}, line {number}: {counted(len(line), 'number')}, {len(names)} needed")
        for name, column, cell in zip(names, columns, line, strict=True):
            try:
                column.append(float(cell))
            except ValueError:
                raise ModelError(f"{path}, line {number}: {name}: {echo(cell)} is no number") from None
    return dict(zip(names, columns, strict=True))
