"""Docstrings as lists: the house writes `name: meaning` on lines of their own, and indents what belongs to them."""

from __future__ import annotations

import re
from typing import Any

import griffe

ENTRY = re.compile(r'(?P<indent> *)(?P<names>"?[\w*][\w*.-]*"?(?:(?:, | and )"?[\w*][\w*.-]*"?)*)(?P<note> \([^)]*\))?: (?P<text>.*)')


class Lists(griffe.Extension):
    """Turns such lines into Markdown lists while a package is read."""

    def on_instance(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring:
            obj.docstring.value = listed(obj.docstring.value)


def listed(text: str) -> str:
    """The Markdown of a docstring. A line that begins with names and a colon is an entry, one indented below it is another one within, or goes on."""
    first, _, rest = text.partition("\n")
    found, open_at, in_list = [first], -1, False
    for line in rest.splitlines():
        indent = len(line) - len(line.lstrip())
        entry = ENTRY.fullmatch(line)
        if entry and (indent == 0 or in_list):
            found += [""] * (not in_list)
            found.append(f"{'    ' * (indent // 4)}- {_names(entry['names'])}{entry['note'] or ''}: {entry['text']}")
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
    return re.sub(r'"?[\w*][\w*.-]*"?', lambda name: name[0] if name[0] == "and" else f"`{name[0]}`", names)
