"""A motion in a file: read back, and its health for `ncgen inspect --along`."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from ncgen.archives import arrays
from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import FORMALISMS
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.signals import Signals, signals_of
from ncgen.solver.trajectories.grid_motion import Statistics
from ncgen.solver.trajectories.happening import Happening
from ncgen.solver.trajectories.monitor import Health, monitor
from ncgen.solver.trajectories.trajectory import Trajectory

ARRAYS = {"t": "K", "q": "Kn", "qd": "Kn", "work": "K", "p": "p"}
"""Numbers of a trajectory and their axes: instants, coordinates, parameters."""

NAMES = {"coordinates": "n", "parameters": "p", "constraints": "m", "independent": "z"}
"""Texts likewise."""

FORMER = {"rows": "constraints"}
"""{array in files of before: its name today}."""

TEXTS = {"about": "", "model": ""}
"""Single texts that it may have."""

OPTIONAL_ARRAYS = {"qdd": "Kn", "lam": "Km", "inputs": "Ki"}
"""Numbers that it may have."""

ENTRY_TYPES: dict[str, type | tuple[type, ...]] = {
    "formalism": str, "integrator": str, "engine": str, "number": str, "stopped": bool, "made_with": str, "chosen": list, "options": dict,
    "statistics": dict,
}  # fmt: skip
"""What is said of how it was made, and what that is."""

UNKNOWN = Statistics(steps=0, evaluations=0, newton_steps=0, partition_changes=0, repeated_steps=0, seconds=0.0)

FORMER_ENTRIES: dict[str, Any] = {
    "formalism": "lagrange", "integrator": "unknown", "engine": "unknown", "number": "double", "stopped": False, "made_with": "",
    "chosen": [], "options": {}, "statistics": asdict(UNKNOWN),
}  # fmt: skip
"""What stands for that in files of before."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Recorded:
    """What a file says of a motion: its path, numbers and names by their keys in `Trajectory.to_npz`.

    about: how it was made, empty in files of before; model: the text of its model file, "" where there is none
    """

    path: Path
    arrays: dict[str, np.ndarray]
    names: dict[str, tuple[str, ...]]
    about: dict[str, Any] = field(default_factory=dict)
    model: str = ""

    @classmethod
    def read(cls, path: Path) -> Recorded:
        """From a file written by `Trajectory.to_npz`. Raises NcgenError for a file of another kind, and for one that is broken."""
        try:
            contents = arrays(path, (*ARRAYS, *NAMES, *OPTIONAL_ARRAYS, *TEXTS), FORMER)
        except OSError as error:
            raise NcgenError(
                f"{path}: it cannot be read: {error.strerror or error}; give a trajectory.npz that `ncgen run` has written"
            ) from error
        except ValueError as error:
            raise _no_trajectory(path, f"it is no readable archive of numbers and texts: {error}") from error
        if missing := [name for name in (*ARRAYS, *NAMES) if name not in contents]:
            raise _no_trajectory(path, f"it has no {missing[0]}")
        _check_sizes(path, contents)
        numbers = {name: contents[name].astype(float) for name in (*ARRAYS, *OPTIONAL_ARRAYS) if name in contents}
        names = {name: tuple(map(str, contents[name])) for name in NAMES}
        return cls(
            path=path, arrays=numbers, names=names, about=_about(path, str(contents.get("about", ""))), model=str(contents.get("model", ""))
        )

    def trajectory(self, kernels: Kernels) -> Trajectory:
        """The motion as it was when it was written; of files of before, which do not say how it was made, its numbers. Raises NcgenError
        where it is one of another model."""
        self._check_model(kernels)
        a, about = self.arrays, self.about or FORMER_ENTRIES
        moved = kernels.driven_by(self._drive(kernels))
        try:
            partitions = None
            if not FORMALISMS[about["formalism"]].is_constrained:
                partitions = choose_partitions(moved, a["q"][-1], a["t"][-1], a["p"], self.names["independent"])
            counts = {name: type(getattr(UNKNOWN, name))(value) for name, value in about["statistics"].items() if hasattr(UNKNOWN, name)}
            statistics = replace(UNKNOWN, **counts)
            made = {name: about[name] for name in ENTRY_TYPES if name not in ("statistics", "chosen")}
            chosen = tuple(map(str, about["chosen"]))
            made["impulses"] = tuple(Impulse(float(t), str(driver), float(size)) for t, driver, size in about.get("impulses", ()))
            made |= {"events": tuple(map(Happening.of, about.get("events", ()))), "changed": bool(about.get("changed", False))}
            run = Trajectory(
                kernels=moved,
                t=a["t"],
                q=a["q"],
                qd=a["qd"],
                work=a["work"],
                p=a["p"],
                partitions=partitions,
                statistics=statistics,
                chosen=chosen,
                **made,
            )
        except (KeyError, TypeError, ValueError) as error:
            why = " ".join(str(error).split())
            raise _no_trajectory(self.path, f"what it says of how it was made is not what this ncgen knows: {why}") from error
        vars(run).update({name: a[name] for name in ("qdd", "lam") if name in a})
        return run

    def _drive(self, kernels: Kernels) -> Signals | None:
        """Inputs as they were at the instants, with lines between them."""
        a = self.arrays
        if "inputs" not in a or a["inputs"].shape[1] != len(kernels.inputs) or len(a["t"]) < 2:
            return None
        tables = {name: (a["t"], column) for name, column in zip(kernels.inputs, a["inputs"].T, strict=True) if np.ptp(column) > 0}
        return signals_of(kernels, tables, a["p"].copy())

    def health(self, kernels: Kernels) -> Health:
        """The health of the motion. Raises NcgenError where it is one of another model."""
        self._check_model(kernels)
        a = self.arrays
        return monitor(kernels, a["t"], a["q"], a["qd"], a["work"], a["p"], self.names["independent"])

    def _check_model(self, kernels: Kernels) -> None:
        expected = {
            "coordinates": kernels.coordinates,
            "parameters": kernels.parameters,
            "constraints": tuple(r.label for r in kernels.rows),
        }
        for kind, names in expected.items():
            if self.names[kind] != names:
                raise NcgenError(f"{self.path}: a trajectory of other {kind} than those of {kernels.name}; give the model it was run with")


