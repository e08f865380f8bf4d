"""The documentation as a site that needs no network: python docs/site/build.py [FOLDER]

Pages lie together as in the repository, so that their links to each other hold; notebooks become pages, and what the program knows of
itself (its words, its functions, its examples) is written down while the site is built. FOLDER (default: ncgen-site beside the
repository) is made anew; open its index.html. Needs pip install 'ncgen[docs]'.
"""

from __future__ import annotations

import logging
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]

PAGES = ("README.md", "CHANGELOG.md", "docs/*.md", "docs/course/*.md", "examples/*/README.md")
"""What is shown as it is."""

LINK = re.compile(r"(?P<before>\]\()(?P<target>[^)#\s]+)")


def pages() -> dict[str, str]:
    """{path in the site: Markdown} of all pages."""
    import gallery
    import notebooks
    import reference

    found = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for pattern in PAGES for path in sorted(ROOT.glob(pattern))
    }
    for path in sorted((ROOT / "docs" / "course").glob("*.ipynb")):
        found[path.relative_to(ROOT).with_suffix(".md").as_posix()] = notebooks.page(path)
    found |= reference.pages()
    return {name: _linked(name, gallery.with_living_page(name, text), set(found)) for name, text in found.items()}


def _linked(name: str, text: str, known: set[str]) -> str:
    """A page whose links lead to pages: a folder has its README, a notebook its page."""

    def lead(link: re.Match[str]) -> str:
        target = link["target"]
        for other in (f"{target.rstrip('/')}/README.md", target.removesuffix(".ipynb") + ".md"):
            if _beside(name, other) in known:
                return link["before"] + other
        return link[0]

    return LINK.sub(lead, text)


def _beside(name: str, target: str) -> str:
    """The path from the root of what a page links to; "" where that lies elsewhere."""
    path = (ROOT / name).parent.joinpath(unquote(target)).resolve()
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else ""


def files(name: str, text: str) -> Iterator[str]:
    """Paths of the files of the repository that a page shows or links to and that are no pages."""
    for link in LINK.finditer(text):
        path = _beside(name, link["target"])
        if path and not path.endswith(".md") and (ROOT / path).is_file():
            yield path


def stage(folder: Path) -> None:
    """Write all pages and what they need into a folder."""
    for name, text in pages().items():
        for path in files(name, text):
            _written(folder / path, ROOT / path)
        _written(folder / name, text)
    for path in (*HERE.glob("*.css"), *HERE.glob("*.js")):
        _written(folder / path.name, path)


def _written(path: Path, what: str | Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(what, Path):
        shutil.copyfile(what, path)
    else:
        path.write_text(what, encoding="utf-8")


def build(site: Path) -> list[str]:
    """Make the site in a folder that does not exist yet, and return what is wrong with its links."""
    import gallery
    import links
    from mkdocs.commands.build import build as written
    from mkdocs.config import load_config

    with tempfile.TemporaryDirectory() as folder:
        staged = Path(folder, "pages")
        stage(staged)
        gallery.write_living_pages(staged)
        config = load_config(str(HERE / "mkdocs.yml"), docs_dir=str(staged), site_dir=str(site), strict=True)
        config.nav = _opened(config.nav, staged)
        config.plugins.on_startup(command="build", dirty=False)
        written(config)
    return links.problems(site)


def _opened(nav: object, staged: Path) -> object:
    """The plan of the site with all pages of a pattern, such as docs/course/0*.md, in the pattern's place."""
    if isinstance(nav, list):
        return [item for entry in nav for item in _entries(entry, staged)]
    return (
        {title: _opened(entry, staged) if isinstance(entry, list) else entry for title, entry in nav.items()}
        if isinstance(nav, dict)
        else nav
    )


def _entries(entry: object, staged: Path) -> list[object]:
    if isinstance(entry, str) and "*" in entry:
        return [path.relative_to(staged).as_posix() for path in sorted(staged.glob(entry))]
    return [_opened(entry, staged)]


def main(arguments: list[str]) -> None:
    logging.basicConfig(level=logging.WARNING, format="%(message)s")  # what ends a strict build is told nowhere else
    site = Path(arguments[0]).resolve() if arguments else ROOT.parent / "ncgen-site"
    if site.exists() and not (site / "sitemap.xml").is_file():
        sys.exit(f"{site} is there and is no site; give another folder")
    shutil.rmtree(site, ignore_errors=True)
    if found := build(site):
        sys.exit("\n".join(found))
    print(f"{site}/index.html")


if __name__ == "__main__":
    main(sys.argv[1:])
