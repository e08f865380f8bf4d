"""Still figures in the manner of the paper's Figure 3: points with names, black lines, dashed springs, red unit vectors."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ncgen.errors import NcgenError
from ncgen.files import path_of, write_bytes
from ncgen.model import Model
from ncgen.view.chart import GRID, empty, finished
from ncgen.view.eye import AZIMUTH, ELEVATION, screen
from ncgen.view.histories import plot
from ncgen.view.label_places import LabelPlaces
from ncgen.view.scene import Scene, scene_of
from ncgen.view.still import palette, shadows, solids

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

__all__ = ["figure", "plot", "save"]

LINE, VECTOR = "black", "#c8102e"
POINT_LABEL: dict[str, Any] = dict(color="black", fontsize=10, ha="center", va="center", zorder=10, gid="point name")
VECTOR_LABEL: dict[str, Any] = dict(color=VECTOR, fontsize=9, ha="center", va="center", zorder=10, gid="vector name")
FLAT_ARROW: dict[str, Any] = dict(angles="xy", scale_units="xy", scale=1, width=0.005, headwidth=4, zorder=2)
SPATIAL_ARROW: dict[str, Any] = dict(arrow_length_ratio=0.25, linewidth=1.4)

SHADOW = palette()["shadow"]

OVER_SOLIDS = 0.5
"""How thick lines and points are over solids, over what they are alone."""

TALL_FRACTION = 0.9
"""The size of what is higher than wide, so that its axes stay in the picture."""

METADATA = {".png": {"Software": None}, ".svg": {"Date": None, "Creator": None}}
"""What a saved file does not say, by suffix: nothing that changes with the day or the version."""


def figure(model_or_run: Model | Trajectory, frame: int = 0, *, names: bool | None = None) -> Figure:
    """A drawing of the mechanism: the model's initial position, or one time of a trajectory.

    frame: index of the time; negative ones count from the end
    names: whether points have names, and unit vectors are drawn with theirs; default: where bodies have no shapes

    Shapes are drawn as solids, points and lines over them. A planar scene is drawn in its plane, without the vectors normal to it.
    Raises NcgenError for a frame the run lacks.
    """
    scene = scene_of(model_or_run)
    if not -len(scene.t) <= frame < len(scene.t):
        raise NcgenError(f"{scene.name}: there is no frame {frame}; give one from 0 to {len(scene.t) - 1}")
    return drawn(scene, frame, scene.name if isinstance(model_or_run, Model) else f"{scene.name}, t = {scene.t[frame]:.4g} s", names)


def drawn(scene: Scene, frame: int, title: str, names: bool | None) -> Figure:
    """One time of a scene under a title; names: as of `figure`."""
    chart = empty(6.4, 5.6)
    axes = _flat_axes(chart, scene) if scene.planar else _spatial_axes(chart, scene)
    axes.set_title(title)
    if scene.has_shapes:
        _draw_solids(axes, scene, frame)
    _draw(axes, scene, frame, not scene.has_shapes if names is None else names)
    return finished(chart) if scene.planar else chart


def save(chart: Figure, path: str | Path) -> Path:
    """Write a figure as PNG or SVG, by the suffix, and return its path; the same figure gives the same bytes.

    Raises NcgenError for another suffix, or if the file cannot be written.
    """
    path = path_of(path)
    suffix = path.suffix.lower()
    if suffix not in METADATA:
        raise NcgenError(f"{path}: a figure is saved as {' or '.join(METADATA)}; choose a name that ends so")
    data = BytesIO()
    with rc_context({"svg.hashsalt": "ncgen"}):
        chart.savefig(data, format=suffix[1:], dpi=160, metadata=METADATA[suffix])
    return write_bytes(path, data.getvalue())


def _flat_axes(chart: Figure, scene: Scene) -> Axes:
    axes = chart.add_subplot(aspect="equal", adjustable="datalim", xlabel="X (m)", ylabel="Y (m)")
    axes.margins(0)
    axes.update_datalim(_limits(scene)[:, :2])
    axes.grid(**GRID)
    axes.set_axisbelow(True)
    return axes


def _spatial_axes(chart: Figure, scene: Scene) -> Axes:
    low, high = _limits(scene)
    sides = high - low
    with rc_context({"grid.color": GRID["color"], "grid.linewidth": GRID["linewidth"]}):
        # Any: matplotlib's own annotations know no axes of three dimensions.
        axes: Any = chart.add_axes((0.0, 0.05, 0.96, 0.9), projection="3d", proj_type="ortho", azim=AZIMUTH, elev=ELEVATION)
    axes.set(xlabel="X (m)", ylabel="Y (m)", zlabel="Z (m)")
    for axis, *limits in zip("xyz", low, high, strict=True):
        axes.set(**{f"{axis}lim": limits})
    axes.set_box_aspect(sides, zoom=TALL_FRACTION if scene.has_shapes and sides[2] == sides.max() else 1.0)
    for axis, side in zip((axes.xaxis, axes.yaxis, axes.zaxis), sides, strict=True):
        axis.set_major_locator(MaxNLocator(nbins=max(2, round(6 * side / sides.max()))))
        axis.pane.set(facecolor="white", edgecolor=GRID["color"])
    return axes


def _draw_solids(axes: Any, scene: Scene, frame: int) -> None:
    """Shapes, what is nearest to the eye last; in space with their shadows on the lowest plane."""
    right, up = screen().T
    towards = np.array([0.0, 0.0, 1.0]) if scene.planar else np.cross(right, up)
    triangles, colours = solids(scene, frame, towards)
    style: dict[str, Any] = dict(facecolors=colours, edgecolors=colours, linewidths=0.4, gid="solid")
    if scene.planar:
        sides = triangles[:, 1:, :2] - triangles[:, :1, :2]
        is_wide = np.abs(np.linalg.det(sides)) > 1e-12 * scene.size**2  # others, seen from their edge, would be drawn as their outline
        order = np.argsort(triangles[..., 2].mean(axis=1), kind="stable")
        order = order[is_wide[order]]
        style |= dict(facecolors=colours[order], edgecolors=colours[order])
        axes.add_collection(PolyCollection(list(triangles[order, :, :2]), zorder=0.8, **style))
        return
    axes.computed_zorder = False
    fallen = shadows(triangles, scene.bounds[0, 2])
    axes.add_collection3d(Poly3DCollection(fallen, facecolors=SHADOW, edgecolors=SHADOW, linewidths=0.4, zorder=0.2, gid="shadow"))
    axes.add_collection3d(Poly3DCollection(triangles, zorder=0.5, zsort="average", **style))


def _draw(axes: Axes, scene: Scene, frame: int, names: bool) -> None:
    """Segments, points, and if asked for arrows and names of one frame, in axes of two or three dimensions."""
    view, style = (np.eye(2), FLAT_ARROW) if scene.planar else (screen(), SPATIAL_ARROW)
    points = scene.positions[frame, :, : len(view)]
    shafts = [(arrow, arrow.direction[frame, : len(view)] * scene.arrow_length) for arrow in scene.arrows if names]
    scale = OVER_SOLIDS if scene.has_shapes else 1.0
    arrows = [(arrow, shaft) for arrow, shaft in shafts if np.linalg.norm(shaft) > 1e-6 * scene.size]
    labels = LabelPlaces(view, 0.045 * scene.size)

    for start, end in scene.segments:
        axes.plot(*points[[start, end]].T, color=LINE, linewidth=1.8 * scale, zorder=1, gid="segment")
        labels.avoid(points[start], points[end])
    for start, end in () if scene.has_shapes else scene.springs:
        axes.plot(*points[[start, end]].T, color=LINE, linewidth=1.0, linestyle="--", zorder=1, gid="spring")
    for arrow, shaft in arrows:
        axes.quiver(*points[arrow.point], *shaft, color=VECTOR, gid="arrow", **style)
        labels.avoid(points[arrow.point], points[arrow.point] + shaft)
    for point, fixed in zip(points, scene.fixed, strict=True):
        axes.plot(*point[:, None], color=LINE, marker="s" if fixed else "o", markersize=4.5 * scale, zorder=3, gid="point")
    for name, point in zip(scene.points, points, strict=True) if names else ():
        axes.text(*labels.next_to(point), s=name, **POINT_LABEL)
    for arrow, shaft in arrows:
        axes.text(*labels.next_to(points[arrow.point] + shaft), s=arrow.name, **VECTOR_LABEL)


def _limits(scene: Scene) -> np.ndarray:
    """The box (m), shape (2, 3), that holds points and arrows at all times, never thinner than a third of its length."""
    tips = [scene.positions[:, arrow.point] + scene.arrow_length * arrow.direction for arrow in scene.arrows]
    points = np.concatenate([scene.positions.reshape(-1, 3), scene.bounds, *tips])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, scene.size / 6) + 0.08 * scene.size
    low, high = middle - half, middle + half
    if scene.has_shapes:
        low[2] = scene.bounds[0, 2]  # where shadows lie
    return np.array([low, high])
