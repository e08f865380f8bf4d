"""A driven crank, ψ = ω t + a sin b t: no freedom is left, and the drive's torque is known from the one-angle formulation."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy
from fourbar_loop import B0, C0, COUPLER, CRANK, ROCKER, A, D
from robot_motions import TIGHT
from scipy.integrate import quad

import ncgen
from ncgen import Model
from ncgen.errors import ModelError

SPEED, SWING, PACE = 9.0, 0.4, 5.0


def law(t):
    """ψ, ψ̇ and ψ̈ of the drive."""
    wave = PACE * t
    return (
        SPEED * t + SWING * np.sin(wave),
        SPEED + SWING * PACE * np.cos(wave),
        -SWING * PACE**2 * np.sin(wave),
    )


def model(drive):
    """The four-bar of the examples, said again, with a drive on its crank."""
    m = Model("driven")
    a, b = m.point("A", A, fixed=True), m.point("B", B0)
    c, d = m.point("C", C0), m.point("D", D, fixed=True)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    for name, start, end, mass in [("crank", a, b, CRANK), ("coupler", b, c, COUPLER), ("rocker", c, d, ROCKER)]:
        length = np.linalg.norm(start.initial - end.initial)
        m.distance(start, end, owner=m.body(name, [start, end], mass=mass, inertia=mass * length**2 / 12))
    drive(m, m.angle("psi", x, b - a, z))
    m.gravity((0, -9.81, 0))
    return m


@pytest.fixture(scope="module")
def kernels():
    def drive(m, psi):
        m.drive(psi, SPEED * m.time + SWING * sympy.sin(PACE * m.time))

    return ncgen.compile(model(drive), backend="c")


@pytest.fixture(scope="module")
def run(kernels):
    return ncgen.simulate(kernels, 1.0, integrator="dop853", points=101, **TIGHT)


def test_nothing_is_free(kernels, run):
    assert run.independent == ()
    assert run.q[:, kernels.index["psi"]] == pytest.approx(law(run.t)[0], abs=1e-11)


@pytest.mark.parametrize("formalism", ["lagrange", "null-space"])
def test_steps_of_radau_end_on_rows_of_their_time(kernels, formalism):
    """Every step is projected at the time at which it ends: the crank is where the law has it, and nothing else is."""
    run = ncgen.simulate(kernels, 0.5, formalism=formalism, integrator="radau", engine="c", points=6, rtol=1e-7, atol=1e-8)
    assert run.q[:, kernels.index["psi"]] == pytest.approx(law(run.t)[0], abs=1e-10)
    assert np.max(run.violation()) < 1e-10
    assert run.statistics.largest_projection < 1e-4


def test_nu_and_gamma(kernels):
    """ν = −Φ_t is the law's rate, γ its second; all other rows do not know of time."""
    rng = np.random.default_rng(1)
    (row,) = [i for i, r in enumerate(kernels.rows) if r.owner.kind == "driver"]
    for t in (0.0, 0.3, 2.7):
        q, qd = rng.normal(size=(2, kernels.n))
        _, rate, acceleration = law(t)
        nu, gamma = kernels.nu(q, t), kernels.gamma(q, qd, t)
        assert nu[row] == pytest.approx(rate, rel=1e-15)
        assert gamma[row] == pytest.approx(acceleration, rel=1e-15, abs=1e-15)
        assert np.array_equal(np.delete(nu, row), np.zeros(kernels.m - 1))


def test_positions_of_the_loop(kernels, run, loop):
    for t, q in zip(run.t, run.q, strict=True):
        assert q[:4] == pytest.approx(loop.places(law(t)[0]).ravel(), abs=1e-11)


def test_velocities_by_differences(run):
    """Fourth-order differences of the positions, 10 ms apart; and of the velocities for the accelerations."""
    h = run.t[1]
    for values, rates in ((run.q, run.qd), (run.qd, run.qdd)):
        found = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * h)
        assert rates[2:-2] == pytest.approx(found, abs=2e-3 * np.max(np.abs(rates)))