def _check_sizes(path: Path, arrays_of_file: dict[str, np.ndarray]) -> None:
    """Refuse arrays whose axes contradict each other, and NaN."""
    sizes: dict[str, int] = {}
    for name, axes in (ARRAYS | NAMES | OPTIONAL_ARRAYS | TEXTS).items():
        if name not in arrays_of_file:
            continue
        array = arrays_of_file[name]
        if array.ndim != len(axes) or any(sizes.setdefault(axis, size) != size for axis, size in zip(axes, array.shape, strict=True)):
            raise _no_trajectory(path, f"{name} has shape {array.shape}, which does not fit the others")
        if array.dtype.kind not in ("biuf" if name in ARRAYS | OPTIONAL_ARRAYS else "U"):
            raise _no_trajectory(path, f"{name} is made of {array.dtype}")
        if name in ARRAYS | OPTIONAL_ARRAYS and not np.all(np.isfinite(array)):
            raise _no_trajectory(path, f"{name} has a number that is not finite")
    if not sizes["K"]:
        raise _no_trajectory(path, "it has no instant")


def _about(path: Path, text: str) -> dict[str, Any]:
    """What a file says of how it was made. Raises NcgenError unless it is that."""
    if not text:
        return {}
    try:
        about = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _no_trajectory(path, "what it says of how it was made is no JSON") from error
    if not isinstance(about, dict) or any(not isinstance(about.get(key), kind) for key, kind in ENTRY_TYPES.items()):
        raise _no_trajectory(path, "what it says of how it was made is not what this ncgen knows")
    return about


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
