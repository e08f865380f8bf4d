"""Models from TOML files: every table is one fact, told to the builder in the order of the file.

    name = "pendulum"

    [[point]]
    name = "A"
    position = [0, 0]
    fixed = true

Mistakes are reported with the line they stand on; `check` goes on after one and reports all of them.
"""

from __future__ import annotations

import difflib
import inspect
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from ncgen.errors import ModelError
from ncgen.exchange.grammar import parse_direction, parse_expression
from ncgen.exchange.words import kind_of, words
from ncgen.model import Model

HEAD = ("name", "scale", "form")
"""What stands at the top of a file; gravity = [x, y, z] may stand there too."""

LARGEST = 4_000_000
"""Bytes of a model file."""


@dataclass(frozen=True)
class Problem:
    """Something wrong with a file, and the line where it stands."""

    line: int
    message: str


@dataclass(frozen=True)
class Entry:
    """One table of the file: its word, its keys, and the line of its header."""

    word: str
    keys: dict
    line: int


def load_toml(path: Path) -> Model:
    """The model of a TOML file. Raises ModelError with file and line of the first mistake."""
    model, problems = read_toml(path)
    if problems:
        more = f" (and {len(problems) - 1} more; `ncgen check {path.name}` lists all)" if len(problems) > 1 else ""
        raise ModelError(f"{path.name}, line {problems[0].line}: {problems[0].message}{more}")
    return model


def read_toml(path: Path) -> tuple[Model | None, list[Problem]]:
    """The model as far as it could be read, and everything that is wrong with the file."""
    try:
        text = path.read_bytes()
        if len(text) > LARGEST:
            raise ModelError(f"{path}: {len(text)} bytes; a model file has at most {LARGEST}")
        text = text.decode("utf-8")
        data = tomllib.loads(text)
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        return None, [Problem(1, "the file is not UTF-8 text")]
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"line (\d+)", str(error))
        return None, [Problem(int(line[1]) if line else text.count("\n") + 1, f"not TOML: {error}")]
    reading = _Reading(text, data)
    return reading.model, sorted(reading.problems, key=lambda p: p.line)


