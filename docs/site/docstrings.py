"""Docstrings as lists: the house writes `name: meaning` on lines of their own, and indents what belongs to them."""

from __future__ import annotations

import re
from typing import Any

import griffe

NAME = r'"?[\w*][\w*.-]*"?'
NOTE = r" \([^)]*\)"
ENTRY = re.compile(rf"(?P<indent> *)(?P<names>{NAME}(?:{NOTE})?(?:(?:, | and ){NAME}(?:{NOTE})?)*): (?P<text>.*)")


class Lists(griffe.Extension):
    """Turns such lines into Markdown lists while a package is read."""

    def on_instance(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring:
            obj.docstring.value = listed(obj.docstring.value)


def listed(text: str) -> str:
    """The Markdown of a docstring.

    Behind an empty line one that begins with names and a colon opens a list; one indented below an entry is another within, or goes on.
    """
    first, _, rest = text.partition("\n")
    found, open_at, in_list = [first], -1, False
    for line in rest.splitlines():
        indent = len(line) - len(line.lstrip())
        entry = ENTRY.fullmatch(line)
        if entry and (in_list or not found[-1]):
            found.append(f"{'    ' * (indent // 4)}- {_names(entry['names'])}: {entry['text']}")
            in_list, open_at = True, indent
        elif in_list and line.strip() and indent > open_at:
            found[-1] += f" {line.strip()}"
        elif in_list and line.strip() and indent:
            found.append(f"{'    ' * (indent // 4)}- {line.strip()}")
            open_at = indent
        else:
            found += [""] * (in_list and bool(line.strip()))
            found.append(line)
            in_list = False
    return "\n".join(found)


def _names(names: str) -> str:
    """The names as code, and as they are what stands in parentheses behind them."""
    return re.sub(rf"{NOTE}|{NAME}", lambda part: part[0] if part[0][0] == " " or part[0] == "and" else f"`{part[0]}`", names)
