"""What is compared must be the same functions: the hand-written robot against the generated kernels."""

import shutil

import numpy as np
import pytest

import ncgen
from ncgen.comparisons.rivals import KERNELS, Inputs, handwritten, octave
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


@pytest.mark.skipif(shutil.which(octave.PROGRAM) is None, reason="Octave is not installed")
def test_octave(robot):
    """The paper's own program reaches, in few steps, the angles that ncgen's runs reach at tight tolerance."""
    run = ncgen.simulate(robot, 0.05, rtol=1e-11, atol=1e-13, points=2)
    found = {r["tool"]: r for r in octave.falls(robot, duration=0.05, steps=4, rtol=1e-5, atol=1e-7)}
    assert found["RK4"]["evaluations"] == 16
    for tool in ("RK4", "ode45"):
        assert np.allclose(found[tool]["psi"], run.q[-1][30:], rtol=0, atol=1e-6), tool


def test_octave_that_fails_says_why(robot, monkeypatch, tmp_path):
    program = tmp_path / octave.PROGRAM
    program.write_text("#!/bin/sh\necho 'error: undefined function' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(ncgen.NcgenError, match="octave-cli: error: undefined function"):
        octave.falls(robot, duration=0.05, steps=1, rtol=1e-5, atol=1e-7)
