"""Curves over time as small SVG pictures: of anything, and of a trajectory, one below the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ncgen.view.chosen import above_lowest, grouped
from ncgen.view.svg import COLOURS, INK, TEXT, SvgDrawing, below_each_other, path, text

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

WIDTH, HEIGHT = 330.0, 140.0
LEFT, RIGHT, TOP, BOTTOM = 58.0, 8.0, 22.0, 20.0
"""Margins of the curves (px): for numbers, for names above and for the time below."""

LETTER = 5.6
"""Width of a letter (px), about."""


def curves(t: np.ndarray, histories: Mapping[str, np.ndarray], label: str, unit: str = "s") -> SvgDrawing:
    """Histories {name: (K,)} over times (K,), or anything else over time; what is not a finite number is left out.

    label: what is drawn, with its unit; unit: of t
    """
    values = np.concatenate([np.asarray(values, dtype=float) for values in histories.values()])
    low, high = _span(values[np.isfinite(values)])
    start, end = _span(t)
    across = LEFT + (t - start) / (end - start) * (WIDTH - LEFT - RIGHT)

    def height(value: np.ndarray) -> np.ndarray:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)

    lines = []
    for number, row in enumerate(histories.values()):
        line = path(np.column_stack([across, height(np.asarray(row, dtype=float))]))
        lines.append(f'<path d="{line}" stroke="{COLOURS[number % len(COLOURS)]}" stroke-width="1.5" fill="none"/>')
    frame = path([(LEFT, TOP), (LEFT, HEIGHT - BOTTOM), (WIDTH - RIGHT, HEIGHT - BOTTOM)])
    words = [text(LEFT - 4, TOP + 8, f"{high:.4g}", "end"), text(LEFT - 4, HEIGHT - BOTTOM, f"{low:.4g}", "end")]
    words += [text(LEFT, HEIGHT - 5, f"{start:.4g}", "start"), text(WIDTH - RIGHT, HEIGHT - 5, f"{end:.4g} {unit}", "end")]
    words += _names(histories, label)
    content = f'<path d="{frame}" {INK} opacity="0.5"/><g {TEXT}>{"".join(words)}</g>{"".join(lines)}'
    return SvgDrawing(content, WIDTH, HEIGHT, f"{label} over {'time' if unit == 's' else unit}: {', '.join(histories)}")


def _names(histories: Mapping[str, np.ndarray], label: str) -> list[str]:
    """The label and the curves' names in their colours, as far as there is room."""
    x, elements = 4.0, [text(4, 12, label, "start")]
    x += LETTER * len(label) + 10
    for number, name in enumerate(histories):
        if x + LETTER * len(name) > WIDTH:
            return [*elements, text(x, 12, "…", "start")]
        elements.append(text(x, 12, name, "start", COLOURS[number % len(COLOURS)]))
        x += LETTER * len(name) + 10
    return elements


def _span(values: np.ndarray) -> tuple[float, float]:
    """Lowest and highest, never the same."""
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return (low, high) if high > low else (low - max(abs(low), 1.0) / 2, high + max(abs(high), 1.0) / 2)


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
