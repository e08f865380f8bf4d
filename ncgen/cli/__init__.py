"""The command line: list, new, draw, run, watch, study, generate, inspect, bench, compare, hard, check, convert, export, cache.

MODEL is the name of an example, or a path to a .toml, .py, .urdf, .sdf or .xml file. Messages go to standard error in one line; results go
to standard output, for people, or with --json as one JSON object.
"""

from __future__ import annotations

import atexit
import gc
import io
import os
import sys
import warnings
from shutil import get_terminal_size
from typing import Annotated, Any

# Kernels are small: threads inside linear algebra would only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer  # noqa: E402

from ncgen import __version__  # noqa: E402
from ncgen.cli import file_commands, measuring, models, studies, watching  # noqa: E402
from ncgen.cli.terminal import err, out  # noqa: E402
from ncgen.cli.wording import in_options  # noqa: E402
from ncgen.errors import CompileError, NcgenError  # noqa: E402

UsageProblem: type[Exception] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
"""What typer raises for a wrong command line; versions of typer differ in the module that it is from."""

MIN_TABLE_COLUMNS = 70
"""Columns of a terminal below which help is plain text: a table of four columns would cut the names of options."""

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown" if get_terminal_size().columns >= MIN_TABLE_COLUMNS else None,
    pretty_exceptions_enable=False,
    help="Generate code for multibody systems in natural coordinates, and simulate them.",
)
GROUPS = {
    "Models": {
        "list": models.list_examples,
        "new": file_commands.new,
        "draw": file_commands.draw,
        "check": file_commands.check,
        "inspect": models.inspect,
        "convert": file_commands.convert,
    },
    "Motions": {"run": models.run, "watch": watching.watch, "study": studies.study},
    "Generated code": {"generate": models.generate, "export": file_commands.export, "cache": file_commands.cache},
    "Measurements": {"bench": measuring.bench, "compare": measuring.compare, "hard": measuring.hard},
}
"""The commands by the panel of `ncgen --help` that lists them."""

for panel, commands in GROUPS.items():
    for name, command in commands.items():
        app.command(name, rich_help_panel=panel)(in_options(command))


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"ncgen {__version__}", markup=False)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version")] = False,
) -> None:
    """Global options."""


def main() -> None:
    """Entry point: every refusal is one line on standard error and an exit code."""
    atexit.register(gc.freeze)  # the system takes all memory back at once: looking for cycles before that takes 80 ms
    warnings.simplefilter("always", UserWarning)
    warnings.showwarning = lambda message, *_, **__: err.print(f"ncgen: {message}", markup=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without Greek letters reads their numbers
    try:
        try:
            code = app(prog_name="ncgen", standalone_mode=False)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe
        _give_up_output()
        sys.exit(1)
    except OSError as error:
        _give_up_output()
        where = error.filename or "the output cannot be written"
        err.print(f"ncgen: {where}: {error.strerror or error}; choose another place for it", markup=False)
        sys.exit(2)
    except CompileError as error:
        err.print(f"ncgen: {error}", markup=False)
        if error.log:
            err.print(error.log.rstrip(), markup=False)
        sys.exit(error.exit_code)
    except NcgenError as error:
        err.print(f"ncgen: {error}", markup=False)
        sys.exit(error.exit_code)
    except UsageProblem as error:
        err.print(_usage(error), markup=False)
        sys.exit(getattr(error, "exit_code", 2))
    except typer.Abort:
        err.print("ncgen: stopped")
        sys.exit(130)
    if code:
        sys.exit(code)


def _usage(error: Any) -> str:
    """Return the line about a wrong command line; without any words there is help instead."""
    if type(error).__name__ == "NoArgsIsHelpError":
        return error.format_message()
    context = getattr(error, "ctx", None)
    words = " ".join(error.format_message().split()).rstrip(".")
    where = context.command_path if context is not None else "ncgen"
    return f"ncgen: {words[:1].lower()}{words[1:]}; `{where} --help` lists what there is"


def _give_up_output() -> None:
    """What is still to be written to standard output goes nowhere, so that Python does not try again on its way out."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (AttributeError, OSError, ValueError):
        pass  # there is no such file: nothing will be tried
