"""The examples side by side, some of them as pages that compute their motion."""

from __future__ import annotations

import inspect
from html import escape
from pathlib import Path

import ncgen
from ncgen.exchange.examples import example_module, example_names

LIVING = ("cartpole", "excavator", "fourbar", "jansen", "nfourbar", "pendulum", "robot", "stewart", "suspension")
"""Examples whose page is made for the site; `ncgen export NAME --to html` makes that of any other."""

FIRST = "fourbar"
"""The one that is shown at once."""


def page() -> str:
    """The Markdown of the gallery, in the folder of the examples."""
    cards = "\n".join(_card(name) for name in example_names())
    return f"""# Gallery

`ncgen run NAME` runs an example, `ncgen export NAME --to html` makes a page of it that computes its motion where it is opened. Drag a body:

<iframe class="living" src="living/{FIRST}.html" title="{FIRST}, computed in this page" loading="lazy"></iframe>

<div class="gallery">
{cards}
</div>
"""


def _card(name: str) -> str:
    says = escape((inspect.getdoc(example_module(name)) or "").partition("\n\n")[0].replace("\n", " "))
    living = f' · <a href="living/{name}.html">move it</a>' if name in LIVING else ""
    picture = Path(example_module(name).__file__ or "").with_name(f"{name}.png")
    image = f'<img src="{name}/{name}.png" alt="{name}" loading="lazy">' if picture.is_file() else ""
    return f'<div><a href="{name}/index.html">{image}<b>{name}</b></a>{living}<p>{says}</p></div>'


def write_living_pages(folder: Path) -> None:
    """Pages that compute, beside the gallery in a folder of pages."""
    for name in LIVING:
        ncgen.export(ncgen.load(name), "html", folder / "examples" / "living")
