"""What help says of options stands in it, brackets as well."""

import inspect
import re

import pytest
import typer
from typer.testing import CliRunner

from ncgen.cli import app

COMMANDS = sorted(typer.main.get_command(app).commands)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_bracket_of_help_is_shown(command):
    told = typer.main.get_command(app).commands[command]
    shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    assert shown.exit_code == 0
    text = re.sub(r"[\s│]+", " ", shown.output)
    for parameter in told.params:
        for bracket in re.findall(r"\[[^\]]*\]", inspect.cleandoc(getattr(parameter, "help", None) or "")):
            assert bracket in text, f"{command} {parameter.name}: {bracket}"
