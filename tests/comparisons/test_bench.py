"""`ncgen bench`: every time has its error beside it, and the records are what scripts may rely on."""

import json
import math

import pytest

import ncgen
from ncgen.comparisons import batches, derivative_parts, falls
from ncgen.comparisons.bench import bench, kernel_records
from ncgen.report import clock, precision


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the numbers are not looked at."""
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
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


def test_the_fall(robot):
    """Simulations reach the known end state, each in its own way."""
    records = {r["tool"]: r for r in falls.fall_records(robot)}
    assert records["dopri5, emitted C"]["error"] < 1e-5
    assert records["rk4, emitted C"]["error"] < 1e-6


@pytest.mark.slow
def test_the_state_derivative(robot):
    records = {r["tool"]: r for r in derivative_parts.derivative_records(robot, 1e9)}
    assert records["accelerations"]["error"] < 1e-12
    assert records["hand-written NumPy"]["error"] < 1e-11
    assert records["a stage of a default run"]["error"] < 1e-13
    assert records["a stage of a default run"]["operations"] < 0.8 * records["all, with one Newton step"]["operations"]
    assert records["Newton step"]["floor"] == records["Newton step"]["operations"] / 1e9


def test_batches(robot):
    """Each state has in the batch what it has alone."""
    records = list(batches.batch_records(robot))
    assert {r["quantity"] for r in records} == {"phi", "phi_q", "gamma", "constraints", "mass", "derivative", "simulation"}
    assert {"one at a time in C", "batch, threads: 1"} <= {r["tool"] for r in records}
    assert all(r["error"] < 1e-11 for r in records if r["tool"].startswith("batch"))
    assert {r["quantity"]: r["tool"] for r in records if r.get("chosen")} == {
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
    assert dict(zip(kernels.coordinates, precision.reference(kernels, *precision.own_run(kernels)).q)) == pytest.approx(end, abs=1e-10)
    assert not all(record["error"] is None or record["error"] > 1e-4 for record in falls.fall_records(kernels))
