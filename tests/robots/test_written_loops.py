"""Mechanisms with loops as SDF: what is read back moves as what was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_module
from ncgen.exchange.robots import robot_text
from ncgen.solver.frames import transformation

HERE = Path(__file__).parent


def excavator() -> Model:
    """Without its cylinders' control, which depends on time: it falls."""
    model = ncgen.load("excavator")
    model.forces.clear()
    return model


def delta() -> Model:
    """With ball joints on its rods, and without motors."""
    model = example_module("delta").build(hinged=False)
    model.forces.clear()
    return model


def fivebar() -> Model:
    m = Model("fivebar")
    A, E = m.point("A", (0, 0), fixed=True), m.point("E", (0.6, 0), fixed=True)
    B, C, D = m.point("B", (-0.2, 0.5)), m.point("C", (0.4, 0.9)), m.point("D", (0.9, 0.4))
    for name, pair in {"left": (A, B), "over": (B, C), "under": (C, D), "right": (E, D)}.items():
        m.body(name, pair, mass=1.3, inertia=0.02)
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    first, second = m.angle("first", x, B - A, z), m.angle("second", D - E, x, z)
    m.torsion_spring(first, 3.0, 0.1, 1.2)
    m.torsion_spring(second, 0.0, 0.2)
    m.independent(first, second)
    m.gravity((0, -9.81, 0))
    return m


MODELS = {
    "fourbar": (lambda: ncgen.load("fourbar"), {}, {"psi"}),
    "fivebar": (fivebar, {}, {"first", "second"}),
    "excavator": (excavator, {}, {"lift", "crowd", "curl"}),
    "stewart": (
        lambda: ncgen.load("stewart"),
        {"s1": 0.6, "s2": -0.3, "s4": 0.4, "s3": 0.0, "s5": 0.0, "s6": 0.0},
        {f"s{i}" for i in range(1, 7)},
    ),
    "delta": (delta, {}, {"psi1", "psi2", "psi3"}),
}


@pytest.mark.parametrize("name", MODELS)
def test_what_is_read_back_moves_as_what_was_written(name, tmp_path):
    """Rotations of all bodies, and what coordinates changed by, over a short fall."""
    make, zd0, coordinates = MODELS[name]
    model = make()
    path = tmp_path / f"{name}.sdf"
    path.write_text(robot_text(model, ".sdf"), encoding="utf-8")
    read = ncgen.load(path)
    read.independent(*sorted(coordinates))
    kernels = [ncgen.compile(each, "numpy") for each in (model, read)]
    assert ncgen.freedom(kernels[0]).dof == ncgen.freedom(kernels[1]).dof
    ours, theirs = (ncgen.simulate(each, 0.12, zd0=zd0, rtol=1e-11, points=4) for each in kernels)
    for body in (body for body in model.bodies.values() if len(body.elements) > 2 or body.frame.planar):
        turned = [transformation(each, body.name, run.q) for each, run in zip(kernels, (ours, theirs), strict=True)]
        np.testing.assert_allclose(turned[1], turned[0], rtol=0, atol=1e-9)
    moved = 0.0
    for coordinate in coordinates:
        first, second = ours[coordinate], theirs[coordinate]
        np.testing.assert_allclose(second - second[0], first - first[0], rtol=0, atol=1e-9)
        assert second[0] == pytest.approx(0.0, abs=1e-14)
        moved = max(moved, float(np.ptp(first)))
    assert moved > 1e-2


def test_an_open_tree_keeps_its_zeros_in_sdf(tmp_path):
    path = tmp_path / "crane.sdf"
    model = ncgen.load(HERE / "crane.urdf")
    path.write_text(robot_text(model, ".sdf"), encoding="utf-8")
    first, second = (ncgen.joint_space(ncgen.compile(each, "numpy")) for each in (model, ncgen.load(path)))
    values = dict(zip(first.rates, np.sin(np.arange(first.n)), strict=True))
    order = [second.rates.index(name) for name in first.rates]
    masses = first.mass_matrix(first.position(values)), second.mass_matrix(second.position(values))[np.ix_(order, order)]
    np.testing.assert_allclose(masses[1], masses[0], rtol=0, atol=1e-12)


def test_a_free_robot_stays_free(tmp_path):
    path = tmp_path / "crane.sdf"
    path.write_text(robot_text(ncgen.load(HERE / "crane.urdf", floating=True), ".sdf"), encoding="utf-8")
    assert ncgen.freedom(ncgen.compile(ncgen.load(path), "numpy")).dof == 12


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: ncgen.load("excavator"),
            "excavator: cylinder lift is no spring or damper of a joint; a file of links and joints cannot say it",
        ),
        (lambda: ncgen.load("jansen"), "jansen: row driver of psi .* is that of no joint; a file of links"),
        (lambda: ncgen.load("flyball"), "flyball: spring K1-M1 is no spring or damper of a joint"),
    ],
)
def test_what_sdf_cannot_say(make, said):
    with pytest.raises(ModelError, match=said):
        robot_text(make(), ".sdf")
