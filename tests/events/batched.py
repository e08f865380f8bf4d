"""What batches with events are compared with: single runs, in all that they say of events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import ncgen
from ncgen.solver.trajectories.happening import Happening


def told(events: Sequence[Happening]) -> list[tuple[object, ...]]:
    return [(each.name, each.transition, each.search, each.limit is None) for each in events]


def numbers(events: Sequence[Happening]) -> np.ndarray:
    rows = [[each.t, each.impulse, each.energy_lost, each.limit or 0.0, *each.q, *each.before, *each.after] for each in events]
    return np.array(rows) if rows else np.zeros((0, 1))


def compare(batch: ncgen.BatchTrajectory, i: int, run: ncgen.Trajectory, close: float) -> None:
    """One state of a batch with its single run."""
    rows = np.isfinite(batch.q[i, :, 0])
    assert told(batch.events[i]) == told(run.events)
    assert numbers(batch.events[i]) == pytest.approx(numbers(run.events), rel=close, abs=close)
    for name in ("q", "qd", "work"):
        assert getattr(batch, name)[i][rows] == pytest.approx(getattr(run, name)[: np.sum(rows)], rel=close, abs=close)


def together(kernels: ncgen.Kernels, seconds: float, values: Sequence[float], **arguments: Any) -> ncgen.BatchTrajectory:
    """A batch over values of the parameter v, every state of which C carries."""
    batch = ncgen.simulate(kernels, seconds, points=7, p={"v": np.array(values)}, rtol=1e-9, **arguments)
    assert not batch.alone.any() and set(batch.status) == {"ok"}, batch.status
    return batch
