"""Generated source files, and writing them so that nobody ever sees half a file."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ncgen.emit.language import language, languages
from ncgen.errors import NcgenError, shown
from ncgen.program.programs import Programs


@dataclass(frozen=True)
class Sources:
    """The generated files of one mechanism; the same model gives the same bytes.

    printed: {language: its files}; a language is printed when it is first asked for
    """

    programs: Programs
    printed: dict[str, dict[str, Any]] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        return f"<Sources {self.programs.equations.model.name}: {', '.join(languages())}>"

    def of(self, name: str) -> dict[str, Any]:
        """{file name: text, or bytes where machines alone read them} in a language. Raises ModelError listing those that there are."""
        if name not in self.printed:
            self.printed[name] = dict(language(name).model_files(self.programs))
        return self.printed[name]

    @property
    def c(self) -> dict[str, str]:
        """The C source and the headers it needs."""
        return self.of("c")

    @property
    def numpy(self) -> dict[str, str]:
        """The NumPy module."""
        return self.of("numpy")

    @property
    def files(self) -> dict[str, str]:
        """All files, in all languages that people read."""
        return {file: text for name in languages() if language(name).IS_READ for file, text in self.of(name).items()}

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write all files into a folder (made if missing) and return their paths.

        Raises NcgenError naming the folder if it cannot be written.
        """
        place = path_of(folder, "folder")
        return [write_text(place / name, text) for name, text in self.files.items()]


def path_of(given: str | os.PathLike[str], what: str = "path") -> Path:
    """A path that something is to be written to. Raises NcgenError for what is none; what: the argument's name."""
    if not isinstance(given, (str, os.PathLike)) or not str(given):
        raise NcgenError(f"{what}: {shown(given)} given; name a {'folder' if what == 'folder' else 'file'}")
    return Path(given)


def write_text(path: Path, text: str) -> Path:
    """Write a text file atomically: to a temporary name in the same folder, then renamed."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> Path:
    """Write a file atomically, into a folder that is made if missing. Raises NcgenError naming the file if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return put(path, data, f".{path.name}.")
    except OSError as error:
        raise NcgenError(f"{path} cannot be written: {error.strerror or error}; choose another folder") from error


def put(path: Path, data: bytes, prefix: str) -> Path:
    """Write a file under a temporary name, which begins with prefix, in the same folder and rename it. Raises OSError."""
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=prefix, delete=False) as file:
            temporary = file.name
            file.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        raise
    return path
