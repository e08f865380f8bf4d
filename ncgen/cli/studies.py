"""The command for many variants: study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ncgen.cli.terminal import PICTURES, RESULTS, Json, err, out, show, timed, writable
from ncgen.errors import counted

PROCESSORS = "Processors"
"""Panel of `--help`."""

MAX_PRINTED_FAILURES = 3
"""Failures that are printed; the table has all."""


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="a TOML file: the model, what varies, and what is kept (docs/studies.md)")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="folder for the results; an existing study is resumed [default: STUDY-study]", rich_help_panel=RESULTS
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="number of worker processes [default: threads of this process]", rich_help_panel=PROCESSORS)
    ] = None,
    cluster: Annotated[
        str | None, typer.Option(help="address of a Dask scheduler, or local [default: no cluster]", rich_help_panel=PROCESSORS)
    ] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, help="threads, or workers of a local cluster [default: all processors]", rich_help_panel=PROCESSORS)
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="plot the kept quantities into this .png or .svg file [default: no plot]", rich_help_panel=RESULTS)
    ] = None,
    table: Annotated[
        Path | None, typer.Option(help="write a table into this .csv or .parquet file [default: no table]", rich_help_panel=RESULTS)
    ] = None,
    sobol: Annotated[
        str | None,
        typer.Option(help="print Sobol' indices of this column of a saltelli design [default: no indices]", rich_help_panel=RESULTS),
    ] = None,
    json_output: Json = False,
) -> None:
    """Simulate many variants of a model. Results are written continuously; the same command resumes an interrupted study."""
    from ncgen.errors import ModelError
    from ncgen.studies.file import read_study
    from ncgen.studies.running import carry_out

    if workers and cluster:
        raise ModelError("--workers and --cluster are both given; give one")
    writable("--plot", plot, PICTURES)
    writable("--table", table, (".csv", ".parquet"))
    definition, folder = read_study(file), output or Path(f"{file.stem}-study")
    try:
        with timed(f"{definition.model.name}: {counted(definition.size, 'variant')}", definition.size) as advance:
            result = carry_out(definition, folder, cluster or workers, threads, advance)
    except KeyboardInterrupt:
        kept = f"results so far are in {folder}; the same command resumes the study" if folder.is_dir() else "no results yet"
        err.print(f"ncgen: stopped; {kept}", markup=False)
        raise
    if plot is not None:
        result.plot(plot)
    if table is not None:
        (result.to_csv if table.suffix.lower() == ".csv" else result.to_parquet)(table)
    failures = result.failures
    if json_output:
        record = {**result.about, "folder": str(folder), "ok": int(result.ok.sum()), "failures": {str(k): v for k, v in failures.items()}}
        print(json.dumps(record, indent=1))
        return
    out.print(f"{result.about['model']}: {result.ok.sum()} of {len(result)} variants completed, in {folder}", markup=False)
    out.print(f"  {result.about['made_with']}", markup=False)
    show(f"  variant {variant}: {sentence}" for variant, sentence in list(failures.items())[:MAX_PRINTED_FAILURES])
    if len(failures) > MAX_PRINTED_FAILURES:
        out.print(f"  and {len(failures) - MAX_PRINTED_FAILURES} more", markup=False)
    if sobol is not None:
        out.print(str(result.sobol(sobol)), markup=False)
