"""Methods that discretise the constrained equations: order, what they conserve, what they damp."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import ncgen
from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.methods.table import INTEGRATORS

MOTIONS = {
    "pendulum": (0.5, 0.01),
    "fourbar": (0.1, 0.002),
    "robot": (0.1, 0.01),
    "heavytop": (0.02, 0.0005),
    "bricard": (0.1, 0.005),
    "disc": (0.1, 0.005),
    "flyball": (0.02, 0.001),
}
"""Seconds and step (s): a bar, angles, M(q), a free body, redundant rows, rolling, springs and dampers."""

PAIRS = [(formalism, entry.name) for entry in INTEGRATORS.values() for formalism in entry.steps]
METHODS = pytest.mark.parametrize(("formalism", "integrator"), PAIRS, ids=lambda name: name)


@cache
def kernels_of(name):
    return ncgen.compile(ncgen.load(name), backend="c")


def simulate(name, duration, **options):
    kernels = kernels_of(name)
    given = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    return ncgen.simulate(kernels, duration, **given, **options)


@cache
def exact(name):
    return simulate(name, MOTIONS[name][0], integrator="dop853", rtol=1e-12, atol=1e-13, points=2)


@METHODS
@pytest.mark.parametrize("name", [*list(MOTIONS)[:-1], pytest.param("flyball", marks=pytest.mark.slow)])
def test_order_two(name, formalism, integrator):
    """Half the step, a quarter of the error, in positions and velocities; closed to rounding at every step."""
    duration, step = MOTIONS[name]
    runs = [simulate(name, duration, formalism=formalism, integrator=integrator, max_step=step / k, points=2) for k in (2, 4)]
    for what in ("q", "qd"):
        coarse, fine = (np.max(np.abs((getattr(r, what) - getattr(exact(name), what))[-1])) for r in runs)
        assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)
    assert np.max(runs[-1].violation()) < 1e-14


def test_trapezoidal_rule_has_order_two():
    runs = [simulate("fourbar", 0.1, integrator="trapezoidal", max_step=h, points=2) for h in (1e-3, 5e-4)]
    coarse, fine = (np.max(np.abs(r.q[-1] - exact("fourbar").q[-1])) for r in runs)
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("name", [*MOTIONS, "jansen"])
def test_energy_is_kept_to_rounding(name):
    """By energy-momentum, whatever the step: also with M(q), springs, dampers, rolling and a driver."""
    duration, step = MOTIONS.get(name, (0.2, 0.01))
    run = simulate(name, duration, formalism="lagrange", integrator="energy-momentum", max_step=step, points=round(duration / step) + 1)
    assert run.energy_drift < 1e-11


def test_the_hidden_velocity_violation():
    """Energy-momentum leaves Φ_q q̇ ≠ 0 of the order of h; projecting costs the exactness of the energy."""
    hidden = {}
    for project in (False, True):
        options = dict(max_step=1e-3, points=11, options={"project_velocities": project})
        run = simulate("heavytop", 0.02, formalism="lagrange", integrator="energy-momentum", **options)
        hidden[project] = np.max(np.abs(kernels_of("heavytop").jacobian(run.q[-1]) @ run.qd[-1]))
        assert (run.energy_drift < 1e-12) == (not project)
    assert hidden[True] < 1e-10 < 1e-4 < hidden[False]


def test_rattle_does_not_lose_energy():
    """The energy error swings with the pendulum and is no larger in the last ten periods than in the first."""
    run = simulate("pendulum", 60.0, formalism="lagrange", integrator="rattle", max_step=0.05, points=1201)
    energies = run.energy()
    error = np.abs(energies[:, 0] + energies[:, 1] - energies[0, 0] - energies[0, 1])
    assert np.max(error[-400:]) == pytest.approx(np.max(error[:400]), rel=0.05)
    assert np.max(error) > 1e-4  # the steps are coarse enough to see something


@pytest.fixture(scope="module")
def dumbbell():
    """Two masses on a spinning bar that floats without weight."""
    model = ncgen.Model("dumbbell")
    a, b = model.point("A", (0, 0)), model.point("B", (1, 0))
    model.distance(a, b)
    for point, mass in ((a, 1.0), (b, 3.0)):
        model.body(f"m{point.name}", points=[point], mass=mass)
    return ncgen.compile(model, backend="numpy")


@pytest.mark.parametrize("integrator", ["rattle", "energy-momentum"])
def test_momenta_are_kept_to_rounding(dumbbell, integrator):
    qd0 = [0.5, -1.0, 0.5, 2.0]
    run = ncgen.simulate(dumbbell, 5.0, qd0=qd0, formalism="lagrange", integrator=integrator, max_step=0.05, points=101)
    mass = np.array([1.0, 1.0, 3.0, 3.0])
    momentum = mass * run.qd
    assert momentum[:, :2] + momentum[:, 2:] == pytest.approx(np.tile([2.0, 5.0], (101, 1)), abs=1e-12)
    q = run.q
    spin = q[:, 0] * momentum[:, 1] - q[:, 1] * momentum[:, 0] + q[:, 2] * momentum[:, 3] - q[:, 3] * momentum[:, 2]
    assert spin == pytest.approx(np.full(101, 6.0), abs=1e-11)


def chung_hulbert(frequency, step, start, count, alpha_m, alpha_f):
    """An oscillator by the generalised-α method as published for structures (J. Appl. Mech. 60, 1993): displacements."""
    gamma = 0.5 - alpha_m + alpha_f
    beta = (1 - alpha_m + alpha_f) ** 2 / 4
    d, v, a = start, 0.0, -(frequency**2) * start
    path = [d]
    for _ in range(count):
        ahead = d + step * v + step**2 * (0.5 - beta) * a
        left = (1 - alpha_m) + frequency**2 * (1 - alpha_f) * beta * step**2
        new = -(alpha_m * a + frequency**2 * ((1 - alpha_f) * ahead + alpha_f * d)) / left
        d, v, a = ahead + beta * step**2 * new, v + step * ((1 - gamma) * a + gamma * new), new
        path.append(d)
    return np.array(path)


@pytest.mark.parametrize("frequency", [10.0, 1000.0, 10000.0])
@pytest.mark.parametrize(
    ("options", "alpha_m", "alpha_f"), [({"rho": 0.5}, 0, 1 / 3), ({"rho": 0.0}, -1, 0), ({"hht": 0.1}, 0, 0.1)], ids=str
)
def test_numerical_damping(options, alpha_m, alpha_f, frequency):
    """An oscillator slower and faster than the steps of 0.01 s is damped as published."""
    model = ncgen.Model("oscillator")
    b = model.point("B", (1, 0))
    model.body("mass", points=[b], mass=1.0)
    model.constrain(b.y)
    model.potential(frequency**2 / 2 * (b.x - 0.9) ** 2)
    kernels = ncgen.compile(model, backend="numpy")
    options = dict(integrator="generalized-alpha", max_step=0.01, points=21, options=options)
    found = ncgen.simulate(kernels, 0.2, formalism="lagrange", **options)["B.x"] - 0.9
    known = chung_hulbert(frequency, 0.01, 0.1, 20, alpha_m, alpha_f)
    assert found == pytest.approx(known, abs=1e-10)


def test_instants_between_steps():
    """The grid does not shape the steps; what is read off between them is closed and as good as the steps."""
    options = dict(formalism="lagrange", integrator="rattle", max_step=0.01)
    on, between = (simulate("pendulum", 0.5, points=n, **options) for n in (51, 38))
    assert between.statistics.steps == on.statistics.steps == 50
    assert between.q[-1] == pytest.approx(on.q[-1], abs=1e-13)
    known = simulate("pendulum", 0.5, integrator="dop853", rtol=1e-11, points=38)
    assert between.q == pytest.approx(known.q, abs=5e-4)
    assert between.qd == pytest.approx(known.qd, abs=5e-3)
    assert np.max(between.violation()) <= 1e-12


REFUSED = [
    ({"formalism": "lagrange", "integrator": "rattle"}, "max_step: rattle has a fixed step; give its length in seconds"),
    (
        {"formalism": "coordinate-partitioning", "integrator": "rattle"},
        "rattle does not go with coordinate-partitioning: .*; rattle goes with lagrange",
    ),
    (
        {"formalism": "ali3p", "integrator": "dopri5"},
        "dopri5 does not go with ali3p: ali3p goes with trapezoidal; dopri5 goes with coordinate-partitioning, ",
    ),
    ({"formalism": "lagrange", "integrator": "generalized-alpha", "max_step": 0.01, "options": {"rho": 1.5}}, "option rho: 1.5 given"),
    ({"formalism": "lagrange", "integrator": "generalized-alpha", "max_step": 0.01, "options": {"hht": 0.5}}, "option hht: 0.5 given"),
    (
        {"formalism": "lagrange", "integrator": "rattle", "max_step": 0.01, "options": {"rho": 1.0}},
        "lagrange with rattle has no such option",
    ),
]


@pytest.mark.parametrize(("options", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refused(options, message):
    with pytest.raises(ModelError, match=message):
        simulate("pendulum", 0.1, **options)


@pytest.mark.parametrize("integrator", ["rattle", "energy-momentum"])
def test_steps_too_long_end_in_a_message(integrator):
    """Ten revolutions in a step cannot be solved; that is said, with the time."""
    with pytest.raises(
        ConvergenceError, match="fourbar: the step of 5 s from t = 0 s does not converge; take smaller steps \\(max_step\\)"
    ):
        simulate("fourbar", 10.0, formalism="lagrange", integrator=integrator, max_step=5.0, points=3)


@METHODS
def test_a_motion_that_nothing_resists_is_refused_by_name(formalism, integrator):
    model = ncgen.Model("rod")
    model.distance(model.point("A", (0, 0), fixed=True), model.point("B", (1, 0)))
    model.gravity((0, -9.81))
    with pytest.raises(SingularError, match="rod: a motion of the mechanism has no inertia: B.y can move"):
        ncgen.simulate(ncgen.compile(model, "c"), 0.1, formalism=formalism, integrator=integrator, max_step=0.01, qd0=[0.0, 1.0])


@METHODS
def test_the_reference_in_python_has_none_of_them(formalism, integrator):
    with pytest.raises(ModelError, match=f"pendulum: {formalism} with {integrator} is in C only; use engine='auto'"):
        simulate("pendulum", 0.1, formalism=formalism, integrator=integrator, max_step=0.01, engine="python")


def test_without_a_compiler_they_are_refused(monkeypatch):
    from ncgen.mechanism import runtime_library

    monkeypatch.setattr(runtime_library, "has_runtime", lambda part: False)
    kernels = ncgen.compile(ncgen.load("pendulum"), "numpy")
    words = (
        "pendulum: lagrange with rattle is in C only, and the kernels are numpy, not compiled; install gcc or clang, or take the integrator"
    )
    with pytest.raises(ModelError, match=words):
        ncgen.simulate(kernels, 0.1, integrator="rattle", max_step=0.01)
    assert ncgen.simulate(kernels, 0.1, points=2).engine.startswith("python")


def test_a_mechanism_without_mass_at_rest_stays_where_it_is():
    """A point on a rod, without mass: multipliers are rounding, and so is all that resists, which must not make the penalty small."""
    model = ncgen.Model("rod")
    end = model.point("B", (-0.22, 0.59), fixed="x")
    model.distance(model.point("A", (-0.76, -0.46), fixed=True), end)
    kernels = ncgen.compile(model, backend="c")
    run = ncgen.simulate(kernels, 0.05, formalism="ali3p", integrator="trapezoidal", max_step=0.00625)
    np.testing.assert_allclose(run.q[:, 0], 0.59, rtol=1e-14)


@pytest.mark.parametrize("integrator", ["energy-momentum", "rattle"])
def test_a_force_that_grows_with_time_is_integrated_exactly(integrator):
    """By the middle of a step, or by both of its ends: pushes of 6 t and 4 − 12 t on 2 kg give the velocity 3 t²/2 and 2 t − 3 t²."""
    model = ncgen.Model("pushed")
    ball = model.point("ball", (0, 0, 0))
    model.body("body", [ball], mass=2.0)
    model.force(ball, (6 * model.time, 4 - 12 * model.time, 0))
    model.distance(model.point("O", (0, 2, 0), fixed=True), model.point("P", (0, 1, 0)))
    model.body("other", [model.elements["P"]], mass=1.0)
    run = ncgen.simulate(ncgen.compile(model, "c"), 0.5, integrator=integrator, max_step=0.05, points=6)
    assert run["rate(ball.x)"] == pytest.approx(1.5 * run.t**2, abs=1e-13)
    assert run["rate(ball.y)"] == pytest.approx(2 * run.t - 3 * run.t**2, abs=1e-13)
