"""Bennett's linkage against its closed form: the relation of its angles, and the motion that its energy gives."""

import numpy as np
import pytest
from scipy.integrate import quad

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.position import residual, sweep

CORNERS = example_module("bennett").CORNERS


@pytest.fixture(scope="module")
def bennett():
    return ncgen.compile(ncgen.load("bennett"), backend="numpy")


@pytest.fixture(scope="module")
def turn(bennett):
    """A good half of a turn."""
    return ncgen.simulate(bennett, 0.4, integrator="dop853", rtol=1e-10, atol=1e-11, points=9, zd0={"theta1": 10.0})


def side_and_twist(r, u, k):
    """Length of side k, and the angle about it from the hinge where it begins to the one where it ends."""
    side = r[(k + 1) % 4] - r[k]
    length = np.linalg.norm(side)
    start, end = u[k], u[(k + 1) % 4]
    return length, np.arctan2(np.cross(start, end) @ side / length, start @ end)


@pytest.fixture(scope="module")
def sides():
    hinges = example_module("bennett").hinges(CORNERS)
    return [side_and_twist(CORNERS, hinges, k) for k in range(4)]


def test_sides_and_twists_are_those_of_a_bennett_linkage(sides):
    assert np.allclose(sides[0], sides[2]) and np.allclose(sides[1], sides[3])
    ratios = [length / np.sin(twist) for length, twist in sides]
    assert np.allclose(ratios, ratios[0], rtol=1e-14)


def test_one_degree_of_freedom_where_the_count_says_minus_two(bennett):
    found = ncgen.freedom(bennett)
    assert bennett.n - bennett.m == -2
    assert (found.dof, len(found.redundant)) == (1, 3)
    assert not found.is_singular


def test_a_misplaced_corner_locks_it():
    crooked = example_module("bennett").build(misplaced=0.001)
    found = ncgen.freedom(ncgen.compile(crooked, backend="numpy"))
    assert (found.dof, len(found.redundant)) == (0, 2)


def test_it_closes_from_a_perturbed_start(bennett):
    noise = 0.01 * bennett.length * np.random.default_rng(0).standard_normal(bennett.n)
    q = ncgen.assemble(bennett, bennett.q0 + noise)
    assert residual(bennett, q) < 1e-11
    assert np.max(np.abs(q - bennett.q0)) < 0.05


def test_it_turns_all_the_way_round_as_the_closed_form_says(bennett, sides):
    start = bennett.q0[bennett.index["theta1"]]
    path = sweep(bennett, "theta1", start + np.linspace(0, 2 * np.pi, 32)[1:])
    one, two = (path[:, bennett.index[name]] for name in ("theta1", "theta2"))
    assert np.allclose(np.tan(one / 2) * np.tan(two / 2), product(sides), rtol=1e-11)
    assert abs(abs(two[-1] - bennett.q0[bennett.index["theta2"]]) - 2 * np.pi) < 1e-11


def test_energy(turn):
    assert turn.energy_drift < 1e-8
    assert np.max(turn.violation()) < 1e-11


def test_speed_and_time_follow_from_the_energy(turn, sides):
    """With the closed form, energy alone gives the speed at every angle, and its integral the time."""
    angle = turn["theta1"]
    hinges = example_module("bennett").hinges(CORNERS)
    total = 0.5 * inertia(angle[0], hinges, sides) * 10.0**2 + potential(angle[0], hinges, sides)

    def speed(theta):
        return np.sqrt(2 * (total - potential(theta, hinges, sides)) / inertia(theta, hinges, sides))

    assert np.allclose(turn["rate(theta1)"], [speed(theta) for theta in angle], rtol=1e-9)
    time = quad(lambda theta: 1 / speed(theta), angle[0], angle[-1], epsabs=1e-12, epsrel=1e-12)[0]
    assert abs(time - turn.t[-1]) < 1e-10


def product(sides):
    """tan(theta1/2) tan(theta2/2) of Bennett's linkage."""
    (_, alpha), (_, beta) = sides[:2]
    return np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)


def turned(vector, axis, angle):
    return np.cos(angle) * vector + np.sin(angle) * np.cross(axis, vector)  # the axis is perpendicular to the vector


def moving_corners(theta, hinges, sides):
    """C and D by the closed form; theta may be complex."""
    A, B = CORNERS[:2]
    along = (B - A) / sides[0][0] * sides[1][0]
    other = 2 * np.arctan(product(sides) / np.tan(theta / 2))
    return B + turned(along, hinges[1], other), A - turned(along, hinges[0], -theta)


def inertia(theta, hinges, sides):
    """Twice the kinetic energy (of three thin bars of 1 kg) at unit speed of theta1."""
    step = 1e-30
    c, d = (r.imag / step for r in moving_corners(theta + 1j * step, hinges, sides))
    return (c @ c + (c @ c + c @ d + d @ d) + d @ d) / 3


def potential(theta, hinges, sides):
    C, D = moving_corners(theta, hinges, sides)
    return 9.81 * (C[2] + D[2])  # up to a constant: each bar has half its weight at either end
