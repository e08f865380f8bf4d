"""Sliders of the plane: as many constraint equations as the joint takes degrees of freedom, and the motion that trigonometry gives."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.toml_writer import to_toml

R, ROD = 0.1, 0.3


def slider_crank(tilt=0.0, offset=(0.0, 0.05)):
    """A crank, a rod and a block of two points that slides on the ground along a line at the angle `tilt`; the block's points are `offset`
    apart."""
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    m = ncgen.Model("slidercrank")
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", turn @ (R, 0)), m.point("B", turn @ (R + ROD, 0))
    C = m.point("C", B.initial[:2] + turn @ offset)
    x, z = m.vector("x", (*turn[:, 0], 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", [O, A], mass=1.0, inertia=1e-3)
    m.body("rod", [A, B], mass=1.0, inertia=1e-2)
    block = m.body("block", [B, C], mass=1.0, inertia=1e-3)
    m.slider(m.ground, block, O, B, x)
    m.angle("psi", start=x, end=A - O, axis=z)
    return m


@pytest.mark.parametrize("tilt", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("offset", [(0.0, 0.05), (0.05, 0.0), (0.03, 0.04)])
def test_a_slider_on_the_ground(tilt, offset):
    """Two rows whatever direction of the block holds its angle; s = r cos ψ + sqrt(l² − r² sin² ψ), and the block does not turn."""
    m = slider_crank(tilt, offset)
    kernels = ncgen.compile(m, "numpy")
    assert [row.owner.kind for row in kernels.rows].count("joint") == 2
    found = ncgen.freedom(kernels)
    assert (found.dof, found.redundant) == (1, ())
    psi = np.linspace(0, 6, 40)
    q = ncgen.sweep(kernels, "psi", psi)
    B, C = (q[:, [kernels.index[f"{name}.x"], kernels.index[f"{name}.y"]]] for name in "BC")
    along = np.array([np.cos(tilt), np.sin(tilt)])
    s = R * np.cos(psi) + np.sqrt(ROD**2 - (R * np.sin(psi)) ** 2)
    np.testing.assert_allclose(B, s[:, None] * along, atol=1e-12)
    np.testing.assert_allclose(C - B, np.broadcast_to(C[0] - B[0], B.shape), atol=1e-12)


def quick_return(join):
    """A crank whose pin slides along a lever; join(m, lever, pin, P, A, along)."""
    m = ncgen.Model("quickreturn")
    O, P, A = m.point("O", (0, 0.3), fixed=True), m.point("P", (0, 0), fixed=True), m.point("A", (0.1, 0.3))
    T = m.point("T", 0.6 * np.array([0.1, 0.3]) / np.hypot(0.1, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", [O, A], mass=1.0, inertia=1e-3)
    lever = m.body("lever", [P, T], mass=1.0, inertia=1e-2)
    join(m, lever, P, A, T - P)
    m.angle("psi", start=x, end=A - O, axis=z)
    return m


def pin(m, lever, P, A, along):
    m.slider(lever, m.body("pin", [A], mass=0.1), P, A, along)


def block(m, lever, P, A, along):
    m.slider(lever, m.body("block", [A, m.point("E", (0.12, 0.36))], mass=0.1, inertia=1e-4), P, A, along)


JOINED = {"pin": (pin, 1), "block": (block, 2), "point": (lambda m, lever, P, A, along: m.point_on_line(lever, A, P, along), 1)}


@pytest.mark.parametrize("kind", JOINED)
def test_a_slider_on_a_body_that_turns(kind):
    """The lever points to the pin: tan φ = (0.3 + r sin ψ)/(r cos ψ). Nothing is added to the lever."""
    join, rows = JOINED[kind]
    kernels = ncgen.compile(quick_return(join), "numpy")
    assert [row.owner.kind for row in kernels.rows].count("joint") == rows
    assert not any(name.startswith("lever") for name in kernels.coordinates)
    found = ncgen.freedom(kernels)
    assert (found.dof, found.redundant) == (1, ())
    psi = np.linspace(0, 6, 40)
    q = ncgen.sweep(kernels, "psi", psi)
    lever = np.arctan2(q[:, kernels.index["T.y"]], q[:, kernels.index["T.x"]])
    np.testing.assert_allclose(lever, np.arctan2(0.3 + 0.1 * np.sin(psi), 0.1 * np.cos(psi)), atol=1e-12)
    if kind == "block":
        turned = np.arctan2(
            q[:, kernels.index["E.y"]] - q[:, kernels.index["A.y"]], q[:, kernels.index["E.x"]] - q[:, kernels.index["A.x"]]
        )
        np.testing.assert_allclose(turned, lever, atol=1e-12)


@pytest.mark.parametrize("build", [slider_crank, lambda: quick_return(block), lambda: quick_return(JOINED["point"][0])])
def test_in_a_file(tmp_path, build):
    """Written and read again it has the same equations."""
    path = tmp_path / "model.toml"
    m = build()
    path.write_text(to_toml(m), encoding="utf-8")
    again, first = (ncgen.compile(each, "numpy") for each in (ncgen.load(path), m))
    q = np.random.default_rng(3).standard_normal(first.n)
    assert again.coordinates == first.coordinates and np.array_equal(again.phi(q), first.phi(q))


def test_in_space_it_is_prismatic():
    """Five constraint equations between two bodies: one degree of freedom is left of six."""
    m = ncgen.Model("space")
    P, A, B = m.point("P", (0, 0, 0), fixed=True), m.point("A", (0.5, 0, 0)), m.point("B", (0.5, 0.3, 0.4))
    e, u, v = m.vector("e", (1, 0, 0), fixed=True), m.vector("u", (0, 1, 0)), m.vector("v", (0, 0, 1))
    body = m.body("body", [A, B], [u, v])
    m.slider(m.ground, body, P, A, e)
    assert ncgen.freedom(ncgen.compile(m, "numpy")).dof == 1
    with pytest.raises(ModelError, match="slider ground-body: A-P is no vector; in space give a unit vector as the axis"):
        m.slider(m.ground, body, P, A, A - P)
    with pytest.raises(ModelError, match="joined to itself"):
        m.slider(m.ground, m.ground, P, P, e)
