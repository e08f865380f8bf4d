"""Help of every command: what the code says of an option is shown, defaults as well, in any width of the terminal."""

import inspect
import os
import re
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from ncgen.cli import GROUPS, MIN_TABLE_COLUMNS, app

COMMANDS = typer.main.get_command(app).commands
MANY = 5
"""Options of one command from which on they stand in panels."""


def shown(command: str, columns: int = 200) -> str:
    """What `ncgen COMMAND --help` prints, without frames, in one line."""
    result = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": str(columns), "NO_COLOR": "1", "TERM": "dumb"})
    assert result.exit_code == 0
    return re.sub(r"[\s│]+", " ", result.output)


def options(command: str) -> list:
    return [parameter for parameter in COMMANDS[command].params if parameter.param_type_name == "option"]


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_help_is_shown_as_it_is_written(command):
    """Every word of it, brackets as well, which markup would take for a style."""
    text = shown(command)
    for parameter in COMMANDS[command].params:
        help_of = inspect.cleandoc(getattr(parameter, "help", None) or "")
        assert help_of and " ".join(help_of.split()) in text, f"{command} {parameter.name}: {help_of}"


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_help_says_the_default_of_every_option(command):
    """A reader learns what happens without the option; a flag without a counterpart is off."""
    text = shown(command)
    for option in options(command):
        is_flag = getattr(option, "is_flag", False) and not option.secondary_opts
        if not (option.required or is_flag or option.name == "help"):
            _, found, behind = text.partition(" ".join(option.help.split()))
            assert found and ("[default: " in found or behind.startswith(" [default: ")), f"{command} {option.opts[0]}"


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_many_options_stand_in_panels(command):
    panels = {getattr(option, "rich_help_panel", None) for option in options(command)}
    assert len(panels) > 1 or len(options(command)) < MANY


def test_every_command_has_a_group():
    assert sorted(name for commands in GROUPS.values() for name in commands) == sorted(COMMANDS)


@pytest.mark.parametrize("columns", [40, MIN_TABLE_COLUMNS])
def test_a_narrow_terminal_cuts_no_name(columns):
    """As a program of its own, which asks the terminal for its width when it starts."""
    environment = {**os.environ, "COLUMNS": str(columns), "NO_COLOR": "1", "TERM": "dumb"}
    command = [sys.executable, "-m", "ncgen", "run", "--help"]
    text = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60).stdout
    for option in options("run"):
        assert option.opts[0] in text.split(), option.opts[0]
