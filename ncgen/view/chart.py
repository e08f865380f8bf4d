"""Empty matplotlib figures, made without pyplot: no window, no display, no list of open figures. A notebook shows them as they are."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

GRID: dict[str, Any] = dict(color="#d0d0d0", linewidth=0.6)


RESOLUTION = 108
"""Dots per inch of what a notebook shows, shown at two thirds of its size, so that it is sharp on fine screens."""


class Chart(Figure):
    """A figure that a notebook shows without being asked to."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """The picture, and the width (px) at which it is shown."""
        data = BytesIO()
        self.savefig(data, format="png", dpi=RESOLUTION)
        return data.getvalue(), {"width": round(72 * self.get_figwidth())}


def empty(width: float, height: float) -> Chart:
    """A figure of some size (inches) that nothing was drawn in."""
    chart = Chart(figsize=(width, height))
    FigureCanvasAgg(chart)
    return chart


def finished(chart: Chart) -> Chart:
    """Fit panels, labels and legends into the figure once and for all, so that drawing it again changes nothing."""
    ConstrainedLayoutEngine().execute(chart)
    return chart
