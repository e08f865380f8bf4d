"""The commands about files: new, draw, check, convert, export, cache."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from ncgen.cli.completion import words_of
from ncgen.cli.robot_options import for_robots
from ncgen.cli.terminal import RESULTS, ModelName, err, out, progress, show, writable
from ncgen.errors import ModelError, counted
from ncgen.exchange.export import targets


def new(file: Annotated[Path, typer.Argument(metavar="FILE", help="the file to write: NAME.toml")]) -> None:
    """Write a small commented model to begin with; existing files are not overwritten."""
    from ncgen.exchange.first_model import write_start

    path = write_start(file)
    out.print(f"{path}: a four-bar linkage to change; `ncgen watch {shlex.quote(str(path))}` runs it whenever you save it", markup=False)


def check(file: Annotated[Path, typer.Argument(metavar="FILE", help="a model file: .toml, .py, .urdf, .sdf or .xml")]) -> None:
    """Check a model file.

    Of a TOML file, and of links and joints of a robot's file, every problem is reported with its line; of other files the first one.
    """
    from ncgen.compiler import generate as sources_of
    from ncgen.exchange.checking import checked

    model, problems = checked(file)
    for problem in problems:
        err.print(problem, markup=False)
    if model is None or problems:
        raise ModelError(f"{file.name}: {counted(len(problems), 'problem')}")
    sources_of(model)
    contents = ((model.components, "coordinate"), (model.rows, "constraint"), (model.bodies, "body"))
    counts = [counted(len(items), noun) for items, noun in contents]
    out.print(f"{file.name}: {', '.join(counts)}", markup=False)


@for_robots
def convert(
    model: ModelName,
    robot: dict[str, Any],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="file to write [default: standard output]", rich_help_panel=RESULTS)
    ] = None,
) -> None:
    """Write a model as TOML; with an output that ends in .sdf, .xml (MJCF) or .urdf (open trees only) as a robot's file."""
    from ncgen.exchange.examples import load
    from ncgen.exchange.robots import WRITERS, robot_text
    from ncgen.exchange.toml_writer import to_toml
    from ncgen.files import write_text

    writable("--output", output, (".toml", *WRITERS), new_folder=True)
    loaded = load(model, **robot)
    suffix = output.suffix.lower() if output else ""
    text = robot_text(loaded, suffix) if suffix in WRITERS else to_toml(loaded)
    if output is None:
        print(text, end="")
    else:
        out.print(str(write_text(output, text)), markup=False)


@for_robots
def export(
    model: ModelName,
    robot: dict[str, Any],
    to: Annotated[str, typer.Option(help=f"target: {', '.join(targets())}", autocompletion=words_of("ncgen.exchange.export", "targets"))],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for the files [default: MODEL-TO]", rich_help_panel=RESULTS)
    ] = None,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="an additional platform of an FMU, such as win64; may be repeated [default: this machine]",
            autocompletion=words_of("ncgen.exchange.export.fmu", "PLATFORMS"),
        ),
    ] = None,
) -> None:
    """Write a mechanism for use without Python: a folder with sources and a README that says how to build and run them."""
    from ncgen.exchange.examples import load
    from ncgen.exchange.export import export as written

    loaded = load(model, **robot)
    with progress(f"exporting {loaded.name}", None):
        paths = written(loaded, to, output or Path(f"{loaded.name}-{to}"), platform or ())
    show(paths)


def cache(clear: Annotated[bool, typer.Option("--clear", help="remove all compiled libraries")] = False) -> None:
    """Show or clear the cache of compiled libraries."""
    from ncgen.toolchain import cache as store

    if clear:
        out.print(f"{counted(store.clear(), 'library')} removed from {store.cache_folder()}", markup=False)
        return
    cached = store.entries()
    out.print(f"{store.cache_folder()}: {counted(len(cached), 'library')}, {sum(e.size for e in cached) / 1e6:.1f} MB", markup=False)
    for entry in cached:
        out.print(f"  {entry.key[:12]}  {', '.join(entry.sources):<24} {entry.size / 1e3:8.0f} kB  {entry.age / 3600:6.1f} h", markup=False)


def draw(file: Annotated[Path, typer.Argument(metavar="FILE", help="the page to write: NAME.html")]) -> None:
    """Write a page in which one draws a planar mechanism, which moves at once and becomes a model file; it needs no network."""
    from ncgen.exchange.editor import editor_page

    out.print(f"{editor_page().save(file)}: open it in a browser", markup=False)
