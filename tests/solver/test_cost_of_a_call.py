"""A call of `simulate` finds again what does not depend on its numbers: how many functions it calls, and that nothing else is kept."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from copy import copy

import numpy as np
import pytest
from benchmarks.calls import calls_of

import ncgen
from ncgen.mechanism.run_arguments import InitialState
from ncgen.mechanism.run_space import RunSpace
from ncgen.methods.table import FORMALISMS, number_in_c
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.motions.prepared_motion import PreparedMotion
from ncgen.solver.motions.run_under_way import RunUnderWay

DURATION = 0.01

MOST_FUNCTIONS = 115
"""Calls of functions of Python and C in a call like those before; there were 622 when everything was found anew, 286 when the run was
put together from its parts, and 119 when every part of it was wrapped in functions made for the call."""


@pytest.fixture(scope="module")
def fourbar():
    return ncgen.compile(ncgen.load("fourbar"), backend="c")


@pytest.fixture
def pendulum():
    """With a parameter."""
    m = ncgen.Model("pendulum")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    m.body("rod", [O, A], mass=m.parameter("mass", 1.0), inertia="rod")
    m.gravity((0, -9.81))
    return ncgen.compile(m, backend="c")


def functions_of(call):
    """How many functions of Python and C a call calls, without those of the first calls."""
    call()
    return calls_of(call)


@pytest.mark.parametrize(
    "given", [{}, {"points": 2}, {"rtol": 1e-6, "t0": 1.0}, {"q0": "own"}, {"options": {"stabilisation": "projection"}}], ids=str
)
def test_a_call_like_those_before(fourbar, given):
    checks = {"q0": 100, "options": 40}.get(next(iter(given), ""), 0)  # of what no cache can compare
    given = given | ({"q0": fourbar.q0.copy()} if "q0" in given else {})
    assert functions_of(lambda: ncgen.simulate(fourbar, DURATION, **given)) < MOST_FUNCTIONS + checks


def test_a_call_has_the_bits_of_the_first(fourbar):
    runs = [ncgen.simulate(fourbar, 0.3, points=7) for _ in range(3)]
    between = ncgen.simulate(fourbar, 0.4, points=5, rtol=1e-5, integrator="dopri5")
    runs.append(ncgen.simulate(fourbar, 0.3, points=7))
    fresh = ncgen.simulate(ncgen.compile(fourbar.model, backend="c"), 0.3, points=7)
    assert between.integrator == "dopri5"
    for run in runs:
        for name in ("t", "q", "qd", "work"):
            np.testing.assert_array_equal(getattr(run, name), getattr(fresh, name))
        assert run.statistics.steps == fresh.statistics.steps and run.made_with == fresh.made_with


METHODS = [
    {}, {"integrator": "radau"}, {"integrator": "generalized-alpha", "max_step": 0.01}, {"integrator": "rattle", "max_step": 0.01},
    {"formalism": "coordinate-partitioning"}, {"number": "float"}, {"options": {"stabilisation": "baumgarte"}}, {"stop": {}},
]  # fmt: skip


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_other_velocities_have_the_bits_of_a_first_call(fourbar, method):
    """After a run at rest, and in turns, so that all that such calls have in common comes from another one."""
    asked = {"points": np.linspace(0.0, 0.2, 5)} | method | ({"stop": {fourbar.coordinates[0]: 10.0}} if "stop" in method else {})
    z = ncgen.simulate(fourbar, 0.2, **asked).independent[0]
    rates = [{"zd0": {z: 0.3}}, {"qd0": np.zeros(fourbar.n)}, {"zd0": [-2.0]}, {"zd0": {z: 0.3}}]
    fresh = ncgen.compile(fourbar.model, backend="c")
    for velocities in rates:
        run, first = (ncgen.simulate(kernels, 0.2, **asked, **velocities) for kernels in (fourbar, fresh))
        fresh = ncgen.compile(fourbar.model, backend="c")
        for name in ("t", "q", "qd", "work"):
            np.testing.assert_array_equal(getattr(run, name), getattr(first, name))
        assert run.statistics.steps == first.statistics.steps and run.made_with == first.made_with


def test_what_a_run_leaves_in_its_workspace_is_nothing_to_the_next(fourbar, monkeypatch):
    expected = ncgen.simulate(fourbar, 0.3, points=7, integrator="radau")
    give_back = RunSpace.clear

    def spoiled(self):
        size = self._ffi.sizeof(self._numbers)
        self._ffi.buffer(self._numbers, size)[:] = np.full(size // 8, np.nan).tobytes()
        return give_back(self)

    monkeypatch.setattr(RunSpace, "clear", spoiled)
    for _ in range(2):
        again = ncgen.simulate(fourbar, 0.3, points=7, integrator="radau")
        np.testing.assert_array_equal(again.q, expected.q)


def test_a_trajectory_is_its_owner_s(pendulum):
    """What a user writes into one changes no later run."""
    first = ncgen.simulate(pendulum, DURATION, points=4)
    kept = [np.array(a) for a in (first.t, first.q, first.qd, first.p)]
    for array in (first.t, first.q, first.qd, first.work, first.p):
        array[:] = 7.0
    first.options["stabilisation"] = "none"
    second = ncgen.simulate(pendulum, DURATION, points=4)
    for array, expected in zip((second.t, second.q, second.qd, second.p), kept, strict=True):
        np.testing.assert_array_equal(array, expected)
    assert second.options["stabilisation"] == "projection"


def test_two_trajectories_share_nothing(pendulum):
    first, second = (ncgen.simulate(pendulum, DURATION, points=4) for _ in range(2))
    for name in ("t", "q", "qd", "work", "p"):
        assert not np.shares_memory(getattr(first, name), getattr(second, name))
    assert first.options is not second.options and first.statistics is not second.statistics


def test_what_changes_after_a_call_is_seen(pendulum):
    """An event that is added to the model, whose equations stay, and other kernels on the same library."""
    copied = copy(pendulum)
    assert ncgen.simulate(pendulum, 1.0, points=3).kernels is pendulum
    assert ncgen.simulate(copied, 1.0, points=3).kernels is copied
    p = np.array([1.0])
    masses = []
    for _ in range(2):
        masses.append(float(ncgen.simulate(pendulum, DURATION, points=3, p=p).p[0]))
        p[0] = 2.0
    assert masses == [1.0, 2.0]


def test_a_model_that_gets_an_event_after_a_call():
    m = ncgen.Model("pendulum")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    m.body("rod", [O, A], mass=1.0, inertia="rod")
    m.gravity((0, -9.81))
    kernels = ncgen.compile(m, backend="c")
    assert not ncgen.simulate(kernels, 0.5, points=3).events
    m.event("below", A.y + 0.5)
    (event,) = ncgen.simulate(kernels, 0.5, points=3).events
    assert event.name == "below"


def test_what_a_callback_raises_leaves_nothing_to_the_next_call():
    m = ncgen.Model("ball")
    m.body("ball", [m.point("A", (0, 1), fixed="x")], mass=1.0, inertia="point")
    fails = []

    def force(t, q, qd, kernels):
        if fails:
            raise LookupError("no force")
        return np.array([-9.0])

    m.callback(force)
    kernels = ncgen.compile(m, backend="c")
    first = ncgen.simulate(kernels, 0.5, points=3)
    fails.append(None)
    for _ in range(2):
        with pytest.raises(LookupError, match="no force"):
            ncgen.simulate(kernels, 0.5, points=3)
    fails.clear()
    np.testing.assert_array_equal(ncgen.simulate(kernels, 0.5, points=3).q, first.q)


@pytest.mark.parametrize("name", ["fourbar", "jansen", "disc"])
def test_the_inspection_in_c_is_that_of_the_kernels(name):
    """No drivers, drivers, and rolling: energies and remainders of velocities at the rows that are inspected."""
    kernels = ncgen.compile(ncgen.load(name), backend="c")
    motion = PreparedMotion.of_arguments(kernels, 0.05)
    under_way = RunUnderWay(motion, None)
    under_way.advance()
    rows, p = motion.rows.looked_at, kernels.p0
    t, path, found = under_way.times, under_way.path, under_way.path.inspection
    energies = np.array([kernels.energy(path.q[k], path.qd[k], t[k], p) for k in rows])
    total = energies[:, 0] + energies[:, 1] - path.work[rows]
    np.testing.assert_allclose([found.energy, found.kinetic], [total[0], energies[:, 0].max()], rtol=1e-12)
    assert found.change == pytest.approx(np.abs(total - total[0]).max(), abs=1e-13 * np.abs(energies).max())
    rests = np.abs([kernels.jacobian(path.q[k], t[k]) @ path.qd[k] - kernels.nu(path.q[k], t[k]) for k in rows]) / kernels.row_sizes
    assert found.remainder == (0.0 if name == "fourbar" else pytest.approx(rests.max(), abs=1e-13))
    assert (found.remainder > 0) == (name != "fourbar")


def test_velocities_that_contradict_a_driver_are_seen_in_c():
    """Velocities that are wrong by 1e-3 of what the driver demands."""
    kernels = ncgen.compile(ncgen.load("jansen"), backend="c")
    motion = PreparedMotion.of_arguments(kernels, 0.05, points=2)
    task = motion.plan(motion.choice).task
    form = motion.plan(motion.choice).form
    call = all_coordinates(kernels, "double", form, "dop853").run_by("dop853", formalism=number_in_c(FORMALISMS["lagrange"]), project=0)
    wrong = InitialState(task.q, 1.001 * task.velocities, task.p)
    done = call.call(task.grid, wrong, inspected=np.array([0])).simulate(None)
    nu = kernels.nu(task.q, 0.0)
    assert done.inspection.remainder == pytest.approx(1e-3 * np.abs(nu / kernels.row_sizes).max(), rel=1e-6)


def test_arguments_that_are_equal_and_not_the_same_are_refused_all_the_same(pendulum):
    ncgen.simulate(pendulum, 1.0, points=2, max_step=1, rtol=0.5)
    with pytest.raises(ncgen.ModelError, match="max_step: True given"):
        ncgen.simulate(pendulum, 1.0, points=2, max_step=True, rtol=0.5)
    ncgen.simulate(pendulum, 1.0, points=2, integrator="rk4", max_step=0.01)
    for _ in range(2):
        with pytest.raises(ncgen.ModelError, match="max_step: rk4 has a fixed step"):
            ncgen.simulate(pendulum, 1.0, points=2, integrator="rk4")
        with pytest.raises(ncgen.ModelError, match="points: True given"):
            ncgen.simulate(pendulum, 1.0, points=True)
        with pytest.raises(ncgen.ModelError, match="option alpha"):
            ncgen.simulate(pendulum, 1.0, formalism="lagrange", options={"alpha": 1.0})


def test_velocities_of_one_call_are_not_those_of_the_next(pendulum):
    """Given by name, as an array, empty, and none, in turns."""
    for _ in range(2):
        first = [ncgen.simulate(pendulum, DURATION, **given).qd[0] for given in (
            {}, {"zd0": {}}, {"zd0": {"A.y": 2.0}}, {"zd0": [2.0]}, {"qd0": {"A.y": 3.0}}, {"qd0": np.array([0.0, 4.0])}, {"qd0": {}},
        )]  # fmt: skip
        np.testing.assert_allclose(first, [[0, 0], [0, 0], [0, 2], [0, 2], [0, 3], [0, 4], [0, 0]], atol=1e-15)
    with pytest.raises(ncgen.ModelError, match="zd0 and qd0 are both given"):
        ncgen.simulate(pendulum, DURATION, zd0=[1.0], qd0={"A.y": 1.0})


def test_an_open_start_is_reported_at_every_call(fourbar):
    q0 = fourbar.q0 + 0.001
    for _ in range(3):
        with pytest.warns(UserWarning, match="the initial position was open"):
            ncgen.simulate(fourbar, DURATION, q0=q0)


def test_threads_have_numbers_of_their_own(pendulum):
    """Runs of the same kernels at the same time, with different parameters, lengths and methods."""
    jobs = [
        {"p": [1.0 + 0.1 * i], "qd0": {"A.y": 0.1 * i}, "points": 3 + i % 4, "integrator": ("dop853", "dopri5", "radau")[i % 3]}
        for i in range(60)
    ]
    alone = [ncgen.simulate(pendulum, 0.2, **job) for job in jobs]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda job: ncgen.simulate(pendulum, 0.2, **job), jobs))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.work, other.work)


def test_a_run_inside_a_run():
    """A force of Python that simulates the same kernels: the run inside has a workspace of its own."""
    m = ncgen.Model("ball")
    m.body("ball", [m.point("A", (0, 1), fixed="x")], mass=1.0, inertia="point")
    inside = []

    def force(t, q, qd, kernels):
        if not inside:
            inside.append(None)
            inside[0] = ncgen.simulate(kernels, 0.5, points=3)
        return np.array([-9.0])

    m.callback(force)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = ncgen.simulate(ncgen.compile(m, backend="c"), 0.5, points=3)
    np.testing.assert_allclose(run.q[:, 0], 1 - 4.5 * run.t**2, atol=1e-9)
    np.testing.assert_allclose(inside[0].q[:, 0], 1 - 4.5 * run.t**2, atol=1e-9)
