"""The command line: list, new, run, watch, study, generate, inspect, bench, compare, hard, check, convert, export, cache.

MODEL is the name of an example, or a path to a .toml, .py, .urdf, .sdf or .xml file. Messages go to standard error in one line; results go
to standard output, for people, or with --json as one JSON object.
"""

from __future__ import annotations

import io
import os
import sys
import warnings
from typing import Annotated

# Kernels are small: threads inside linear algebra would only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer  # noqa: E402

from ncgen import __version__  # noqa: E402
from ncgen.cli import files, measuring, models, studies, watching  # noqa: E402
from ncgen.cli.terminal import err, out  # noqa: E402
from ncgen.errors import CompileError, NcgenError  # noqa: E402

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode="markdown", pretty_exceptions_enable=False, help=(__doc__ or "").partition("\n")[0]
)
app.command("list")(models.list_examples)
for command in (files.new, models.run, watching.watch, models.inspect, models.generate, studies.study):
    app.command()(command)
for command in (measuring.bench, measuring.compare, measuring.hard, files.check, files.convert, files.export, files.cache):
    app.command()(command)


def _tell_version(asked: bool) -> None:
    if asked:
        out.print(f"ncgen {__version__}", markup=False)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="print the version")] = False,
) -> None:
    """What stands before the command."""


def main() -> None:
    """Entry point: every refusal is one line on standard error and an exit code."""
    warnings.simplefilter("always", UserWarning)
    warnings.showwarning = lambda message, *_, **__: err.print(f"ncgen: {message}", markup=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without Greek letters reads their numbers
    try:
        try:
            app(prog_name="ncgen")
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BrokenPipeError:  # whoever read it has read enough
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
    except KeyboardInterrupt:
        err.print("ncgen: stopped")
        sys.exit(130)


def _give_up_output() -> None:
    """What is still to be written to standard output goes nowhere, so that Python does not try again on its way out."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (AttributeError, OSError, ValueError):
        pass  # there is no such file: nothing will be tried
