"""Empty matplotlib figures, made without pyplot: no window, no display, no list of open figures."""

from __future__ import annotations

from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

GRID: dict[str, Any] = dict(color="#d0d0d0", linewidth=0.6)


def empty(width: float, height: float) -> Figure:
    """A figure of some size (inches) that nothing was drawn in."""
    chart = Figure(figsize=(width, height))
    FigureCanvasAgg(chart)
    return chart


def settle(chart: Figure) -> Figure:
    """Fit panels, labels and legends into the figure once and for all, so that drawing it again changes nothing."""
    ConstrainedLayoutEngine().execute(chart)
    return chart
