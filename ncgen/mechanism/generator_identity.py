"""What tells generators apart: their files and the versions that they rely on, in a digest that is made anew only where files changed."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from ncgen.resources import package_files
from ncgen.toolchain.cache_location import keep, kept

KIND = "generators"

PACKAGES = ("jinja2", "mpmath", "numpy", "sympy")
"""What generating relies on."""

FOLDERS = ("model", "symbolic", "program", "methods", "emit", "runtime", "templates")
"""Folders whose files make code of a model."""


@cache
def generator_identity(*more: str) -> str:
    """All that makes code of a model: the generator's own files, what they rely on, and Python, whose sums and functions round.

    more: further packages that have a part in it
    """
    files = package_files(*(more or FOLDERS))
    others = [generator_identity()] if more else []
    state = _digest([platform.python_version(), *others, *_states(files), *_states(_entry_points())])
    key = _digest([*more, files[0]])[:40]
    known = kept(KIND, key)
    if known is not None and known["state"] == state:
        return known["identity"]
    identity = "\n".join([*(others or _versions()), _content(files)])
    keep(KIND, key, {"state": state, "identity": identity})
    return identity


def _digest(words: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _states(files: Iterable[str]) -> list[str]:
    """Size and time of the last change of files, by which Python itself tells whether a module has to be compiled again."""
    return [f"{path} {status.st_size} {status.st_mtime_ns}" for path in files for status in [os.stat(path)]]


def _entry_points() -> list[str]:
    """The files that other packages begin with, and the folders that these are installed in: another version changes both."""
    origins = [spec.origin for spec in map(find_spec, PACKAGES) if spec is not None and spec.origin is not None]
    return [path for origin in origins for path in (origin, os.path.dirname(os.path.dirname(origin)))]


def _versions() -> list[str]:
    from importlib.metadata import version

    return [platform.python_version(), *(f"{name} {version(name)}" for name in PACKAGES)]


def _content(files: Iterable[str]) -> str:
    """The digest of names and content of files."""
    made_with = hashlib.sha256()
    for path in files:
        made_with.update(f"{os.path.basename(path)}\n".encode() + hashlib.sha256(Path(path).read_bytes()).digest())
    return made_with.hexdigest()
