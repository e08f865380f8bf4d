"""Runs in C that are listened to: how far they have come is told, and Ctrl-C, a limit of time or `progress` ends them."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import ncgen
from ncgen.mechanism.listening import FIRST, REACTION, Listener
from ncgen.methods.method import Method
from ncgen.report.precision import TimeIsUp, time_limit
from ncgen.solver.engines.compiled import run, run_constrained
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.grid import GOLDEN, N_SAMPLES
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances

METHODS = [
    ("coordinate-partitioning", "dopri5", None),
    ("coordinate-partitioning", "dop853", None),
    ("coordinate-partitioning", "rk4", 1e-5),
    ("coordinate-partitioning", "radau", None),
    ("coordinate-partitioning", "trapezoidal", 1e-5),
    ("lagrange", "dopri5", None),
    ("null-space", "dop853", None),
    ("lagrange", "rattle", 1e-5),
    ("lagrange", "energy-momentum", 1e-5),
    ("lagrange", "generalized-alpha", 1e-5),
    ("ali3p", "trapezoidal", 1e-5),
]
"""All loops of the runtime; the mechanism, two pendulums, would go on for minutes."""

LONG = np.linspace(0.0, 1e5, 100_001)


class Enough(BaseException):
    """What nothing on the way should catch."""


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("doublependulum"), backend="c")


def begin(kernels, formalism, integrator, step, grid, progress):
    """A run in C by the engine itself, and the path that it fills."""
    q, p = kernels.q0, kernels.p0
    partitions = choose_partitions(kernels, q, 0.0, p)
    path = Path.empty(kernels.n, partitions)
    tolerances, alone = Tolerances(1e-8, 1e-10, False, 0.0), formalism == "coordinate-partitioning"
    velocities = np.zeros(len(partitions.velocity.independent) if alone else kernels.n)
    task = Task(
        method=Method.of(formalism, integrator),
        grid=grid,
        q=q,
        velocities=velocities,
        p=p,
        max_step=step or np.inf,
        tolerances=tolerances,
        progress=progress,
    )
    return path, lambda: run(path, kernels, task, "dense") if alone else run_constrained(path, kernels, task)


@pytest.mark.parametrize(("formalism", "integrator", "step"), METHODS)
def test_progress_goes_on_and_may_end_the_run(pendulum, formalism, integrator, step):
    """Times only grow; what was reached is kept: every row of the grid until then, and the last state."""
    told = []

    def progress(t):
        told.append(t)
        if len(told) == 6:
            raise Enough

    grid = LONG / 10
    path, start = begin(pendulum, formalism, integrator, step, grid, progress)
    with pytest.raises(Enough):
        start()
    assert np.all(np.diff(told) > 0) and len(told) == 6
    assert path.stopped >= told[-1] > 0.0
    rows = np.searchsorted(grid, path.stopped)  # grid instants before the end
    assert len(path.q) == len(path.qd) == len(path.work) == rows + 1
    whole = ncgen.simulate(
        pendulum, grid[3], formalism=formalism, integrator=integrator, points=4, engine="c", **({"max_step": step} if step else {})
    )
    assert np.allclose(path.q[: min(rows, 3)], whole.q[: min(rows, 3)], atol=1e-6)


def test_an_end_between_the_rows_of_one_step(pendulum, monkeypatch):
    """What is told among many rows of a step is the last row, which an end leaves, not the end of the step."""
    monkeypatch.setattr("ncgen.mechanism.listening.REACTION", 0.0)  # it is asked at every row
    told = []

    def progress(t):
        told.append(t)
        if t > 0.0:
            raise Enough

    path, start = begin(pendulum, "null-space", "dop853", None, np.linspace(0.0, 1e-3, 5001), progress)
    with pytest.raises(Enough):
        start()
    assert 0.0 < path.stopped == told[-1] < 1e-3


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs interval timers")
@pytest.mark.parametrize(("formalism", "integrator", "step"), METHODS[::2])
@pytest.mark.usefixtures("signals_may_raise")
def test_a_signal_ends_it_at_once(pendulum, formalism, integrator, step):
    """Python's handlers run while C computes: an alarm stands for Ctrl-C."""
    _, warm = begin(pendulum, formalism, integrator, step, np.linspace(0.0, 0.01, 2), None)
    warm()  # whatever is compiled
    rung = []

    def handler(*_):
        rung.append(time.perf_counter())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, handler)
    path, start = begin(pendulum, formalism, integrator, step, LONG, None)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.4)
        due = time.perf_counter() + 0.4
        with pytest.raises(KeyboardInterrupt):
            start()
        answered = time.perf_counter()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert len(rung) == 1
    assert answered - due < 0.25
    assert path.stopped > 0.0 and len(path.q) >= 1


