"""The command itself: what it refuses is one line, and the package says where the rest is."""

import json
import re

import pytest

from benchmarks import bench
from ncgen.report import clock


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["robot", "--peers"], "robot: this is not measured of it; choose nfourbar"),
        (["robot", "--growth"], "robot: this is not measured of it; choose chain, arm"),
        (["robot", "--arms"], "robot: this is not measured of it; choose arm"),
        (["pendulum", "--defaults"], "pendulum: this is not measured of it; choose"),
        (["nosuch", "--data"], "nosuch"),
        (["pendulum", "--derivatives", "--html", "nowhere/a.html"], "--html nowhere/a.html: there is no folder nowhere"),
    ],
)
def test_what_cannot_be_measured_is_said_in_a_line(arguments, words, capfd):
    assert bench.main(arguments) == 2
    said = capfd.readouterr()
    assert said.out == "" and words in said.err and said.err.startswith("bench.py: ")


@pytest.mark.slow
def test_records_for_machines(monkeypatch, capfd):
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))
    assert bench.main(["cartpole", "--data", "--json"]) == 0
    assert {(r["case"], r["model"]) for r in json.loads(capfd.readouterr().out)} == {("operations", "cartpole")}


def test_every_measurement_is_in_the_help():
    assert set(re.findall(r"--[a-z-]+", bench.__doc__)) == {*bench.WHAT, "--seed"}
