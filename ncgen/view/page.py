"""What pages that move have in common: the drawing as plain data, and text that is safe inside a script."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ncgen.emit.sources import write_text
from ncgen.view.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DIGITS = 7
"""Significant digits of embedded numbers that are only looked at."""


HEIGHT = 560
"""Of the frame in a notebook (px)."""


@dataclass(frozen=True)
class Page:
    """A page of HTML that needs nothing else: a notebook shows it in a frame of its own, `save` writes it into a file.

    text: of the page; what: what it shows
    """

    what: str
    text: str = field(repr=False)

    def _repr_html_(self) -> str:
        """The frame; what is in it can run its own scripts, and reaches nothing outside."""
        return (
            f'<iframe title="{escape(self.what)}" srcdoc="{escape(self.text)}" sandbox="allow-scripts" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page and return its path. Raises NcgenError if it cannot be written."""
        return write_text(Path(path), self.text)


def drawing(scene: Scene) -> dict:
    """All of a scene that does not move, as templates/html/drawing.js.jinja reads it."""
    vectors = scene.vectors
    return {
        "name": scene.name,
        "planar": scene.planar,
        "bounds": rounded(scene.bounds),
        "arrowLength": rounded(scene.arrow_length),
        "points": list(scene.points),
        "fixed": scene.fixed.tolist(),
        "bodies": [{"name": name, "points": points} for name, points in scene.bodies],
        "segments": scene.segments,
        "springs": scene.springs,
        "vectors": vectors,
        "arrows": [[arrow.point, vectors.index(arrow.name)] for arrow in scene.arrows],
    }


def script_json(data: object) -> str:
    """JSON for a script block of HTML: no text in it can end the block."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def script_text(text: str) -> str:
    """JavaScript for a script block of HTML: what is written in its strings and comments cannot end the block."""
    return text.replace("</", "<\\/").replace("<!--", "<\\!--")


def rounded(values: ArrayLike) -> list | float:
    """Numbers of any shape as nested lists, rounded to DIGITS significant digits."""
    values = np.asarray(values, dtype=float)
    numbers = [float(f"{value:.{DIGITS}g}") + 0.0 for value in values.ravel()]
    return np.reshape(numbers, values.shape).tolist()
