"""Where a sparse matrix has numbers, as a small SVG picture."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ncgen.program.ir.blocks import Pattern
from ncgen.view.svg import INK, RED, SvgDrawing

MAX_SIDE = 200.0
"""The longer side of a picture (px)."""

MAX_CELLS = 100
"""Cells along a side: of a larger matrix several rows and columns share a cell."""


def spots(pattern: Pattern, label: str, marked: Collection[int] = ()) -> SvgDrawing:
    """A pattern, a square a number; marked: rows in red."""
    rows, columns = pattern.shape
    block = max(1, -(-max(rows, columns) // MAX_CELLS))
    indices = np.repeat(np.arange(rows), np.diff(pattern.indptr)), np.array(pattern.indices, dtype=int)
    cells = {(row // block, column // block): row in marked for row, column in zip(*(p.tolist() for p in indices))}
    height, width = -(-rows // block), -(-columns // block)
    size = MAX_SIDE / max(height, width, 10)
    paths = []
    for colour, chosen in (("currentColor", False), (RED, True)):
        squares = "".join(f"M{column} {row}h1v1h-1z" for (row, column), red in sorted(cells.items()) if red is chosen)
        if squares:
            paths.append(f'<path transform="scale({size:.3f})" d="{squares}" style="fill:{colour}"/>')
    frame = f'<rect x="0.5" y="0.5" width="{width * size - 1:.1f}" height="{height * size - 1:.1f}" {INK} opacity="0.4"/>'
    return SvgDrawing(frame + "".join(paths), round(width * size, 1), round(height * size, 1), label)
