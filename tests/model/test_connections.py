"""The joints and drivers of a model: read from what bodies share and from constraints, not from labels."""

from io import StringIO

import pytest
from rich.console import Console

import ncgen
from ncgen.report.screen import show_inspection


def kinds(model):
    return [(joint.kind, joint.bodies) for joint in model.joints]


def test_a_four_bar_has_four_hinges():
    expected = [("ground", "crank"), ("ground", "rocker"), ("crank", "coupler"), ("coupler", "rocker")]
    assert kinds(ncgen.load("fourbar")) == [("revolute", bodies) for bodies in expected]
    assert [joint.elements for joint in ncgen.load("fourbar").joints] == [("A",), ("D",), ("B",), ("C",)]


def test_bodies_on_one_pin_have_one_joint_fewer_than_bodies():
    """Andrews' mechanism: seven bodies, ten hinges (Schiehlen, Multibody Systems Handbook, 1990)."""
    assert kinds(ncgen.load("andrews")) == [("revolute", joint.bodies) for joint in ncgen.load("andrews").joints]
    assert len(ncgen.load("andrews").joints) == 10


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        pytest.param("slidercrank", {"revolute": 3, "prismatic": 1}, id="planar slider"),
        pytest.param("slidercrank3d", {"revolute": 1, "prismatic": 1, "spherical": 1, "universal": 1}, id="spatial slider"),
        pytest.param("panels", {"revolute": 4, "gear": 3}, id="gears"),
        pytest.param("disc", {"rolling": 1}, id="rolling"),
        pytest.param("cartpole", {"prismatic": 1, "revolute": 1}, id="held components"),
        pytest.param("delta", {"revolute": 3, "spherical": 12}, id="three arms with two rods each"),
        pytest.param(
            "tree",
            {"prismatic": 1, "cylindrical": 1, "revolute": 3, "planar": 1, "spherical": 2, "screw": 1, "universal": 1},
            id="every kind",
        ),
    ],
)  # fmt: skip
def test_joints_of_examples(name, counts):
    found = [joint.kind for joint in ncgen.load(name).joints]
    assert {kind: found.count(kind) for kind in found} == counts


def test_drivers():
    (driver,) = ncgen.load("jansen").drivers
    assert (driver.coordinate, driver.constraint.owner.kind) == ("psi", "driver")
    (t,) = driver.law.free_symbols
    assert t.name == "t" and float(driver.law.diff(t)) == pytest.approx(6.283185307179586)


def test_closed_loops_are_joints():
    m = ncgen.Model("loop")
    O, P, Q, R = (m.point(name, at, fixed=name == "O") for name, at in zip("OPQR", ((0, 0), (1, 0), (1, 0), (1, 1)), strict=True))
    m.body("a", [O, P], mass=1.0, inertia="rod")
    m.body("b", [Q, R], mass=1.0, inertia="rod")
    m.close(P, Q, "ball")
    assert ("ball", ("a", "b")) in kinds(m)


def test_inspection_lists_them():
    record = ncgen.inspect(ncgen.compile(ncgen.load("slidercrank3d"), "numpy"))
    assert {"kind": "universal", "bodies": ["rod", "slider"], "elements": ["C"]} in record["joints"]
    console = Console(record=True, width=200, file=StringIO())
    show_inspection(console, record)
    assert "1 universal: rod-slider" in console.export_text()
