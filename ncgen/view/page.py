"""What pages that move have in common: the drawing as plain data, and text that is safe inside a script."""

from __future__ import annotations

import base64
import json
import os
import re
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import NcgenError
from ncgen.files import argument_was, path_of, write_text
from ncgen.model.elements import Point
from ncgen.view.carriers import Carrier, Direction
from ncgen.view.eye import LIGHT_DIRECTION
from ncgen.view.scene import Scene
from ncgen.view.triangles import Mesh, cylinder, spring

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DIGITS = 7
"""Significant digits of embedded numbers that are only looked at."""


SUFFIXES = (".html", ".htm")
"""Of files that are pages."""

MAX_UINT16 = 65535
"""The largest number of 16 bits."""

HEIGHT = 560
"""Of the frame in a notebook (px)."""


@dataclass(frozen=True)
class Page:
    """A page of HTML that needs nothing else: a notebook shows it in a frame of its own, `save` writes it into a file.

    text: of the page; title: what it shows
    """

    title: str
    text: str = field(repr=False)

    def _repr_html_(self) -> str:
        """The frame; what is in it can run its own scripts, and reaches nothing outside."""
        return (
            f'<iframe title="{escape(self.title)}" srcdoc="{escape(self.text)}" sandbox="allow-scripts" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    @argument_was("path")
    def save(self, output: str | os.PathLike[str]) -> Path:
        """Write the page.

        Parameters
        ----------
        output : path
            Name of the file, .html or .htm.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        NcgenError
            For a name with another ending, or if the file cannot be written.
        """
        path = path_of(output)
        if path.suffix.lower() not in SUFFIXES:
            raise NcgenError(f"{output}: a page is saved as {' or '.join(SUFFIXES)}; choose a name that ends so")
        return write_text(path, self.text)


def drawing(scene: Scene) -> dict:
    """All of a scene that does not move, as templates/html/drawing.js.jinja reads it."""
    vectors = scene.moving
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
        **_shapes(scene),
    }


def _shapes(scene: Scene) -> dict:
    """The shapes of a scene, as templates/html/solids.js.jinja reads them: each mesh once, and where it stands in its carrier's frame."""
    packed: list[dict] = []

    def number(mesh: Mesh) -> int:
        record = _packed(mesh)
        if record not in packed:
            packed.append(record)
        return packed.index(record)

    carriers = range(len(scene.carriers))
    surfaces = [
        {
            "mesh": number(surface.mesh),
            "carrier": surface.carrier,
            "matrix": rounded(surface.matrix),
            "shift": rounded(surface.shift),
            "color": surface.colour,
        }
        for surface in scene.surfaces
    ]
    return {
        "surfaces": surfaces,
        "struts": [[strut.start, strut.end, strut.radius, strut.length, strut.colour] for strut in scene.struts],
        "bar": number(cylinder(1.0, 0.0, 1.0)) if scene.struts else -1,
        "coil": number(spring()) if scene.has_shapes and scene.springs else -1,
        "carriers": [_carrier(carrier, scene) for carrier in scene.carriers],
        "reach": [rounded([coordinate for s in scene.surfaces if s.carrier == k for coordinate in s.reach]) for k in carriers],
        "meshes": packed,
        "light": rounded(LIGHT_DIRECTION),
    }


def _carrier(carrier: Carrier, scene: Scene) -> dict:
    """Vectors and points by their numbers."""

    def said(direction: Direction) -> int | list:
        if isinstance(direction, str):
            return scene.moving.index(direction)
        return [scene.points.index(number.name) if isinstance(number, Point) else number for number in direction]

    origin = -1 if carrier.origin is None else scene.points.index(carrier.origin.name)
    body = -1 if carrier.body is None else carrier.body
    return {"body": body, "origin": origin, "first": said(carrier.first), "second": said(carrier.second)}


def _packed(mesh: Mesh) -> dict:
    """Vertices as numbers of 16 bits between the lowest and the highest, triangles as such numbers, both in 64 letters."""
    low = mesh.vertices.min(axis=0)
    step = np.ptp(mesh.vertices, axis=0) / MAX_UINT16
    fractions = (mesh.vertices - low) / np.where(step > 0, step, 1.0)
    record = {"vertices": _letters(fractions), "triangles": _letters(mesh.triangles), "low": rounded(low), "step": rounded(step)}
    return record if mesh.normals is None else record | {"normals": _letters((mesh.normals + 1) / 2 * MAX_UINT16)}


def _letters(numbers: np.ndarray) -> str:
    return base64.b64encode(np.round(numbers).astype("<u2").tobytes()).decode()


def script_json(data: object) -> str:
    """JSON for a script block of HTML: no text in it can end the block."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def script_text(text: str) -> str:
    """JavaScript for a script block of HTML: what is written in its strings and comments cannot end the block."""
    return text.replace("</", "<\\/").replace("<!--", "<\\!--")


def lean(script: str) -> str:
    """JavaScript without indentation, empty lines and lines of comment, which are a quarter of a page; its sources have them."""
    bare = re.sub(r"^\s*/\*\*.*?\*/\n", "", script, flags=re.DOTALL | re.MULTILINE)
    lines = (line.strip() for line in bare.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def rounded(values: ArrayLike) -> list | float:
    """Numbers of any shape as nested lists, rounded to DIGITS significant digits."""
    values = np.asarray(values, dtype=float)
    numbers = [float(f"{value:.{DIGITS}g}") + 0.0 for value in values.ravel()]
    return np.reshape(numbers, values.shape).tolist()
