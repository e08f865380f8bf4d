"""Lists of names in messages: all that there are, the nearest, or as many as fit."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

LISTED = 100
"""Characters that a list of names may take in a message."""


def offer(name: object, known: Sequence[str], introduction: str = "it has") -> str:
    """The end of a sentence about an unknown name: what there is, or the nearest where that is too much to read."""
    listed = ", ".join(known)
    if not known:
        return f"{introduction} none"
    if len(listed) <= LISTED:
        return f"{introduction} {listed}"
    if near := difflib.get_close_matches(str(name), known, n=1):
        return f"did you mean {near[0]}?"
    return f"{introduction} {listed_names(known)}"


def listed_names(names: Sequence[str]) -> str:
    """Names with commas between them, as many as a message can take."""
    listed = ", ".join(names)
    if len(listed) <= LISTED:
        return listed
    return f"{listed[: listed.rindex(', ', 0, LISTED)]}, … ({len(names)} of them)"
