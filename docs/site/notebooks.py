"""A notebook as a page: its text, its code, what its cells gave."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import nbformat
from nbformat import NotebookNode

FOLDED = ("<details>", '<details markdown="1">')
"""What makes Markdown within a folded solution be read as such."""


def page(path: Path) -> str:
    """The Markdown of an executed notebook, with a link to the notebook itself."""
    parts = [part for cell in nbformat.read(path, as_version=4).cells for part in _parts(cell)]
    title, _, rest = "\n\n".join(parts).partition("\n")
    return f"{title}\n\n[This page as a notebook]({path.name}){{ .notebook download }}\n{rest}\n"


def _parts(cell: NotebookNode) -> Iterator[str]:
    if cell.cell_type == "markdown":
        yield cell.source.replace(*FOLDED)
    else:
        yield f"```python\n{cell.source}\n```"
        yield from filter(None, map(_shown, cell.outputs))


def _shown(output: NotebookNode) -> str:
    """The richest form of what a cell gave."""
    if output.output_type == "stream":
        return _block(output.text)
    data = output.data
    if svg := data.get("image/svg+xml"):
        return f'<div class="output">{_on_one_line(svg[svg.index("<svg") :])}</div>'
    return f'<div class="output">{_on_one_line(data["text/html"])}</div>' if "text/html" in data else _block(data["text/plain"])


def _block(text: str) -> str:
    return f"```{{ .text .output .no-copy }}\n{text.rstrip()}\n```"


def _on_one_line(html: str) -> str:
    """Without empty lines, at which Markdown would take up again."""
    return "\n".join(line for line in html.splitlines() if line.strip())
