"""The commands that measure and compare: bench, compare."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ncgen.cli.assignments import assigned, with_model_parameters
from ncgen.cli.terminal import (
    PAGES,
    PICTURES,
    RESULTS,
    Duration,
    Json,
    ModelName,
    Parameters,
    Velocities,
    progress,
    show,
    writable,
)  # fmt: skip

if TYPE_CHECKING:
    from ncgen.comparisons.comparison import Comparison
    from ncgen.model import Model


def bench(
    model: ModelName,
    duration: Duration = None,
    param: Parameters = None,
    velocity: Velocities = None,
    html: Annotated[Path | None, typer.Option(help="write a report into this file [default: no report]", rich_help_panel=RESULTS)] = None,
    plot: Annotated[
        Path | None, typer.Option(help="write the plot into this .svg or .png file [default: no plot]", rich_help_panel=RESULTS)
    ] = None,
    json_output: Json = False,
) -> None:
    """Simulate by every method, from loose to tight: error against time, and the quickest method for an error.

    Times of the generated code itself, and other people's simulators, are measured by tests/benchmarks/bench.py of the sources.
    """
    from ncgen.exchange.examples import load
    from ncgen.files import write_text
    from ncgen.report import precision
    from ncgen.report.document import Section, aligned, page
    from ncgen.report.machine import machine

    check_reports(html, plot)
    loaded = load(model)
    with progress(f"simulating {loaded.name}", None):
        p = with_model_parameters(loaded, assigned("--param", param))
        records = precision.precision_records(loaded, duration=duration, p=p, zd0=assigned("--velocity", velocity))
    doubt = f"the reference is known to {records[0]['reference_error']:.1e}: by so much two methods at tight tolerance differ"
    rows, front = precision.table(records), precision.front(records)
    if json_output:
        print(json.dumps({"machine": machine(), "records": records}, indent=1))
    else:
        show([f"{loaded.name}: time until an error is reached", *aligned(rows), doubt, *front])
    if html is not None:
        section = Section("Time until an error is reached", "; ".join([doubt, *front]), tuple(rows), precision.figure(records, loaded.name))
        write_text(html, page(f"{loaded.name}: error against time", [section], machine()))
    if plot is not None:
        from ncgen.view.figure import save

        save(precision.figure(records, loaded.name), plot)


def compare(
    model: ModelName,
    users: Annotated[
        list[str] | None,
        typer.Option(
            "--with", help="your own function, as module:function for Φ_q or gamma=module:function; may be repeated [default: no function]"
        ),
    ] = None,
    handwritten: Annotated[
        Path | None, typer.Option(help="find mistakes in phi, phi_q and gamma of this Python file, which is executed [default: no file]")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="write a report into this file [default: no report]", rich_help_panel=RESULTS)] = None,
    plot: Annotated[
        Path | None, typer.Option(help="write the plots into this .svg or .png file [default: no plot]", rich_help_panel=RESULTS)
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="write the records into this file [default: no file]", rich_help_panel=RESULTS)] = None,
    json_output: Json = False,
) -> None:
    """Compare generated derivatives with hand-written ones and with finite differences: error and time.

    Automatic differentiation by CasADi, JAX and SymForce is compared with them by tests/benchmarks/bench.py of the sources.
    """
    from ncgen.comparisons.comparison import Comparison
    from ncgen.exchange.examples import load

    check_reports(html, plot, csv)
    loaded = load(model)
    if handwritten is not None:
        _mistakes(loaded, handwritten, json_output)
        return
    show_comparison(Comparison(loaded, users or []), html, plot, csv, json_output)


def check_reports(html: Path | None, plot: Path | None, csv: Path | None = None) -> None:
    """Refuse what cannot be written before anything is measured."""
    for option, path, suffixes in (("--html", html, PAGES), ("--plot", plot, PICTURES), ("--csv", csv, (".csv",))):
        writable(option, path, suffixes)


def show_comparison(comparison: Comparison, html: Path | None, plot: Path | None, csv: Path | None, json_output: bool) -> None:
    """The sections of a comparison as they are measured, or all records, and the reports that are asked for."""
    from ncgen.files import write_text

    with progress(f"comparing {comparison.model.name}", None):
        for section in comparison.sections():
            if not json_output:
                show(comparison.lines(section))
    for path, write in ((html, comparison.html), (csv, comparison.csv)):
        if path is not None:
            write_text(path, write())
    if plot is not None:
        comparison.save_plot(plot)
    if json_output:
        print(json.dumps({"machine": comparison.machine, "records": comparison.records}, indent=1))


def _mistakes(model: Model, path: Path, json_output: bool) -> None:
    """The mistakes in a file; exit code 1 if there are any."""
    from dataclasses import asdict

    from ncgen.comparisons.mistakes import find_mistakes
    from ncgen.compiler import compile

    by_function = find_mistakes(compile(model, "c"), path)
    if json_output:
        print(json.dumps({name: [asdict(m) for m in mistakes] for name, mistakes in by_function.items()}, indent=1))
    else:
        for name, mistakes in by_function.items():
            show(mistakes or [f"{name}: no mistakes"])
    if any(by_function.values()):
        raise typer.Exit(1)
