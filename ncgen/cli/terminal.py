"""What all commands share: where they write, what they are given, and a bar that shows how far they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ncgen.cli.completion import models, words_of
from ncgen.errors import ModelError

out = Console(highlight=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, soft_wrap=True)

ModelName = Annotated[
    str,
    typer.Argument(metavar="MODEL", help="an example's name, or a path to a .toml, .py, .urdf, .sdf or .xml file", autocompletion=models),
]
Floating = Annotated[
    bool | None, typer.Option("--floating/--fixed", help="a robot's base moves freely, or is ground [default: its file's]")
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
Backend = Annotated[str, typer.Option(help="auto, c or numpy", autocompletion=words_of("ncgen.compiler", "BACKENDS"))]
Emission = Annotated[str, typer.Option(help="auto, tabled or unrolled", autocompletion=words_of("ncgen.program.programs", "EMISSIONS"))]

PICTURES = (".svg", ".png")


def writable(option: str, path: Path | None, suffixes: tuple[str, ...] = ()) -> None:
    """Refuse a file that cannot be written before the work that it is for is done."""
    if path is None:
        return
    if suffixes and path.suffix.lower() not in suffixes:
        raise ModelError(f"{option} {path}: choose a name that ends in {' or '.join(suffixes)}")
    if path.is_dir():
        raise ModelError(f"{option} {path}: that is a folder; name a file in it")
    if not path.parent.is_dir():
        raise ModelError(f"{option} {path}: there is no folder {path.parent}; make it, or choose another")
    if not os.access(path.parent, os.W_OK):
        raise ModelError(f"{option} {path}: the folder {path.parent} cannot be written to; choose another")


@contextmanager
def progress(what: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error, only where somebody is watching."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def timed(what: str, total: int) -> Iterator[Callable[[int, int, float | None], None]]:
    """A bar for work whose end can be foretold: called with what is done, all, and the seconds left."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f}"), TextColumn("{task.fields[left]}"))
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(what, total=total, left="")
        yield lambda done, _, left: bar.update(task, completed=done, left="" if left is None else f"{_clock(left)} left")


def _clock(seconds: float) -> str:
    """Seconds as days, hours, minutes and seconds, the largest two of them."""
    parts = [
        (int(seconds // size) % most, unit) for size, most, unit in ((86400, 10**9, "d"), (3600, 24, "h"), (60, 60, "min"), (1, 60, "s"))
    ]
    first = next((k for k, (count, _) in enumerate(parts) if count), len(parts) - 1)
    return " ".join(f"{count} {unit}" for count, unit in parts[first : first + 2])
