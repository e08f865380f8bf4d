"""Nobody replaces a stepper's state behind its back: assignments, states of others, copies, and two threads at once."""

import copy
import dataclasses
import math
import threading

import numpy as np
import pytest
from driven_models import pendulum

import ncgen
from ncgen import ModelError


@pytest.fixture
def sim():
    return ncgen.start(ncgen.compile(pendulum(), "c"))


@pytest.mark.parametrize("name", ["q", "qd", "p", "t", "work", "qdd"])
def test_assignments_say_what_to_write(sim, name):
    with pytest.raises(ModelError, match=rf"sim\.{name} cannot be replaced.*; write "):
        setattr(sim, name, getattr(sim, name))


def test_writing_into_q_moves_the_simulation(sim):
    other = ncgen.start(sim.kernels).step(0.1)
    sim.q[:], sim.qd[:] = other.q, other.qd
    sim.project_state()
    assert np.allclose(sim.step(0.1).q, other.step(0.1).q, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        {"q": np.zeros(1)}, {"qd": np.full(3, math.nan)}, {"p": None}, {"q": "q"}, {"next_step": math.nan}, {"next_step": -1.0},
        {"t": math.inf}, {"work": "1"}, {"mechanism": "another"},
        {"q": lambda q: q + 1e-20j}, {"qd": lambda q: np.ma.masked_array(q, True)}, {"p": lambda p: p + math.nan},
    ],
)  # fmt: skip
def test_reset_changes_nothing_where_it_refuses(sim, change):
    kept = sim.step(0.01).state
    changes = {name: value(getattr(kept, name)) if callable(value) else value for name, value in change.items()}
    moved = sim.step(0.01).state
    with pytest.raises(ModelError, match="reset: "):
        sim.reset(dataclasses.replace(kept, **changes))
    for field in dataclasses.fields(moved):
        assert np.array_equal(getattr(sim.state, field.name), getattr(moved, field.name))


def test_a_state_of_another_mechanism(sim):
    """With as many coordinates and parameters."""
    other = pendulum()
    other.gravity((0, -3.71, 0))
    with pytest.raises(ModelError, match="another mechanism"):
        sim.reset(ncgen.start(ncgen.compile(other, "c")).state)


@pytest.mark.parametrize("name", ["h", "self", "inputs"])
def test_inputs_may_be_called_as_arguments_are(name):
    """An input is given by its own name, whatever that is."""
    m = ncgen.Model("swing")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.force(B, (0.0, m.input(name, default=0.0)))
    kernels = ncgen.compile(m, "c")
    pushed = ncgen.start(kernels).step(0.1, **{name: 1.0})
    assert np.isclose(pushed["rate(B.y)"], 0.1, rtol=1e-2)
    assert np.isclose(ncgen.start(kernels).drive(**{name: 1.0}).step(0.1)["rate(B.y)"], pushed["rate(B.y)"], rtol=0, atol=1e-12)
    assert np.allclose(ncgen.start(kernels, 2).step(0.1, **{name: 1.0}).qd[:, 1], pushed.qd[1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy])
def test_copies_are_refused(sim, act):
    with pytest.raises(ModelError, match="a simulation is not copied"):
        act(sim)


def test_a_second_thread_is_refused(sim):
    """While one thread is within a step, which a lock that is held stands for, another one cannot begin one."""
    seen: list[BaseException] = []

    def step() -> None:
        try:
            sim.step(0.01)
        except ModelError as error:
            seen.append(error)

    before = sim.t
    with sim._alone:
        thread = threading.Thread(target=step)
        thread.start()
        thread.join()
    assert len(seen) == 1
    assert "another thread" in str(seen[0])
    assert sim.t == before
    assert sim.step(0.01).t > before


@pytest.mark.parametrize("name", ["q", "qd", "p", "t", "work"])
def test_arrays_of_many_stay(sim, name):
    sims = ncgen.start(sim.kernels, 3)
    with pytest.raises(ModelError, match=rf"write sims\.{name}\[:\] = array"):
        setattr(sims, name, getattr(sims, name))
    with pytest.raises(ModelError, match="simulations are not copied"):
        copy.copy(sims)


@pytest.mark.parametrize("change", [{"q": np.zeros((2, 1))}, {"qd": None}, {"next_step": -np.ones(3)}, {"p": np.full((3, 1), math.nan)},
                                    {"t": np.zeros(3) + 1j}, {"mechanism": "another"}])  # fmt: skip
def test_reset_of_many_changes_nothing_where_it_refuses(sim, change):
    sims = ncgen.start(sim.kernels, 3)
    kept, moved = sims.states, sims.step(0.01).states
    with pytest.raises(ModelError, match="reset: "):
        sims.reset(states=dataclasses.replace(kept, **change))
    for field in dataclasses.fields(moved):
        assert np.array_equal(getattr(sims.states, field.name), getattr(moved, field.name))
