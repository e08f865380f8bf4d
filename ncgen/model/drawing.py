"""What a picture of the mechanism shows: lines between points, and vectors at points (the paper's Table 7)."""

from __future__ import annotations

from dataclasses import dataclass, field

from ncgen.model.elements import Point, Vector


@dataclass
class Drawing:
    """lines: pairs of points; arrows: (point, vector), the vector being drawn from the point."""

    lines: list[tuple[Point, Point]] = field(default_factory=list)
    arrows: list[tuple[Point, Vector]] = field(default_factory=list)