class _Reading:
    """One pass over a file: builds the model and collects problems."""

    def __init__(self, text: str, data: dict):
        self.lines = text.splitlines()
        self.problems: list[Problem] = []
        self.missing: set[str] = set()  # names whose definition failed: complaints about them are not repeated
        self.model = self._head(data)
        if self.model is not None:
            for entry in self._entries(data):
                self._tell(entry)

    def _head(self, data: dict) -> Model | None:
        options = {k: v for k, v in data.items() if k in HEAD}
        gravity = data.pop("gravity") if _is_numbers(data.get("gravity")) else None
        if "name" not in options:
            self.problems.append(Problem(1, 'the file has no name; begin with name = "…"'))
        for key in data:
            if key not in HEAD and not isinstance(data[key], (list, dict)):
                self.problems.append(Problem(self._key_line(key, 0), f"{key}: unknown; {_suggest(key, (*HEAD, 'gravity'))}"))
        try:
            model = Model(options.pop("name", "model"), **options)
            if gravity is not None:
                model.gravity(gravity)
            return model
        except (ModelError, TypeError) as error:
            self.problems.append(Problem(1, str(error)))
            return None

    def _entries(self, data: dict) -> list[Entry]:
        """Tables in the order in which their headers stand in the file, which TOML itself does not keep."""
        seen: dict[str, int] = {}
        entries = []
        for number, line in enumerate(self.lines, 1):
            header = re.match(r"\s*\[\[?\s*([A-Za-z_]\w*)\s*\]\]?\s*(#.*)?$", line)
            if not header:
                continue
            word = header[1]
            tables = data.get(word, [])
            tables = tables if isinstance(tables, list) else [tables]
            index = seen.get(word, 0)
            seen[word] = index + 1
            if index < len(tables) and isinstance(tables[index], dict):
                entries.append(Entry(word, tables[index], number))
        for word, value in data.items():
            expected = len(value) if isinstance(value, list) else 1
            if word not in HEAD and isinstance(value, (list, dict)) and seen.get(word, 0) != expected:
                self.problems.append(Problem(self._key_line(word, 0), f"{word}: write every table with its own header line, as [[{word}]]"))
        return entries

    def _tell(self, entry: Entry) -> None:
        vocabulary = words()
        if entry.word not in vocabulary:
            self.problems.append(Problem(entry.line, f"[[{entry.word}]]: unknown; {_suggest(entry.word, vocabulary)}"))
            return
        try:
            positional, named = self._arguments(entry, vocabulary[entry.word])
            getattr(self.model, entry.word)(*positional, **named)
        except _AtKey as error:
            self._report(entry, self._key_line(error.key, entry.line), str(error))
        except ModelError as error:
            self._report(entry, entry.line, str(error))
        except (TypeError, ValueError) as error:
            self._report(entry, entry.line, f"{entry.word}: {error}")

    def _report(self, entry: Entry, line: int, message: str) -> None:
        follows = any(re.search(rf"\b{re.escape(name)}\b", message) for name in self.missing)
        if isinstance(entry.keys.get("name"), str):
            self.missing.add(entry.keys["name"])
        if not follows:
            self.problems.append(Problem(line, message))

    def _arguments(self, entry: Entry, signature: inspect.Signature):
        parameters = {k: p for k, p in signature.parameters.items() if k != "self"}
        open_ended = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
        for key in entry.keys:
            if key not in parameters and not open_ended:
                raise _AtKey(key, f"{entry.word}.{key}: unknown; {_suggest(key, parameters)}")
        for key, parameter in parameters.items():
            needed = parameter.default is parameter.empty and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
            if needed and key not in entry.keys:
                raise ModelError(f"{entry.word}: {key} is missing")
        positional, named = [], {}
        for key, raw in entry.keys.items():
            value = self._argument(entry.word, key, raw)
            if key in parameters and parameters[key].kind is inspect.Parameter.VAR_POSITIONAL:
                first = [p for p in parameters if parameters[p].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
                positional = [self._argument(entry.word, p, entry.keys[p]) for p in first] + list(value)
                named = {k: v for k, v in named.items() if k not in first}
            elif key not in (p for p in parameters if positional and parameters[p].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD):
                named[key] = value
        return positional, named

    def _argument(self, word: str, key: str, raw):
        try:
            return self._convert(kind_of(word, key) if word != "simulation" else "text", raw)
        except ModelError as error:
            raise _AtKey(key, f"{word}.{key}: {error}") from None
        except (TypeError, AttributeError, ValueError):
            raise _AtKey(key, f"{word}.{key}: {raw!r} is not what is expected here ({kind_of(word, key)})") from None

    def _convert(self, kind: str, raw):
        model = self.model
        if kind == "text":
            return raw
        if kind == "direction":
            return parse_direction(raw, model.elements)
        if kind == "directions":
            return [parse_direction(item, model.elements) for item in raw]
        if kind == "names":
            return list(raw)
        if kind == "body":
            if raw != "ground" and raw not in model.bodies:
                raise ModelError(f"there is no body {raw}; define it first")
            return model.ground if raw == "ground" else model.bodies[raw]
        if kind == "coordinate":
            return self._coordinate(raw)
        if kind == "law":
            return parse_expression(raw, {"x", "v", "t", *model.parameters})
        if kind == "expression":
            return self._value(model, raw, everything=True)
        if kind == "expressions":
            return [self._value(model, item, everything=True) for item in raw]
        return self._value(model, raw)

    def _coordinate(self, raw: str):
        if raw in self.model.elements:
            return self.model.elements[raw]
        found = [c for c in self.model.components if c.name == raw]
        if not found:
            raise ModelError(f"there is no coordinate {raw}; define it first")
        return found[0]

    def _value(self, model: Model, raw, everything: bool = False):
        """A number, or a text that is an expression of parameters (or of everything that moves)."""
        if isinstance(raw, list):
            return [self._value(model, item, everything) for item in raw]
        if isinstance(raw, bool) or not isinstance(raw, (int, float, str)):
            raise ModelError(f"{raw!r} is not a number or an expression")
        if not isinstance(raw, str):
            return raw
        if raw in model.parameters:
            return model.parameters[raw]
        known = set(model.parameters)
        if everything:
            known |= {"t"} | {c.name for c in model.components}
        return parse_expression(raw, known)

    def _key_line(self, key: str, start: int) -> int:
        """The line of a key at or after the header it belongs to."""
        for number in range(start, len(self.lines)):
            if re.match(rf"\s*{re.escape(key)}\s*=", self.lines[number]):
                return number + 1
            if number > start and self.lines[number].lstrip().startswith("["):
                break
        return max(start, 1)


class _AtKey(ModelError):
    """A mistake in one key of a table."""

    def __init__(self, key: str, message: str):
        super().__init__(message)
        self.key = key


def _is_numbers(value) -> bool:
    return isinstance(value, list) and all(isinstance(x, (int, float)) for x in value)


def _suggest(word: str, known) -> str:
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
