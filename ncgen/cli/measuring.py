"""The commands that measure and compare: bench, compare, hard."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ncgen.cli.assignments import assigned, with_model_parameters
from ncgen.cli.completion import models, words_of
from ncgen.cli.terminal import (
    PAGES,
    PICTURES,
    RESULTS,
    Duration,
    Json,
    ModelName,
    Parameters,
    Velocities,
    out,
    print_records,
    progress,
    show,
    writable,
)  # fmt: skip
from ncgen.errors import ModelError

if TYPE_CHECKING:
    from ncgen.comparisons.comparison import Comparison
    from ncgen.model import Model


def bench(
    model: Annotated[
        str, typer.Argument(metavar="MODEL", help="an example's name, a path to a model file, or the word robots", autocompletion=models)
    ],
    files: Annotated[list[Path] | None, typer.Argument(help="after the word robots: robots' files, or folders with such files")] = None,
    precision: Annotated[bool, typer.Option("--precision", help="simulate by every method and print error against time")] = False,
    duration: Duration = None,
    param: Parameters = None,
    velocity: Velocities = None,
    limit: Annotated[float | None, typer.Option(min=0.0, help="with robots: time limit of a file, in seconds [default: 120]")] = None,
    html: Annotated[
        Path | None, typer.Option(help="with --precision: write a report into this file [default: no report]", rich_help_panel=RESULTS)
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="with --precision: write the plot into this .svg or .png file [default: no plot]", rich_help_panel=RESULTS),
    ] = None,
    json_output: Json = False,
) -> None:
    """Measure generated code next to hand-written code: times with their errors.

    Other people's simulators and generators are compared with it by tests/benchmarks/bench.py of the sources.
    """
    from ncgen.comparisons.bench import bench as measurements
    from ncgen.exchange.examples import load

    writable("--html", html, PAGES)
    writable("--plot", plot, PICTURES)
    if model == "robots":
        _robots(files or [], limit, json_output)
        return
    if files:
        raise ModelError(f"bench {model} {files[0]}: only `robots` takes files; name one model")
    if precision or html or plot:
        chosen = {"duration": duration, "p": assigned("--param", param), "zd0": assigned("--velocity", velocity)}
        _precision(load(model), html, plot, json_output, **chosen)
        return
    for option, value in (("--duration", duration), ("--param", param), ("--velocity", velocity)):
        if value is not None:
            raise ModelError(f"{option}: only with --precision a motion can be chosen; add --precision")
    show_sections(model, measurements(load(model)), json_output)


def show_sections(
    model: str, sections: Iterable[tuple[str, list[dict]]], json_output: bool, more: Mapping[str, Callable[[list[dict]], Any]] | None = None
) -> None:
    """One table after the other as they are measured, or all records. model: its name; more: rows of further cases, as of `show`"""
    from ncgen.comparisons.bench import show as show_section

    records = []
    with progress(f"measuring {model}", 3.0) as advance:
        for done, (title, section) in enumerate(sections, 1):
            records += section
            advance(done)
            if not json_output:
                show_section(out, title, section, more)
    if json_output:
        print(json.dumps(records, indent=1))


def _robots(paths: list[Path], limit: float | None, json_output: bool) -> None:
    """Robots from files, a line a file."""
    from ncgen.comparisons import robots

    files, records = robots.robot_files(paths), []
    with progress("measuring robots", len(files)) as advance:
        for record in robots.robot_records(files, limit or robots.LIMIT):
            if not (records or json_output):
                show([robots.titles()])
            records.append(record)
            advance(len(records))
            if not json_output:
                show([robots.robot_line(record)])
    print_records(records, robots.summary, json_output)


def _precision(model: Model, html: Path | None, plot: Path | None, json_output: bool, **chosen: Any) -> None:
    """Every method from loose to tight; the front in words. chosen: duration, p and zd0 of `simulate`, None for the model's"""
    from ncgen.files import write_text
    from ncgen.report import precision
    from ncgen.report.document import Section, aligned, page
    from ncgen.report.machine import machine

    with progress(f"simulating {model.name}", None):
        chosen["p"] = with_model_parameters(model, chosen["p"])
        records = precision.precision_records(model, **chosen)
    doubt = f"the reference is known to {records[0]['reference_error']:.1e}: by so much two methods at tight tolerance differ"
    rows, front = precision.table(records), precision.front(records)
    if json_output:
        print(json.dumps({"machine": machine(), "records": records}, indent=1))
    else:
        show([f"{model.name}: time until an error is reached", *aligned(rows), doubt, *front])
    if html is not None:
        section = Section("Time until an error is reached", "; ".join([doubt, *front]), tuple(rows), precision.figure(records, model.name))
        write_text(html, page(f"{model.name}: error against time", [section], machine()))
    if plot is not None:
        from ncgen.view.figure import save

        save(precision.figure(records, model.name), plot)


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


def check_reports(html: Path | None, plot: Path | None, csv: Path | None) -> None:
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


def hard(
    case: Annotated[
        list[str] | None,
        typer.Option(help="a case; may be repeated [default: all cases]", autocompletion=words_of("ncgen.comparisons.hard_cases", "CASES")),
    ] = None,
    limit: Annotated[float, typer.Option(min=0.0, help="time limit of a run, in seconds")] = 20.0,
    json_output: Json = False,
) -> None:
    """Benchmark all methods on difficult mechanisms: error, drift and time, or why a method fails.

    The default method is compared with the best one by tests/benchmarks/bench.py --defaults of the sources.
    """
    from ncgen.comparisons.hard import hard_records, lines, methods
    from ncgen.comparisons.hard_cases import CASES

    if unknown := [name for name in case or () if name not in CASES]:
        raise ModelError(f"--case {unknown[0]}: there is no such case; choose one of {', '.join(CASES)}")
    names = case or list(CASES)
    records = []
    with progress("hard cases", len(names) * len(methods())) as advance:
        for done, record in enumerate(hard_records(names, limit), 1):
            records.append(record)
            advance(done)
            if not json_output and done % len(methods()) == 0:
                show(lines(records[-len(methods()) :]))
    if json_output:
        print(json.dumps(records, indent=1))
