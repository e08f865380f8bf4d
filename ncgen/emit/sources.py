"""Generated source files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ncgen.emit.language import language, languages
from ncgen.emit.number_table import FilledSources
from ncgen.files import argument_was, path_of, write_text
from ncgen.program.programs import Programs


@dataclass(frozen=True)
class Sources:
    """The generated files of one mechanism; the same model gives the same bytes.

    printed: {language: its files}; a language is printed when it is first asked for
    filled: C sources whose numbers are data, where there are some
    """

    programs: Programs
    printed: dict[str, dict[str, Any]] = field(default_factory=dict, repr=False, compare=False)
    filled: FilledSources | None = field(default=None, repr=False, compare=False)

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
    def compiled(self) -> FilledSources:
        """What is compiled for calls from Python."""
        return self.filled or FilledSources(self.c, None)

    @property
    def numpy(self) -> dict[str, str]:
        """The NumPy module."""
        return self.of("numpy")

    @property
    def files(self) -> dict[str, str]:
        """All files, in all languages that people read."""
        return {file: text for name in languages() if language(name).IS_READ for file, text in self.of(name).items()}

    @argument_was("folder")
    def write(self, output: str | os.PathLike[str]) -> list[Path]:
        """Write all files into a folder.

        Parameters
        ----------
        output : path
            The folder; it is created if it does not exist.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        NcgenError
            If the folder cannot be written.
        """
        folder = path_of(output, "folder")
        return [write_text(folder / name, text) for name, text in self.files.items()]
