"""Pictures as SVG text, quick to make: matplotlib, which is imported for longer than all of `ncgen run` takes, is not needed.

Within a page they have its colour and its ground, whether light or dark; as a file they are black on white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import ArrayLike

INK = 'stroke="currentColor" fill="none"'
TEXT = 'fill="currentColor" stroke="none" font-family="system-ui, sans-serif"'

COLOURS = ("#3b82f6", "#e07b39", "#35a06b", "#c2569b", "#8b6fe0", "#b0912a")
"""Of curves: as far from white as from black."""

RED = "#e0455e"


ENLARGED = 2.4
"""How much larger than in a page's text a picture is as a file."""


@dataclass(frozen=True)
class SvgDrawing:
    """A picture of some size (px); label: what it shows, for those who do not see it."""

    content: str = field(repr=False)
    width: float
    height: float
    label: str

    def __str__(self) -> str:
        """An <svg> element that shrinks with its column."""
        return self._element(f'width="{self.width:g}" style="max-width:100%;height:auto;overflow:visible"', self.content)

    def _repr_svg_(self) -> str:
        """What a notebook shows."""
        return str(self)

    def file(self) -> str:
        """The text of a file of its own."""
        ground = f'<rect width="{self.width:g}" height="{self.height:g}" fill="white"/>'
        size = f'width="{ENLARGED * self.width:g}" height="{ENLARGED * self.height:g}" color="black"'
        return self._element(size, ground + self.content) + "\n"

    def _element(self, size: str, content: str) -> str:
        box = f'viewBox="0 0 {self.width:g} {self.height:g}"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(self.label)}" {box} {size}>{content}</svg>'


def below_each_other(drawings: Sequence[SvgDrawing], label: str) -> SvgDrawing:
    """One picture of several, in their order."""
    content, top = [], 0.0
    for drawing in drawings:
        content.append(f'<g transform="translate(0 {top:g})">{drawing.content}</g>')
        top += drawing.height
    return SvgDrawing("".join(content), max((drawing.width for drawing in drawings), default=0.0), top, label)


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
