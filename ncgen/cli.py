"""The command line: list, run, generate, inspect, bench, compare, hard, check, convert, export, cache.

MODEL is the name of an example, or a path to a .toml or .py file. Messages go to standard error in one line; results go
to standard output, for people, or with --json as one JSON object.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

# Kernels are small: threads inside linear algebra would only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: E402

from ncgen.errors import CompileError, Interrupted, ModelError, NcgenError  # noqa: E402

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__.splitlines()[0])
out = Console(highlight=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, soft_wrap=True)

ModelName = Annotated[str, typer.Argument(metavar="MODEL", help="an example's name, or a path to a .toml or .py file")]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
Backend = Annotated[str, typer.Option(help="auto, c or numpy")]
PICTURES = (".svg", ".png")
Emission = Annotated[str, typer.Option(help="auto, tabled or unrolled")]


@app.command("list")
def list_examples(json_output: Json = False) -> None:
    """List the examples with degrees of freedom, rows, and what each teaches."""
    from ncgen.exchange.examples import example_names
    from ncgen.report.gallery import gallery

    with _progress("looking at the examples", len(example_names())) as advance:
        records = gallery(advance)
    if json_output:
        print(json.dumps(records, indent=1))
        return
    for r in records:
        out.print(f"{r['name']:<15}{r['dof']:>3} dof {r['rows']:>4} rows ({r['redundant']} redundant)  {r['teaches']}", markup=False)


@app.command()
def inspect(
    model: ModelName,
    along: Annotated[Path | None, typer.Option(help="a trajectory.npz: show how healthy that motion is")] = None,
    json_output: Json = False,
    backend: Backend = "auto",
    emission: Emission = "auto",
) -> None:
    """Show degrees of freedom, redundant rows, what was left out, and the kernels; or the health of a motion."""
    from ncgen.report.along import Recorded, health_record, show_health
    from ncgen.report.inspection import inspect as facts_of
    from ncgen.report.screen import show_inspection

    recorded = None if along is None else Recorded.read(along)
    kernels, _, seconds = _compiled(model, backend, emission)
    if recorded is not None:
        health = recorded.health(kernels)
        if json_output:
            print(json.dumps(health_record(health), indent=1))
        else:
            show_health(out, health)
        return
    facts = facts_of(kernels)
    if json_output:
        print(json.dumps(facts, indent=1))
        return
    for term, row in zip(kernels.programs.equations.rows, kernels.rows, strict=True):
        out.print(f"  {term.row + 1:>4} {row.code or '':<5} {row.label} ({row.owner}): {term.equation}", markup=False)
    show_inspection(out, facts, seconds)


@app.command()
def generate(
    model: ModelName,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="folder for the sources [default: generated/MODEL]")] = None,
    emission: Emission = "auto",
) -> None:
    """Write the C and NumPy sources of a model."""
    from ncgen.compiler import generate as sources_of
    from ncgen.exchange.examples import load

    loaded = load(model)
    folder = output or Path("generated") / loaded.name
    for path in sources_of(loaded, emission).write(folder):
        out.print(str(path), markup=False)


@app.command()
def run(
    model: ModelName,
    duration: Annotated[float | None, typer.Option(help="seconds [default: the model's]")] = None,
    integrator: Annotated[str | None, typer.Option(help="dopri5, dop853, adams, bdf, radau, ode45 …")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance [default: 1e-8]")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance [default: 1e-10]")] = None,
    points: Annotated[int | None, typer.Option(help="instants in the trajectory [default: 101]")] = None,
    velocity: Annotated[list[str] | None, typer.Option(help="initial velocity, as psi1=2.5; may be repeated")] = None,
    backend: Backend = "auto",
    emission: Emission = "auto",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="folder for the files [default: MODEL-output]")] = None,
    files: Annotated[bool, typer.Option(help="write sources, trajectory, drawing and animation")] = True,
    json_output: Json = False,
) -> None:
    """Generate, compile, check, simulate and draw a model."""
    from ncgen.report.inspection import inspect as facts_of
    from ncgen.report.running import run_record, write_outputs
    from ncgen.report.screen import show_inspection, show_run
    from ncgen.report.timing import kernel_times
    from ncgen.solver.rank import freedom
    from ncgen.solver.run import check_simulation, simulation_of
    from ncgen.solver.simulate import simulate

    given = dict(duration=duration, integrator=integrator, rtol=rtol, atol=atol, points=points, zd0=_velocities(velocity))
    kernels, sources, seconds = _compiled(model, backend, emission, lambda loaded: check_simulation(loaded, **given))
    found = freedom(kernels)
    if not json_output:
        show_inspection(out, facts_of(kernels, found), seconds, kernel_times(kernels))
    options = simulation_of(kernels.model, **given)
    with _progress(f"simulating {options['duration']} s", options["duration"]) as advance:
        try:
            trajectory = simulate(kernels, progress=lambda t: advance(t - options.get("t0", 0.0)), **options)
        except Interrupted as stopped:
            err.print(f"ncgen: {stopped}; what was reached is written", markup=False)
            trajectory = stopped.run
    folder = (output or Path(f"{kernels.name}-output")) if files else None
    if files:
        with _progress("writing files", 1.0):
            outputs = write_outputs(sources, trajectory, folder)
    else:
        outputs = []
    record = run_record(trajectory, found, folder, outputs)
    if json_output:
        print(json.dumps(record, indent=1))
    else:
        show_run(out, record)


@app.command()
def bench(
    model: ModelName,
    precision: Annotated[bool, typer.Option("--precision", help="whole simulations by every method, error against time")] = False,
    instructions: Annotated[bool, typer.Option("--instructions", help="instructions of a call, counted by valgrind")] = False,
    growth: Annotated[bool, typer.Option("--growth", help="of the chain: generation and compilation of 100 to 5000 links")] = False,
    peers: Annotated[bool, typer.Option("--peers", help="N four-bars beside other simulators, those that are installed")] = False,
    limit: Annotated[float, typer.Option(help="with --peers: seconds after which a run is stopped")] = 20.0,
    html: Annotated[Path | None, typer.Option(help="with --precision: write a report into this file")] = None,
    plot: Annotated[Path | None, typer.Option(help="with --precision: write the plot into this .svg or .png file")] = None,
    json_output: Json = False,
) -> None:
    """Measure generated code beside hand-written code: times with their errors."""
    from ncgen.comparisons.bench import bench as measurements
    from ncgen.comparisons.bench import show
    from ncgen.exchange.examples import load

    _writable("--html", html)
    _writable("--plot", plot, PICTURES)
    if peers:
        _peers(load(model), limit, json_output)
        return
    if growth:
        _growth(load(model), json_output)
        return
    if instructions:
        _instructions(load(model), json_output)
        return
    if precision or html or plot:
        _precision(load(model), html, plot, json_output)
        return
    records = []
    with _progress(f"measuring {model}", 3.0) as advance:
        for done, (title, found) in enumerate(measurements(load(model)), 1):
            records += found
            advance(done)
            if not json_output:
                show(out, title, found)
    if json_output:
        print(json.dumps(records, indent=1))


def _growth(model, json_output: bool) -> None:
    """Seconds and bytes of longer and longer chains."""
    from ncgen.comparisons.bench import aligned, generation_rows
    from ncgen.comparisons.generation import LENGTHS, growth_records

    if model.name != "chain":
        raise ModelError(f"--growth: {model.name} has one size; choose chain")
    records = []
    with _progress("generating chains", len(LENGTHS)) as advance:
        for done, record in enumerate(growth_records(), 1):
            records.append(record)
            advance(done)
    if json_output:
        print(json.dumps(records, indent=1))
    else:
        for line in aligned(generation_rows(records)):
            out.print(line, markup=False)


def _instructions(model, json_output: bool) -> None:
    """Counts that repeat to the digit."""
    from ncgen.comparisons.bench import aligned
    from ncgen.comparisons.instructions import instruction_records, table

    with _progress(f"counting instructions of {model.name}", None):
        records = list(instruction_records(model))
    if json_output:
        print(json.dumps(records, indent=1))
    else:
        for line in aligned(table(records)):
            out.print(line, markup=False)


def _peers(model, limit: float, json_output: bool) -> None:
    """Other simulators beside ncgen."""
    from ncgen.comparisons import peers

    if model.name != "nfourbar":
        raise ModelError(f"--peers: {model.name} is not a mechanism that the other simulators were given; choose nfourbar")
    records = []
    for count in peers.COUNTS:
        with _progress(f"measuring {count} four-bars", None):
            found = list(peers.peer_records([count], limit=limit))
        records += found
        for line in () if json_output else peers.lines(found):
            out.print(line, markup=False)
    if json_output:
        print(json.dumps(records, indent=1))


def _precision(model, html: Path | None, plot: Path | None, json_output: bool) -> None:
    """Every method from loose to tight; the front in words."""
    from ncgen.comparisons import precision
    from ncgen.comparisons.bench import aligned
    from ncgen.emit.sources import write_text
    from ncgen.report.document import Section, page
    from ncgen.report.machine import machine

    with _progress(f"simulating {model.name}", None):
        records = precision.precision_records(model)
    doubt = f"the reference is known to {records[0]['doubt']:.1e}: by so much two methods at tight tolerance differ"
    rows, front = precision.table(records), precision.front(records)
    if json_output:
        print(json.dumps({"machine": machine(), "records": records}, indent=1))
    else:
        for line in [f"{model.name}: time until an error is reached", *aligned(rows), doubt, *front]:
            out.print(line, markup=False)
    if html is not None:
        section = Section("Time until an error is reached", "; ".join([doubt, *front]), tuple(rows), precision.figure(records, model.name))
        write_text(html, page(f"{model.name}: error against time", [section], machine()))
    if plot is not None:
        from ncgen.view.figure import save

        save(precision.figure(records, model.name), plot)


@app.command()
def compare(
    model: ModelName,
    users: Annotated[
        list[str] | None, typer.Option("--with", help="a function of yours, module:function for Φ_q, or gamma=module:function")
    ] = None,
    handwritten: Annotated[
        Path | None, typer.Option(help="find mistakes in this Python file's phi, phi_q, gamma (the file is run)")
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="also the paper's Tables 9 and 10: integrators by source of derivatives")
    ] = False,
    html: Annotated[Path | None, typer.Option(help="write a report into this file")] = None,
    plot: Annotated[Path | None, typer.Option(help="write the plots into this .svg or .png file")] = None,
    csv: Annotated[Path | None, typer.Option(help="write the records into this file")] = None,
    json_output: Json = False,
) -> None:
    """Compare generated derivatives with hand-written ones, differences and automatic differentiation: error beside time."""
    from ncgen.comparisons.comparison import Comparison
    from ncgen.emit.sources import write_text
    from ncgen.exchange.examples import load

    for option, path, suffixes in (("--html", html, ()), ("--plot", plot, PICTURES), ("--csv", csv, ())):
        _writable(option, path, suffixes)
    loaded = load(model)
    if handwritten is not None:
        _mistakes(loaded, handwritten, json_output)
        return
    comparison = Comparison(loaded, users or [], tables)
    with _progress(f"comparing {loaded.name}", None):
        for section in comparison.sections():
            if not json_output:
                for line in comparison.lines(section):
                    out.print(line, markup=False)
    for path, write in ((html, comparison.html), (csv, comparison.csv)):
        if path is not None:
            write_text(path, write())
    if plot is not None:
        comparison.save_plot(plot)
    if json_output:
        print(json.dumps({"machine": comparison.machine, "records": comparison.records}, indent=1))


def _mistakes(model, path: Path, json_output: bool) -> None:
    """The mistakes in a file; exit code 1 if there are any."""
    from dataclasses import asdict

    from ncgen.comparisons.mistakes import find_mistakes
    from ncgen.compiler import compile

    found = find_mistakes(compile(model, "c"), path)
    if json_output:
        print(json.dumps({name: [asdict(m) for m in mistakes] for name, mistakes in found.items()}, indent=1))
    else:
        for name, mistakes in found.items():
            for mistake in mistakes:
                out.print(str(mistake), markup=False)
            if not mistakes:
                out.print(f"{name}: no mistakes", markup=False)
    if any(found.values()):
        raise typer.Exit(1)


@app.command()
def hard(
    case: Annotated[list[str] | None, typer.Option(help="one case [default: all]; may be repeated")] = None,
    limit: Annotated[float, typer.Option(help="seconds after which a run is stopped")] = 20.0,
    json_output: Json = False,
) -> None:
    """Run mechanisms that break methods: case by formalism and integrator, with error, drift, time, or why it fails."""
    from ncgen.comparisons.hard import hard_records, lines, methods
    from ncgen.comparisons.hard_cases import CASES

    names = case or list(CASES)
    if unknown := [name for name in names if name not in CASES]:
        raise ModelError(f"case {unknown[0]!r} is unknown; choose one of {', '.join(CASES)}")
    records = []
    with _progress("hard cases", len(names) * len(methods())) as advance:
        for done, record in enumerate(hard_records(names, limit), 1):
            records.append(record)
            advance(done)
            if not json_output and done % len(methods()) == 0:
                for line in lines(records[-len(methods()) :]):
                    out.print(line, markup=False)
    if json_output:
        print(json.dumps(records, indent=1))


@app.command()
def check(file: Annotated[Path, typer.Argument(help="a TOML model file")]) -> None:
    """Report everything that is wrong with a model file, with line numbers."""
    from ncgen.compiler import generate as sources_of
    from ncgen.exchange.toml_reader import problems_of_run, read_toml

    model, problems = read_toml(file)
    problems = problems or problems_of_run(file, model)
    for problem in problems:
        err.print(problem.of(file), markup=False)
    if problems:
        raise ModelError(f"{file.name}: {len(problems)} problem{'s' if len(problems) > 1 else ''}")
    sources_of(model)
    out.print(f"{file.name}: {len(model.components)} coordinates, {len(model.rows)} rows, {len(model.bodies)} bodies", markup=False)


@app.command()
def convert(
    model: ModelName,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="file to write [default: print]")] = None,
) -> None:
    """Write a model as a TOML file."""
    from ncgen.emit.sources import write_text
    from ncgen.exchange.examples import load
    from ncgen.exchange.toml_writer import to_toml

    text = to_toml(load(model))
    if output is None:
        print(text, end="")
    else:
        out.print(str(write_text(output, text)), markup=False)


@app.command()
def export(
    model: ModelName,
    to: Annotated[str, typer.Option(help="c, fmu2, fmu3, wasm, python or numpy")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="folder for the files [default: MODEL-TO]")] = None,
) -> None:
    """Write a mechanism for use without Python: a folder that builds and runs by its own README."""
    from ncgen.exchange.examples import load
    from ncgen.exchange.export import export as written

    loaded = load(model)
    with _progress(f"exporting {loaded.name}", None):
        paths = written(loaded, to, output or Path(f"{loaded.name}-{to}"))
    for path in paths:
        out.print(str(path), markup=False)


@app.command()
def cache(clear: Annotated[bool, typer.Option("--clear", help="remove all compiled libraries")] = False) -> None:
    """Show or clear the cache of compiled libraries."""
    from ncgen.toolchain import cache as store

    if clear:
        out.print(f"{store.clear()} libraries removed from {store.cache_folder()}", markup=False)
        return
    found = store.entries()
    out.print(f"{store.cache_folder()}: {len(found)} libraries, {sum(e.size for e in found) / 1e6:.1f} MB", markup=False)
    for entry in found:
        out.print(f"  {entry.key[:12]}  {', '.join(entry.sources):<24} {entry.size / 1e3:8.0f} kB  {entry.age / 3600:6.1f} h", markup=False)


def main() -> None:
    """Entry point: every refusal is one line on standard error and an exit code."""
    warnings.simplefilter("always", UserWarning)
    warnings.showwarning = lambda message, *_, **__: err.print(f"ncgen: {message}", markup=False)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a terminal without Greek letters reads their numbers
    try:
        try:
            app()
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


def _writable(option: str, path: Path | None, suffixes: tuple[str, ...] = ()) -> None:
    """Refuse a file that cannot be written before the work that it is for is done."""
    if path is None:
        return
    if suffixes and path.suffix.lower() not in suffixes:
        raise ModelError(f"{option} {path}: choose a name that ends in {' or '.join(suffixes)}")
    if path.is_dir():
        raise ModelError(f"{option} {path}: that is a folder; name a file in it")
    if not path.parent.is_dir():
        raise ModelError(f"{option} {path}: there is no folder {path.parent}; make it, or choose another")
    if not os.access(path.parent, os.W_OK):
        raise ModelError(f"{option} {path}: the folder {path.parent} cannot be written to; choose another")


def _compiled(name: str, backend: str, emission: str, check=None):
    """Kernels, sources and the seconds of every stage, with the stages shown while they run.

    check: of the model, before anything is made of it
    """
    from ncgen.compiler import Timings, check_words, compile, generate
    from ncgen.exchange.examples import load

    check_words(backend, emission)
    timings = Timings()
    with _progress(f"generating and compiling {name}", None):
        model = timings.stage("model", load, name)
        if check:
            check(model)
        sources = generate(model, emission, timings)
        kernels = compile(sources, backend, timings=timings)
    return kernels, sources, timings.seconds


def _velocities(pairs: list[str] | None) -> dict[str, float] | None:
    if not pairs:
        return None
    velocities = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        try:
            velocities[name] = float(value)
        except ValueError:
            raise ModelError(f"--velocity {pair}: write it as name=number, for example psi1=2.5") from None
    return velocities


@contextmanager
def _progress(what: str, total: float | None):
    """A progress bar on standard error, only where somebody is watching."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


if __name__ == "__main__":
    main()
