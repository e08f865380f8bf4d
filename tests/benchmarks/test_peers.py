"""`bench.py nfourbar --peers`: every simulator solves the same problem, whose exact motion is known."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import peers
from ncgen.comparisons.case import GRAVITY
from ncgen.comparisons.hard_linkages import four_bars_position


def test_the_exact_motion_is_that_of_one_angle():
    """(N+1)/3 θ̈ + N θ̈ = g ((N+1)/2 + N) sin θ of the standing rods' angle from the vertical, θ̇ = 1 at the start (hinges at the feet)."""
    for count in peers.COUNTS:
        rate = GRAVITY * ((count + 1) / 2 + count) / ((count + 1) / 3 + count)
        run = solve_ivp(lambda t, y, rate=rate: (y[1], rate * np.sin(y[0])), (0, 3), (0.0, 1.0), method="DOP853", rtol=1e-12, atol=1e-13)
        assert np.allclose(four_bars_position(count, [3.0])[0], (np.sin(run.y[0, -1]), np.cos(run.y[0, -1])), atol=1e-9)


@pytest.mark.parametrize("name, steps", [("pinocchio", 10), ("mujoco", 40), ("exudyn", 40)])
def test_a_peer_solves_the_same_problem(name, steps):
    """A second of it: 100 intervals to 1e-4 m, before the singular position."""
    module = pytest.importorskip(f"benchmarks.peers.{name}", reason=f"{name} is not installed")
    seconds, found = module.run(2, 1.0, 20, steps)
    assert seconds > 0 and np.allclose(found, four_bars_position(2, np.linspace(0, 1, 21)), atol=1e-4)


def test_what_is_missing_is_said_and_ncgen_reaches_the_error(monkeypatch):
    monkeypatch.setattr(peers, "TOLERANCES", (1e-9,))
    monkeypatch.setattr(peers, "STEPS", (5,))
    monkeypatch.setattr(peers, "STEPS", (5,))
    monkeypatch.setattr(peers, "REPEATS", 1)
    records = list(peers.peer_records((2,), ("nosuchsimulator",)))
    assert json.loads(json.dumps(records)) == records
    assert any("nosuchsimulator" in line for line in peers.reasons(records, 2))
    best = {r["tool"]: min(x["error"] or np.inf for x in records if x["tool"] == r["tool"]) for r in records}
    assert best["ncgen, dop853 on lagrange"] < peers.ERROR
    _, first, *_ = peers.table(records, 2)
    assert first[2] == "1" and "never" not in first[1]
