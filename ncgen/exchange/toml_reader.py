"""Models from TOML files: every table is one fact, told to the builder in the order of the file.

    name = "pendulum"

    [[point]]
    name = "A"
    position = [0, 0]
    fixed = true

Mistakes are reported with the line they stand on; `check` continues after one and reports all of them.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from ncgen.errors import MAX_ECHO, ModelError, UnknownName, shortened
from ncgen.exchange.file_arguments import convert, shown
from ncgen.exchange.text import NotToml, placed, text_of, toml
from ncgen.exchange.toml_layout import FileTable, layout
from ncgen.exchange.words import head, is_required, signature_of, suggestion, words
from ncgen.model import Model
from ncgen.model.names import normal

SUGGESTIONS = 20
"""Unknown words to which similar ones are looked for; a file of thousands is no file of slips."""


@dataclass(frozen=True)
class Problem:
    """Something wrong with a file, and the line where it stands."""

    line: int
    message: str

    def of(self, path: Path) -> str:
        """The problem in one line, with its place."""
        return placed(path.name, self.line, self.message)


def load_toml(path: Path) -> Model:
    """The model of a TOML file. Raises ModelError with file and line of the first mistake."""
    return model_of(text_of(path), path)


def model_of(text: str, path: Path) -> Model:
    """The model of a text that stands in a file. Raises ModelError with file and line of the first mistake."""
    model, problems = _read(text)
    if model is None or problems:
        more = f" (and {len(problems) - 1} more; `ncgen check {path.name}` lists all)" if len(problems) > 1 else ""
        raise ModelError(f"{problems[0].of(path)}{more}")
    return model


def read_toml(path: Path) -> tuple[Model | None, list[Problem]]:
    """The model as far as it could be read, and everything that is wrong with the file."""
    return _read(text_of(path))


def _read(text: str) -> tuple[Model | None, list[Problem]]:
    try:
        data = toml(text)
    except NotToml as error:
        return None, [Problem(error.line, str(error))]
    reading = _Reading(layout(text), data)
    return reading.model, sorted(reading.problems, key=lambda p: p.line)


def line_of(path: Path, word: str, key: str) -> int:
    """The line of a key in the last table of that word; of the table's header, or 1, where there is none."""
    tables = [table for table in layout(text_of(path)) if table.word == word]
    return tables[-1].line_of(key) if tables else 1


def problems_of_run(path: Path, model: Model) -> list[Problem]:
    """What is wrong with the run that [simulation] describes, in a file that could be read."""
    from ncgen.solver.runs.simulation_options import refusals

    return sorted(
        (Problem(line_of(path, "simulation", option or ""), message) for option, message in refusals(model)), key=lambda p: p.line
    )


class _Reading:
    """One pass over a file: builds the model and collects problems."""

    def __init__(self, tables: list[FileTable], data: dict) -> None:
        self.problems: list[Problem] = []
        self.missing: set[str] = set()  # names whose definition failed: complaints about them are not repeated
        self.suggestions = 0
        top, *tables = [table for table in tables if table.word in data or not table.word]
        with_header = {table.word for table in tables}
        self.model = self._head(top, {key: value for key, value in data.items() if key not in with_header})
        self._read_all(tables, data)

    def _head(self, top: FileTable, data: dict) -> Model:
        known = head().parameters
        arguments = {key: value for key, value in data.items() if key in known}
        if "name" not in arguments:
            self.problems.append(Problem(1, 'the file has no name; begin with name = "…"'))
        for key in data:
            if key in words() and key != "gravity":
                self.problems.append(Problem(top.line_of(key), f"{key}: write every table with its own header line, as [[{key}]]"))
            elif key not in arguments and key != "gravity":
                self.problems.append(Problem(top.line_of(key), f"{shown_key(key)}: unknown; {self._suggest(key, (*known, 'gravity'))}"))
        self.model = model = self._begun(top, arguments)
        if "gravity" in data:
            self._gravity(FileTable("gravity", top.line_of("gravity")), data["gravity"])
        return model

    def _begun(self, top: FileTable, contents: dict) -> Model:
        """An empty model; where its name or an option cannot be taken, one without, so that the rest of the file is checked as well."""
        arguments = self._arguments(None, "", top, head(), {"name": "model", **contents})
        try:
            if arguments is not None:
                return Model(*arguments.args, **arguments.kwargs)
        except ModelError as error:
            self.problems.append(Problem(top.line_of("name"), str(error)))
        return Model("model")

    def _gravity(self, table: FileTable, field: object) -> None:
        if not isinstance(field, list):
            shape = "write the field as a list, for example [0, -9.81] in the plane, [0, 0, -9.81] in space"
            self.problems.append(Problem(table.line, f"gravity: {shown(field)} given; {shape}"))
        else:
            self._read("gravity", table, {"field": field})

    def _read_all(self, tables: list[FileTable], data: dict) -> None:
        """Tables in the order in which their headers stand in the file, which TOML itself does not keep."""
        written_so_far: Counter[str] = Counter()
        for table in tables:
            entries = data[table.word] if isinstance(data[table.word], list) else [data[table.word]]
            if written_so_far[table.word] < len(entries):  # a table may be opened again after tables within it
                self._read(table.word, table, entries[written_so_far[table.word]])
            written_so_far[table.word] += 1

    def _read(self, word: str, table: FileTable, contents: dict) -> None:
        if word not in words():
            self.problems.append(Problem(table.line, f"[[{shown_key(word)}]]: unknown; {self._suggest(word, words())}"))
            return
        arguments = self._arguments(self.model, word, table, signature_of(word), contents)
        try:
            if arguments is not None:
                getattr(self.model, word)(*arguments.args, **arguments.kwargs)
                return
        except ModelError as error:
            self._report(table.line, error)
        if isinstance(contents.get("name"), str):
            self.missing.add(normal(contents["name"]))

    def _arguments(
        self, model: Model | None, word: str, table: FileTable, signature: inspect.Signature, contents: dict
    ) -> inspect.BoundArguments | None:
        """The arguments of a call, or None where they cannot be given: then that has been reported."""
        prefix = f"{word}." if word else ""
        refused = False
        for key in contents:
            if key not in signature.parameters:
                self._report(
                    table.line_of(key), ModelError(f"{prefix}{shown_key(key)}: unknown; {self._suggest(key, signature.parameters)}")
                )
                refused = True
        arguments = {}
        for key, parameter in signature.parameters.items():
            if key not in contents:
                if is_required(parameter):
                    self._report(table.line, ModelError(f"{word}: {key} is missing"))
                    refused = True
                continue
            try:
                arguments[key] = convert(model, parameter, contents[key], f"{prefix}{key}")
            except ModelError as error:
                self._report(table.line_of(key), error)
                refused = True
        return None if refused else inspect.BoundArguments(signature, arguments)

    def _report(self, line: int, error: ModelError) -> None:
        """Note what is wrong, unless it follows from what was wrong before."""
        name = error.name if isinstance(error, UnknownName) else ""
        if not {name, name.rpartition(".")[0]} & self.missing - {""}:
            self.problems.append(Problem(line, str(error)))

    def _suggest(self, word: str, known: Collection[str]) -> str:
        self.suggestions += 1
        return suggestion(word, known) if self.suggestions <= SUGGESTIONS else "correct the mistakes above first"


def shown_key(key: str) -> str:
    """A key of a file within a message."""
    return shortened(key, MAX_ECHO)
