"""Messages in the words of the command line: the option that was typed in the place of the argument of a function."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from typing import Any

from ncgen.errors import ModelError, shortened

ARGUMENTS = {
    "velocity": r"(?:zd0|initial velocity of [^:]+)",
    "param": "p",
    "stop": r"stop(?: at [^:]+)?",
    "frame": "frames",
    "platform": "platforms",
}
"""What a message calls the value of an option whose name is another, as a regular expression."""

MISSING_ARGUMENTS = ("max_step",)
"""Arguments that a message asks for when they were not given."""


def in_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command whose ModelErrors name options, such as `--velocity phi=12`, and not arguments, such as `zd0`."""

    @wraps(command)
    def called(**options: Any) -> None:
        try:
            command(**options)
        except ModelError as error:
            error.args = (shortened(worded(str(error), options)), *error.args[1:])
            raise

    return called


def worded(message: str, options: Mapping[str, Any]) -> str:
    """Return a message with an option in the place of the argument that it begins with.

    Parameters
    ----------
    message : a message that begins with an argument's name, `zd0: …`, or with a file and that, `arm.toml: floating is …`
    options : values by the names of a command's parameters; None where nothing was typed
    """
    for argument, option in _typed(message, options):
        text, count = re.subn(rf"^((?:\S+: )?)(?:{argument})(?=: | is | and | ')", lambda match, option=option: match[1] + option, message)
        if count:
            return text
    return message


def _typed(message: str, options: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(regular expression of an argument, option as it was typed) of all options that were."""
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if name == "having":
            yield from ((word, f"--with {word}") for word in value or ())
        elif name == "floating" and value is not None:
            yield name, "--floating" if value else "--fixed"
        elif value or name in MISSING_ARGUMENTS:
            yield ARGUMENTS.get(name, name), f"{option} {_meant(message, value)}" if name in ARGUMENTS else option


def _meant(message: str, typed: Any) -> str:
    """That of several values, `phi=12` or a name, which the message mentions first; all of them where it mentions none."""
    values = [typed] if isinstance(typed, str) else typed
    matches = {value: re.search(rf"(?<![\w.]){re.escape(value.rpartition('=')[0] or value)}(?!\w)", message) for value in values}
    mentioned = [(match.start(), value) for value, match in matches.items() if match]
    return min(mentioned)[1] if mentioned else ", ".join(values)