def test_accelerations_of_the_loop(run, loop):
    for t, qdd in zip(run.t, run.qdd, strict=True):
        expected = loop.accelerations(*law(t)).ravel()
        assert qdd[:4] == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


def test_torque_of_the_drive(kernels, run, loop):
    """Less the driver's multiplier is the torque J θ̈ + ½ J′ θ̇² + V′."""
    (row,) = [i for i, r in enumerate(kernels.rows) if r.owner.kind == "driver"]
    expected = np.array([loop.torque(*law(t)) for t in run.t])
    assert -run.lam[:, row] == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


def test_the_drive_has_a_name(kernels, run, fourbar, loop):
    """The couple that the drive puts in, by the coordinate it turns: of the one-angle formulation, and what a motor on the same
    mechanism without a drive would need for the same motion."""
    ((name, couple),) = run.driver_forces().items()
    expected = np.array([loop.torque(*law(t)) for t in run.t])
    assert name == "psi" and couple == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))
    assert run.coordinates == fourbar.coordinates
    motor = ncgen.inverse_dynamics(replace(run, kernels=fourbar), motors="psi")
    assert motor["psi"] == pytest.approx(couple, abs=1e-9 * np.max(np.abs(expected)))


def test_no_motor_where_everything_is_driven(run):
    """Nothing in silence: the driver's own force is what was looked for."""
    where = "psi is driven, and run.driver_forces() has what that takes"
    with pytest.raises(ModelError, match=re.escape(f"driven: no degree of freedom is left for a motor; {where}")):
        ncgen.inverse_dynamics(run)
    with pytest.raises(ModelError, match=re.escape(f"driven: 1 motor for 0 degrees of freedom; {where}")):
        ncgen.inverse_dynamics(run, motors="psi")
    with pytest.raises(ModelError, match=r"^motors: the mechanism has no free coordinate psy; it has B.x"):
        ncgen.inverse_dynamics(run, motors="psy")


def test_motors_are_asked_by_name(turning):
    found = ncgen.inverse_dynamics(turning)
    assert np.max(np.abs(found["psi"])) < 1e-9 and turning.driver_forces() == {}
    with pytest.raises(ModelError, match="^there is no motor on B.x; there are motors on psi$"):
        found["B.x"]


def lifted(second):
    """A mass of 2 kg that a drive lifts with 3 m/s², twice if told so: by its coordinate, and by its distance from above."""
    m = Model("lift")
    P, top = m.point("P", (0, 0, 0), fixed="xy"), m.point("top", (0, 0, 5), fixed=True)
    m.body("cabin", [P], mass=2.0)
    rope = m.length("rope", P, top)
    m.gravity((0, 0, -9.81))
    m.drive(P.z, 1.5 * m.time**2)
    if second:
        m.drive(rope, 5 - 1.5 * m.time**2)
    return ncgen.simulate(ncgen.compile(m, "numpy"), 0.5, points=3, **TIGHT)


def test_a_driver_of_a_point_has_a_force():
    """m (g + a) upwards, from rest on."""
    forces = lifted(second=False).driver_forces()
    assert list(forces) == ["P.z"] and forces["P.z"] == pytest.approx(2 * (9.81 + 3.0), abs=1e-9)


def test_drivers_that_share_are_named():
    """Upwards along z, and the rope gets shorter: together they carry the cabin, each its share nobody knows."""
    run = lifted(second=True)
    with pytest.warns(
        UserWarning,
        match="lift: the driver of .* does what other constraints do as well; how the load is divided between them is arbitrary",
    ):
        forces = run.driver_forces()
    assert forces["P.z"] - forces["rope"] == pytest.approx(2 * (9.81 + 3.0), abs=1e-9)


