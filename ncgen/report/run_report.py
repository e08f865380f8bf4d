"""A run from beginning to end: simulate, write the files, and say what happened as plain data."""

from __future__ import annotations

from pathlib import Path

from ncgen.emit.sources import Sources
from ncgen.files import write_text
from ncgen.solver.positions.rank import Freedom
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.view.curve_pictures import curves_of_motion
from ncgen.view.scene import scene_of
from ncgen.view.sketch import sketch


def run_record(run: Trajectory, mobility: Freedom, folder: Path | None, outputs: list[Path]) -> dict:
    """One JSON-ready record of a run.

    name, dof, time; stopped: whether it ended where it was told to; final, final_velocity: {independent coordinate: value}
    in m, rad and per second; violation, energy_drift: relative; steps, evaluations, wall_seconds of the run;
    preparation_seconds: generating and compiling what the run needed first; backend, engine; outputs: paths relative to folder
    """
    statistics = run.statistics
    return {
        "name": run.name,
        "dof": mobility.dof,
        "duration": float(run.t[-1] - run.t[0]),
        "stopped": run.stopped,
        "final_position": {name: float(run[name][-1]) for name in run.independent},
        "final_velocity": {name: float(run[f"rate({name})"][-1]) for name in run.independent},
        "constraint_violation": float(run.violation().max()),
        "energy_drift": run.energy_drift,
        "steps": statistics.steps,
        "evaluations": statistics.evaluations,
        "newton_steps": statistics.newton_steps,
        "partition_changes": statistics.partition_changes,
        "wall_seconds": statistics.seconds,
        "preparation_seconds": statistics.preparation,
        "backend": run.kernels.backend,
        "engine": run.engine,
        "formalism": run.formalism,
        "integrator": run.integrator,
        "folder": str(folder) if folder else "",
        "outputs": [path.relative_to(folder).as_posix() for path in outputs] if folder else [],
    }


def write_outputs(sources: Sources, run: Trajectory, folder: Path) -> list[Path]:
    """Sources, trajectory, drawing and animation of a run; returns the paths in the order written."""
    paths = sources.write(folder / "sources")
    paths.append(run.to_npz(folder / "trajectory.npz"))
    paths.append(run.to_csv(folder / "trajectory.csv"))
    paths.append(write_text(folder / "drawing.svg", sketch(scene_of(run.model)).file()))
    paths.append(write_text(folder / "motion.svg", curves_of_motion(run).file()))
    paths.append(run.animate(folder / "animation.html"))
    return paths
