"""The health of a motion in a file, for `ncgen inspect --along`."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.monitor import Health, monitor

ARRAYS = {"t": "K", "q": "Kn", "qd": "Kn", "work": "K", "p": "p"}
"""Numbers of a trajectory and their axes: instants, coordinates, parameters."""

NAMES = {"coordinates": "n", "parameters": "p", "rows": "m", "independent": "z"}
"""Texts likewise."""

UNREADABLE = (ValueError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error, NotImplementedError)
"""What NumPy raises for a file that is no archive, a broken one, or one with objects in it, which are never unpickled."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a file says of a motion: its path, numbers and names by their keys in `Trajectory.to_npz`."""

    path: Path
    arrays: dict[str, np.ndarray]
    names: dict[str, tuple[str, ...]]

    @classmethod
    def read(cls, path: Path) -> Recorded:
        """From a file written by `Trajectory.to_npz`. Raises NcgenError for a file of another kind, and for one that is broken."""
        try:
            with open(path, "rb") as file:
                archive = np.load(file, allow_pickle=False)
                if not isinstance(archive, np.lib.npyio.NpzFile):
                    raise ValueError("a single array")
                found = {name: archive[name] for name in (*ARRAYS, *NAMES) if name in archive.files}
        except OSError as error:
            raise NcgenError(
                f"{path}: it cannot be read: {error.strerror or error}; give a trajectory.npz that `ncgen run` has written"
            ) from error
        except UNREADABLE as error:
            raise _no_trajectory(path, "it is no readable archive of numbers and texts") from error
        if missing := [name for name in (*ARRAYS, *NAMES) if name not in found]:
            raise _no_trajectory(path, f"it has no {missing[0]}")
        _check_sizes(path, found)
        return cls(path, {name: found[name].astype(float) for name in ARRAYS}, {name: tuple(map(str, found[name])) for name in NAMES})

    def health(self, kernels: Kernels) -> Health:
        """The health of the motion. Raises NcgenError where it is one of another model."""
        mine = {"coordinates": kernels.coordinates, "parameters": kernels.parameters, "rows": tuple(row.label for row in kernels.rows)}
        for what, names in mine.items():
            if self.names[what] != names:
                raise NcgenError(f"{self.path}: a trajectory of other {what} than those of {kernels.name}; give the model it was run with")
        a = self.arrays
        return monitor(kernels, a["t"], a["q"], a["qd"], a["work"], a["p"], self.names["independent"])


def health_of_file(kernels: Kernels, path: Path) -> Health:
    """The health of a trajectory written by `Trajectory.to_npz`. Raises NcgenError for a file of another kind or model."""
    return Recorded.read(path).health(kernels)


def _check_sizes(path: Path, found: dict[str, np.ndarray]) -> None:
    """Refuse arrays whose axes contradict each other, and numbers that are none."""
    sizes: dict[str, int] = {}
    for name, axes in (ARRAYS | NAMES).items():
        array = found[name]
        if not isinstance(array, np.ndarray):  # NumPy gives the bytes of what it does not know
            raise _no_trajectory(path, f"{name} is no array")
        if array.ndim != len(axes) or any(sizes.setdefault(axis, size) != size for axis, size in zip(axes, array.shape, strict=True)):
            raise _no_trajectory(path, f"{name} has shape {array.shape}, which does not fit the others")
        if array.dtype.kind not in ("biuf" if name in ARRAYS else "U"):
            raise _no_trajectory(path, f"{name} is made of {array.dtype}")
        if name in ARRAYS and not np.all(np.isfinite(array)):
            raise _no_trajectory(path, f"{name} has a number that is not finite")
    if not sizes["K"]:
        raise _no_trajectory(path, "it has no instant")


def _no_trajectory(path: Path, why: str) -> NcgenError:
    return NcgenError(f"{path}: not a trajectory ({why}); give a trajectory.npz that `ncgen run` has written")


def health_record(health: Health) -> dict:
    """JSON-ready: independent, findings, and the arrays by name."""
    arrays = ("t", "sigma", "quality", "best", "energy", "drift", "violation")
    return {
        "independent": list(health.independent),
        "findings": health.findings(),
        **{name: getattr(health, name).tolist() for name in arrays},
    }


def show_health(console: Console, health: Health) -> None:
    """The extremes and the findings."""
    console.print(
        f"  σ of Φ_q from {health.sigma.min():.2g} to {health.sigma.max():.2g} · quality of the partition "
        f"{', '.join(health.independent) or 'none'} from {health.quality.min():.2g} to {health.quality.max():.2g} · "
        f"energy drift {health.drift.max():.2g} · violation {health.violation.max():.2g}",
        markup=False,
    )
    for line in health.findings():
        console.print(f"  {line}", markup=False)
