"""A page in which one draws a planar mechanism, which moves at once and becomes a model file; it computes without Python."""

from __future__ import annotations

import base64
import json
import zlib

from ncgen.emit.environment import render
from ncgen.program.term_tables import types
from ncgen.toolchain.generic_wasm import binary
from ncgen.view.page import Page, lean, script_text

SCRIPTS = ("motion", "tables", "changes", "examples", "files", "picture", "editor", "hands", "page")
"""Parts of the page's script in templates/editor, in their order."""

TOOLS = (
    ("move", "Move", "V"), ("pivot", "Pivot", "P"), ("bar", "Bar", "B"), ("plate", "Plate", "L"), ("slider", "Slider", "S"),
    ("motor", "Motor", "M"), ("spring", "Spring", "K"), ("gear", "Gear", "G"), ("delete", "Delete", "X"),
)  # fmt: skip
"""Tools of the editor: their names in its script, their words, and their keys."""

ICONS = {
    "move": '<path d="M12 3v18M3 12h18M9 6l3-3 3 3M9 18l3 3 3-3M6 9l-3 3 3 3M18 9l3 3-3 3"/>',
    "pivot": '<circle cx="12" cy="8" r="3"/><path d="M10 11l-4 7h12l-4-7M4 21h16"/>',
    "bar": '<circle cx="5" cy="19" r="2.5"/><circle cx="19" cy="5" r="2.5"/><path d="M7 17L17 7"/>',
    "plate": '<path d="M4 19L20 17 11 4z"/>',
    "slider": '<path d="M2 17h20"/><rect x="7" y="9" width="10" height="8"/>',
    "motor": '<path d="M5 15a8 8 0 1 1 10 4M15 14v5h5"/>',
    "spring": '<path d="M2 12h3l2-5 3 10 3-10 3 10 2-5h4"/>',
    "gear": '<circle cx="8" cy="14" r="5.5"/><circle cx="17.5" cy="7.5" r="4"/>',
    "delete": '<path d="M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13"/>',
}
"""A picture of each tool, in the lines of an SVG of 24 by 24."""


def editor_page() -> Page:
    """The page: `save` writes it into a file, a notebook shows it."""
    script = "\n".join(render(f"editor/{name}.js") for name in SCRIPTS)
    text = render(
        "editor/page.html.jinja",
        script=script_text(lean(script.replace('"use strict";\n', ""))),
        types=json.dumps([template.key for template in types()]),
        binary=base64.b64encode(zlib.compress(binary(), 9)).decode(),
        tools=TOOLS,
        icons=ICONS,
    )
    return Page("an editor for planar mechanisms", text)
