"""The health of a motion in a file, for `ncgen inspect --along`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ncgen.build.kernels import Kernels
from ncgen.errors import NcgenError
from ncgen.solver.monitor import Health, monitor


def health_of_file(kernels: Kernels, path: Path) -> Health:
    """The health of a trajectory written by `Trajectory.to_npz`. Raises NcgenError for a file of another kind or model."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            run = {name: archive[name] for name in ("t", "q", "qd", "work", "p", "coordinates", "independent")}
    except (OSError, ValueError, KeyError) as error:
        raise NcgenError(f"{path}: not a trajectory ({error}); give a trajectory.npz that `ncgen run` has written") from error
    if tuple(run["coordinates"]) != kernels.coordinates:
        raise NcgenError(f"{path}: a trajectory of other coordinates than those of {kernels.name}; give the model it was run with")
    names = tuple(map(str, run["independent"]))
    return monitor(kernels, run["t"], run["q"], run["qd"], run["work"], run["p"], names)


def health_record(health: Health) -> dict:
    """JSON-ready: independent, findings, and the arrays by name."""
    arrays = ("t", "sigma", "quality", "best", "energy", "drift", "violation")
    return {
        "independent": list(health.independent),
        "findings": health.findings(),
        **{name: getattr(health, name).tolist() for name in arrays},
    }


def show_health(console, health: Health) -> None:
    """The extremes and the findings."""
    console.print(
        f"  σ of Φ_q from {health.sigma.min():.2g} to {health.sigma.max():.2g} · quality of the partition "
        f"{', '.join(health.independent) or 'none'} from {health.quality.min():.2g} to {health.quality.max():.2g} · "
        f"energy drift {health.drift.max():.2g} · violation {health.violation.max():.2g}",
        markup=False,
    )
    for line in health.findings():
        console.print(f"  {line}", markup=False)
