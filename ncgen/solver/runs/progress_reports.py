"""Progress reports of a run: to a function of the caller, to a bar in a terminal or notebook, or to nobody."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TypeAlias

from ncgen.errors import ModelError
from ncgen.solver.argument_checks import echo

ProgressOption: TypeAlias = "Callable[[float], None] | bool | None"
"""In signatures: a function, True for a bar in a terminal or a notebook, None or False for nobody."""


def check_progress(progress: object) -> None:
    """Raise ModelError for a `progress` that is neither a function, a truth value nor None."""
    if progress is not None and not isinstance(progress, bool) and not callable(progress):
        raise ModelError(f"progress: {echo(progress)} given; it must be a function of the time reached, or True for a bar")


@contextmanager
def reporting(progress: ProgressOption, title: str, start: float, length: float) -> Iterator[Callable[[float], None] | None]:
    """What a run of some length that begins at `start` calls, in the units of both; title: what a bar says."""
    if progress is True:
        with import_module("ncgen.report.bar").progress(title, length) as advance:
            yield lambda reached: advance(reached - start)
    else:
        yield progress or None
