"""The text of a model file, read no further than a model file goes."""

from __future__ import annotations

import os
from pathlib import Path

from ncgen.errors import LONGEST_LINE, SHOWN, ModelError, shortened, shown

LARGEST = 4_000_000
"""Bytes of a model file."""


def placed(name: str, line: int | None, message: str) -> str:
    """What is wrong with a file, in one line, with its name and where it has one the line."""
    place = shortened(name, SHOWN) + (": " if line is None else f", line {line}: ")
    return place + shortened(message, LONGEST_LINE - len(place))


def as_path(given: str | os.PathLike[str], what: str) -> Path:
    """A path. Raises ModelError, saying what is needed, for anything that is none."""
    if isinstance(given, (str, os.PathLike)):
        return Path(given)
    raise ModelError(f"{shown(given)} given; give {what}")


def is_file(path: Path) -> bool:
    """True for what can be read to an end: no folder, no device, no pipe; False for names that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def why_no_file(path: Path, missing: str) -> str:
    """Why a path is no file, where `is_file` says so. missing: the words where nothing is there."""
    try:
        return "a model file is an ordinary file, not a folder, a device or a pipe" if path.exists() else missing
    except (OSError, ValueError):
        return missing


def text_of(path: Path) -> str:
    """The text of a file, without a byte order mark.

    Raises ModelError where there is no file, where it cannot be read, is too large, or is no UTF-8 text.
    """
    if not is_file(path):
        raise ModelError(f"{path}: {why_no_file(path, 'there is no such file')}")
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from None
    if len(data) > LARGEST:
        raise ModelError(f"{path}: a model file has at most {LARGEST} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError(f"{path}, line {line}: byte {data[error.start]:#04x} is no UTF-8 text; save the file as UTF-8") from None
