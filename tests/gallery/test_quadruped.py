"""The quadruped against the laws of momentum, from bodies' own masses and velocities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import simpson

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.symbolic.tree import spanning_tree

EXAMPLE = example_module("quadruped")
GRAVITY = 9.81
MASS = EXAMPLE.TRUNK + 4 * (EXAMPLE.HIP + 2 * sum(EXAMPLE.LINKS.values()))
LEGS = range(1, 5)


def masses():
    """(mass, the points whose middle it is in) of every body."""
    yield EXAMPLE.TRUNK, ("T",)
    for i in LEGS:
        yield EXAMPLE.HIP, (f"H{i}",)
        for end in "ab":
            yield EXAMPLE.LINKS[EXAMPLE.UPPER], (f"H{i}", f"K{i}{end}")
            yield EXAMPLE.LINKS[EXAMPLE.LOWER], (f"K{i}{end}", f"F{i}")


def velocity(run, name):
    return np.transpose([run[f"rate({name}.{axis})"] for axis in "xyz"])


def weighted(run, place):
    """The sum of masses times what `place` gives for a point, over the mass."""
    return sum(m * sum(place(run, name) for name in names) / len(names) for m, names in masses()) / MASS


def centre(run):
    return weighted(run, lambda run, name: run.point(name))


def test_bodies_and_freedoms():
    """Six of the trunk and three of each leg, from a tree of 26 that four feet close."""
    kernels = ncgen.compile(ncgen.load("quadruped"), "numpy")
    tree = spanning_tree(kernels.model)
    assert (len(tree.links), tree.dof, ncgen.freedom(kernels).dof) == (21, 26, 18)


def test_falling_freely():
    kernels = ncgen.compile(EXAMPLE.build(ground=False), "c")
    run = ncgen.simulate(kernels, 0.5, rtol=1e-9, points=11)
    assert run.engine == "emitted"
    fallen = centre(run) - centre(run)[0]
    assert fallen == pytest.approx(np.outer(run.t**2, [0.0, 0.0, -GRAVITY / 2]), abs=1e-9)
    # natural coordinates y_a of a body, points and vectors: L = sum M_ab y_a × ẏ_b about the origin, less that of the centre of mass
    L = np.array([angular_momentum(kernels, q, qd) for q, qd in zip(run.q, run.qd, strict=True)])
    moving = MASS * np.cross(centre(run), weighted(run, velocity))
    assert np.ptp(run["theta1a"]) > 0.3  # the motors work
    assert L - moving == pytest.approx(np.zeros_like(L), abs=1e-8)


def angular_momentum(kernels, q, qd):
    mass = kernels.mass_matrix(q)
    elements = [
        e for e in kernels.model.elements.values() if len(e.components) == 3 and kernels.index.get(e.components[0].name) is not None
    ]
    places = [[kernels.index[c.name] for c in e.components] for e in elements]
    return sum(mass[a[0], b[0]] * np.cross(q[a], qd[b]) for a in places for b in places if mass[a[0], b[0]])


def test_on_the_ground_impulse_is_the_change_of_momentum():
    """Feet push as the model says, along with friction; nothing else holds the robot up."""
    kernels = ncgen.compile(ncgen.load("quadruped"), "c")
    run = ncgen.simulate(kernels, 1.0, rtol=1e-8, points=4001)
    sunk = {i: (run[f"F{i}.z"], run[f"rate(F{i}.z)"]) for i in LEGS}
    push = sum(MASS * GRAVITY / 4 * np.exp(-z / EXAMPLE.SOFTNESS - v / EXAMPLE.SLOWNESS) for z, v in sunk.values())
    momentum = MASS * weighted(run, velocity)[:, 2]
    impulse = simpson(push - MASS * GRAVITY, x=run.t)
    assert impulse == pytest.approx(momentum[-1] - momentum[0], abs=1e-6)
    assert max(z.max() for z, _ in sunk.values()) > 0.03 and min(z.min() for z, _ in sunk.values()) > -0.02  # feet are lifted, and stand
    assert abs(run["T.z"][-1] - run["T.z"][0]) < 0.02
