"""Curves of a trajectory, one picture below the other: coordinates, energy, and how well the constraints hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ncgen.view.chosen import above_lowest, grouped
from ncgen.view.curve_pictures import curves
from ncgen.view.svg import SvgDrawing, below_each_other

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

PANELS, LINES = 2, 6
"""Pictures of coordinates, and curves in each."""


def curves_of_motion(run: Trajectory) -> SvgDrawing:
    """Angles and lengths, or the independent coordinates; energies where there are any; the largest |Φ| as its power of ten."""
    drawn = [curves(run.t, {name: run[name] for name in names[:LINES]}, label) for label, names in [*grouped(run).items()][:PANELS]]
    kinetic, potential = above_lowest(run)
    if np.isfinite(kinetic + potential).any():
        energies = {"kinetic": kinetic, "potential above its lowest": potential, "total": kinetic + potential}
        drawn.append(curves(run.t, energies, "energy (J)"))
    violation = np.asarray(run.violation(), dtype=float)
    if (violation > 0).any():
        powers = np.log10(violation, out=np.full_like(violation, np.nan), where=violation > 0)
        drawn.append(curves(run.t, {"of the largest |Φ|": powers}, "power of ten"))
    return below_each_other(drawn, f"{run.name} over time")
