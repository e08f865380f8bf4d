"""Events as results of studies, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bouncing import G, ball
from sliding import sliding_block

import ncgen
from ncgen.studies.definition import Study

KEEP = (
    "P.y", "first_time(floor)", "count(floor)", "impulse(floor)", "energy_lost(floor)", "first_time(floor rests)", "min(P.y)", "max(P.y)",
    "max(rate(P.y))",
)  # fmt: skip
DROPS = {"e": [0.3, 0.5], "start(P.y)": [0.5, 1.0]}


@pytest.fixture(scope="module")
def found():
    return ncgen.study(ball(), DROPS, keep=KEEP, duration=0.8)


def test_columns_of_events(found):
    """Impacts at t₁ (1 + 2 e + 2 e² + …), t₁ = √(2h/g), with impulses (1 + e) eᵏ v₁; all energy is gone at rest, at t₁ (1 + e)/(1 − e)."""
    e, height = found["e"], found["start(P.y)"]
    fall, speed = np.sqrt(2 * height / G), np.sqrt(2 * height * G)
    assert found.ok.all() and found["first_time(floor)"] == pytest.approx(fall, rel=1e-12)
    rest = fall * (1 + e) / (1 - e)
    is_at_rest = found["first_time(floor rests)"] < 0.8
    assert is_at_rest.tolist() == (rest < 0.8).tolist() and np.isnan(found["first_time(floor rests)"][~is_at_rest]).all()
    assert found["energy_lost(floor)"][is_at_rest] == pytest.approx(G * height[is_at_rest], rel=1e-10)
    slowest = 2e-5  # m/s: bounces that are lower than 1e-11 m are none
    assert found["impulse(floor)"][is_at_rest] == pytest.approx((speed * (1 + e) / (1 - e))[is_at_rest], abs=slowest)
    assert (
        found["count(floor)"].dtype == np.int64
        and found["count(floor)"][3] == 1
        and found["impulse(floor)"][3] == pytest.approx(1.5 * math.sqrt(2 * G), rel=1e-12)
    )


def test_extremes_know_the_instants_of_events(found):
    """Between instants of the grid a ball is at its floor, and fastest behind it."""
    assert found["min(P.y)"] == pytest.approx(0.0, abs=1e-12) and found["max(P.y)"] == pytest.approx(found["start(P.y)"], rel=1e-13)
    assert found["max(rate(P.y))"] == pytest.approx(found["e"] * np.sqrt(2 * found["start(P.y)"] * G), rel=1e-10)


def test_columns_are_those_of_single_runs(found):
    kernels = ncgen.compile(ball())
    for i in range(4):
        run = ncgen.simulate(kernels, 0.8, p={"e": found["e"][i]}, q0={"P.y": found["start(P.y)"][i]}, points=101)
        own = [each for each in run.events if not each.transition]
        assert found["P.y"][i] == run["P.y"][-1] and found["count(floor)"][i] == len(own) and found["first_time(floor)"][i] == own[0].t


def test_joints_that_stick():
    """On a belt of speed v a block of 1 kg on a spring of 1 N/m slips at 5 N, first after 4/v from 1 m, and turns never."""
    m, u = sliding_block("belt")
    speed = m.parameter("speed", 3.0)
    m.torque(u, -(u + speed * m.time))
    m.friction(u, coulomb=3.0, static=5.0, name="belt")
    keep = ["first_time(belt slips)", "count(belt turns)", "count(belt)"]
    result = ncgen.study(m, {"speed": [1.0, 2.0, 3.0]}, keep=keep, duration=4.5, q0={"s": 1.0, "A.x": 1.0}, rtol=1e-11)
    assert result["first_time(belt slips)"] == pytest.approx(4 / result["speed"], rel=1e-9)
    assert result["count(belt turns)"].tolist() == [0, 0, 0] and (result["count(belt)"] >= 2).all()


def test_energies_of_joints_that_stick():
    """Columns of the whole motion are those of single runs: work of friction takes the energy."""
    m, s = sliding_block("rubbed")
    m.torque(s, -s)
    m.friction(s, coulomb=m.parameter("most", 1.0))
    keep, options = ["energy_drift", "s", "max(s)"], {"duration": 10.0, "q0": {"s": 5.0, "A.x": 5.0}, "rtol": 1e-9}
    result = ncgen.study(m, {"most": [0.5, 1.0]}, keep=keep, **options)
    assert "events in C" in result.about["made_with"] and np.max(result["energy_drift"]) < 1e-8
    for i, most in enumerate(result["most"]):
        run = ncgen.simulate(ncgen.compile(m), points=101, p={"most": most}, **options)
        assert result["s"][i] == pytest.approx(run["s"][-1], rel=1e-9)
        assert result["energy_drift"][i] == pytest.approx(run.energy_drift, abs=1e-9)


def test_a_folder_keeps_them(found, tmp_path):
    again = ncgen.study(ball(), DROPS, keep=KEEP, duration=0.8, output=tmp_path / "drops", workers=1)
    read = ncgen.read(tmp_path / "drops")
    for name in KEEP:
        assert np.array_equal(again[name], found[name], equal_nan=True) and np.array_equal(read[name], found[name], equal_nan=True)


def test_the_digest_tells_events_apart():
    """Models whose equations are the same differ by their events."""
    digests = {Study.of(m, {"start(P.y)": [1.0]}, keep="P.y").digest for m in (ball(), ball(order="in turn"), ball(rest="end"))}
    assert len(digests) == 3 and Study.of(ball(), {"start(P.y)": [1.0]}, keep="P.y").digest in digests


def called() -> ncgen.Model:
    m = ball()
    m.event("seen", when=m.elements["P"].y - 0.5, do=lambda at, kernels: None)
    return m


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (ball, {"keep": "count(wall)"}, "keep, count\\(wall\\): the mechanism has no event wall; it has floor"),
        (ball, {"keep": "gradient(P.y, e)", "steps": 10}, "keep, gradient\\(P.y, e\\): the model has events"),
        (lambda: ball(rest="end"), {"keep": "history(P.y)", "times": [0.1]}, "times: event floor may end a run before"),
        (called, {"keep": "P.y"}, "ball: event seen calls a Python function, which is no data"),
    ],
    ids=["name", "gradient", "history", "function"],
)
def test_refused(model, options, message):
    with pytest.raises(ncgen.ModelError, match=message):
        ncgen.study(model(), {"start(P.y)": [1.0]}, **options)
