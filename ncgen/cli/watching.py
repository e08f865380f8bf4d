"""The command that runs until it is interrupted: watch."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from ncgen.cli.completion import models
from ncgen.cli.terminal import err, out


class Saved(Exception):
    """The file was saved while the run before was still going on."""


def watch(file: Annotated[Path, typer.Argument(metavar="FILE", help="a model file", autocompletion=models)]) -> None:
    """Check and run a model file at every save, and print what changed; Ctrl-C ends it."""
    from ncgen.exchange.text import text_of
    from ncgen.report.saves import saves

    text_of(file)  # a name that is no file's is refused at once
    try:
        for lines in _blocks(file, saves(file)):
            _show(lines)
    except KeyboardInterrupt:
        err.print(f"ncgen: stopped watching {file}", markup=False)
        raise typer.Exit(130) from None


def _blocks(file: Path, saved: Iterable[bool]) -> Iterator[list[str]]:
    """What there is to say each time that the file was saved; saved: as of `report.saves`."""
    from ncgen.report.rounds import Round, check_and_run, summary_of

    ran: Round | None = None
    for is_there in saved:
        if not is_there:
            yield [f"{file}: the file is gone; waiting for it"]
            continue
        try:
            round_now = check_and_run(file, _ender(file))
        except Saved:
            continue
        yield summary_of(round_now, ran)
        ran = round_now if round_now.record else ran


def _ender(file: Path) -> Callable[[float], None]:
    """Called while a run lasts, it raises Saved as soon as the file has another content."""
    from ncgen.report.saves import digest

    begun = digest(file)

    def end_where_saved(_: float) -> None:
        if digest(file) != begun:
            raise Saved

    return end_where_saved


def _show(lines: list[str]) -> None:
    """A block with the time of day."""
    out.print(f"{time.strftime('%H:%M:%S')} {lines[0]}", markup=False)
    for line in lines[1:]:
        out.print(f"         {line}", markup=False)
    out.file.flush()
