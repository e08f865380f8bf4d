"""Methods that discretise the constrained equations themselves, by name, and the run that makes a trajectory of their steps."""

from __future__ import annotations

from importlib import import_module
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.solver.finite import watched
from ncgen.solver.formalisms.projection import project
from ncgen.solver.integrators.hermite import Hermite
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.stop import Stop
from ncgen.solver.runs.task import Task
from ncgen.solver.steppers.stepper import Stepper

State: TypeAlias = tuple[float, np.ndarray, np.ndarray, float]
"""Time (s), q (n,), q̇ (n,) and work (J) at the end of a step."""

ON_THE_GRID = 1e-9
"""An instant nearer to the end of a step than this share of it takes the state of the step itself."""


def stepper_of(method: Method) -> type[Stepper]:
    """The class of a method: `EnergyMomentum` in `energy_momentum` for energy-momentum.

    It has the integrator's name, or that of a formalism that goes with no other one.
    """
    name = method.integrator.name if method.formalism.is_ordinary else method.formalism.name
    module = import_module(f"{__name__}.{name.replace('-', '_')}")
    return getattr(module, "".join(part.capitalize() for part in name.split("-")))


def run(path: Path, kernels: Kernels, task: Task) -> None:
    """Fill an empty path over a time grid, to its end or to a `Stop`, with equal steps of max_step, or a little less
    so that they end with the grid, or where the task says so with one step to each of its times.

    Instants within a step are interpolated and projected onto the constraints.
    Raises ConvergenceError with the time where a step cannot be solved, DomainError naming what is not a number there. Whatever
    is raised, by `progress` or by Ctrl-C as well, the path holds what was reached.
    """
    kernels, grid, method = watched(kernels), task.grid, task.method
    h = (grid[-1] - grid[0]) / task.steps
    stepper = stepper_of(method)(kernels, grid[0], task.q, task.velocities, task.p, h, **method.options)
    path.extend(stepper.q[None], stepper.qd[None], [0.0], [0] * 5)
    reached: State = stepper.t, stepper.q, stepper.qd, stepper.work
    try:
        for k in range(task.steps):
            if task.steps_to_rows:
                stepper.start, stepper.taken, stepper.h = grid[k], 0, grid[k + 1] - grid[k]
            reached = _step(path, stepper, reached, grid, task.stop)
            if path.stopped is not None:
                break
            if task.progress:
                task.progress(stepper.t)
    except BaseException:
        path.break_off(grid, *reached)
        raise
    finally:
        path.jacobians += stepper.newton
        path.counts = path.counts + [stepper.taken, stepper.newton, stepper.newton, 0, 0]


def _step(path: Path, stepper: Stepper, before: State, grid: np.ndarray, stop: Stop | None) -> State:
    """One step, and the instants of the grid within it; returns time, q, q̇ and work at its end."""
    stepper.step()
    found = _stop(stepper, before, stop, path) if stop else None
    reached = stepper.t + ON_THE_GRID * stepper.h
    for t in [t for t in grid[len(path.q) :] if (t <= reached if found is None else t < found[0])]:
        q, qd, work = _between(stepper, before, t, path)
        path.extend(q[None], qd[None], [work], [0] * 5)
    if found is not None:
        path.stop(found[0], *found[1])
        return before
    stepper.p = refresh_branches(stepper.kernels, stepper.q, stepper.p)
    return stepper.t, stepper.q, stepper.qd, stepper.work


def _stop(stepper: Stepper, before: State, stop: Stop, path: Path) -> tuple[float, tuple[np.ndarray, np.ndarray, float]] | None:
    """(time, (q, q̇, work)) at which the last step passed the stop, or None."""
    t0, q0, qd0, work = before
    return stop.find(t0, stepper.t, (q0, qd0, work), (stepper.q, stepper.qd, stepper.work), lambda t: _between(stepper, before, t, path))


def _between(stepper: Stepper, before: State, t: float, path: Path) -> tuple[np.ndarray, np.ndarray, float]:
    """The state at an instant of the last step."""
    if abs(t - stepper.t) <= ON_THE_GRID * stepper.h:
        return stepper.q, stepper.qd, stepper.work
    t0, q0, qd0, work0 = before
    positions = Hermite(t0, q0, qd0, stepper.t, stepper.q, stepper.qd)
    found = project(stepper.kernels, positions(t), positions.rate(t), t, stepper.p)
    path.note_projection(found.moved, found.steps)
    return found.q, found.qd, work0 + (t - t0) / (stepper.t - t0) * (stepper.work - work0)
