"""The double wishbone suspension: counts, camber and toe against a closure in angles, and wheel load by virtual work."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.loads.inverse_dynamics import motor_forces

CAR = example_module("suspension")
PLACES = {name: np.array(xyz) for part in (CAR.UPPER, CAR.LOWER, CAR.UPRIGHT, CAR.CHASSIS) for name, xyz in part.items()}
RACK = np.array(CAR.RACK)
RIDES = [(0.0, 0.0), (0.06, 0.0), (-0.08, 0.0), (0.03, 0.05), (-0.05, -0.06)]
"""How far the wheel is above its drawing, and the rack to the left of it (m)."""


@pytest.fixture(scope="module")
def car():
    return ncgen.compile(CAR.build(), backend="numpy")


def test_freedom(car):
    """Wheel travel and steering."""
    found = ncgen.freedom(car)
    assert (found.dof, len(found.redundant), found.is_singular) == (2, 0, False)


def test_assembles_near_the_drawing(car):
    noise = 0.01 * car.length * np.random.default_rng(6).standard_normal(car.n)
    q = ncgen.assemble(car, car.q0 + noise)
    assert np.max(np.abs(car.phi(q) / car.row_sizes)) < 1e-10
    assert np.max(np.abs(q - car.q0)) < 0.1


def test_energy(car):
    run = ncgen.simulate(car, 0.05, integrator="dop853", rtol=1e-9, atol=1e-11, points=5)
    assert run.energy_drift < 1e-8
    assert np.max(run.violation()) < 1e-10


@pytest.mark.parametrize("ride", RIDES)
def test_camber_and_toe(car, ride):
    q = ridden(car, ride)
    axis = [q[car.index[f"axis.{xyz}"]] for xyz in "xyz"]
    x = closed(ride)
    np.testing.assert_allclose(axis, turn(x[2:]) @ [0, 1, 0], atol=1e-11)
    for name, place in upright(x).items():
        np.testing.assert_allclose([q[car.index[f"{name}.{xyz}"]] for xyz in "xyz"], place, atol=1e-11)


@pytest.mark.parametrize("ride", RIDES)
def test_static_wheel_and_rack_forces(car, ride):
    """At rest the ground carries ∂V/∂z of the wheel, the rack ∂V/∂y, over the closure in angles."""
    q = ridden(car, ride)
    missing, _ = motor_forces(car, ["W.z", "R.y"], 0.0, q, np.zeros(car.n), np.zeros(car.n))
    applied = np.array([CAR.LOAD - CAR.TYRE * ride[0], -CAR.RACK_STIFFNESS * ride[1]])
    x = closed(ride)
    change = -np.linalg.solve(gradient(lambda x: closure(x, ride), x), gradient(lambda ride: closure(x, ride), ride))
    np.testing.assert_allclose(missing + applied, gradient(potential, x) @ change, rtol=1e-9, atol=1e-6)


def ridden(car, ride):
    targets = {"W.z": PLACES["W"][2] + ride[0], "R.y": RACK[1] + ride[1]}
    return ncgen.move(car, car.q0, targets, steps=4).q


# -- the same suspension in angles: of the lower and the upper arm, and Rodrigues' parameters of the upright


def closed(ride):
    """Newton's method from the drawing; derivatives by a complex step."""
    x = np.zeros(5)
    for _ in range(20):
        x = x - np.linalg.solve(gradient(lambda x: closure(x, ride), x), closure(x, ride))
    return x


def closure(x, ride):
    """Wheel height, the three of the upper joint, and the tie rod's length; zero where all is closed."""
    points, (lift, rack) = upright(x), ride
    rod = points["T"] - RACK - rack * np.array([0, 1, 0])
    start = PLACES["T"] - RACK
    gap = points["U"] - swung("UF", "UB", PLACES["U"], x[1])
    return np.array([points["W"][2] - PLACES["W"][2] - lift, *gap, rod @ rod - start @ start])


def upright(x):
    corner, rotation = swung("LF", "LB", PLACES["L"], x[0]), turn(x[2:])
    return {name: corner + rotation @ (PLACES[name] - PLACES["L"]) for name in "LUTW"}


def potential(x, gravity=9.81):
    """J, of the spring and the weights."""
    spring = PLACES["C"] - swung("LF", "LB", PLACES["S"], x[0])
    energy = CAR.SPRING / 2 * (np.sqrt(spring @ spring) - CAR.FREE_LENGTH) ** 2
    corner, rotation = swung("LF", "LB", PLACES["L"], x[0]), turn(x[2:])
    for name, (mass, com, _) in CAR.BODIES.items():
        if name in ("lower", "upper"):
            centre = swung("LF", "LB", com, x[0]) if name == "lower" else swung("UF", "UB", com, x[1])
        else:
            centre = corner + rotation @ (com - PLACES["L"])
        energy = energy + mass * gravity * centre[2]
    return energy


def swung(front, back, place, angle):
    """A point of a wishbone after it turned about its two joints on the chassis."""
    axis = PLACES[front] - PLACES[back]
    axis = axis / np.linalg.norm(axis)
    arm = np.array(place) - PLACES[back]
    along = (arm @ axis) * axis
    return PLACES[back] + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)


def turn(c):
    """The rotation of Rodrigues' parameters c = e tan(φ/2)."""
    cross = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
    return ((1 - c @ c) * np.eye(3) + 2 * np.outer(c, c) + 2 * cross) / (1 + c @ c)


def gradient(function, x, step=1e-30):
    """∂function/∂x by complex steps: exact to rounding."""
    return np.array([function(np.array(x) + 1j * step * e).imag / step for e in np.eye(len(x))]).T
