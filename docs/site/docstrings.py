"""Docstrings as tables and lists: sections in NumPy's style become tables, and lines `name: meaning` in other docstrings lists."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import griffe

NAME = r'"?[\w*][\w*.-]*"?'
NOTE = r" \([^)]*\)"
ENTRY = re.compile(rf"(?P<indent> *)(?P<names>{NAME}(?:{NOTE})?(?:(?:, | and ){NAME}(?:{NOTE})?)*): (?P<text>.*)")


SECTION = re.compile(r"^(Parameters|Returns|Raises|Warns|Notes)\n-+\n", re.MULTILINE)


class Lists(griffe.Extension):
    """Turns docstrings into Markdown while a package is read."""

    def on_instance(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring:
            text = inspect.cleandoc(obj.docstring.value)
            obj.docstring.value = tabled(whole(obj, text)) if SECTION.search(text) else listed(obj.docstring.value)


def whole(obj: griffe.Object, text: str) -> str:
    """Return a docstring with the arguments that a group or a class describes for it, as `help()` shows it."""
    parent = obj.parent
    if parent is not None and parent.is_module and re.search(r"^\*\*\w+ : ", text, re.MULTILINE):
        return inspect.getdoc(getattr(import_module(parent.path), obj.name)) or text
    if isinstance(parent, griffe.Class) and obj.is_function and any(str(each.value).startswith("shares(") for each in parent.decorators):
        return inspect.getdoc(getattr(getattr(import_module(parent.path.rpartition(".")[0]), parent.name), obj.name)) or text
    return text


def tabled(text: str) -> str:
    """Return the Markdown of a docstring in NumPy's style: a table for every section, paragraphs for notes.

    Parameters
    ----------
    text : str
        The docstring, without indentation.

    Returns
    -------
    str
        Its Markdown.
    """
    before, *sections = SECTION.split(text)
    parts = [before.strip()]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        if title == "Notes":
            parts.append(f"**{title}.** {body.strip()}")
        else:
            parts += [f"**{title}**", "\n".join(_rows(title, body))]
    return "\n\n".join(parts)


def _rows(title: str, body: str) -> Iterator[str]:
    """Yield the rows of a section's table: name, type and meaning of parameters, type and meaning of what is returned or raised."""
    named = title == "Parameters"
    yield "| name | type | meaning |" if named else "| type | meaning |"
    yield "|---|---|---|" if named else "|---|---|"
    for entry in re.finditer(r"^(\S.*)\n((?:(?: +.*)?\n)*)", f"{body.strip()}\n", re.MULTILINE):
        name, _, kind = entry[1].partition(" : ")
        meaning = " ".join(entry[2].split()).replace("|", "\\|")
        yield f"| `{name}` | {kind} | {meaning} |" if named else f"| {name} | {meaning} |"


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
