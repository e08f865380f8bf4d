"""What becomes of files, each in a process of its own with a limit of time, so that a file that never ends costs a line."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeAlias

LONGEST = 300
"""Seconds for one file."""

Judge: TypeAlias = Callable[[Path], tuple[str, str]]
"""What became of a file, in one word and in a line."""


def judged_apart(judge: Judge, paths: Iterable[Path], longest: float = LONGEST) -> Iterator[tuple[Path, str, str]]:
    """Each file with its word and its line: "failed" for one that raised an error, crashed, or took longer than so many seconds."""
    for path in paths:
        mine, theirs = multiprocessing.Pipe()
        process = multiprocessing.get_context("fork").Process(target=_answer, args=(judge, path, theirs))
        process.start()
        theirs.close()
        try:
            word, said = mine.recv() if mine.poll(longest) else ("failed", f"not done after {longest:g} s")
        except EOFError:
            word, said = "failed", "its process ended without an answer"
        process.kill()
        process.join()
        yield path, word, said


def _answer(judge: Judge, path: Path, pipe: Connection) -> None:
    try:
        pipe.send(judge(path))
    except Exception as error:  # a line of the table, whatever it was
        pipe.send(("failed", f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"))
