"""Identifiers of emitted code: readable, valid in C, C++ and Python, and never twice the same."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ncgen.emit.taken import TAKEN
from ncgen.program.ir.functions import FUNCTIONS

_C_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
alignas alignof and and_eq asm bitand bitor bool catch class compl concept const_cast consteval constexpr
constinit co_await co_return co_yield decltype delete dynamic_cast explicit export false friend mutable
namespace new noexcept not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires
static_assert static_cast template this thread_local throw true try typeid typename using virtual wchar_t xor xor_eq
""".split()

_ARGUMENTS = {"t", "q", "qd", "qdd", "lam", "zd", "forces", "p", "e", "d", "i", "R", "np", "main", "errno"}

RESERVED = frozenset(_C_WORDS) | frozenset(keyword.kwlist) | _ARGUMENTS
"""Words that no emitted name may take: keywords, and the arguments of the kernels."""


_FUNCTIONS = {name for f in FUNCTIONS.values() for name in (f.sympy.lower(), f.numpy)} | {"fabs"}
_MACROS = {"NULL", "NAN", "INFINITY", "HUGE_VAL", "HUGE_VALF", "HUGE_VALL"}
LIBRARY = frozenset(f"{name}{kind}" for name in _FUNCTIONS for kind in ("", "f", "l", "q")) | _MACROS
"""Functions and macros of C that the source may use: a local variable must not have their name."""


def identifier(name: str) -> str:
    """A valid identifier that still looks like `name`: `r2.x` becomes `r2_x`."""
    word = re.sub(r"[^0-9A-Za-z_]", lambda c: "_" if c[0].isascii() else f"u{ord(c[0]):x}", name)
    word = re.sub(r"__+", "_", word).strip("_") or "x"
    word = word if word[0].isalpha() else f"x{word}"
    return f"{word}_" if word in RESERVED else word


def prefix_of(model: str) -> str:
    """What the files, functions and packages of a model begin with: its name, with `_` behind one that means something else there.

    So a model called stdio has the header stdio_.h, and one called Class the package class_.
    """
    word = identifier(model)
    return f"{word}_" if word.lower() in TAKEN or (word.lower() in RESERVED and word not in RESERVED) else word


class Names:
    """Hands out identifiers within one scope; none begins like the names that the source uses itself."""

    def __init__(self, taken: Iterable[str] = (), prefix: str = "ncgen") -> None:
        self._taken = set(taken)
        self._own = tuple(word.lower() for word in ("ncgen", f"{prefix}_"))

    def __call__(self, wish: str) -> str:
        word = identifier(wish)
        word = f"{word}_" if word in LIBRARY else f"x_{word}" if word.lower().startswith(self._own) else word
        number, name = 2, word
        while name in self._taken:
            name, number = f"{word}_{number}", number + 1
        self._taken.add(name)
        return name


@dataclass(frozen=True)
class Label:
    """What a number is called in C, and the user's words for it."""

    label: str
    text: str


def labels(names: Sequence[str]) -> list[Label]:
    """Names of constants in C, all of them different."""
    constants: dict[str, str] = {}
    for name in names:
        wish = label = identifier(name).upper()
        while label in constants:
            label = f"{wish}_{len(constants)}"
        constants[label] = name
    return [Label(label, name) for label, name in constants.items()]
