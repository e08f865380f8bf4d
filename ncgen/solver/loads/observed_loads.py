"""Outputs that mention joint loads or driver forces: at one instant, and a word where such a load is not unique."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ncgen.errors import warn
from ncgen.mechanism.kernels import Kernels
from ncgen.model.bodies import load_names
from ncgen.model.elements import driver_name
from ncgen.solver.loads.inverse_dynamics import shared_drivers
from ncgen.solver.loads.reactions import Reactions
from ncgen.solver.loads.sharing import REACH_TOLERANCE
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.trajectories.grid_motion import Statistics
from ncgen.solver.trajectories.output_values import load_slopes, mentioned
from ncgen.solver.trajectories.trajectory import Trajectory


def multipliers_at(kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Multipliers (m,) of a state at t (s). The first time that the kernels are asked, `warn_of_shared` has a word."""
    now = instant(kernels, t, q, qd, p)
    kernels.remember("shared loads", (), lambda: warn_of_shared(now))
    return now.lam[0]


def instant(kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> Trajectory:
    """A trajectory of one instant: a state (n,) with its accelerations, multipliers and loads."""
    partitions, nothing = (
        choose_partitions(kernels, q, t, p),
        Statistics(steps=0, evaluations=0, newton_steps=0, partition_changes=0, repeated_steps=0, seconds=0.0),
    )
    return Trajectory(
        kernels=kernels,
        t=np.array([t]),
        q=q[None].copy(),
        qd=qd[None].copy(),
        work=np.zeros(1),
        p=p.copy(),
        partitions=partitions,
        statistics=nothing,
        formalism="coordinate-partitioning",
        integrator="none",
    )


def warn_of_shared(run: Trajectory) -> None:
    """Warn of every output that another share of loads would change, see `Reactions.shared` and `driver_forces`."""
    reactions, drivers = run.reactions(), set(map(driver_name, shared_drivers(run)))
    changes = dict(zip(run.model.outputs, _changes(reactions), strict=True))
    for label, output in run.model.outputs.items():
        names = mentioned(output)
        if ambiguous := sorted(names & drivers):
            warn(f"{run.name}: output {label}: other constraints do what {ambiguous[0]} does; one of many possible distributions is given")
        elif changes[label]:
            name, words = next(each for each in _shared(reactions) if each[0] in names)
            warn(f"{run.name}: output {label}: {name} is not unique ({words}); one of many possible distributions is given")


def _changes(reactions: Reactions) -> np.ndarray:
    """(outputs,): True where what can be added to the loads changes an output; a sum of shares does not change."""
    run, changing = reactions.run, np.zeros(len(reactions.run.model.outputs), dtype=bool)
    felt = reactions.felt
    for k, added in reactions.changes.items():
        if added.size:
            p = run.kernels.present(float(run.t[k]), run.p)
            derivatives = load_slopes(run.kernels, float(run.t[k]), (run.q[k], run.qd[k], run.qdd[k], run.lam[k], felt[k]), p)
            changing |= np.any(np.abs(derivatives @ added) > REACH_TOLERANCE * (np.abs(derivatives) @ np.abs(added)), axis=1)
    return changing


def _shared(reactions: Reactions) -> Iterator[tuple[str, str]]:
    """(name of a load that is not unique, what shares it)"""
    for body in reactions.run.model.bodies.values():
        words = ", ".join(sentence for sentence in reactions.shared if sentence.startswith(f"{body.name}: "))
        for element in body.elements:
            for name, component in zip(load_names(body, element), element.components, strict=True):
                if not reactions.determinate[body.name][component.name]:
                    yield name, words
