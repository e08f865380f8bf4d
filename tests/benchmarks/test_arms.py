"""`bench.py arm --arms`: every program that is there finds the same accelerations."""

import pytest

import ncgen
from benchmarks import arms, sections
from benchmarks.rivals import articulated
from ncgen.comparisons import derivative_parts
from ncgen.exchange.examples import example_module
from ncgen.report import clock
from ncgen.solver.engines.partition_dynamics import split_of
from ncgen.solver.positions.partition import choose_partitions


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the times are not looked at."""
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))
    monkeypatch.setattr(arms, "STATES", 20)


def test_the_articulated_body_algorithm_of_another_generator():
    """It gives the accelerations of an arm to rounding; a mechanism with loops has none."""
    pytest.importorskip("casadi", reason="casadi is not installed")
    kernels = ncgen.compile(example_module("arm").build(3), "c")
    records = {r["tool"]: r for r in derivative_parts.derivative_records(kernels, 1e9, sections.by_articulated_bodies)}
    assert records[sections.ARTICULATED]["error"] < 1e-12 and records[sections.ARTICULATED]["operations"] > 300
    robot = ncgen.compile(ncgen.load("robot"), "c")
    assert articulated.rival(robot, split_of(choose_partitions(robot, ncgen.assemble(robot)).velocity)) is None


def test_arms_beside_what_is_installed(monkeypatch):
    """ncgen and every program that is there find the same accelerations; Pinocchio's headers take minutes and are left out."""
    monkeypatch.setattr(arms, "_ready", lambda count, seed: 1.0)
    monkeypatch.setattr(arms.pinocchio, "in_cpp", lambda *given: None)
    monkeypatch.setattr(arms, "ROUNDS", 3)
    example, random = arms.arm_records([2], seed=3)
    assert "random arm (seed 3) of 2 joints" in arms.title(random[0]) and "random arm" not in arms.title(example[0])
    for records in (example, random):
        assert {r["tool"] for r in records} >= {arms.FIRST, "ncgen: a stage of a default run", "ncgen: a run of rk4, 1 ms"}
        assert all(r["error"] < (1e-6 if " a run of " in r["tool"] else 1e-12) and r["seconds"] > 0 for r in records)
        assert [row[0] for row in arms.rows(records)] == ["", *(r["tool"] for r in records)]


def test_a_random_arm_is_the_same_again_and_falls_freely():
    """The same seed gives the same arm, and nothing takes its energy."""
    first, again, other = (ncgen.generate(arms.random_arm(4, seed)) for seed in (4, 4, 5))
    assert first.c == again.c and first.c != other.c
    model = arms.random_arm(4, 4)
    assert len(model.bodies) == 4 and model.chosen_independent == ("psi1", "psi2", "psi3", "psi4")
    assert ncgen.simulate(ncgen.compile(model), 0.5, points=11).energy_drift < 1e-8
