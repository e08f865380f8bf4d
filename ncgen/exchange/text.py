"""The text of a model file, read no further than a model file goes."""

from __future__ import annotations

import errno
import os
import re
import tomllib
from pathlib import Path
from typing import Any

from ncgen.errors import LONGEST_LINE, MAX_ECHO, ModelError, shortened, shown
from ncgen.files import contents, is_file, is_there

MAX_FILE_BYTES = 4_000_000
"""Bytes of a model file."""


def placed(name: str, line: int | None, message: str) -> str:
    """What is wrong with a file, in one line, with its name and where it has one the line."""
    prefix = shortened(name, MAX_ECHO) + (": " if line is None else f", line {line}: ")
    return prefix + shortened(message, LONGEST_LINE - len(prefix))


def as_path(path: str | os.PathLike[str], expected: str) -> Path:
    """A path. Raises ModelError, saying what is needed, for anything else."""
    if isinstance(path, (str, os.PathLike)):
        return Path(path)
    raise ModelError(f"{shown(path)} given; give {expected}")


def why_no_file(path: Path, missing: str) -> str:
    """Why a path is no file, where `is_file` says so. missing: the words where nothing is there."""
    return "a model file is an ordinary file, not a folder, a device or a pipe" if is_there(path) else missing


def text_of(path: Path) -> str:
    """The text of a file, without a byte order mark.

    Raises ModelError where there is no file, where it cannot be read, is too large, or is no UTF-8 text.
    """
    if not is_file(path):
        raise ModelError(f"{path}: {why_no_file(path, 'there is no such file')}")
    try:
        data = contents(path, MAX_FILE_BYTES)
    except OSError as error:
        why = f"a model file has at most {MAX_FILE_BYTES} bytes" if error.errno == errno.EFBIG else error.strerror
        raise ModelError(f"{path}: {why}") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError(f"{path}, line {line}: byte {data[error.start]:#04x} is no UTF-8 text; save the file as UTF-8") from None


class NotToml(Exception):
    """A text that is no TOML, or that Python cannot hold: why, and the line (1, …)."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(why)
        self.line = line


def toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises NotToml."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"line (\d+)", str(error))
        raise NotToml(int(line[1]) if line else text.count("\n") + 1, f"not TOML: {error}") from None
    except ValueError as error:  # a number or a date that Python cannot hold
        raise NotToml(_line_of_number(text), f"a number or a date that cannot be read: {error}") from None
    except RecursionError:
        raise NotToml(1, "lists or tables stand too deep within each other") from None


def _line_of_number(text: str) -> int:
    """The line of the longest run of digits."""
    longest = max(re.finditer(r"[0-9A-Fa-f_]+", text), key=lambda match: len(match[0]), default=None)
    return text.count("\n", 0, longest.start()) + 1 if longest else 1
