"""Studies from TOML files: data, like model files, and told with the line where something is wrong.

model = "pendulum.toml"        # a model file next to this one, or an example's name
design = "sobol"
count = 1024
keep = ["psi", "max(psi)"]

[vary]                         # or vary = "table.csv"
length = { low = 0.9, high = 1.1 }
"start(rate(psi))" = { mean = 1.0, deviation = 0.1 }

[simulation]                   # as in a model file
duration = 2.0
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ncgen.errors import ModelError, NcgenError
from ncgen.exchange.examples import load
from ncgen.exchange.text import NotToml, placed, text_of, toml
from ncgen.exchange.toml_layout import FileTable, layout
from ncgen.exchange.words import suggestion
from ncgen.studies.definition import Study
from ncgen.studies.design import table

KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "model": ((str,), "a text"),
    "design": ((str,), "a text"),
    "count": ((int,), "a whole number"),
    "seed": ((int,), "a whole number"),
    "keep": ((str, list), "a list of texts"),
    "times": ((list,), "a list of numbers"),
    "steps": ((int,), "a whole number"),
    "vary": ((dict, str), "a table, or the name of a CSV file"),
    "simulation": ((dict,), "a table"),
}
"""{key: what its value is}."""

NEEDED = ("model", "vary", "keep")


def read_study(path: Path) -> Study:
    """The study of a TOML file. Raises ModelError with file and line."""
    text = text_of(path)
    try:
        data = toml(text)
    except NotToml as error:
        raise ModelError(placed(path.name, error.line, str(error))) from None
    tables = layout(text)
    _check(path, data, tables)
    try:
        return _study_of(path, data)
    except NcgenError as error:
        line = _line(tables, str(error), data)
        error.args = (str(error) if str(error).startswith(path.name) else placed(path.name, line, str(error)), *error.args[1:])
        raise


def _check(path: Path, data: dict[str, Any], tables: list[FileTable]) -> None:
    for key, value in data.items():
        if key not in KINDS:
            raise ModelError(placed(path.name, _key_line(tables, key), f"{key}: unknown; {suggestion(key, KINDS)}"))
        kinds, expected = KINDS[key]
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise ModelError(placed(path.name, _key_line(tables, key), f"{key}: it is {expected}"))
    if missing := [key for key in NEEDED if key not in data]:
        raise ModelError(placed(path.name, 1, f"{missing[0]} is missing; a study has {', '.join(NEEDED)}"))


def _study_of(path: Path, data: dict[str, Any]) -> Study:
    vary, model = data["vary"], data["model"]
    if model.endswith(".py"):
        raise ModelError(f"model: {model} is a program, which a study file does not run; write it as data by `ncgen convert {model}`")
    neighbour = path.parent / model
    options = {key: data[key] for key in ("design", "count", "seed", "times", "steps") if key in data}
    if isinstance(vary, str):
        vary = table(vary, text_of(path.parent / vary))
        options.setdefault("design", "list")
    return Study.of(
        load(neighbour if neighbour.suffix else model), vary, keep=data["keep"], simulation=data.get("simulation", {}), **options
    )


def _key_line(tables: list[FileTable], key: str) -> int:
    """The line of a key at the top, or of a table's header."""
    return next((table.line for table in tables if table.word == key), tables[0].line_of(key))


def _line(tables: list[FileTable], message: str, data: dict[str, Any]) -> int | None:
    """The line that a message speaks of: that of the longest key that it begins with, as far as that can be told."""
    for word in ("vary", "simulation"):
        inner = next((table for table in tables if table.word == word), None)
        for key in sorted(inner.keys if inner else (), key=len, reverse=True):
            if message.startswith((f"{key}:", f"{word}, {key}", f"m.simulation: there is no argument {key!r}")) or f" {key};" in message:
                return inner.line_of(key) if inner else None
    for key in data:
        if message.startswith((f"{key}:", f"{key} ")):
            return _key_line(tables, key)
    return None
