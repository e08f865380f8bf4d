"""Outputs that mention joint loads or driver forces: at one instant, and a word where such a load is not unique."""

from __future__ import annotations

import warnings

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.model.bodies import load_names
from ncgen.model.elements import driver_name
from ncgen.solver.inverse_dynamics import shared_drivers
from ncgen.solver.outputs import mentioned
from ncgen.solver.partition import choose_partitions
from ncgen.solver.trajectory import Statistics, Trajectory


def multipliers_at(kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Multipliers (m,) of a state at t (s). The first time that the kernels are asked, `warn_of_shared` has a word."""
    now = instant(kernels, t, q, qd, p)
    kernels.remember("shared loads", (), lambda: warn_of_shared(now))
    return now.lam[0]


def instant(kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> Trajectory:
    """A trajectory of one instant: a state (n,) with its accelerations, multipliers and loads."""
    partitions, nothing = choose_partitions(kernels, q, t, p), Statistics(0, 0, 0, 0, 0, 0.0)
    state = np.array([t]), q[None].copy(), qd[None].copy(), np.zeros(1)
    return Trajectory(kernels, *state, p.copy(), partitions, nothing, "coordinate-partitioning", "none")


def warn_of_shared(run: Trajectory) -> None:
    """Warn of every output with a load whose share is arbitrary, see `Reactions.determinate` and `driver_forces`."""
    arbitrary = _arbitrary(run)
    for output in run.model.outputs.values():
        if found := sorted(mentioned(output) & arbitrary.keys()):
            warnings.warn(
                f"{run.name}: output {output.label}: {found[0]} is not unique ({arbitrary[found[0]]}); one of many shares is given",
                stacklevel=3,
            )


def _arbitrary(run: Trajectory) -> dict[str, str]:
    """{name of a load that is not unique: what shares it}"""
    reactions, found = run.reactions(), {}
    for body in run.model.bodies.values():
        words = ", ".join(sentence for sentence in reactions.shared if sentence.startswith(f"{body.name}: "))
        for element in body.elements:
            names = zip(load_names(body, element), element.components, strict=True)
            found |= {name: words for name, c in names if not reactions.determinate[body.name][c.name]}
    return found | {driver_name(name): "other rows do what the driver does" for name in shared_drivers(run)}
