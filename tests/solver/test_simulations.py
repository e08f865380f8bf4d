"""Many motions together, beside the same motions one by one."""

from __future__ import annotations

import numpy as np
import pytest
from driven_models import pendulum

import ncgen
from ncgen import ConvergenceError, ModelError
from ncgen.solver.motions import simulations


@pytest.fixture(scope="module")
def rod():
    return ncgen.compile(pendulum())


@pytest.mark.parametrize("integrator", ["auto", "rk4"])
@pytest.mark.parametrize("threads", [1, 2])
def test_rows_are_single_simulations_to_the_bit(rod, integrator, threads):
    inputs = np.random.default_rng(1).uniform(-4, 4, (50, 5))
    sims = ncgen.start(rod, 5, integrator=integrator, threads=threads, zd0={"psi": 0.5})
    singles = [ncgen.start(rod, integrator=integrator, zd0={"psi": 0.5}) for _ in range(5)]
    for taus in inputs:
        sims.step(5e-3, tau=taus)
        for sim, tau in zip(singles, taus.tolist(), strict=True):
            sim.step(5e-3, tau=tau)
    for row, sim in enumerate(singles):
        assert np.array_equal(sims.q[row], sim.q) and np.array_equal(sims.qd[row], sim.qd)
        assert (sims.t[row], sims.work[row]) == (sim.t, sim.work)
        assert np.array_equal(sims.qdd[row], sim.qdd)


def test_loops_and_redundant_rows_too():
    kernels = ncgen.compile(ncgen.load("bricard"))
    sims, sim = ncgen.start(kernels, 3), ncgen.start(kernels)
    for _ in range(10):
        sims.step(2e-3)
        sim.step(2e-3)
    assert all(np.array_equal(row, sim.q) for row in sims.q)


def test_chosen_rows_go_back(rod):
    sims = ncgen.start(rod, 4, zd0={"psi": 1.0}, inputs={"tau": [0.0, 1.0, 2.0, 3.0]})
    first = sims.states
    sims.step(0.05)
    kept = sims.states
    sims.step(0.05).reset([1, 3])
    assert sims.t.tolist() == pytest.approx([0.1, 0.0, 0.1, 0.0])
    assert np.array_equal(sims.q[1], first.q[1]) and sims["tau"].tolist() == [0.0, 1.0, 2.0, 3.0]
    sims.reset(sims.t > 0.05, kept)
    assert np.array_equal(sims.q[[0, 2]], kept.q[[0, 2]])
    again = sims.step(0.05).states
    alone = ncgen.start(rod, zd0={"psi": 1.0}, inputs={"tau": 2.0}).step(0.05).step(0.05)
    assert np.array_equal(again.q[2], alone.q) and np.array_equal(again.qd[2], alone.qd)
    assert sims.reset([]).t.tolist() == again.t.tolist()


def test_names_and_written_positions(rod):
    sims = ncgen.start(rod, 3)
    angles = np.array([0.0, 0.4, -1.2])
    sims.q[:, rod.index["psi"]] = angles
    sims.q[:, rod.index["A.x"]], sims.q[:, rod.index["A.y"]] = 0.7 * np.cos(angles), 0.7 * np.sin(angles) + 1e-3
    sims.project_state()
    assert max(np.max(np.abs(rod.phi(q))) for q in sims.q) < 1e-12
    assert sims["psi"].shape == sims["rate(psi)"].shape == (3,)
    with pytest.raises(ModelError, match="driven has no coordinate, rate, input or output 'nobody'"):
        sims["nobody"]


def test_outputs_are_those_of_single_simulations():
    kernels = ncgen.compile(ncgen.load("cartpole"))
    pushes = [0.0, 2.0, -3.0]
    sims = ncgen.start(kernels, 3).step(0.01, F=pushes)
    for row, push in enumerate(pushes):
        sim = ncgen.start(kernels).step(0.01, F=push)
        assert {name: values[row] for name, values in sims.outputs.items()} == sim.outputs


def test_who_is_stuck_stays_and_the_others_move():
    m = pendulum()
    m.force(m.elements["A"], (0, -((1 - m.inputs["tau"].symbol) ** 0.5), 0), label="rooted")
    sims = ncgen.start(ncgen.compile(m), 3)
    with pytest.raises((ncgen.DomainError, ConvergenceError), match="rooted"):
        sims.step(0.01, tau=[0.0, 2.0, 0.5])
    assert sims.stuck.tolist() == [False, True, False]
    assert sims.t.tolist() == [0.01, 0.0, 0.01]
    sims.step(0.01, tau=0.5)
    assert not sims.stuck.any()


def test_so_many_as_there_is_memory_for(rod, monkeypatch):
    """q, q̇, q̈ and the parameters of each are counted."""
    numbers = 3 * rod.n + len(rod.driven_by(None).p0)
    monkeypatch.setattr(simulations, "MOST_NUMBERS", 4 * numbers)
    assert ncgen.start(rod, 4).size == 4
    with pytest.raises(ModelError, match="^variants: 5 simulations of 3 coordinates take more than"):
        ncgen.start(rod, 5)


def test_what_is_refused(rod):
    sims = ncgen.start(rod, 3)
    for act, said in (
        (lambda: ncgen.start(rod, 0), "variants"),
        (lambda: ncgen.start(rod, 10**12), "coordinates take more than 16 GiB; ask for fewer"),
        (lambda: ncgen.start(rod, 2, threads=0), "threads is 0"),
        (lambda: sims.step(-1.0), "h is -1.0; it must be positive"),
        (lambda: sims.step(1e-3, nobody=1.0), "step: the mechanism has no input nobody; it has tau"),
        (lambda: sims.step(1e-3, tau=[1.0, 2.0]), "step: tau has the shape (2,); it must be a number, or 3 of them"),
        (lambda: sims.step(1e-3, tau=[1.0, np.nan, 2.0]), "step: tau is nan for simulation 1; it must be a finite number"),
        (lambda: sims.step(1e-3, tau="much"), "step: tau is 'much'; it must be a number, or 3 of them"),
        (lambda: sims.reset([3]), "rows: driven has simulations 0 to 2; give their numbers, or a mask (3,)"),
        (lambda: sims.reset([True, False]), "rows: driven has simulations 0 to 2"),
    ):
        with pytest.raises(ncgen.NcgenError) as refused:
            act()
        assert said in str(refused.value)
    assert sims.t.tolist() == [0.0, 0.0, 0.0]
