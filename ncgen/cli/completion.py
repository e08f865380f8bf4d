"""What the shell is offered while a command is typed: examples and model files, and the words that an option takes.

Every list comes from where it is made; where nothing fits, the shell completes with names of files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING
from warnings import catch_warnings

import typer

from ncgen.errors import shortened

if TYPE_CHECKING:
    from ncgen.solver.argument_checks import Outline

WIDTH = 60
"""Characters of what is said about a word: typer breaks longer lines, and shells take each for another word."""


def models(incomplete: str) -> list[tuple[str, str]]:
    """(name, what it is) of examples and of model files in this folder; in other folders the shell finds its way alone."""
    from ncgen.exchange.examples import SUFFIXES, example_names, lesson

    files = [(path.name, "") for path in sorted(Path().iterdir()) if path.suffix.lower() in SUFFIXES and path.is_file()]
    return [(name, shortened(lesson(name), WIDTH)) for name in example_names() if name.startswith(incomplete)] + files


def assignments_of(names: Callable[[Outline], Iterable[str]]) -> Callable[[typer.Context, str], list[str]]:
    """What offers `name=` for names of the model that the command line mentions.

    A model in Python is offered nothing: its file would have to be run while somebody types.
    """

    def words(ctx: typer.Context, incomplete: str) -> list[str]:
        from ncgen.errors import NcgenError
        from ncgen.exchange.examples import example_names, load
        from ncgen.solver.runs.run import outline

        name = str(ctx.params.get("model") or next(iter(ctx.args), ""))  # the option that still lacks its value ends the parsing
        if "=" in incomplete or (name not in example_names() and Path(name).suffix.lower() in ("", ".py")):
            return []
        try:
            with catch_warnings(action="ignore"):
                known = outline(load(name))
        except NcgenError:  # the command will say what is wrong
            return []
        return [f"{each}=" for each in names(known) if each.startswith(incomplete)]

    return words


parameters = assignments_of(lambda known: known.parameters)
coordinates = assignments_of(lambda known: known.coordinates)
stops = assignments_of(lambda known: [*known.coordinates, *(f"rate({name})" for name in known.coordinates)])


def words_of(module: str, name: str) -> Callable[[], list[tuple[str, str]]]:
    """What offers the words of a list, of a table's entries with their `help`, or of a function that returns them.

    The module is imported when the shell asks.
    """

    def words() -> list[tuple[str, str]]:
        known = getattr(import_module(module), name)
        known = known() if callable(known) else known
        return [(word, shortened(getattr(known[word], "help", ""), WIDTH) if isinstance(known, dict) else "") for word in known]

    return words
