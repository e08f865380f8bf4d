"""The suspension's design for ride: its balance by weight, its gradient beside differences of the same cost, and its optimum."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module

pytestmark = pytest.mark.slow  # half a minute of compiling


@pytest.fixture(scope="module")
def case():
    module = example_module("suspension", "ride.py")
    return module, module.Ride()


def test_the_car_rests_at_the_drawings_height(case):
    """The tyre carries all of the weight, and spring and preload hold the wheel: at first nothing is accelerated but by the half newton
    that the data of `model.py` miss balance by (tests/gallery/test_suspension.py); two degrees of freedom."""
    kernels = case[1].kernels
    assert ncgen.freedom(kernels).dof == 2
    mass = kernels.mass_matrix(kernels.q0, 0.0, kernels.p0)
    up = np.array([name.endswith(".z") and name != "axis.z" for name in kernels.coordinates], dtype=float)
    assert up @ mass @ up * 9.81 == pytest.approx(case[0].CAR.LOAD, rel=1e-9)
    run = ncgen.simulate(kernels, 1e-3, points=2)
    assert np.max(np.abs(run.qdd[0])) < 0.02


def test_gradient_and_optimum(case, monkeypatch, capsys, tmp_path):
    """Seven derivatives against differences; at the design the gradient is zero or points out of the bounds, and the cost is a quarter."""
    module, ride = case
    x = module.begin() + 0.05
    value, slope = ride.cost(x)
    for k, unit in enumerate(np.eye(len(x))):
        ends = [ride.cost(x + sign * 1e-5 * unit)[0] for sign in (1, -1)]
        assert slope[k] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5, abs=1e-6 * abs(value))
    found, seconds = module.designed(ride)
    assert found.fun < 0.5 * ride.cost(module.begin())[0]
    slope = ride.cost(found.x)[1]
    for x, by, (low, high) in zip(found.x, slope, module.BOUNDS, strict=True):
        assert abs(by) < 1e-4 or (x == low and by > 0) or (x == high and by < 0)
    monkeypatch.setattr(module, "designed", lambda ride: (found, seconds))
    monkeypatch.setattr(module.sys, "argv", ["script", "--plot", str(tmp_path / "plot.png")])
    module.main()
    assert f"{found.fun:12.6f}" in capsys.readouterr().out
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
