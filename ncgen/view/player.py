"""The player: one HTML file that shows a trajectory moving, with its data inside and nothing fetched from anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ncgen.emit.environment import render
from ncgen.errors import NcgenError
from ncgen.view.page import Page, drawing, rounded, script_json
from ncgen.view.scene import Scene, scene_of

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

FRAMES = 300
"""How many times are embedded at most; of longer runs, as many spread evenly by index."""


def page_of(run: Trajectory) -> Page:
    """The page of a trajectory. Raises NcgenError as `player` does."""
    return Page(f"{run.name} in motion", player(run))


def player(run: Trajectory) -> str:
    """The text of the HTML file for a trajectory.

    Raises NcgenError where the trajectory holds a number that is not finite.
    """
    frames = chosen_frames(len(run.t))
    data = _motion(scene_of(run).at(frames)) | {"energy": _energy(run, frames)}
    return render("html/player.html.jinja", name=run.name, planar=data["planar"], data=script_json(data))


def write_player(run: Trajectory, path: str | Path) -> Path:
    """Write the HTML file and return its path. Raises NcgenError if it cannot be written."""
    return page_of(run).save(path)


def chosen_frames(count: int) -> np.ndarray:
    """Indices of the times that are embedded, first and last among them, shape (min(count, FRAMES),)."""
    return np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int)


def _motion(scene: Scene) -> dict:
    """The scene as plain lists; a vector drawn at several points is stored once."""
    known = {arrow.name: arrow.direction for arrow in scene.arrows} | dict(scene.directions)
    directions = {name: known[name] for name in scene.moving}
    return drawing(scene) | {
        "t": rounded(scene.t),
        "positions": rounded(scene.positions),
        "directions": rounded(np.stack(list(directions.values()), axis=1)) if directions else [],
    }


def _energy(run: Trajectory, frames: np.ndarray) -> dict | None:
    """Kinetic and potential energy (J) at the frames, or None where there is none of either."""
    kinetic, potential, _ = np.asarray(run.energy(), dtype=float)[frames].T
    if not (np.isfinite(kinetic) & np.isfinite(potential)).all():
        raise NcgenError(f"{run.name}: the energy is not a finite number at all times; draw the run up to where it is")
    return {"kinetic": rounded(kinetic), "potential": rounded(potential)} if kinetic.any() or potential.any() else None
