"""The measured tables of these pages, measured again.

    python docs/renew.py            what would be run, page by page
    python docs/renew.py performance.md compare.md …
    python docs/renew.py gallery.png    the examples' pictures in one

A table is a block between fences that follows a comment with the command that prints it, such as <!-- ncgen bench robot -->. The
command runs and what it prints takes the block's place. Numbers in sentences beside a table are the writer's to correct; the pages name
the machine that they were measured on.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PAGES = Path(__file__).resolve().parent
COLUMNS = 5
TABLE = re.compile(r"<!-- (?P<command>(?:ncgen|python) [^\n]*?) -->\n```\n(?P<output>.*?)```\n", re.DOTALL)


def commands(page: Path) -> list[str]:
    """The commands of a page's tables, in order."""
    return [found["command"] for found in TABLE.finditer(page.read_text(encoding="utf-8"))]


def renewed(text: str, run) -> str:
    """A page with the tables that `run` prints: command to output."""

    def table(found: re.Match[str]) -> str:
        lines = run(found["command"]).splitlines()
        while lines and not lines[0].strip():
            lines.pop(0)  # and nothing else: a first line may be indented
        printed = "\n".join(lines).rstrip()
        return f"<!-- {found['command']} -->\n```\n{printed}\n```\n"

    return TABLE.sub(table, text)


def shell(command: str) -> str:
    """What a command prints. Raises CalledProcessError where it fails."""
    print(command, file=sys.stderr)
    return subprocess.run(command, shell=True, check=True, stdout=subprocess.PIPE, text=True, cwd=PAGES.parent).stdout


def gallery(path: Path) -> None:
    """The examples' own pictures side by side."""
    import matplotlib.pyplot as plt

    folders = sorted((PAGES.parent / "examples").glob("*/"))
    pictures = [picture for folder in folders if (picture := folder / f"{folder.name}.png").is_file()]
    figure, places = plt.subplots(-(-len(pictures) // COLUMNS), COLUMNS, figsize=(3.3 * COLUMNS, 13.2), layout="constrained")
    for place in places.flat:
        place.axis("off")
    for place, picture in zip(places.flat, pictures, strict=False):
        place.imshow(plt.imread(picture))
    figure.savefig(path, dpi=100)


def main(names: list[str]) -> None:
    for page in sorted(PAGES.glob("*.md")) if not names else [PAGES / name for name in names]:
        if page.suffix == ".png":
            gallery(page)
        elif names:
            page.write_text(renewed(page.read_text(encoding="utf-8"), shell), encoding="utf-8")
        elif found := commands(page):
            print(page.name, *(f"    {command}" for command in found), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
