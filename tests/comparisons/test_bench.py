"""`ncgen bench`: every time has its error beside it, and the records are what scripts may rely on."""

import json
import math

import pytest

import ncgen
from ncgen.comparisons import arms, batches, falls, paper_tables, precision, rates
from ncgen.comparisons.bench import _simulation_rows, aligned, bench, kernel_records
from ncgen.comparisons.rivals import articulated, handwritten
from ncgen.exchange.examples import example_module
from ncgen.report import clock
from ncgen.solver.engines.compiled import split_of
from ncgen.solver.positions.partition import choose_partitions


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the numbers are not looked at."""
    monkeypatch.setattr(clock, "SHORTEST", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))
    monkeypatch.setattr(falls, "TOLERANCES", (1e-6,))
    monkeypatch.setattr(falls, "STEPS", (100,))
    monkeypatch.setattr(falls, "REPEATS", 1)
    monkeypatch.setattr(batches, "STATES", 20)
    monkeypatch.setattr(batches, "RUNS", 9)
    monkeypatch.setattr(batches, "ROUNDS", 1)


def test_kernels_of_the_robot(robot_model):
    """All tools compute the same; lambdify prints 15 digits."""
    records = kernel_records(robot_model, 1e9)
    tools = {r["tool"] for r in records}
    assert {"generated C, auto", "hand-written C", "hand-written NumPy, vectorised", "generated NumPy"} <= tools
    assert {r["case"] for r in records} == {"phi", "phi_q", "gamma", "all"}
    assert all(r["error"] < 2e-15 for r in records if r["tool"] != "floor")
    assert all(r["seconds"] > 0 for r in records)


def test_sections_of_a_mechanism_without_hand_written_code():
    sections = dict(bench(ncgen.load("fourbar")))
    records = [r for found in sections.values() for r in found]
    assert {r["case"] for r in records} >= {"phi", "all", "state derivative", "simulation", "batch"}
    assert all({"case", "tool", "error", "seconds"} <= r.keys() for r in records)
    assert not any("hand-written" in r["tool"] for r in records)
    assert json.loads(json.dumps(records)) == records


def test_the_fall(robot, monkeypatch):
    """Simulations reach the known end state, each in its own way; Octave would take a quarter of a minute."""
    end = [0.0] * 6
    for name, value in handwritten(robot).END.items():
        end[int(name[-1]) - 1] = value
    octaves = [{"tool": tool, "seconds": 1.0, "psi": end, "evaluations": 400} for tool in ("RK4", "ode45")]
    monkeypatch.setattr(falls.octave, "available", lambda kernels: True)
    monkeypatch.setattr(falls.octave, "falls", lambda kernels, **settings: octaves)
    records = {r["tool"]: r for r in falls.fall_records(robot)}
    assert records["dopri5, emitted C"]["error"] < 1e-5
    assert records["rk4, emitted C"]["error"] < 1e-6
    assert records["hand-written NumPy, SciPy RK45"]["error"] < 1e-5
    assert records["hand-written Octave, RK4"] | {"error": 0.0, "seconds": 1.0} == records["hand-written Octave, RK4"]
    assert records["the paper's Table 9, ode45"]["seconds"] == 4.125


def test_octave_that_fails_takes_nothing_else_with_it(robot, monkeypatch):
    """Its line says why; a bench has other results by then."""

    def fails(kernels, **settings):
        raise ncgen.NcgenError("octave-cli: no jsondecode")

    monkeypatch.setattr(falls.octave, "available", lambda kernels: True)
    monkeypatch.setattr(falls.octave, "falls", fails)
    (record,) = falls._octave(robot, 0.5, {})
    assert record["stopped"] == "octave-cli: no jsondecode" and record["seconds"] is None
    assert "stopped" in "".join(aligned(_simulation_rows([record])))


@pytest.mark.slow
def test_the_state_derivative(robot):
    records = {r["tool"]: r for r in rates.derivative_records(robot, 1e9)}
    assert records["accelerations"]["error"] < 1e-12
    assert records["hand-written NumPy"]["error"] < 1e-11
    assert records["a stage of a default run"]["error"] < 1e-13
    assert records["a stage of a default run"]["operations"] < 0.8 * records["all, with one Newton step"]["operations"]
    if records["accelerations"]["worst"] is not None:  # where long double is more than double
        assert records["accelerations, refined"]["worst"] < 1e-13 < 10 * records["accelerations"]["worst"] < 1e-8
    assert records["Newton step"]["floor"] == records["Newton step"]["operations"] / 1e9


def test_batches(robot):
    """Each state has in the batch what it has alone."""
    records = list(batches.batch_records(robot))
    assert {r["what"] for r in records} == {"phi", "phi_q", "gamma", "constraints", "mass", "derivative", "simulation"}
    assert {"one at a time in C", "batch, threads: 1"} <= {r["tool"] for r in records}
    assert all(r["error"] < 1e-11 for r in records if r["tool"].startswith("batch"))
    assert {r["what"]: r["tool"] for r in records if r.get("chosen")} == {
        "phi": "batch in lanes", "phi_q": "batch, one after the other", "gamma": "batch in lanes", "constraints": "batch in lanes",
        "mass": "batch, one after the other",
    }  # fmt: skip


def test_the_models_own_run_begins_as_the_model_says():
    """A rod without weight turns at 2 rad/s from where the model's simulation lets it begin: after 0.5 s it is at 1 rad."""
    m = ncgen.Model("turning")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    m.simulation(duration=0.5, qd0={"B.x": 0.0, "B.y": 2.0}, z=["B.y"])
    kernels = ncgen.compile(m, "c")
    end = {"B.x": math.cos(1.0), "B.y": math.sin(1.0)}
    assert falls.end_state(kernels, 0.5) == pytest.approx(end, abs=1e-10)
    assert dict(zip(kernels.coordinates, precision.reference(kernels, *falls.own_run(kernels)).q)) == pytest.approx(end, abs=1e-10)
    assert not all(record["error"] is None or record["error"] > 1e-4 for record in falls.fall_records(kernels))
    run = paper_tables._Partitioned(kernels)
    assert (run.names, list(run.y0)) == (["B.y"], pytest.approx([2.0, 0.0], abs=1e-12))
    assert run.derivative(0.0, run.y0) == pytest.approx([0.0, 2.0], abs=1e-12)


def test_the_articulated_body_algorithm_of_another_generator():
    """It gives the accelerations of an arm to rounding; a mechanism with loops has none."""
    pytest.importorskip("casadi", reason="casadi is not installed")
    records = {r["tool"]: r for r in rates.derivative_records(ncgen.compile(example_module("arm").build(3), "c"), 1e9)}
    assert records[rates.ARTICULATED]["error"] < 1e-12 and records[rates.ARTICULATED]["operations"] > 300
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
