"""What all commands share: output streams, common options, and checks of files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from ncgen.cli.completion import coordinates, models, parameters, words_of
from ncgen.errors import ModelError
from ncgen.files import is_file, is_folder, is_there
from ncgen.report.bar import err, progress, timed

__all__ = ["err", "out", "progress", "show", "print_records", "timed", "writable"]

out = Console(highlight=False, soft_wrap=True)

ModelName = Annotated[
    str,
    typer.Argument(metavar="MODEL", help="an example's name, or a path to a .toml, .py, .urdf, .sdf or .xml file", autocompletion=models),
]
MOTION = "Motion"
METHOD = "Method"
ROBOTS = "Robots' files"
CODE = "Generated code"
RESULTS = "Results"
"""Panels of `--help`: options that answer one question."""

Json = Annotated[bool, typer.Option("--json", help="print one JSON object", rich_help_panel=RESULTS)]
Backend = Annotated[
    str,
    typer.Option(
        help="what computes: auto (C where there is a compiler), c or numpy",
        autocompletion=words_of("ncgen.compiler", "BACKENDS"),
        rich_help_panel=CODE,
    ),
]
Emission = Annotated[
    str,
    typer.Option(
        help="equal equations as loops over tables (tabled), as straight-line code (unrolled), or by their number (auto)",
        autocompletion=words_of("ncgen.program.programs", "EMISSIONS"),
        rich_help_panel=CODE,
    ),
]
Duration = Annotated[float | None, typer.Option(help="seconds to simulate [default: the model's]", rich_help_panel=MOTION)]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        help="value of a parameter, as k=3; may be repeated [default: the model's]", autocompletion=parameters, rich_help_panel=MOTION
    ),
]
Velocities = Annotated[
    list[str] | None,
    typer.Option(
        help="initial velocity of a coordinate, as psi1=2.5; may be repeated [default: the model's]",
        autocompletion=coordinates,
        rich_help_panel=MOTION,
    ),
]

PICTURES = (".svg", ".png")
PAGES = (".html", ".htm")


def show(lines: Iterable[object]) -> None:
    """Print lines as they are, without markup."""
    for line in lines:
        out.print(str(line), markup=False)


def print_records(records: Sequence[object], lines: Callable[[list[Any]], Iterable[str]], json_output: bool) -> None:
    """Print records as JSON, or as the lines that `lines` makes of them."""
    if json_output:
        print(json.dumps(records, indent=1))
    else:
        show(lines(list(records)))


def listed(words: Sequence[str]) -> str:
    """Words of which one is to be chosen: `a, b or c`."""
    return " or ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def writable(option: str, path: Path | None, suffixes: tuple[str, ...] = (), new_folder: bool = False) -> None:
    """Refuse a file that cannot be written, or whose name ends otherwise than its content, before the work that it is for is done.

    new_folder: the folder of the file is made where there is none
    """
    if path is None:
        return
    if is_folder(path):
        raise ModelError(f"{option} {path}: that is a folder; name a file in it")
    if suffixes and path.suffix.lower() not in suffixes:
        raise ModelError(f"{option} {path}: choose a name that ends in {listed(suffixes)}")
    if is_there(path) and not is_file(path):
        raise ModelError(f"{option} {path}: that is a device or a pipe; name an ordinary file")
    if new_folder and not is_there(path.parent):
        return
    if not is_folder(path.parent):
        raise ModelError(f"{option} {path}: there is no folder {path.parent}; make it, or choose another")
    if not os.access(path.parent, os.W_OK):
        raise ModelError(f"{option} {path}: the folder {path.parent} cannot be written to; choose another")
