"""A mechanism as a small SVG picture: points with names, lines, dashed springs, red unit vectors."""

from __future__ import annotations

import numpy as np

from ncgen.view.eye import screen
from ncgen.view.label_places import LabelPlaces
from ncgen.view.scene import Scene
from ncgen.view.svg import INK, RED, TEXT, SvgDrawing, path, text

WIDTH, HEIGHT, MARGIN = 250.0, 210.0, 22.0
"""Of a picture (px)."""

MAX_NAMED_ELEMENTS = 40
"""Points and vectors beyond which names would only cover each other."""

OFFSET = 12.0
"""From a point to the middle of its name (px)."""

HEAD = 6.0
"""Of an arrow (px)."""


def sketch(scene: Scene, frame: int = 0) -> SvgDrawing:
    """One time of a scene; a planar scene without the vectors normal to it."""
    points, tips = _on_screen(scene, frame)
    labels = LabelPlaces(np.eye(2), OFFSET)
    arrows = [(arrow.name, points[arrow.point], tip) for arrow, tip in zip(scene.arrows, tips, strict=True)]
    arrows = [(name, start, tip) for name, start, tip in arrows if np.linalg.norm(tip - start) > 1]
    for start, end in [(points[a], points[b]) for a, b in scene.segments] + [arrow[1:] for arrow in arrows]:
        labels.avoid(start, end)
    lines = "".join(path(points[list(pair)]) for pair in scene.segments)
    springs = "".join(path(points[list(pair)]) for pair in scene.springs)
    parts = [
        f'<path d="{lines}" {INK} stroke-width="2" stroke-linecap="round"/>' if lines else "",
        f'<path d="{springs}" {INK} stroke-dasharray="4 3"/>' if springs else "",
        f'<path d="{"".join(_arrow(*ends) for _, *ends in arrows)}" stroke="{RED}" stroke-width="1.4" fill="none"/>' if arrows else "",
        *(_spot(point, fixed) for point, fixed in zip(points, scene.fixed.tolist(), strict=True)),
    ]
    if len(scene.points) + len(arrows) <= MAX_NAMED_ELEMENTS:
        named = [(name, point, "currentColor") for name, point in zip(scene.points, points, strict=True)]
        named += [(name, tip, RED) for name, _, tip in arrows]
        for name, point, colour in named:
            x, y = labels.next_to(point)
            parts.append(text(x, y + 4, name, colour=colour))
    return SvgDrawing(f"<g {TEXT}>{''.join(parts)}</g>", WIDTH, HEIGHT, f"{scene.name} at t = {scene.t[frame]:.4g} s")


def _on_screen(scene: Scene, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 2) and tips of arrows (A, 2) in px, all of them within the picture."""
    projection = np.eye(3)[:, :2] if scene.planar else screen()
    positions = scene.positions[frame]
    tips = [positions[a.point] + scene.arrow_length * a.direction[frame] for a in scene.arrows]
    flat = np.array([*positions, *tips]) @ projection
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
    scale = min(room / np.maximum(high - low, 1e-3 * scene.size))
    shown = ((flat - (low + high) / 2) * scale * [1, -1]) + np.array([WIDTH, HEIGHT]) / 2
    return shown[: len(positions)], shown[len(positions) :]


def _arrow(start: np.ndarray, tip: np.ndarray) -> str:
    along = (tip - start) / np.linalg.norm(tip - start)
    across = np.array([-along[1], along[0]])
    barbs = [tip - HEAD * along + side * HEAD / 2 * across for side in (1, -1)]
    return path([start, tip]) + path([barbs[0], tip, barbs[1]])


def _spot(point: np.ndarray, fixed: bool) -> str:
    """A square where a point cannot move, else a disc."""
    x, y = point
    if fixed:
        return f'<rect x="{x - 3.5:.1f}" y="{y - 3.5:.1f}" width="7" height="7" fill="currentColor"/>'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="currentColor"/>'
