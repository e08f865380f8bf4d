"""What one body does to another, by free bodies: joints that are rows, the user's own rows, drivers; Newton and Euler done here."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError

G = 9.81


def reactions_of(model, **options):
    return ncgen.simulate(ncgen.compile(model), 0.3, points=4, rtol=1e-10, **options).reactions()


def block(joint):
    """A block of 1 kg between (0.5, 0) and (1.1, 0), on a line along x that `joint` makes."""
    m = Model("slider")
    m.gravity((0, -G, 0))
    O, X = m.point("O", (0, 0), fixed=True), m.vector("X", (1, 0, 0), fixed=True)
    A, B = m.point("A", (0.5, 0)), m.point("B", (1.1, 0))
    body = m.body("block", [A, B], mass=1.0, com=(0.6, 0), inertia=0.1)
    if joint == "prismatic":
        m.prismatic(m.ground, body, O, A, X)
    elif joint == "lines":
        m.point_on_line(m.ground, A, O, X)
        m.point_on_line(m.ground, B, O, X)
    else:
        m.constrain(A.y)
        m.constrain(3 * B.y - A.y)
    return m


@pytest.mark.parametrize("joint", ["prismatic", "lines", "own rows"])
def test_a_block_on_a_line_is_held_by_its_weight(joint):
    """9.81 N up, and about A the moment that holds a centre 0.1 m beside it."""
    found = reactions_of(block(joint))
    force, moment = found.wrench("block", "A", neighbour="ground")
    assert force == pytest.approx(np.tile([0, G, 0], (4, 1)), abs=1e-9)
    assert moment == pytest.approx(np.tile([0, 0, 0.1 * G], (4, 1)), abs=1e-9)


def carriage():
    """A carriage on a rail, on which a slide moves along a slope, from which a rod hangs."""
    m = Model("carriage")
    m.gravity((0, -G, 0))
    X, z = m.vector("X", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0.2, 0))
    slope, D, E = m.vector("slope", (0.8, 0.6)), m.point("D", (0.6, 0.3)), m.point("E", (0.9, -0.4))
    base = m.body("base", [A], [slope], mass=2.0, com=(0.2, 0.1), inertia=0.05)
    slide = m.body("slide", [D], [slope], mass=0.5, com=(0.6, 0.3), inertia=0.01)
    m.prismatic(m.ground, base, O, A, X)
    m.prismatic(base, slide, A, D, slope)
    m.body("rod", [D, E], mass=0.8, com=(0.75, -0.05), inertia=0.02)
    m.angle("psi", X, E - D, z)
    return m


def test_a_chain_of_slides():
    """Every wrench is what hangs behind it: forces are sums of m (a − g), whichever rows carry them."""
    found = reactions_of(carriage())
    run, g = found.run, np.array([0, -G, 0])
    index = run.kernels.index

    def acceleration(point):
        return np.stack([run.qdd[:, index[f"{point}.{axis}"]] if f"{point}.{axis}" in index else 0 * run.t for axis in "xyz"], -1)

    # the rod is rigid: its centre lies in its own frame where it does at the start
    along, start = run.point("E") - run.point("D"), np.array([0.3, -0.7])
    part = np.array([0.15, -0.35]) @ start / (start @ start)
    rod = 0.8 * (acceleration("D") + part * (acceleration("E") - acceleration("D")) - g)
    slide, base = 0.5 * (acceleration("D") - g), 2.0 * (acceleration("A") - g)
    assert np.max(np.abs(np.linalg.norm(along, axis=1) - np.hypot(0.3, 0.7))) < 1e-9
    assert found.wrench("rod", "D", neighbour="slide")[0] == pytest.approx(rod, abs=1e-8)
    assert found.wrench("slide", "D", neighbour="rod")[0] == pytest.approx(-rod, abs=1e-8)
    assert found.wrench("slide", "D", neighbour="base")[0] == pytest.approx(rod + slide, abs=1e-8)
    back, moment = found.wrench("base", "D", neighbour="slide")
    assert back == pytest.approx(-rod - slide, abs=1e-8)
    assert moment == pytest.approx(-found.wrench("slide", "D", neighbour="base")[1], abs=1e-8)
    assert found.wrench("base", "A", neighbour="ground")[0] == pytest.approx(rod + slide + base, abs=1e-8)
    force = found.wrench("slide", "D", neighbour="base")[0]
    assert np.max(np.abs(np.sum(force * run.vector("slope"), axis=1))) < 1e-8  # nothing along the slide


def test_neighbours_add_up_to_all():
    found = reactions_of(carriage())
    for body, neighbours in {"base": ("ground", "slide"), "slide": ("base", "rod"), "rod": ("slide",)}.items():
        parts = [found.wrench(body, "A", neighbour=other) for other in neighbours]
        force, moment = found.wrench(body, "A")
        assert sum(part[0] for part in parts) == pytest.approx(force, abs=1e-8)
        assert sum(part[1] for part in parts) == pytest.approx(moment, abs=1e-8)


def test_a_pin_that_the_ground_guides_is_not_told_apart():
    """Two rods share a pin in a slot of the ground: what one does to the other is not in the equations."""
    m = Model("slot")
    m.gravity((0, -G, 0))
    O, X = m.point("O", (0, 0), fixed=True), m.vector("X", (1, 0, 0), fixed=True)
    P, Q, R = m.point("P", (0.5, 0)), m.point("Q", (0.6, 0.3)), m.point("R", (0.8, -0.3))
    m.body("first", [P, Q], mass=1.0, inertia="rod")
    m.body("second", [P, R], mass=1.0, inertia="rod")
    m.point_on_line(m.ground, P, O, X)
    found = reactions_of(m)
    with pytest.raises(ModelError, match="joins first and second with ground, too"):
        found.wrench("first", "P", neighbour="second")


def test_bodies_without_a_joint_are_refused():
    with pytest.raises(ModelError, match="body rod shares no point and no vector with base, and no constraint connects them"):
        reactions_of(carriage()).wrench("rod", "D", neighbour="base")