PROGRAM = """
import signal
import numpy as np, ncgen
signal.signal(signal.SIGINT, signal.default_int_handler)
kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
ncgen.simulate(kernels, 0.01)
print("begins", flush=True)
try:
    ncgen.simulate(kernels, 1e7, points=2)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_ctrl_c_in_a_program_of_its_own():
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline() == "begins\n"
        time.sleep(0.3)
        program.send_signal(signal.SIGINT)
        sent = time.perf_counter()
        assert program.stdout.readline() == "interrupted\n"
        assert time.perf_counter() - sent < 0.5
        assert program.wait(timeout=20) == 0


@pytest.mark.parametrize("engine", ["c", "emitted", "python"])
def test_a_limit_ends_a_run_in_any_thread(pendulum, engine):
    """Without an alarm of the system, which only the main thread may set and which raises between any two instructions."""

    def run():
        start = time.perf_counter()
        with pytest.raises(TimeIsUp, match=r"stopped after 0\.3 s"):
            ncgen.simulate(pendulum, 5e3, integrator="rk4", max_step=1e-5, engine=engine, points=2, progress=time_limit(0.3))
        return time.perf_counter() - start

    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(run).result() < 0.3 + 0.5


def test_short_runs_are_not_asked_and_large_mechanisms_at_every_stage():
    """The first call comes after about a millisecond of a small mechanism, later ones twenty times a second."""
    small, large = Listener(None, 10), Listener(None, 2000)
    assert small.attempts == FIRST and large.attempts == 1
    assert small.hear(0.0) == 2 * FIRST  # next to no time has passed: twice as many
    small._clock -= 10 * REACTION  # it took ten times as long as it should
    assert FIRST / 10 < small.hear(0.0) <= FIRST / 5
    large._clock -= 1.0
    assert large.hear(0.0) == 1


@pytest.mark.parametrize("number", ["float", pytest.param("long double", marks=pytest.mark.slow)])
def test_other_number_types_listen_too(number):
    kernels, told = ncgen.compile(ncgen.load("pendulum"), backend="c"), []

    def progress(t):
        told.append(t)
        if len(told) == 3:
            raise Enough

    with pytest.raises(Enough):
        ncgen.simulate(
            kernels, 1e4, integrator="rk4", max_step=1e-2 if number == "float" else 1e-5, number=number, points=101, progress=progress
        )
    assert told[0] < told[1] < told[2]


@pytest.mark.parametrize(("formalism", "integrator"), [
    ("coordinate-partitioning", "dopri5"), ("coordinate-partitioning", "bdf"), ("lagrange", "dopri5"),
])  # fmt: skip
def test_engines_in_python_keep_what_they_reached(pendulum, formalism, integrator, monkeypatch):
    """As those in C do: rows of the grid, and the last state behind them."""
    paths, empty = [], Path.empty.__func__
    monkeypatch.setattr(Path, "empty", classmethod(lambda cls, *given: paths.append(empty(cls, *given)) or paths[-1]))

    def progress(t):
        if t > 0.105:
            raise Enough

    with pytest.raises(Enough):
        ncgen.simulate(
            pendulum, 1.0, formalism=formalism, integrator=integrator, engine="python", points=101, max_step=3e-3, progress=progress
        )
    path = paths[-1]
    grid = np.linspace(0.0, 1.0, 101)
    grid = np.union1d(grid, np.arange(1, N_SAMPLES + 1) * GOLDEN % 1.0)  # where its energy is looked at
    assert 0.105 < path.stopped < 0.12
    assert len(path.q) == np.searchsorted(grid, path.stopped) + 1
    known = ncgen.simulate(pendulum, path.stopped, points=2, rtol=1e-10)
    assert np.allclose(path.q[-1], known.q[-1], atol=1e-5)
