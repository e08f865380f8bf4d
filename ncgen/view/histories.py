"""Time histories of a trajectory: coordinates, energy, and how well the constraints hold."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ncgen.view.chart import GRID, empty, finished
from ncgen.view.chosen import above_lowest, grouped

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory


def plot(run: Trajectory, names: str | Iterable[str] | None = None, against: str | None = None) -> Figure:
    """Time histories of a trajectory: a panel a kind of coordinate, one for energy, one for the violation.

    names: one free coordinate or several; default: angles and lengths; where there are none the independent coordinates, else the
        first ones
    against: one quantity to plot those named over in place of the time, in one panel; both may be whatever `run[…]` has, such as
        `rate(psi)` or an output

    Raises ModelError for a name that is no free coordinate.
    """
    if against is not None:
        return _over(run, names, against)
    groups = grouped(run, names)
    chart = empty(8, 0.6 + 2.1 * (len(groups) + 2))
    panels = chart.subplots(len(groups) + 2, sharex=True)
    for axes, (label, members) in zip(panels, groups.items()):
        _lines(axes, run.t, label, {name: run[name] for name in members})
    _energy(panels[-2], run)
    _violation(panels[-1], run)
    panels[0].set_title(run.name)
    panels[-1].set_xlabel("time (s)")
    return finished(chart)


def _over(run: Trajectory, names: str | Iterable[str] | None, against: str) -> Figure:
    """Quantities over another one, with the beginning of the motion marked."""
    if isinstance(names, str):
        wanted = [names]
    else:
        wanted = [name for members in grouped(run, None).values() for name in members if name != against] if names is None else list(names)
    x = run[against]
    chart = empty(6.4, 4.8)
    axes = chart.subplots()
    _lines(axes, x, wanted[0] if len(wanted) == 1 else "", {name: run[name] for name in wanted})
    for line in axes.get_lines():
        axes.plot(x[0], np.asarray(line.get_ydata())[0], marker="o", color=line.get_color())
    axes.margins(x=0.05)
    axes.set_xlabel(against)
    axes.set_title(run.name)
    return finished(chart)


def _energy(axes: Axes, run: Trajectory) -> None:
    """Energies over time; the potential counts from its lowest value, so that it compares with the kinetic energy."""
    kinetic, potential = above_lowest(run)
    _lines(axes, run.t, "energy (J)", {"kinetic": kinetic, "potential\nabove its lowest": potential, "total": kinetic + potential})


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
