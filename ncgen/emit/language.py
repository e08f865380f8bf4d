"""The languages that programs can be written in: each is a folder next to this file, found by its name.

    emit/NAME/files.py    what `Language` asks for
    templates/NAME/       skeletons of its files, if it has any

What else is in a folder is its language's own affair; `ncgen.emit.spelling` is there for languages with infix notation.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Protocol, cast

import ncgen.emit
from ncgen.errors import one_of

if TYPE_CHECKING:
    from ncgen.program.programs import Programs


class Language(Protocol):
    """What a module `files` has to provide."""

    IS_READ: bool
    """True for text that people read: `ncgen generate` writes it. What a machine alone reads goes into exports."""

    def model_files(self, programs: Programs) -> Mapping[str, str | bytes]:
        """{file name: contents}: the kernels of a mechanism with their patterns; the same programs give the same bytes."""
        ...


def languages() -> tuple[str, ...]:
    """The names of all languages."""
    packages = (module.name for module in iter_modules(ncgen.emit.__path__) if module.ispkg)
    return tuple(sorted(name for name in packages if find_spec(f"{ncgen.emit.__name__}.{name}.files")))


def language(name: str) -> Language:
    """The language of a name. Raises ModelError listing the known ones."""
    one_of(name, "language", languages())
    return cast("Language", import_module(f"{ncgen.emit.__name__}.{name}.files"))
