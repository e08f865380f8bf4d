"""The jinja2 environment: templates hold the skeleton of a file, never a decision.

Undefined names are errors, and the output has no trailing blanks, so the same input gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING

from ncgen.program.ir.blocks import Block, Loop
from ncgen.resources import folder

if TYPE_CHECKING:
    from jinja2 import Environment

MAX_EXACT_INTEGER = 2**53
"""Whole numbers below this are doubles."""


@cache
def environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    env = Environment(
        loader=FileSystemLoader(folder("templates"), encoding="utf-8"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    env.filters["comment"] = comment_text
    env.filters["wrapped"] = wrapped
    env.filters["c_string"] = c_string
    env.filters["docstring"] = docstring_text
    env.filters["c_literal"] = c_literal
    env.filters["bit_of"] = lambda name, entries: 1 << [entry.name for entry in entries].index(name)
    return env


def render(template: str, **records: object) -> str:
    return environment().get_template(template).render(**records)


def c_literal(number: Fraction | int) -> str:
    """An exact number (a Fraction) as C sees it: a quotient of whole numbers, or a decimal with all its digits."""
    number = Fraction(number)
    above, below, sign = abs(number.numerator), number.denominator, "-" if number < 0 else ""
    if max(above, below) < MAX_EXACT_INTEGER:
        return f"{sign}R({above}.0)" if below == 1 else f"{sign}Q({above}, {below})"
    digits = next(k for k in range(1, 60) if 10**k % below == 0)
    return f"{sign}R({above * 10**digits // below}e-{digits})"


def comment_text(text: str) -> str:
    """Text that cannot end a C comment or leave its line, and holds no trigraph."""
    text = str(text)
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " for c in text)
    words = " ".join(text.split())
    return words.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")


def c_string(text: str) -> str:
    """Text as a C string literal: everything that is not plain is written as the octal bytes of UTF-8."""
    plain = frozenset(b" !#$%&'()*+,-./0123456789:;<=>@ABCDEFGHIJKLMNOPQRSTUVWXYZ[]^_`abcdefghijklmnopqrstuvwxyz{|}~")
    return '"' + "".join(chr(b) if b in plain else f"\\{b:03o}" for b in str(text).encode("utf-8")) + '"'


def docstring_text(text: str) -> str:
    """Text that cannot end a Python docstring or begin an escape."""
    return comment_text(text).replace("\\", "/").replace('"', "'")


def loop_comments(block: Block) -> list[str]:
    """What the runs of a loop compute: a line a constraint row, short labels side by side."""
    comments = block.comments if isinstance(block, Loop) else ()
    if any(": " in comment for comment in comments):
        return [comment_text(comment) for comment in comments]
    return rows_of(map(comment_text, comments), 90)


def wrapped(items: Iterable[object], width: int, indent: int) -> str:
    """Comma-separated items as text that begins behind so many blanks and stays within `width` characters."""
    return ("\n" + " " * indent).join(rows_of(items, width - indent))


def rows_of(items: Iterable[object], width: int) -> list[str]:
    """Comma-separated items broken into lines of at most `width` characters."""
    lines, line = [], ""
    for item in items:
        piece = f"{item}, "
        if line and len(line) + len(piece) > width:
            lines.append(line.rstrip())
            line = ""
        line += piece
    return lines + [line.rstrip(", ")] if line else lines
