"""Time histories of a trajectory: coordinates, energy, and how well the constraints hold."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ncgen.model import Model
from ncgen.model.elements import Relative
from ncgen.solver.given import names_of
from ncgen.view.chart import GRID, empty, settle

if TYPE_CHECKING:
    from ncgen.solver.trajectory import Trajectory

MOST = 6
"""How many coordinates are shown where the caller names none and there are no angles or lengths."""


def plot(run: Trajectory, names: str | Iterable[str] | None = None) -> Figure:
    """Time histories of a trajectory: a panel a kind of coordinate, one for energy, one for the violation.

    names: one free coordinate or several; default: angles and lengths; where there are none the independent coordinates, else the
        first ones

    Raises ModelError for a name that is no free coordinate.
    """
    groups = _grouped(run.model, _chosen(run, names))
    chart = empty(8, 0.6 + 2.1 * (len(groups) + 2))
    panels = chart.subplots(len(groups) + 2, sharex=True)
    for axes, (label, members) in zip(panels, groups.items()):
        _lines(axes, run.t, label, {name: run[name] for name in members})
    _energy(panels[-2], run)
    _violation(panels[-1], run)
    panels[0].set_title(run.name)
    panels[-1].set_xlabel("time (s)")
    return settle(chart)


def _chosen(run: Trajectory, names: str | Iterable[str] | None) -> tuple[str, ...]:
    free = tuple(run.coordinates)
    if names is not None:
        return names_of(names, "names", free)
    relative = tuple(name for name in free if isinstance(run.model.elements.get(name), Relative))
    return relative or (run.model.chosen_independent or free)[:MOST]


def _grouped(model: Model, names: Iterable[str]) -> dict[str, list[str]]:
    """The names by the label of their panel, which is that of their element's kind: angles and lengths first, else in the order given."""
    owners = {component.name: element for element in model.elements.values() for component in element.components}
    groups: dict[str, list[str]] = {}
    for name in sorted(names, key=lambda name: not isinstance(owners[name], Relative)):
        groups.setdefault(f"{owners[name].quantity} ({owners[name].unit})", []).append(name)
    return groups


def _energy(axes: Axes, run: Trajectory) -> None:
    """Energies over time; the potential counts from its lowest value, so that it compares with the kinetic energy."""
    kinetic, potential, _ = np.asarray(run.energy(), dtype=float).T
    above = potential - potential.min()
    _lines(axes, run.t, "energy (J)", {"kinetic": kinetic, "potential\nabove its lowest": above, "total": kinetic + above})


def _violation(axes: Axes, run: Trajectory) -> None:
    """The largest constraint error over time, on a logarithmic scale; exact zeros are left out."""
    violation = np.asarray(run.violation(), dtype=float)
    positive = violation > 0
    axes.set_yscale("log")
    _lines(axes, run.t, "largest |Φ|", {"violation": np.where(positive, violation, np.nan)})
    if not positive.any():
        axes.set_ylim(1e-17, 1e-15)


def _lines(axes: Axes, t: np.ndarray, label: str, curves: dict[str, np.ndarray]) -> None:
    for name, values in curves.items():
        axes.plot(t, values, label=name, linewidth=1.5)
    axes.set_ylabel(label)
    axes.grid(**GRID)
    axes.margins(x=0)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False, fontsize=9)
