"""A file while somebody works on it: it is looked at again and again, and told each time that it was saved.

Editors write a file in pieces, or take it away and put another in its place; so what counts is what two looks in a row agree about.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

from ncgen.files import opened

POLL_SECONDS = 0.2
"""Seconds between two looks."""

MAX_MISSED_POLLS = 5
"""Looks in a row without a file before it counts as gone: editors that put another file in its place are quicker."""


def saves(path: Path, wait: Callable[[float], object] = time.sleep) -> Iterator[bool]:
    """True for every content that a file comes to have, the first one included, and False when it is gone; never ends.

    wait: called with the seconds until the next look
    """
    reported, before, alike = b"never", b"never", 0
    while True:
        now = digest(path)
        alike = alike + 1 if now == before else 1
        before = now
        if now != reported and alike >= (2 if now else MAX_MISSED_POLLS):
            reported = now
            yield bool(now)
        else:
            wait(POLL_SECONDS)


def digest(path: Path) -> bytes:
    """What tells one content of a file from another; b"" where there is no file that can be read."""
    try:
        with opened(path) as file:
            return sha256(file.read()).digest()
    except OSError:
        return b""
