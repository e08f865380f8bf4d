"""A bar that shows how far something is: in a notebook, in a terminal, and nowhere else.

In a terminal it is rich's, in a notebook a line of HTML that needs no widgets; both are gone when the work is done.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

err = Console(stderr=True, highlight=False, soft_wrap=True)

REFRESH_SECONDS = 0.1
"""Seconds between two pictures of a bar in a notebook."""


@contextmanager
def progress(title: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar for work of some size, or of none that is known: called with what is done."""
    if display := notebook():
        with _in_notebook(display, title, total) as advance:
            yield lambda done: advance(done, "")
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(title, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def timed(title: str, total: int) -> Iterator[Callable[[int, int, float | None], None]]:
    """A bar for work whose end can be foretold: called with what is done, all, and the seconds left."""
    if display := notebook():
        with _in_notebook(display, title, total) as advance:
            yield lambda done, _, left: advance(done, _left(left))
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f}"), TextColumn("{task.fields[left]}"))
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(title, total=total, left="")
        yield lambda done, _, left: bar.update(task, completed=done, left=_left(left))


def notebook() -> Callable[..., Any] | None:
    """What displays something in the notebook that this is run in, or None outside of one."""
    ipython = sys.modules.get("IPython")  # whoever runs a notebook has imported it
    shell = ipython.get_ipython() if ipython else None
    if shell is None or getattr(shell, "kernel", None) is None:
        return None
    from IPython.display import display  # pyright: ignore[reportMissingImports]

    return display


@contextmanager
def _in_notebook(display: Callable[..., Any], title: str, total: float | None) -> Iterator[Callable[[float, str], None]]:
    """A bar that is displayed once and then changed."""
    begun, last = time.perf_counter(), 0.0
    handle = display({"text/html": _html(title, None, total, "")}, raw=True, display_id=True)

    def advance(done: float, left: str) -> None:
        nonlocal last
        now = time.perf_counter()
        if now - last >= REFRESH_SECONDS:
            last = now
            handle.update({"text/html": _html(title, done, total, left or _clock(now - begun))}, raw=True)

    try:
        yield advance
    finally:
        handle.update({"text/html": ""}, raw=True)


def _html(title: str, done: float | None, total: float | None, time_told: str) -> str:
    """One picture of a bar; without `done` or `total` it only shows that something runs."""
    known = f'value="{done:.6g}" max="{total:.6g}"' if done is not None and total else ""
    return f'<div>{escape(title)} <progress {known} style="vertical-align:middle"></progress> {escape(time_told)}</div>'


def _left(seconds: float | None) -> str:
    return "" if seconds is None else f"{_clock(seconds)} left"


def _clock(seconds: float) -> str:
    """Seconds as days, hours, minutes and seconds, the largest two of them."""
    parts = [
        (int(seconds // size) % most, unit) for size, most, unit in ((86400, 10**9, "d"), (3600, 24, "h"), (60, 60, "min"), (1, 60, "s"))
    ]
    first = next((k for k, (count, _) in enumerate(parts) if count), len(parts) - 1)
    return " ".join(f"{count} {unit}" for count, unit in parts[first : first + 2])
