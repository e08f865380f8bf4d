"""The list of signatures in docs/reports has all public functions and methods, as they are."""

from __future__ import annotations

import importlib.util
import inspect
import re
from pathlib import Path

import pytest
from test_docstrings import CLASSES, methods_of

import ncgen

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def program():
    spec = importlib.util.spec_from_file_location("signatures", ROOT / "docs" / "signatures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def listed(program) -> dict[str, dict[str, str]]:
    """{ncgen or class: {function or method: its parameters today}}."""
    sections = re.split(r"\n\n# ", program.REPORT.read_text(encoding="utf-8"))[1:]
    return {section.partition("\n")[0]: dict(entries(section.splitlines()[1:])) for section in sections}


def entries(lines):
    """(name, parameters) of what there is today; "" for a property."""
    for number, line in enumerate(lines):
        if line.startswith("    now:    ") and not line.endswith(" -"):
            yield lines[number - 2], line.removeprefix("    now:    ").replace("a property", "")
        elif line and not line.startswith(" ") and not (number + 1 < len(lines) and lines[number + 1].startswith("    before:")):
            name, bracket, rest = line.partition("(")
            yield name, bracket + rest


def test_the_list_is_what_the_sources_say(program, listed):
    sources = program.now()
    assert program.CLASSES == CLASSES
    assert listed == {"ncgen": sources.functions()} | {path.rpartition(".")[2]: sources.methods(path) for path in CLASSES}


def test_the_list_is_complete(listed):
    assert set(listed["ncgen"]) == {name for name in ncgen.__all__ if inspect.isfunction(getattr(ncgen, name))}
    for path in CLASSES:
        assert set(listed[path.rpartition(".")[2]]) == set(methods_of(path))


@pytest.mark.parametrize("name", [name for name in ncgen.__all__ if inspect.isfunction(getattr(ncgen, name))])
def test_the_list_is_true(name, listed):
    """Names and kinds of parameters are those that Python sees; a group stands for its arguments."""
    function = inspect.unwrap(getattr(ncgen, name), stop=lambda f: not hasattr(f, "__wrapped__"))
    seen = [p for p in inspect.signature(function, follow_wrapped=False).parameters.values() if p.kind is not p.VAR_KEYWORD]
    words = [
        word
        for word in re.split(r", (?![^(\[{]*[)\]}])", listed["ncgen"][name][1:-1])
        if word and word != "*" and not word.startswith("**")
    ]
    assert [word.partition("=")[0] for word in words] == [p.name for p in seen]


def test_the_table_of_what_has_changed_is_up_to_date(program, listed):
    text = program.PAGE.read_text(encoding="utf-8").partition(program.START)[2].partition(program.END)[0]
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| `")]
    assert len(rows) > 15
    for first, before, now in rows:
        name = first.strip("| `")
        assert now.strip("| `") == listed["ncgen"].get(name, "") and before.strip("| `") != now.strip("| `")
