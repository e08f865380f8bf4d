"""What is compared must be the same functions: the hand-written robot against the generated kernels."""

import numpy as np
import pytest

import ncgen
from ncgen.comparisons.rivals import KERNELS, Inputs, handwritten
from ncgen.comparisons.rivals.generated import compiled
from ncgen.comparisons.rivals.handwritten import in_c

TOLERANCE = 1e-13


@pytest.fixture(scope="module")
def hand(robot):
    return handwritten(robot)


@pytest.fixture(params=range(5))
def place(request, robot):
    """A random position, which need not be a possible one, and random velocities."""
    random = np.random.default_rng(request.param)
    return Inputs(robot.q0 + 0.3 * random.standard_normal(robot.n), random.standard_normal(robot.n), robot.p0)


def near(value, expected):
    return np.max(np.abs(value - expected)) <= TOLERANCE * max(1.0, np.max(np.abs(expected)))


@pytest.mark.parametrize("kind", ["loop", "vector"])
def test_numpy(robot, hand, place, kind):
    assert near(getattr(hand, f"{kind}_phi")(place.q), robot.phi(place.q))
    assert near(getattr(hand, f"{kind}_phi_q")(place.q), robot.jacobian(place.q))
    assert near(getattr(hand, f"{kind}_gamma")(place.q, place.qd), robot.gamma(place.q, place.qd))


def test_mass_and_force(robot, hand, place):
    mass, force = hand.mass_and_force(place.q, place.qd)
    assert near(mass, robot.mass_matrix(place.q))
    assert near(force, robot.force(place.q, place.qd))


def test_c(robot, place):
    (functions,) = in_c(robot)
    rival = compiled("hand-written C", functions, place, KERNELS)
    for name in KERNELS:
        assert near(rival.values(name), robot.values(name, 0.0, place.q, place.qd, None)), name


def test_derivative(robot, hand):
    """The student's state derivative is that of a run by ncgen."""
    run = ncgen.simulate(robot, 0.1, rtol=1e-10, atol=1e-12, points=2, engine="python")
    y = np.concatenate([run.qd[-1][30:], run.q[-1][30:]])
    expected = np.concatenate([run.qdd[-1][30:], run.qd[-1][30:]])
    assert np.allclose(hand.derivative(0.1, y, robot.q0.copy()), expected, rtol=1e-9, atol=1e-9)
