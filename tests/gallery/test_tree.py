"""The random tree: every joint, two loops, and a fall whose accelerations are those of free bodies held together."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.rigid_bodies import FreeBodies

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.exchange.toml_writer import to_toml
from ncgen.model.elements import Spatial
from ncgen.symbolic.tree import spanning_tree

EXAMPLE = example_module("tree")


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("tree"), "numpy")


def words(model):
    return [fact.word for fact in model.facts]


def test_every_joint_and_two_loops(kernels):
    told = words(kernels.model)
    joints = [word for word in told if word in EXAMPLE.FREEDOMS]
    assert set(joints) == set(EXAMPLE.FREEDOMS)
    assert (told.count("body"), len(joints), told.count("distance")) == (9, 10, 1)
    first, loops = joints[:9], 3 + 1
    assert ncgen.freedom(kernels).dof == sum(EXAMPLE.FREEDOMS[joint] for joint in first) - loops == 11
    assert len(spanning_tree(kernels.model).links) == 9


def test_a_seed_is_always_the_same_tree():
    assert to_toml(EXAMPLE.build(5, 3, 1)) == to_toml(EXAMPLE.build(5, 3, 1)) != to_toml(EXAMPLE.build(5, 4, 1))


def test_it_falls_as_free_bodies_held_together():
    """From rest, after a time so short that nothing has turned: q(h) − q(0) = q̈ h²/2 + O(h⁴). The longer fall keeps its energy."""
    kernels, h = ncgen.compile(EXAMPLE.build(4, 11, 1), "c"), 2e-4
    assert "spherical" in words(kernels.model)  # which closes a loop
    at_rest = {e: np.zeros(3) for e in kernels.model.elements.values() if isinstance(e, Spatial)}
    expected = FreeBodies(kernels.model, at_rest, flat=False).accelerations()
    run = ncgen.simulate(kernels, h, rtol=1e-12, points=2)
    for element, acceleration in expected.items():
        names = [(axis, c.name) for axis, c in enumerate(element.components) if c.name in kernels.index]
        moved = [2 / h**2 * (run[name][-1] - run[name][0]) for _, name in names]
        assert moved == pytest.approx([acceleration[axis] for axis, _ in names], abs=1e-4)
    fall = ncgen.simulate(kernels, 0.3, rtol=1e-8)
    assert fall.engine == "emitted" and fall.energy_drift < 1e-7 and fall.violation().max() < 1e-10
