"""Names: what can be one, and which two are the same.

A name is read back by the grammar of model files, which is Python's: there µ (U+00B5) and μ (U+03BC) are one letter, and so
they are here. Names are kept in that normal form, NFKC, and whoever looks for one asks for the normal form.
"""

from __future__ import annotations

import keyword
import unicodedata
from collections.abc import Callable
from typing import TypeVar, overload

from ncgen.errors import ModelError, shown

T = TypeVar("T")

LONGEST_NAME = 500

TIME = "t"

LAW = {"x": "the length or angle", "v": "its rate"}
"""The symbols of a spring's law."""

RESERVED = {TIME: "time", "pi": "the constant"}
"""Names that an expression already gives a meaning to, and no name of one's own can take from it."""


@overload
def normal(name: str) -> str: ...
@overload
def normal(name: T) -> T: ...
def normal(name: object) -> object:
    """The form in which a name is kept and looked for; what is no text is returned as it is."""
    return unicodedata.normalize("NFKC", name) if isinstance(name, str) else name


def numbered(wish: str, is_taken: Callable[[str], bool]) -> str:
    """The name that is wished for, or it with the first number behind it that makes it a name of its own."""
    name, number = wish, 2
    while is_taken(name):
        name, number = f"{wish}_{number}", number + 1
    return name


SIGNS = str.maketrans("", "", "_.")
"""What names consist of besides letters and digits."""


def check_word(name: object, kind: str) -> str:
    """The name, unless it is no word of letters, digits, '_' and '.' that begins with a letter: that is refused."""
    if not isinstance(name, str) or not name or not name.translate(SIGNS).isalnum() or not name[0].isalpha():
        raise ModelError(f"{kind} name {shown(name)}: give a word of letters, digits and '_' that begins with a letter")
    if len(name) > LONGEST_NAME:
        raise ModelError(f"{kind} name {shown(name)}: it has {len(name)} characters; use at most {LONGEST_NAME}")
    return name


def check_name(name: object, kind: str) -> None:
    """Refuse a name that no expression could mention; between dots stand Python's identifiers, but none of its keywords."""
    for identifier in check_word(name, kind).split("."):
        if not identifier.isidentifier():
            raise ModelError(f"{kind} name {shown(name)}: an expression could not mention it; let a letter follow every dot")
        if keyword.iskeyword(identifier):
            raise ModelError(f"{kind} name {shown(name)}: {identifier} is a keyword of expressions; choose another")


def check_scalar(name: str, kind: str) -> None:
    """Refuse a scalar's name that means something else in every expression."""
    if name in RESERVED:
        raise ModelError(f"{kind} {name}: that is the name of {RESERVED[name]}; choose another")


def word(name: str, kind: str) -> str:
    """A name that a model can have: other signs become _, a letter comes first, _ follows a keyword, and a joint's that expressions use."""
    kept = "".join(c if c.isalnum() and f"a{c}".isidentifier() else "_" for c in normal(name))
    kept = kept if kept[:1].isidentifier() and kept[0] != "_" else f"{kind}_{kept}"
    return f"{kept}_" if keyword.iskeyword(kept) or (kind == "joint" and kept in RESERVED) else kept
