"""Rolling in C: the reference's motions, changes of coordinates that turn with the wheel, and a bicycle."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.solver.runs.start import given_velocity

G = 9.81


@cache
def disc():
    return ncgen.compile(ncgen.load("disc"), backend="c")


def roll(duration, **options):
    return ncgen.simulate(disc(), duration, zd0=disc().model.simulation_options["zd0"], **options)


def test_both_engines_step_alike():
    c, python = (
        roll(0.05, formalism="coordinate-partitioning", integrator="rk4", max_step=2.5e-3, points=6, engine=engine)
        for engine in ("c", "python")
    )
    assert c.engine == "c" and python.engine.startswith("python")
    assert c.q == pytest.approx(python.q, abs=1e-12)
    assert c.qd == pytest.approx(python.qd, abs=1e-11)


@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "radau"])
def test_the_default_is_in_c_and_changes_its_coordinates(integrator):
    """Three seconds: five turns of the disc, of which no coordinate is good all the way. Against all coordinates in another formalism."""
    run = roll(3.0, formalism="coordinate-partitioning", integrator=integrator, rtol=1e-9, atol=1e-11, points=31)
    known = roll(3.0, integrator="dop853", rtol=1e-12, atol=1e-13, points=31, formalism="lagrange", engine="c")
    assert run.engine == known.engine == "c"
    assert run.statistics.partition_changes > 5
    assert run.q == pytest.approx(known.q, abs=1e-6)
    assert run.energy_drift < 1e-7
    assert np.max(run.violation()) < 1e-12
    # The rows of rolling are kept as well: Φ_q q̇ = 0 for all of them.
    assert max(np.max(np.abs(disc().jacobian(q) @ qd)) for q, qd in zip(run.q, run.qd, strict=True)) < 1e-12


def test_single_precision():
    run, known = (roll(0.5, integrator="dop853", points=6, number=n) for n in ("float", "double"))
    assert run.q == pytest.approx(known.q, abs=1e-3)


def test_a_stop_and_what_is_not_written_out():
    run = roll(3.0, stop={"C.x": 0.5})
    assert run.stopped and run["C.x"][-1] == pytest.approx(0.5, abs=1e-12)
    with pytest.raises(
        ModelError, match="disc cannot be simulated in C: a state derivative is emitted for one choice of independent coordinates"
    ):
        roll(0.1, engine="emitted")
    with pytest.raises(ModelError, match="disc cannot be simulated in a batch: a state derivative is emitted for one choice"):
        ncgen.simulate(disc(), 0.1, zd0=np.zeros((2, 3)))


TILT, BASE, TRAIL, REAR, FRONT = np.pi / 10, 1.02, 0.08, 0.3, 0.35
"""The benchmark bicycle of Meijaard, Papadopoulos, Ruina, Schwab, Proc. R. Soc. A 463 (2007), doi 10.1098/rspa.2007.1857."""


def tensor(xx, yy, zz, xz):
    """With z upwards the product of inertia has the other sign than in the paper."""
    return np.array([[xx, 0, -xz], [0, yy, 0], [-xz, 0, zz]])


@cache
def bicycle():
    model = ncgen.Model("bicycle")
    steering = np.array([-np.sin(TILT), 0, np.cos(TILT)])
    rear, front = model.point("R", (0, 0, REAR)), model.point("F", (BASE, 0, FRONT))
    head = model.point("S", np.array([BASE + TRAIL, 0, 0]) + 0.9 * steering)
    e, u, g = model.vector("e", steering), model.vector("u", (0, 1, 0)), model.vector("g", (0, 1, 0))
    a, b = model.vector("a", (1, 0, 0)), model.vector("b", (1, 0, 0))
    model.body("frame", [rear, head], [u, e], mass=85.0, com=(0.3, 0, 0.9), inertia=tensor(9.2, 11.0, 2.8, 2.4))
    model.body("fork", [front, head], [g, e], mass=4.0, com=(0.9, 0, 0.7), inertia=tensor(0.05892, 0.06, 0.00708, -0.00756))
    wheels = [
        model.body("rear", [rear], [u, a], mass=2.0, inertia=np.diag([0.0603, 0.12, 0.0603]), constant_mass=True),
        model.body("front", [front], [g, b], mass=3.0, inertia=np.diag([0.1405, 0.28, 0.1405]), constant_mass=True),
    ]
    model.rolling(wheels[0], rear, u, a, REAR)
    model.rolling(wheels[1], front, g, b, FRONT)
    model.gravity((0, 0, -G))
    return ncgen.compile(model, backend="c")


def straight(speed):
    """Velocities by name, of all but what ncgen has added to the wheels."""
    rates = {"R.x": speed, "F.x": speed, "S.x": speed, "a.z": -speed / REAR, "b.z": -speed / FRONT}
    names = [name for name in bicycle().coordinates if "aux" not in name]
    return {name: rates.get(name, 0.0) for name in names}


def test_a_bicycle_rights_itself():
    """Ten seconds at 5 m/s, where it is stable: a push to its side dies out, and it rolls on at the speed its energy tells."""
    kernels = bicycle()
    assert ncgen.freedom(kernels).dof == 3 and kernels.n - len(kernels.holonomic) == 7
    qd0 = {name: rate for name, rate in straight(5.0).items() if rate} | {"u.z": 0.1, "g.z": 0.1}
    run = ncgen.simulate(kernels, 10.0, qd0=qd0, integrator="dop853", points=101)
    assert run.engine == "emitted"
    assert run.energy_drift < 1e-4
    assert np.max(run.violation()) < 1e-12
    lean = np.abs(run["u.z"])
    assert np.max(lean[:20]) > 5e-3
    assert lean[-1] < 1e-3 and np.abs(run["g.z"][-1]) < 1e-3
    known = ncgen.simulate(
        kernels, 10.0, qd0=qd0, integrator="dop853", points=101, formalism="lagrange", rtol=1e-10, atol=1e-12, engine="c"
    )
    assert run.q == pytest.approx(known.q, abs=2e-3)


@pytest.mark.parametrize("z", [(), ("R.x", "u.z", "e.y")], ids=str)
@pytest.mark.parametrize("speed", [0.5, 3.0, 5.0, 8.0])
def test_eigenvalues_of_a_bicycle(speed, z):
    """M λ² + v C₁ λ + g K₀ + v² K₂ of the paper, to the digits of its coefficients."""
    mass = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
    weight = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
    centrifugal = np.array([[0, 76.59734589573222], [0, 2.65431523794604]])
    damping = np.array([[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
    top = np.hstack([np.zeros((2, 2)), np.eye(2)])
    bottom = -np.linalg.solve(mass, np.hstack([G * weight + speed**2 * centrifugal, speed * damping]))
    known = np.linalg.eigvals(np.vstack([top, bottom]))
    kernels = bicycle()
    small = ncgen.linearise(kernels, qd0=given_velocity(kernels, straight(speed), kernels.q0, 0.0, kernels.p0), z=z)
    assert small.steady
    assert small.stable == (speed == 5.0)  # between 4.292 and 6.024 m/s
    found = small.eigenvalues
    for root in known:
        assert np.min(np.abs(found - root)) < 1e-9 * np.max(np.abs(known))
    assert np.sum(np.abs(found) < 1e-5) == len(found) - 4
