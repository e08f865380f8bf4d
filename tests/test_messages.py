"""All messages as one text: in plain words, a line each, and listed in docs/reports/messages.txt."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest
from terms import misused

ROOT = Path(__file__).parents[1]

OUTDATED = {
    "hidden told": r"\btells? (its|their)\b",
    "number that is no": r"number that is no",
    "arrived": r"\barrived\b",
    "hang": r"\bhangs? (on|together)\b",
}
"""Words that readers do not find in a textbook, as regular expressions, in addition to those of `terms`."""


TWICE = {
    "joint: body {} is joined to itself; give two bodies",
    "motion {} of {}: {}",
    "the mass is {} kg; give a positive number",
    "there is no body {}; {}",
    "{} divides by zero",
    "{} has masked numbers; fill them",
    "{}.{}: t is {}; compiled kernels take one real number",
    "{}: a product of {} factors; {} are allowed",
    "{}: {} given; give a list of numbers, low and high, or mean and deviation",
    "{}: {} given; give {}",
    "{}: {} is no array of numbers",
    "{}: {} is not a finite number; correct it",
    "{}: {} is of type {}; it must be real numbers",
    "{}: {} is too large; the largest number is {}, check the unit",
    "{}: {}; give the folder of a study",
    "{}: {}; start nearer to a closed position",
}
"""Messages that stand in two places, without their expressions; the list may only become shorter."""


@pytest.fixture(scope="module")
def program():
    """docs/messages.py as a module."""
    spec = importlib.util.spec_from_file_location("messages", ROOT / "docs" / "messages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def messages(program):
    return program.messages()


def test_messages_are_found(messages):
    """Errors, warnings and help, with the expressions in them."""
    assert len(messages) > 500
    assert "model/joints: ModelError: joint: body {a.name} is joined to itself; give two bodies" in messages
    assert any(line.startswith("help: run --velocity: initial velocity of a coordinate") for line in messages)
    assert any(": warning: " in line for line in messages)


@pytest.mark.parametrize("word", OUTDATED)
def test_messages_are_in_terms_of_the_field(messages, word):
    assert [line for line in messages if re.search(OUTDATED[word], line.split(": ", 2)[-1])] == []


def test_messages_and_help_have_no_outdated_terms(messages):
    prose = {line: re.sub(r"\{[^{}]*(\{[^{}]*\}[^{}]*)*\}", "", line.split(": ", 2)[-1]) for line in messages}
    assert {line: misused(text) for line, text in prose.items() if misused(text)} == {}


def test_a_message_is_a_line(messages):
    assert [line for line in messages if "\n" in line or line.endswith(" ")] == []


def test_a_message_has_one_function(messages):
    """What two places say in the same words comes from one of them (`ncgen.errors.one_of`, …)."""
    errors = [line.split(": ", 2)[-1] for line in messages if not line.startswith("help: ")]
    plain = [re.sub(r"\{[^{}]*(\{[^{}]*\}[^{}]*)*\}", "{}", text) for text in errors]
    twice = {text for text in plain if plain.count(text) > 1 and re.search("[a-z]{3}", text)}
    assert twice == TWICE


def test_the_list_is_up_to_date(program, messages):
    assert program.REPORT.read_text(encoding="utf-8").splitlines() == messages
