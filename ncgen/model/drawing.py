"""What a picture of the mechanism shows: lines between points, vectors at points (the paper's Table 7), shapes of bodies (its Figure 4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ncgen.model.elements import Point, Vector
from ncgen.model.shapes import Solid, Strut


@dataclass(kw_only=True)
class Drawing:
    """lines: pairs of points; arrows: (point, vector), the vector being drawn from the point; solids, struts: shapes

    ranges: {number: its least and its largest value} of numbers that a page offers first
    folder: where the files of meshes lie whose names do not say it; the working directory if None
    """

    lines: list[tuple[Point, Point]] = field(default_factory=list)
    arrows: list[tuple[Point, Vector]] = field(default_factory=list)
    solids: list[Solid] = field(default_factory=list)
    struts: list[Strut] = field(default_factory=list)
    folder: Path | None = None
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def has_shapes(self) -> bool:
        return bool(self.solids or self.struts)
