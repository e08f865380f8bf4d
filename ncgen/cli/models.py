"""The commands that inspect and simulate a model: list, inspect, generate, run."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ncgen.cli.assignments import assigned, with_model_parameters
from ncgen.cli.completion import stops, words_of
from ncgen.cli.robot_options import for_robots
from ncgen.cli.terminal import (
    METHOD,
    MOTION,
    RESULTS,
    Backend,
    Duration,
    Emission,
    Json,
    ModelName,
    Parameters,
    Velocities,
    err,
    out,
    progress,
)  # fmt: skip
from ncgen.errors import Interrupted

if TYPE_CHECKING:
    from ncgen.emit.sources import Sources
    from ncgen.mechanism.kernels import Kernels
    from ncgen.model import Model


def list_examples(json_output: Json = False) -> None:
    """List the examples with degrees of freedom, constraints, and what each teaches."""
    from ncgen.exchange.examples import example_names
    from ncgen.report.gallery import gallery

    with progress("looking at the examples", len(example_names())) as advance:
        records = gallery(advance)
    if json_output:
        print(json.dumps(records, indent=1))
        return
    for r in records:
        out.print(
            f"{r['name']:<15}{r['dof']:>3} dof {r['constraints']:>4} constraints ({r['redundant']} redundant)  {r['teaches']}", markup=False
        )


@for_robots
def inspect(
    model: ModelName,
    robot: dict[str, Any],
    along: Annotated[
        Path | None, typer.Option(help="a trajectory.npz: print the diagnostics of that motion [default: of the model alone]")
    ] = None,
    json_output: Json = False,
    backend: Backend = "auto",
    emission: Emission = "auto",
) -> None:
    """Show constraints, loads, degrees of freedom, redundant constraints, omitted terms and kernels; or the diagnostics of a motion."""
    from ncgen.report.along import Recorded, health_record, show_health
    from ncgen.report.derivative import derivative, matrix, motion
    from ncgen.report.inspection import inspect as facts_of
    from ncgen.report.screen import show_inspection

    recorded = None if along is None else Recorded.read(along)
    kernels, _, seconds = _compiled(model, robot, backend, emission, lists_left_out=recorded is None)
    if recorded is not None:
        health = recorded.health(kernels)
        if json_output:
            print(json.dumps(health_record(health), indent=1))
        else:
            show_health(out, health)
        return
    facts = {**facts_of(kernels), "motion": motion(kernels), "matrix": matrix(kernels), "derivative": derivative(kernels)}
    if json_output:
        print(json.dumps(facts, indent=1))
        return
    for number, (term, row) in enumerate(zip(kernels.programs.equations.rows, kernels.rows, strict=True), 1):
        out.print(f"  {number:>4} {row.code or '':<5} {row.label} ({row.owner}): {term.equation}", markup=False)
    for term in kernels.programs.equations.forces:
        if term.equation:
            out.print(f"  {term.label}: {term.equation}", markup=False)
    show_inspection(out, facts, seconds)


@for_robots
def generate(
    model: ModelName,
    robot: dict[str, Any],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for the sources [default: generated/MODEL]", rich_help_panel=RESULTS)
    ] = None,
    emission: Emission = "auto",
) -> None:
    """Write the C and NumPy sources of a model."""
    from ncgen.compiler import generate as sources_of
    from ncgen.exchange.examples import load

    loaded = load(model, **robot)
    folder = output or Path("generated") / loaded.name
    for path in sources_of(loaded, emission).write(folder):
        out.print(str(path), markup=False)


@for_robots
def run(
    model: ModelName,
    robot: dict[str, Any],
    duration: Duration = None,
    param: Parameters = None,
    velocity: Velocities = None,
    stop: Annotated[
        str | None,
        typer.Option(
            help="end where a coordinate passes a value: psi=1.2, psi=1.2,rising or rate(psi)=0 [default: the model's]",
            autocompletion=stops,
            rich_help_panel=MOTION,
        ),
    ] = None,
    formalism: Annotated[
        str | None,
        typer.Option(
            help="formulation of the accelerations: lagrange, coordinate-partitioning … [default: chosen for the mechanism]",
            autocompletion=words_of("ncgen.methods.table", "FORMALISMS"),
            rich_help_panel=METHOD,
        ),
    ] = None,
    integrator: Annotated[
        str | None,
        typer.Option(
            help="integration method: dopri5, dop853, adams, bdf, radau, ode45 … [default: chosen for the mechanism and rtol]",
            autocompletion=words_of("ncgen.methods.table", "INTEGRATORS"),
            rich_help_panel=METHOD,
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="what advances the motion: compiled, c, emitted, refined or python [default: the model's, else auto]",
            autocompletion=words_of("ncgen.solver.runs.settings", "ENGINES"),
            rich_help_panel=METHOD,
        ),
    ] = None,
    number: Annotated[
        str | None,
        typer.Option(
            help="number type: double, float or 'long double' [default: double]",
            autocompletion=words_of("ncgen.solver.runs.run", "NUMBERS"),
            rich_help_panel=METHOD,
        ),
    ] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance [default: 1e-8]", rich_help_panel=METHOD)] = None,
    atol: Annotated[
        float | None, typer.Option(help="absolute tolerance [default: rtol/100, times the size of each coordinate]", rich_help_panel=METHOD)
    ] = None,
    max_step: Annotated[
        float | None,
        typer.Option(
            help="longest step (s); of methods with a fixed step, that step [default: the model's, else no limit]", rich_help_panel=METHOD
        ),
    ] = None,
    points: Annotated[int | None, typer.Option(help="output times in the trajectory [default: 101]", rich_help_panel=MOTION)] = None,
    backend: Backend = "auto",
    emission: Emission = "auto",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for the files [default: MODEL-output]", rich_help_panel=RESULTS)
    ] = None,
    files: Annotated[bool, typer.Option(help="write sources, trajectory, drawing and animation", rich_help_panel=RESULTS)] = True,
    json_output: Json = False,
) -> None:
    """Generate, compile, check, simulate and draw a model."""
    from ncgen.mechanism.runtime_library import compiling_thread
    from ncgen.report.inspection import inspect as facts_of
    from ncgen.report.run_report import run_record, write_outputs
    from ncgen.report.screen import show_inspection, show_run
    from ncgen.report.timing import kernel_times
    from ncgen.solver.engines.acceleration_forms import expected_component
    from ncgen.solver.motions.simulate import simulate_one
    from ncgen.solver.positions.rank import freedom
    from ncgen.solver.runs.simulation_options import check_simulation, simulation_of

    arguments: dict[str, Any] = dict(
        duration=duration, p=assigned("--param", param), zd0=assigned("--velocity", velocity), stop=assigned("--stop", stop, "rising"),
        formalism=formalism, integrator=integrator, engine=engine, number=number, rtol=rtol, atol=atol, max_step=max_step, points=points,
    )  # fmt: skip

    compiling: list[Thread] = []

    def check(loaded: Model) -> None:
        arguments["p"] = with_model_parameters(loaded, arguments["p"])
        checked = check_simulation(loaded, **arguments)
        if backend != "numpy" and engine != "python":
            compiling.append(compiling_thread(component=expected_component(loaded, checked)))
            compiling[0].start()

    kernels, sources, seconds = _compiled(model, robot, backend, emission, check, lists_left_out=not json_output)
    mobility = freedom(kernels)
    if any(thread.is_alive() for thread in compiling):
        with progress("compiling the runtime", None):
            compiling[0].join()  # a compiler that still runs would disturb the times
    if not json_output:
        show_inspection(out, facts_of(kernels, mobility), seconds, kernel_times(kernels))
    options = simulation_of(kernels.model, **arguments)
    with progress(f"simulating {options['duration']} s", options["duration"]) as advance:
        try:
            trajectory = simulate_one(kernels, progress=lambda t: advance(t - options.get("t0", 0.0)), **options)
        except Interrupted as stopped:
            err.print(f"ncgen: {stopped}; partial results were written", markup=False)
            trajectory = stopped.run
    folder = (output or Path(f"{kernels.name}-output")) if files else None
    if folder is not None:
        with progress("writing files", 1.0):
            outputs = write_outputs(sources, trajectory, folder)
    else:
        outputs = []
    record = run_record(trajectory, mobility, folder, outputs)
    if json_output:
        print(json.dumps(record, indent=1))
    else:
        show_run(out, record)


def _compiled(
    name: str,
    robot: dict[str, Any],
    backend: str,
    emission: str,
    check: Callable[[Model], object] | None = None,
    lists_left_out: bool = False,
) -> tuple[Kernels, Sources, dict[str, float]]:
    """Kernels, sources and the seconds of every stage, with the stages shown while they run.

    robot: arguments of `ncgen.load` for a robot; check: of the model, before anything is made of it
    lists_left_out: the command lists what of a file is not modelled, so the warning that counts it is not shown
    """
    from ncgen.compiler import Timings, check_words, compile, sources_of
    from ncgen.exchange.examples import load
    from ncgen.exchange.robots.accounting import NOT_MODELLED

    check_words(backend, emission)
    timings = Timings()
    with progress(f"generating and compiling {name}", None):
        with warnings.catch_warnings():
            if lists_left_out:
                warnings.filterwarnings("ignore", f".* {NOT_MODELLED}, ", UserWarning)
            model = timings.stage("model", lambda: load(name, **robot))
        if check:
            check(model)
        sources = sources_of(model, emission, timings)
        kernels = compile(sources, backend, timings=timings)
    return kernels, sources, timings.seconds
