"""The commands that look at a model and run it: list, inspect, generate, run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ncgen.cli.terminal import Backend, Emission, Floating, Json, ModelName, err, out, progress
from ncgen.errors import Interrupted, ModelError

if TYPE_CHECKING:
    from ncgen.emit.sources import Sources
    from ncgen.mechanism.kernels import Kernels
    from ncgen.model import Model


def list_examples(json_output: Json = False) -> None:
    """List the examples with degrees of freedom, rows, and what each teaches."""
    from ncgen.exchange.examples import example_names
    from ncgen.report.gallery import gallery

    with progress("looking at the examples", len(example_names())) as advance:
        records = gallery(advance)
    if json_output:
        print(json.dumps(records, indent=1))
        return
    for r in records:
        out.print(f"{r['name']:<15}{r['dof']:>3} dof {r['rows']:>4} rows ({r['redundant']} redundant)  {r['teaches']}", markup=False)


def inspect(
    model: ModelName,
    along: Annotated[Path | None, typer.Option(help="a trajectory.npz: show how healthy that motion is")] = None,
    json_output: Json = False,
    floating: Floating = None,
    backend: Backend = "auto",
    emission: Emission = "auto",
) -> None:
    """Show rows, loads, degrees of freedom, redundant rows, what was left out, and the kernels; or the health of a motion."""
    from ncgen.report.along import Recorded, health_record, show_health
    from ncgen.report.derivative import derivative, motion
    from ncgen.report.inspection import inspect as facts_of
    from ncgen.report.screen import show_inspection

    recorded = None if along is None else Recorded.read(along)
    kernels, _, seconds = _compiled(model, floating, backend, emission)
    if recorded is not None:
        health = recorded.health(kernels)
        if json_output:
            print(json.dumps(health_record(health), indent=1))
        else:
            show_health(out, health)
        return
    facts = {**facts_of(kernels), "motion": motion(kernels), "derivative": derivative(kernels)}
    if json_output:
        print(json.dumps(facts, indent=1))
        return
    for number, (term, row) in enumerate(zip(kernels.programs.equations.rows, kernels.rows, strict=True), 1):
        out.print(f"  {number:>4} {row.code or '':<5} {row.label} ({row.owner}): {term.equation}", markup=False)
    for term in kernels.programs.equations.forces:
        if term.equation:
            out.print(f"  {term.label}: {term.equation}", markup=False)
    show_inspection(out, facts, seconds)


def generate(
    model: ModelName,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="folder for the sources [default: generated/MODEL]")] = None,
    floating: Floating = None,
    emission: Emission = "auto",
) -> None:
    """Write the C and NumPy sources of a model."""
    from ncgen.compiler import generate as sources_of
    from ncgen.exchange.examples import load

    loaded = load(model, floating=floating)
    folder = output or Path("generated") / loaded.name
    for path in sources_of(loaded, emission).write(folder):
        out.print(str(path), markup=False)


def run(
    model: ModelName,
    duration: Annotated[float | None, typer.Option(help="seconds [default: the model's]")] = None,
    integrator: Annotated[str | None, typer.Option(help="dopri5, dop853, adams, bdf, radau, ode45 …")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance [default: 1e-8]")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance [default: 1e-10]")] = None,
    points: Annotated[int | None, typer.Option(help="instants in the trajectory [default: 101]")] = None,
    velocity: Annotated[list[str] | None, typer.Option(help="initial velocity, as psi1=2.5; may be repeated")] = None,
    floating: Floating = None,
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
    kernels, sources, seconds = _compiled(model, floating, backend, emission, lambda loaded: check_simulation(loaded, **given))
    found = freedom(kernels)
    if not json_output:
        show_inspection(out, facts_of(kernels, found), seconds, kernel_times(kernels))
    options = simulation_of(kernels.model, **given)
    with progress(f"simulating {options['duration']} s", options["duration"]) as advance:
        try:
            trajectory = simulate(kernels, progress=lambda t: advance(t - options.get("t0", 0.0)), **options)
        except Interrupted as stopped:
            err.print(f"ncgen: {stopped}; what was reached is written", markup=False)
            trajectory = stopped.run
    folder = (output or Path(f"{kernels.name}-output")) if files else None
    if folder is not None:
        with progress("writing files", 1.0):
            outputs = write_outputs(sources, trajectory, folder)
    else:
        outputs = []
    record = run_record(trajectory, found, folder, outputs)
    if json_output:
        print(json.dumps(record, indent=1))
    else:
        show_run(out, record)


def _compiled(
    name: str, floating: bool | None, backend: str, emission: str, check: Callable[[Model], object] | None = None
) -> tuple[Kernels, Sources, dict[str, float]]:
    """Kernels, sources and the seconds of every stage, with the stages shown while they run.

    check: of the model, before anything is made of it
    """
    from ncgen.compiler import Timings, check_words, compile, sources_of
    from ncgen.exchange.examples import load

    check_words(backend, emission)
    timings = Timings()
    with progress(f"generating and compiling {name}", None):
        model = timings.stage("model", lambda: load(name, floating=floating))
        if check:
            check(model)
        sources = sources_of(model, emission, timings)
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
