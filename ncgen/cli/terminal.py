"""What all commands share: where they write and what they are given."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from ncgen.cli.completion import models, words_of
from ncgen.errors import ModelError
from ncgen.files import is_file, is_folder, is_there
from ncgen.report.bar import err, progress, timed

__all__ = ["err", "out", "progress", "show", "tell", "timed", "writable"]

out = Console(highlight=False, soft_wrap=True)

ModelName = Annotated[
    str,
    typer.Argument(metavar="MODEL", help="an example's name, or a path to a .toml, .py, .urdf, .sdf or .xml file", autocompletion=models),
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
Backend = Annotated[str, typer.Option(help="auto, c or numpy", autocompletion=words_of("ncgen.compiler", "BACKENDS"))]
Emission = Annotated[str, typer.Option(help="auto, tabled or unrolled", autocompletion=words_of("ncgen.program.programs", "EMISSIONS"))]

PICTURES = (".svg", ".png")


def show(lines: Iterable[object]) -> None:
    """Lines as they are: brackets in them are no markup."""
    for line in lines:
        out.print(str(line), markup=False)


def tell(records: Sequence[object], lines: Callable[[list[Any]], Iterable[str]], json_output: bool) -> None:
    """Records as JSON, or as the lines that are made of them."""
    if json_output:
        print(json.dumps(records, indent=1))
    else:
        show(lines(list(records)))


def writable(option: str, path: Path | None, suffixes: tuple[str, ...] = ()) -> None:
    """Refuse a file that cannot be written before the work that it is for is done."""
    if path is None:
        return
    if suffixes and path.suffix.lower() not in suffixes:
        raise ModelError(f"{option} {path}: choose a name that ends in {' or '.join(suffixes)}")
    if is_folder(path):
        raise ModelError(f"{option} {path}: that is a folder; name a file in it")
    if is_there(path) and not is_file(path):
        raise ModelError(f"{option} {path}: that is a device or a pipe; name an ordinary file")
    if not is_folder(path.parent):
        raise ModelError(f"{option} {path}: there is no folder {path.parent}; make it, or choose another")
    if not os.access(path.parent, os.W_OK):
        raise ModelError(f"{option} {path}: the folder {path.parent} cannot be written to; choose another")
