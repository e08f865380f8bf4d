"""Small pictures as SVG text for a page's own text: in its colour and on its ground, whether light or dark, and quick to make.

matplotlib is not needed for them; larger pictures are made with it (`figure`, `histories`).
"""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import ArrayLike

INK = 'stroke="currentColor" fill="none"'
TEXT = 'fill="currentColor" stroke="none" font-family="system-ui, sans-serif"'

COLOURS = ("#3b82f6", "#e07b39", "#35a06b", "#c2569b", "#8b6fe0", "#b0912a")
"""Of curves: as far from white as from black."""

RED = "#e0455e"


def element(content: str, width: float, height: float, label: str) -> str:
    """An <svg> element of some size (px) that shrinks with its column; label: what it shows, for those who do not see it."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(label)}" viewBox="0 0 {width:g} {height:g}" '
        f'width="{width:g}" style="max-width:100%;height:auto;overflow:visible">{content}</svg>'
    )


def text(x: float, y: float, words: str, anchor: str = "middle", colour: str = "currentColor", size: int = 11) -> str:
    """Words at a place, escaped."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" style="fill:{colour}">{escape(words)}</text>'


def path(points: ArrayLike) -> str:
    """The line through points (K, 2) in px, as the data of a <path>; broken where a number is not finite."""
    parts, drawn = [], False
    for x, y in np.asarray(points, dtype=float).tolist():
        if not (np.isfinite(x) and np.isfinite(y)):
            drawn = False
            continue
        parts.append(f"{'L' if drawn else 'M'}{x:.1f} {y:.1f}")
        drawn = True
    return "".join(parts)
