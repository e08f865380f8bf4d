"""Variants as pictures: envelopes of histories, heat maps of a grid of two, points over one number, and parallel coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ncgen.errors import NcgenError
from ncgen.view.chart import GRID, empty, finished

COLOURS = "viridis"
BAND, MIDDLE = "#4477aa", "#222222"
ENVELOPE_FRACTIONS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Shares of the variants below the lines of an envelope."""

MOST_LINES = 2000
"""Variants drawn in parallel coordinates, evenly taken from all: more cannot be told apart."""

Columns = Mapping[str, np.ndarray]


def picture(title: str, varied: Columns, kept: Columns, times: np.ndarray, shape: tuple[int, ...] | None) -> Figure:
    """A figure of what was kept over what varied.

    varied: {name: (B,)}; kept: {word: (B,) or (B, times)}; shape: of a complete grid, else None
    Raises NcgenError where there is no variant that arrived.
    """
    if not kept or not any(np.isfinite(np.asarray(values, dtype=float)).any() for values in kept.values()):
        raise NcgenError(f"{title}: there is nothing to draw; no variant completed")
    histories = {name: values for name, values in kept.items() if values.ndim > 1}
    single = {name: values for name, values in kept.items() if values.ndim == 1}
    if histories:
        return _panels(title, histories, lambda axes, name, values: _envelope(axes, name, values, times))
    if shape is not None and len(shape) == 2 and min(shape) > 1:
        return _panels(title, single, lambda axes, name, values: _map(axes, name, values.reshape(shape), varied, shape))
    if len(varied) == 1:
        ((varied_name, numbers),) = varied.items()
        return _panels(title, single, lambda axes, name, values: _scatter(axes, name, values, varied_name, numbers))
    return _parallel(title, varied, single)


def _panels(title: str, kept: Columns, draw: Any) -> Figure:
    """A panel for each column, one above the other."""
    chart = empty(6.8, 0.6 + 2.8 * len(kept))
    for k, (name, values) in enumerate(kept.items(), 1):
        axes = chart.add_subplot(len(kept), 1, k)
        draw(axes, name, values.astype(float))
        axes.set_title(title if k == 1 else "")
    return finished(chart)


def _envelope(axes: Axes, name: str, values: np.ndarray, times: np.ndarray) -> None:
    arrived = values[np.isfinite(values).all(axis=1)]
    lines = np.quantile(arrived, ENVELOPE_FRACTIONS, axis=0)
    for k in range(len(ENVELOPE_FRACTIONS) // 2):
        label = f"{100 * ENVELOPE_FRACTIONS[k]:g} to {100 * ENVELOPE_FRACTIONS[-1 - k]:g} %"
        axes.fill_between(times, lines[k], lines[-1 - k], color=BAND, alpha=0.15 + 0.15 * k, linewidth=0, label=label, gid="band")
    axes.plot(times, lines[len(ENVELOPE_FRACTIONS) // 2], color=MIDDLE, linewidth=1.2, label="median", gid="median")
    axes.set(xlabel="t (s)", ylabel=name)
    axes.grid(**GRID)
    axes.legend(fontsize=7)


def _map(axes: Axes, name: str, values: np.ndarray, varied: Columns, shape: tuple[int, ...]) -> None:
    (below, x), (vertical, y) = ((varied_name, numbers.reshape(shape)) for varied_name, numbers in varied.items())
    mesh = axes.pcolormesh(x[:, 0], y[0], np.ma.masked_invalid(values.T), cmap=COLOURS, shading="nearest")
    axes.set(xlabel=below, ylabel=vertical, facecolor="#eeeeee")
    axes.figure.colorbar(mesh, ax=axes, label=name, use_gridspec=False)


def _scatter(axes: Axes, name: str, values: np.ndarray, varied_name: str, numbers: np.ndarray) -> None:
    axes.plot(numbers, values, linestyle="", marker=".", markersize=3, color=BAND, gid="variants")
    axes.set(xlabel=varied_name, ylabel=name)
    axes.grid(**GRID)


def _parallel(title: str, varied: Columns, kept: Columns) -> Figure:
    """A line a variant through all columns, each from its smallest to its largest number, coloured by the last."""
    names = [*varied, *kept]
    rows = np.column_stack([np.asarray(column, dtype=float) for column in (*varied.values(), *kept.values())])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        raise NcgenError(f"{title}: no variant has all numbers; choose other columns")
    low, span = rows.min(axis=0), np.ptp(rows, axis=0)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_LINES).astype(int))]
    heights = np.where(span > 0, (rows - low) / np.where(span > 0, span, 1.0), 0.5)
    chart = empty(max(6.4, 1.1 * len(names)), 4.2)
    axes = chart.add_subplot(ylim=(-0.05, 1.05), yticks=[])
    colours = _colours(rows[:, -1])
    for line, colour in zip(heights, colours, strict=True):
        axes.plot(range(len(names)), line, color=colour, linewidth=0.6, alpha=max(0.08, min(1.0, 60 / len(rows))), gid="variant")
    for k in range(len(names)):
        axes.axvline(k, color=MIDDLE, linewidth=0.8)
        for height, value, side in ((0.0, low[k], "top"), (1.0, low[k] + span[k], "bottom")):
            axes.text(k, height, f"{value:.4g}", ha="center", va=side, fontsize=7)
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize=8)
    axes.set_title(title, pad=14)
    return finished(chart)


def _colours(values: np.ndarray) -> np.ndarray:
    from matplotlib import colormaps

    return colormaps[COLOURS](Normalize()(values))
