"""States of a batch whose mechanism has events, in C as far as it carries them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.solver.argument_checks import has_events
from ncgen.solver.motions.states import States
from ncgen.solver.positions.position import TOLERANCE
from ncgen.solver.runs.choice import choose
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import COMPILED
from ncgen.solver.runs.signals import Signal
from ncgen.solver.trajectories.happening import Happening

if TYPE_CHECKING:
    from ncgen.mechanism.batch_runs import LaneOutcome

INTERRUPTED = "interrupted"
"""The status of a state that was on its way, or had not begun, when the batch was ended from outside."""


def not_begun(run: Run, states: States) -> LaneOutcome:
    """What is known of states before they are simulated."""
    from ncgen.mechanism.batch_runs import LaneOutcome

    count, n = states.q.shape
    rows = np.full((count, len(run.times), n), np.nan)
    status, steps, reached = ["not begun"] * count, np.zeros(count, dtype="l"), np.full(count, run.times[0])
    return LaneOutcome(q=rows, qd=rows.copy(), work=rows[:, :, 0].copy(), status=status, steps=steps, reached=reached)


def through_events(
    kernels: Kernels,
    run: Run,
    method: Method,
    states: States,
    threads: int | None,
    progress: Callable[[float], None] | None,
    inputs: Mapping[str, Signal] | None = None,
) -> tuple[LaneOutcome, dict[int, tuple[Happening, ...]]]:
    """What came of states, and the events of those that C carried out; others have not begun."""
    done = not_begun(run, states)
    if not has_events(kernels.model):
        return done, {}
    from ncgen.mechanism.event_runs import MotionRows
    from ncgen.mechanism.kernel_batch import thread_count
    from ncgen.solver.events.many_runs import ManyRuns, refusal_in_c

    single = Run.from_arguments(
        kernels, run.duration, t0=run.initial.t, points=run.times, integrator=method.integrator.name, rtol=run.settings.rtol,
        atol=run.settings.atol, max_step=run.settings.max_step, engine=COMPILED, inputs=inputs,
    )  # fmt: skip
    chosen = choose(single.settings).method
    if refusal_in_c(kernels):
        return done, {}
    q, qd = np.empty(states.q.shape), np.empty(states.q.shape)
    states.choice.lanes.accelerate(
        run.initial.t, states.q, states.zd, states.p, (q, qd, np.empty(states.zd.shape)), threads, tolerance=TOLERANCE
    )
    rows = np.zeros(len(q), dtype=np.intc)
    motions = MotionRows(
        times=single.times,
        q=q,
        qd=qd,
        p=np.array(states.p),
        out_q=done.q,
        out_qd=done.qd,
        out_work=done.work,
        rows=rows,
        steps=done.steps,
        ended=done.reached,
    )
    many = ManyRuns(kernels=kernels, run=single, method=chosen, motions=motions, stop_when_stiff=run.settings.integrator is None)
    raised: BaseException | None = None
    try:
        many.carry_out(thread_count(threads, kernels.name), progress)
    except BaseException as error:
        raised = error
    for i in range(len(q)):
        if i not in many.carried:
            done.q[i], done.qd[i], done.work[i], done.steps[i] = np.nan, np.nan, np.nan, 0
            done.status[i] = INTERRUPTED if raised else done.status[i]
        else:
            done.status[i] = status_of(kernels, int(rows[i]) == len(run.times), many.carried[i], float(done.reached[i]))
    return replace(done, raised=raised), many.carried


def status_of(kernels: Kernels, arrived: bool, events: tuple[Happening, ...], t: float) -> str:
    """Of a motion that has come to its end at t (s)."""
    return "ok" if arrived else f"{kernels.name}: event {events[-1].name} ended the motion at t = {t:.9g} s"
