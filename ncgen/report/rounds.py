"""A model file checked and run again and again, and what is different from the time before: `ncgen watch`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ncgen.compiler import compile
from ncgen.errors import NcgenError, counted
from ncgen.exchange.checking import checked
from ncgen.report.run_report import run_record
from ncgen.solver.motions.simulate import simulate_one
from ncgen.solver.positions.rank import freedom
from ncgen.solver.runs.simulation_options import simulation_of

MAX_LISTED = 6
"""Numbers that are told in one line, and problems."""

END_TOLERANCE = 1e-9
"""Relative difference up to which two ends are the same: less than a run promises."""


@dataclass(frozen=True)
class Round:
    """What one look at a file came to: its problems, else a record as of `report.running` with `rows`, `redundant` and `bodies`."""

    problems: tuple[str, ...] = ()
    record: dict = field(default_factory=dict)


def check_and_run(path: Path, progress: Callable[[float], None] | None = None) -> Round:
    """Check a model file, and run it if nothing is wrong with it.

    progress: as of `simulate`; what it raises ends the round
    """
    try:
        model, problems = checked(path)
        if model is None or problems:
            return Round(tuple(problems))
        kernels = compile(model)
        mobility = freedom(kernels)
        run = simulate_one(kernels, progress=progress, **simulation_of(model))
        counts = {"constraints": kernels.m, "redundant": len(mobility.redundant), "bodies": len(model.bodies)}
        return Round((), run_record(run, mobility, None, []) | counts)
    except NcgenError as error:
        return Round((str(error),))


def summary_of(now: Round, before: Round | None) -> list[str]:
    """A round in a few lines; before: the last one that ran, if any."""
    if not now.record:
        more = len(now.problems) - MAX_LISTED
        return [*now.problems[:MAX_LISTED], *([f"and {more} more; `ncgen check` lists all"] if more > 0 else [])]
    record, ends = now.record, _ends(now.record)
    counts = [counted(record["dof"], "degree of freedom"), counted(record["constraints"], "constraint"), f"{record['redundant']} redundant"]
    lines = [
        f"{record['name']}: {', '.join(counts)}, {counted(record['bodies'], 'body')}",
        _some([f"{name} {value:.9g}" for name, value in ends.items()]) or "nothing can move",
        f"energy error {record['energy_drift']:.1e}, constraint error {record['constraint_violation']:.1e}, "
        f"{record['duration']:g} s of motion in {record['wall_seconds']:.2g} s by {record['integrator']} on {record['formalism']}",
    ]
    if before and before.record:
        lines.append(f"different: {_some(differences(before.record, record)) or 'nothing'}")
    return lines


def differences(before: dict, now: dict) -> list[str]:
    """What is different between two records, as `psi 1.5 → 1.7`: counts first, then where the motions ended."""
    olds, news = (_counts(record) | {"seconds": record["duration"]} | _ends(record) for record in (before, now))
    names = [("name", before["name"], now["name"])] if before["name"] != now["name"] else []
    pairs = [(name, olds.get(name), news.get(name)) for name in dict.fromkeys([*olds, *news])]
    unlike = [
        (name, a, b)
        for name, a, b in pairs
        if a is None or b is None or not math.isclose(a, b, rel_tol=END_TOLERANCE, abs_tol=END_TOLERANCE)
    ]
    return [f"{name} {_written(old)} → {_written(new)}" for name, old, new in [*names, *unlike]]


def _written(value: float | str | None) -> str:
    return "none" if value is None else value if isinstance(value, str) else f"{value:.6g}"


def _counts(record: dict) -> dict[str, int]:
    return {"degrees of freedom": record["dof"]} | {key: record[key] for key in ("constraints", "redundant", "bodies")}


def _ends(record: dict) -> dict[str, float]:
    """Where a motion ended: independent coordinates, then their velocities."""
    return record["final_position"] | {f"rate({name})": value for name, value in record["final_velocity"].items()}


def _some(texts: list[str]) -> str:
    """The first texts in one line, and how many more there are."""
    more = len(texts) - MAX_LISTED
    return ", ".join(texts[:MAX_LISTED]) + (f" and {more} more" if more > 0 else "")
