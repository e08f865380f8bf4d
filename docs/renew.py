"""The measured tables of these pages, measured again.

    python docs/renew.py            what would be run, page by page
    python docs/renew.py performance.md compare.md …
    python docs/renew.py gallery.png    the examples' pictures in one
    python docs/renew.py robot.gif      the fall of the paper's robot, forwards and backwards

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
FRAMES = 21
"""Number of pictures between the start and the end of the robot's fall."""
FRAME_TIME = 60
"""Milliseconds between two pictures."""
REST = 600
"""Milliseconds for which the first and the last picture stand."""
COLOURS = 128
"""Number of colours of the animation; fewer make a smaller file."""
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


def robot(path: Path) -> None:
    """The fall of the paper's robot as an animated GIF that ends where it begins."""
    from io import BytesIO

    from PIL import Image

    import ncgen
    from ncgen.view.figure import figure

    run = ncgen.simulate(ncgen.compile(ncgen.load("robot")), 0.5, points=FRAMES)
    pictures = []
    for frame in range(FRAMES):
        data = BytesIO()
        chart = figure(run, frame)
        chart.axes[0].set_title("")
        chart.savefig(data, format="png", dpi=75)
        pictures.append(Image.open(data).convert("RGB"))
    width, height = pictures[0].size
    all_of_them = Image.new("RGB", (width, FRAMES * height))
    for number, picture in enumerate(pictures):
        all_of_them.paste(picture, (0, number * height))
    colours = all_of_them.quantize(COLOURS)
    loop = [picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in (*pictures, *pictures[-2:0:-1])]
    times = [REST if number in (0, FRAMES - 1) else FRAME_TIME for number in range(len(loop))]
    loop[0].save(path, save_all=True, append_images=loop[1:], duration=times, loop=0, optimize=True)


PICTURES = {"gallery.png": gallery, "robot.gif": robot}
"""{file: what draws it}"""


def main(names: list[str]) -> None:
    for page in sorted(PAGES.glob("*.md")) if not names else [PAGES / name for name in names]:
        if page.name in PICTURES:
            PICTURES[page.name](page)
        elif names:
            page.write_text(renewed(page.read_text(encoding="utf-8"), shell), encoding="utf-8")
        elif found := commands(page):
            print(page.name, *(f"    {command}" for command in found), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
