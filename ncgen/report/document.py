"""A report as one HTML file that needs nothing else: tables, plots as SVG, and the machine it was measured on."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TypeAlias

from matplotlib import rc_context
from matplotlib.figure import Figure

from ncgen.emit.environment import render

Rows: TypeAlias = Sequence[tuple[str, ...]]
"""Cells, titles first."""


@dataclass(frozen=True)
class Section:
    """A heading, what is reported, rows of cells (the first row are titles), and a plot."""

    title: str
    text: str = ""
    rows: tuple[tuple[str, ...], ...] = ()
    plot: Figure | None = None


def aligned(rows: Rows) -> list[str]:
    """Rows of text as lines: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [first.ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(others, widths[1:], strict=True))]
        lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


def page(title: str, sections: list[Section], machine: dict[str, str]) -> str:
    """The text of the HTML file. The browser is asked to load nothing from anywhere."""
    parts = [{"title": s.title, "text": s.text, "rows": s.rows, "svg": svg(s.plot) if s.plot else ""} for s in sections]
    return render("html/report.html.jinja", title=title, sections=parts, machine=machine)


def svg(chart: Figure) -> str:
    """A figure as an <svg> element; the same figure gives the same text."""
    data = BytesIO()
    with rc_context({"svg.hashsalt": "ncgen", "svg.fonttype": "none"}):
        chart.savefig(data, format="svg", metadata={"Date": None, "Creator": None})
    text = data.getvalue().decode()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    return text[text.index("<svg") :]
