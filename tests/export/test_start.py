"""An export starts as the model's own simulation does, however that is said."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.export.package import package


def rod(**simulation):
    """A bob at (0.6, 0.8) on a rod about the origin, with a parameter that nothing of this depends on."""
    model = ncgen.Model("rod")
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (0.6, 0.8))
    model.distance(A, B)
    model.body("bob", points=[B], mass=model.parameter("mass", 2.0))
    model.simulation(duration=1.0, **simulation)
    return model


@pytest.mark.parametrize(
    "given",
    [
        {"z": ["B.y"], "zd0": {"B.y": 1.5}},
        {"z": "B.y", "zd0": {"B.y": 1.5}},
        {"z": ["B.y"], "zd0": np.array([1.5])},
        {"z": "B.y", "zd0": [1.5]},
        {"qd0": {"B.y": 1.5}},
        {"qd0": np.array([-2.0, 1.5])},
    ],
    ids=str,
)
def test_velocities(given):
    """A point on a circle moves across its radius: 1.5 m/s upwards are 2 m/s to the left at (0.6, 0.8)."""
    found = package(rod(**given))
    np.testing.assert_allclose(found.q, [0.6, 0.8], atol=1e-15)
    np.testing.assert_allclose(found.qd, [-2.0, 1.5], rtol=1e-14)


def test_position():
    """On the other side: the same rise is a motion to the right there."""
    found = package(rod(q0={"B.x": -0.6}, qd0={"B.y": 1.5}))
    np.testing.assert_allclose([*found.q, *found.qd], [-0.6, 0.8, 2.0, 1.5], rtol=1e-14)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"t0": 0.5}, "its simulation begins at t0 = 0.5 s, an export at 0; describe the motion from 0 on"),
        ({"p": {"mass": 3.0}}, "its simulation has p of its own: mass = 3; make that the parameter's default"),
        ({"zd0": {"A.x": 1.0}}, "zd0: the mechanism has no free coordinate A.x; it has B.x, B.y"),
        ({"duraton": 1.0}, r"m\.simulation: there is no argument 'duraton'; did you mean duration\?"),
    ],
    ids=["t0", "p", "zd0", "duraton"],
)
def test_what_an_export_cannot_start_with(given, message):
    with pytest.raises(ModelError, match=f"^(rod cannot be exported: )?{message}$"):
        package(rod(**given))


def test_defaults_may_be_said_again():
    np.testing.assert_array_equal(package(rod(t0=0.0, p=[2.0])).q, package(rod()).q)