def test_work_of_the_drive(run, loop):
    """∫ τ ψ̇ dt by quadrature, the change of T + V by the loop, and the run's own balance."""

    def power(t):
        angle, rate, acceleration = law(t)
        return loop.torque(angle, rate, acceleration) * rate

    energy = np.array([loop.energy(*law(t)[:2]) for t in run.t])
    assert run.energy()[:, :2].sum(axis=1) == pytest.approx(energy, abs=1e-10)
    assert run.work == pytest.approx(energy - energy[0], abs=1e-8)
    assert run.work[50] == pytest.approx(quad(power, 0.0, run.t[50], epsabs=1e-10, limit=200)[0], abs=1e-8)
    assert run.energy_drift <= 1e-8
    assert np.max(run.violation()) <= 1e-11


def test_a_driver_beside_a_freedom():
    """A bead on a line that is driven sideways: x follows the law, y falls freely; the drive works for both."""
    m = Model("bead")
    P = m.point("P", (0, 0))
    m.body("bead", [P], mass=2.0)
    m.gravity((0, -9.81, 0))
    m.drive(P.x, 0.5 * m.time**2)
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 2.0, zd0={"P.y": 3.0}, points=5, **TIGHT)
    t = run.t
    assert run.independent == ("P.y",)
    assert run.q == pytest.approx(np.stack([t**2 / 2, 3 * t - 9.81 / 2 * t**2], axis=1), abs=1e-9)
    assert run.qd == pytest.approx(np.stack([t, 3 - 9.81 * t], axis=1), abs=1e-9)
    assert run.lam[:, 0] == pytest.approx(-2.0 * np.ones(5), abs=1e-12)
    assert run.work == pytest.approx(t**2, abs=1e-9)


def test_a_start_at_another_time(kernels, loop):
    """The law at t₀ decides where the crank must be; a start from elsewhere is assembled there, and that is said."""
    t0 = 0.25
    angle, rate, _ = law(t0)
    q = np.array([*loop.places(angle).ravel(), angle])
    run = ncgen.simulate(kernels, 0.1, q0=q, t0=t0, points=3, **TIGHT)
    assert run.t == pytest.approx([0.25, 0.3, 0.35])
    assert run["rate(psi)"][0] == pytest.approx(rate, rel=1e-12)
    assert run["psi"][-1] == pytest.approx(law(0.35)[0], abs=1e-11)
    with pytest.warns(UserWarning, match="has been assembled"):
        moved = ncgen.simulate(kernels, 0.1, t0=t0, points=2)
    assert moved["psi"][0] == pytest.approx(angle, abs=1e-11)


def test_a_driven_coordinate_is_not_free(kernels):
    with pytest.raises(ModelError, match="psi: it is not independent"):
        ncgen.simulate(kernels, 0.1, zd0={"psi": 1.0})


def test_a_velocity_row_that_contradicts_a_driver_is_told():
    """The driver begins to move x at t = 0 s, where the velocity row that forbids it is not broken yet."""
    model = ncgen.Model("slider")
    point = model.point("A", (1.0, 0.0), fixed="y")
    model.body("block", points=[point], mass=1.0)
    model.drive(point.x, 1 + 0.1 * model.time**2)
    model.constrain_velocity(point.x.rate * sympy.cos(point.x.symbol))
    with pytest.warns(UserWarning, match="no velocities satisfy all rows: .* is off by .* a second, so a driver or a velocity row"):
        ncgen.simulate(ncgen.compile(model, backend="numpy"), 1e-4)


def test_a_driver_that_comes_to_rest_contradicts_nothing():
    """At the end of a path from rest to rest velocities are rounding, and so is what rows are off by."""
    model = ncgen.load("robot")
    start = ncgen.compile(model, backend="numpy")
    path = 10 * model.time**3 - 15 * model.time**4 + 6 * model.time**5
    for psi, change in {"psi1": 0.6, "psi2": 0.3, "psi3": -0.4, "psi4": 0.5, "psi5": 0.4, "psi6": -0.8}.items():
        model.drive(model.elements[psi], float(start.q0[start.index[psi]]) + change * path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ncgen.simulate(ncgen.compile(model), 1.0, points=3)
