"""Panel deployment: counts, conserved momentum, and a motion against Lagrange's equations in the hub's place and two angles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.exchange.examples import example_module

PANELS = example_module("panels")
ACCURATE = dict(integrator="dop853", rtol=1e-9, atol=1e-11)


@pytest.fixture(scope="module")
def satellite():
    return ncgen.compile(PANELS.build(), backend="numpy")


@pytest.fixture(scope="module")
def run(satellite):
    return ncgen.simulate(satellite, 7.0, points=15, **ACCURATE)


@pytest.mark.parametrize(("panels", "free", "dof"), [(3, True, 4), (3, False, 1), (1, True, 4), (6, False, 1)])
def test_freedom(panels, free, dof):
    """One for all hinges together, and three for a hub that is free in the plane."""
    found = ncgen.freedom(ncgen.compile(PANELS.build(panels, free), backend="numpy"))
    assert (found.dof, len(found.redundant), found.is_singular) == (dof, 0, False)


def test_assembles_near_the_drawing(satellite):
    noise = 0.01 * np.random.default_rng(5).standard_normal(satellite.n)
    q = ncgen.assemble(satellite, satellite.q0 + noise)
    assert np.max(np.abs(satellite.phi(q) / satellite.row_sizes)) < 1e-10
    assert np.max(np.abs(q - satellite.q0)) < 0.1


def test_energy_and_momentum(run):
    assert run.energy_drift < 1e-8
    centre, momentum = balance(run)
    np.testing.assert_allclose(centre, np.broadcast_to(centre[0], centre.shape), atol=1e-8)
    np.testing.assert_allclose(momentum, 0.0, atol=1e-6)


def test_motion(run):
    states = lagrange(run.t)
    psi, turn = states[:, 3], states[:, 2]
    np.testing.assert_allclose(run["psi0"], psi, atol=1e-7)
    np.testing.assert_allclose(run["psi3"], -2 * psi, atol=2e-7)
    hub = run.point("A") - run.point("H")
    np.testing.assert_allclose(np.arctan2(hub[:, 1], hub[:, 0]), turn, atol=1e-8)
    np.testing.assert_allclose(run.point("H")[:, :2], states[:, :2], atol=1e-7)


def test_held_hub():
    """Without the hub's motion: one equation in the yoke's angle."""
    held = ncgen.simulate(ncgen.compile(PANELS.build(free=False), backend="numpy"), 7.0, points=8, **ACCURATE)
    np.testing.assert_allclose(held["psi0"], lagrange(held.t, free=False)[:, 3], atol=1e-7)


# -- Lagrange's equations: x and y of the hub, its turn, and the yoke's angle; panels zigzag by ±ψ -------

LEVERS = np.array(
    [  # of the centre of mass, along hub, yoke and panels
        [0, 0, 0, 0, 0],
        [PANELS.HALF, PANELS.YOKE / 2, 0, 0, 0],
        [PANELS.HALF, PANELS.YOKE, PANELS.PANEL / 2, 0, 0],
        [PANELS.HALF, PANELS.YOKE, PANELS.PANEL, PANELS.PANEL / 2, 0],
        [PANELS.HALF, PANELS.YOKE, PANELS.PANEL, PANELS.PANEL, PANELS.PANEL / 2],
    ]
)
TURNING = np.array([[1, 0], [1, 1], [1, -1], [1, 1], [1, -1]])
"""Bodies' angles from the hub's turn and ψ."""

MASSES = np.array([PANELS.HUB_MASS, PANELS.YOKE_MASS, *[PANELS.PANEL_MASS] * 3])
MOMENTS = MASSES * np.array([(2 * PANELS.HALF) ** 2 / 6, PANELS.YOKE**2 / 12, *[PANELS.PANEL**2 / 12] * 3])
HINGES = 1 + 3 * 2**2
"""The springs' share: the first hinge turns by ψ, three by ±2ψ."""


def lagrange(times, free=True):
    """x, y, turn and ψ over time (K, 4), from the folded position at rest; M ÿ = Q with complex numbers for the plane."""
    moving = slice(0, 4) if free else slice(3, 4)

    def derivative(_, state):
        y, rate = state[:4], state[4:]
        along = np.exp(1j * TURNING @ y[2:])
        spin = TURNING @ rate[2:]
        jacobian = np.column_stack([np.ones(5), 1j * np.ones(5), 1j * LEVERS @ (along[:, None] * TURNING)])
        bias = -LEVERS @ (along * spin**2)
        weighted = (MASSES[:, None] * jacobian).conj().T
        matrix = (weighted @ jacobian).real
        matrix[2:, 2:] += TURNING.T @ (MOMENTS[:, None] * TURNING)
        force = -(weighted @ bias).real
        force[3] -= HINGES * (PANELS.STIFFNESS * y[3] + PANELS.DAMPING * rate[3])
        change = np.zeros(4)
        change[moving] = np.linalg.solve(matrix[moving, moving], force[moving])
        return np.concatenate([rate, change])

    start = np.array([0, 0, 0, np.pi / 2, 0, 0, 0, 0])
    return solve_ivp(derivative, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13).y[:4].T


def balance(run):
    """The centre of mass (K, 2) and the angular momentum about the origin (K,), summed over the bodies' middles."""
    model = run.model
    centre, momentum = 0.0, 0.0
    for body, mass, moment in zip(["hub", "yoke", "panel1", "panel2", "panel3"], MASSES, MOMENTS, strict=True):
        start, end = ["H", "H"] if body == "hub" else [p.name for p in model.bodies[body].points]
        place = (run.point(start) + run.point(end)) / 2
        speed = sum(np.stack([run[f"rate({p}.{axis})"] for axis in "xy"], axis=-1) for p in (start, end)) / 2
        spin = run.angular_velocity(body)[:, 2]
        centre = centre + mass * place[:, :2] / MASSES.sum()
        momentum = momentum + mass * (place[:, 0] * speed[:, 1] - place[:, 1] * speed[:, 0]) + moment * spin
    return centre, momentum
