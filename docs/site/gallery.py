"""The examples side by side, each with a page that computes its motion."""

from __future__ import annotations

import inspect
from html import escape
from pathlib import Path

import ncgen
from ncgen.exchange.examples import example_module, example_names

FIRST = "fourbar"
"""The one that is shown at once."""

HOME = "docs/course/living/linkage.html#traces=P&loop=1&speed=0.2&play=1"
"""What moves on the first page of the site: the linkage of the lesson, with the curve of its coupler point."""

ENTRIES = f"""
<iframe class="living" src="{HOME}" title="A four-bar linkage that draws its coupler curve, computed in this page" loading="lazy"></iframe>

**[Learn](docs/course/lesson.md)** with a page like this one, or with [nine notebooks](docs/course/README.md) ·
**[Simulate a robot](docs/robots.md)** from its URDF, SDF or MJCF file · **[Embed](docs/embedding.md)** a mechanism in C, in an FMU, on a
microcontroller or in a page
"""


def with_living_page(path: str, text: str) -> str:
    """The Markdown of a page of the site with what moves in it, below its first paragraph: the home's, and that of an example."""
    folder, _, name = path.rpartition("/")
    example = folder.removeprefix("examples/")
    if path == "README.md":
        shown = ENTRIES
    elif name == "README.md" and example in example_names():
        shown = (
            f'\n<iframe class="living" src="../living/{example}.html" title="{example}, computed in this page" loading="lazy"></iframe>\n'
        )
    else:
        return text
    title, first, rest = text.split("\n\n", 2)
    return f"{title}\n\n{first}\n{shown}\n{rest}"


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
    living = f' · <a href="living/{name}.html">move it</a>'
    folder = Path(example_module(name).__file__ or "").parent
    picture, title = folder / f"{name}.png", (folder / "README.md").read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    image = f'<img src="{name}/{name}.png" alt="" loading="lazy">' if picture.is_file() else ""
    return f'<div><a href="{name}/index.html">{image}<b>{escape(title)}</b></a>{living}<p>{says}</p></div>'


def write_living_pages(folder: Path) -> None:
    """Pages that compute, beside the gallery in a folder of pages."""
    for name in example_names():
        ncgen.export(ncgen.load(name), "html", folder / "examples" / "living")
    course = Path(__file__).resolve().parents[1] / "course"
    ncgen.export(ncgen.load(course / "linkage.py"), "html", folder / "docs" / "course" / "living")
