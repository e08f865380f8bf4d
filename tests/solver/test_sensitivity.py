"""Derivatives of motions against complex steps through an independent Runge-Kutta computation on the NumPy kernels."""

from __future__ import annotations

import time

import numpy as np
import pytest
import sympy
from benchmarks import data

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism import taped
from ncgen.methods.table import INTEGRATORS
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.tolerances import Tolerances

STEP = 1e-30
DURATION, STEPS = 0.5, 40


def fourbar() -> Model:
    """A sprung four-bar with masses, whose lengths, stiffness, load and gravity are parameters."""
    model = Model("sprung")
    crank, coupler = model.parameter("crank", 1.0), model.parameter("coupler", 2.2)
    stiff, load, g = model.parameter("k", 30.0), model.parameter("load", 4.0), model.parameter("g", 9.81)
    A, D = model.point("A", (0, 0, 0), fixed=True), model.point("D", (2.5, 0, 0), fixed=True)
    x, z = model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    B = model.point("B", (np.cos(1.1), np.sin(1.1), 0), fixed="z")
    C = model.point("C", closing(B.initial, D.initial, 2.2, 1.7), fixed="z")
    model.distance(A, B, crank)
    model.distance(B, C, coupler)
    model.distance(C, D)
    model.body("joint", points=[B], mass=2.0)
    model.body("weight", points=[C], mass=model.parameter("m", 3.0))
    psi = model.angle("psi", start=x, end=B - A, axis=z)
    model.gravity((0, -g, 0))
    model.spring(B, D, stiffness=stiff, damping=0.3, free_length=1.5)
    model.force(C, (load * sympy.cos(3 * model.time), 0, 0))
    model.torque(psi, -0.2 * psi.rate)
    return model


def closing(b, d, coupler: float, rocker: float):
    """The upper point at these distances from two others."""
    span = d - b
    length = np.linalg.norm(span)
    along = (coupler**2 - rocker**2 + length**2) / (2 * length)
    across = np.sqrt(coupler**2 - along**2)
    unit = span / length
    return b + along * unit + across * np.array([-unit[1], unit[0], 0.0])


def driven() -> Model:
    """A driven crank with a sprung pendulum on it: rows that depend on time, and on the drive's own parameter."""
    model = Model("driven")
    speed, length = model.parameter("speed", 2.0), model.parameter("length", 0.8)
    A = model.point("A", (0, 0, 0), fixed=True)
    x, z = model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    B, C = model.point("B", (1, 0, 0), fixed="z"), model.point("C", (1, -0.8, 0), fixed="z")
    model.distance(A, B)
    model.distance(B, C, length)
    psi = model.angle("psi", start=x, end=B - A, axis=z)
    theta = model.angle("theta", start=B - A, end=C - B, axis=z)
    model.drive(psi, speed * model.time + sympy.sin(3 * model.time) / 5)
    model.body("bob", points=[C], mass=1.5)
    model.torsion_spring(theta, stiffness=5.0, damping=0.1, free_angle=-1.0)
    model.gravity((0, -9.81, 0))
    return model


def linkage() -> Model:
    """A four-bar of three bodies whose lengths, masses, centres and moments of inertia, spring and load are parameters: its motion is
    written out."""
    model = Model("linkage")
    number = model.parameter
    crank, rise = number("crank", 1.0), number("rise", 0.9)
    A, D = model.point("A", (0, 0), fixed=True), model.point("D", (2.5, number("foot", 0.1)), fixed=True)
    x, z = model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    B, C = model.point("B", (crank * sympy.cos(rise), crank * sympy.sin(rise))), model.point("C", (2.3, 1.7))
    model.body("first", points=[A, B], mass=number("m1", 2.0), inertia="point")
    model.body("second", points=[B, C], mass=3.0, com=(number("cx", 1.4), 1.5), inertia=number("J", 0.6))
    model.body("third", points=[C, D], mass=number("m3", 1.5), inertia="point")
    psi = model.angle("psi", start=x, end=B - A, axis=z)
    model.gravity((0, -number("g", 9.81), 0))
    model.spring(B, D, stiffness=number("k", 30.0), damping=0.3, free_length=1.5)
    model.torque(psi, number("load", 4.0) * sympy.cos(3 * model.time) - 0.2 * psi.rate)
    model.independent(psi)
    return model


def mast() -> Model:
    """A spatial pendulum on a driven arm: rows that depend on time and on the drive's own parameter, and bodies of parametric length."""
    model = Model("mast")
    speed, length, reach = model.parameter("speed", 2.0), model.parameter("length", 0.8), model.parameter("reach", 1.0)
    O = model.point("O", (0, 0, 0), fixed=True)
    x, z = model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    u, A = model.vector("u", (0, 1, 0)), model.point("A", (reach, 0, 0.2))
    arm = model.body("arm", [O, A], [u, z], mass=2.0, com=(reach / 2, 0, 0.1), inertia=(0.1, 0.2, 0.2))
    B = model.point("B", (reach, 0.3, 0.2 - length))
    model.body("rod", [A, B], [u], mass=model.parameter("m", 1.2), com=(reach, 0.1, 0.2 - length / 2), inertia=(0.1, 0.1, 0.02))
    turn = model.angle("turn", start=x, end=A - O, axis=z)
    swing = model.angle("swing", start=z, end=B - A, axis=u)
    model.drive(turn, speed * model.time + sympy.sin(3 * model.time) / 5)
    model.torsion_spring(swing, stiffness=5.0, damping=0.1, free_angle=2.5)
    model.gravity((0, 0, -9.81))
    assert arm
    return model


def complex_motion(plain, partition, p, z, zd, method):
    """q and q̇ at every instant, in complex numbers: solve, do not linearise."""
    tableau = INTEGRATORS[method].coefficients
    rows, d, i = partition.rows, partition.dependent, partition.independent
    n, nz, h = plain.n, len(i), DURATION / STEPS
    guess = plain.q0.astype(complex)

    def slope(t, y, q):
        q[i] = y[nz:]
        for _ in range(6):  # from the stage before
            q[d] -= np.linalg.solve(plain.jacobian(q, t, p)[np.ix_(rows, d)], plain.phi(q, t, p)[rows])
        J = plain.jacobian(q, t, p)[rows]
        qd = np.zeros(n, dtype=complex)
        qd[i] = y[:nz]
        qd[d] = np.linalg.solve(J[:, d], plain.nu(q, t, p)[rows] - J[:, i] @ y[:nz])
        M = plain.mass_matrix(q, t, p)
        kkt = np.block([[M, J.T], [J, np.zeros((len(rows), len(rows)))]])
        right = np.concatenate([plain.values("force", t, q, qd, p), plain.values("gamma", t, q, qd, p)[rows]])
        qdd = np.linalg.solve(kkt, right)[:n]
        return np.concatenate([qdd[i], y[:nz]]), qd

    y = np.concatenate([zd, z]).astype(complex)
    history = []
    for k in range(STEPS + 1):
        t = DURATION * k / STEPS
        first, qd = slope(t, y, guess)
        history.append((guess.copy(), qd))
        slopes = [first]
        for node, row in zip(tableau.c[1 : tableau.stages], tableau.a, strict=False):
            at = y + h * sum(float(a) * k for a, k in zip(row, slopes, strict=True))
            slopes.append(slope(t + float(node) * h, at, guess)[0])
        y = y + h * sum(float(b) * k for b, k in zip(tableau.weights, slopes, strict=False))
    return np.array([q for q, _ in history]), np.array([qd for _, qd in history])


START = {"sprung": {"psi": 1.3}, "driven": {"theta": -0.4}, "linkage": {"psi": 0.7}, "mast": {"swing": -0.4}}

METHODS = {fourbar: "rk4", driven: "rk4", linkage: "dop853", mast: "dop853"}
"""The two written out come to the truth of their steps another way than the independent computation, so both are as exact as numbers."""


@pytest.fixture(scope="module", params=METHODS, ids=lambda build: build.__name__)
def case(request):
    """(kernels, initial rates, by: {name: (K, 2, n) derivatives of q and q̇ by complex steps}, the method)."""
    sources, method = ncgen.generate(request.param()), METHODS[request.param]
    kernels, plain = ncgen.compile(sources, backend="c"), ncgen.compile(sources, backend="numpy")
    rates = START[kernels.name]
    z = tuple(rates)
    partition = choose_partitions(kernels, kernels.q0, independent=z).position
    z0, zd0 = kernels.q0[partition.independent], np.array(list(rates.values()))
    columns, follows = {}, kernels.start_p()[partition.independent]
    for name in (*kernels.parameters, *z, *(f"rate({x})" for x in z)):
        p, start, speed = kernels.p0.astype(complex), z0.astype(complex), zd0.astype(complex)
        if name in kernels.parameters:
            p[kernels.parameters.index(name)] += 1j * STEP
            start += 1j * STEP * follows[:, kernels.parameters.index(name)]
        elif name in z:
            start[z.index(name)] += 1j * STEP
        else:
            speed[[f"rate({x})" for x in z].index(name)] += 1j * STEP
        columns[name] = np.array(complex_motion(plain, partition, p, start, speed, method))
    return kernels, rates, columns, method


def test_forward_against_complex_steps(case):
    """Every coordinate and velocity at every instant, by every parameter and initial value, to 1e-10 of the largest."""
    kernels, rates, columns, method = case
    found = ncgen.sensitivities(kernels, DURATION, STEPS, integrator=method, zd0=rates, z=tuple(rates))
    assert found.names == tuple(columns)
    q, qd = next(iter(columns.values())).real
    np.testing.assert_allclose(found.q, q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.qd, qd, rtol=0, atol=1e-11)
    for k, wanted in enumerate(columns.values()):
        by_q, by_qd = wanted.imag / STEP
        assert np.max(np.abs(found.q_by[:, :, k] - by_q)) <= 1e-10 * max(1.0, np.max(np.abs(by_q)))
        assert np.max(np.abs(found.qd_by[:, :, k] - by_qd)) <= 1e-10 * max(1.0, np.max(np.abs(by_qd)))


def weights(kernels):
    rng = np.random.default_rng(2)
    return rng.standard_normal((2, STEPS + 1, kernels.n))


def test_adjoint_against_complex_steps(case):
    """The gradient of a number that sees all instants, to 1e-10."""
    kernels, rates, columns, method = case
    a, b = weights(kernels)
    found = ncgen.gradient(
        kernels, DURATION, STEPS, lambda q, qd: (np.sum(a * q**2 / 2 + b * qd), a * q, b), integrator=method, zd0=rates, z=tuple(rates)
    )
    assert tuple(found.derivatives) == tuple(columns)
    for name, (q, qd) in columns.items():
        wanted = np.sum(a * q.real * q.imag + b * qd.imag) / STEP
        assert abs(found.derivatives[name] - wanted) <= 1e-10 * max(1.0, abs(wanted)), name


def test_many_against_complex_steps(case):
    """The same of one state among others that move otherwise, in lanes where the motion is written out, to 1e-10."""
    kernels, rates, columns, method = case
    a, b = weights(kernels)
    others = {name: rate * np.array([0.5, 1.0, 1.2]) for name, rate in rates.items()}
    found = ncgen.gradient(
        kernels, DURATION, STEPS, lambda q, qd: (np.sum(a * q**2 / 2 + b * qd), a * q, b), integrator=method, zd0=others, z=tuple(rates)
    )
    assert found.names == tuple(columns) and found.ok.all() and found.alone.all() == (method == "rk4")
    q, qd = next(iter(columns.values())).real
    assert found.values[1] == pytest.approx(np.sum(a * q**2 / 2 + b * qd), rel=1e-11)
    for name, (q, qd) in columns.items():
        wanted = np.sum(a * q.real * q.imag + b * qd.imag) / STEP
        assert abs(found.by(name)[1] - wanted) <= 1e-10 * max(1.0, abs(wanted)), name
        assert abs(found.by(name)[0] - wanted) > 1e-6 * abs(wanted), name


@pytest.mark.parametrize("build", [linkage, mast])
def test_what_is_differentiated_in_c_are_the_steps_themselves(build):
    """Coarse steps, whose motion is far from the truth: the derivative is that of the steps, by differences of their own."""
    kernels = ncgen.compile(build())
    rates = START[kernels.name]
    at = {"zd0": rates, "z": tuple(rates), "q0": kernels.q0}
    found = ncgen.sensitivities(kernels, DURATION, 5, **at)
    fine = ncgen.sensitivities(kernels, DURATION, STEPS, **at)
    assert np.max(np.abs(found.q[-1] - fine.q[-1])) > 1e-5
    for k, name in enumerate(kernels.parameters):
        if np.any(kernels.start_p()[:, k]) or name == "foot":
            continue  # the position at the start would have to move, too
        step = 1e-5 * kernels.p0[k]
        ends = [ncgen.sensitivities(kernels, DURATION, 5, **at, p={name: kernels.p0[k] + sign * step}) for sign in (1, -1)]
        assert found.q_by[-1, :, k] == pytest.approx((ends[0].q[-1] - ends[1].q[-1]) / (2 * step), abs=1e-8), name


@pytest.mark.parametrize("name", ["slidercrank3d", "panels"])
def test_both_ways_are_the_same_derivative(name):
    """Forward in lanes against the transposed sweep, by all data of a mechanism, with which its start moves: to rounding."""
    model, _ = data.first_written_out(ncgen.load(name), data.ALL)
    kernels = ncgen.compile(model)
    a, b = weights(kernels)
    forward = ncgen.sensitivities(kernels, DURATION, STEPS)
    back = ncgen.gradient(kernels, DURATION, STEPS, lambda q, qd: (np.sum(a * q + b * qd), a, b))
    wanted = np.einsum("kn,knd->d", a, forward.q_by) + np.einsum("kn,knd->d", b, forward.qd_by)
    np.testing.assert_allclose(list(back.derivatives.values()), wanted, rtol=1e-11, atol=1e-13 * np.max(np.abs(wanted)))  # some are 0


@pytest.mark.parametrize("build", [linkage, mast])
def test_a_long_run_is_taped_in_segments(build, monkeypatch):
    """Of seven steps each, the last one shorter: the motion and its derivatives, both ways, are those of the whole tape."""
    kernels = ncgen.compile(build())
    rates, method = START[kernels.name], METHODS[build]
    at = {"zd0": rates, "z": tuple(rates)}
    a, b = weights(kernels)

    def found():
        forward = ncgen.sensitivities(kernels, DURATION, STEPS, integrator=method, **at)
        back = ncgen.gradient(kernels, DURATION, STEPS, lambda q, qd: (np.sum(a * q + b * qd), a, b), integrator=method, **at)
        return forward, list(back.derivatives.values())

    whole, back = found()
    monkeypatch.setattr(taped, "SEGMENT", 7 * 8 * taped.step_size(method, kernels.n))
    parts, parts_back = found()
    for name in ("q", "qd", "q_by", "qd_by"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.max(np.abs(other)), err_msg=name)
    assert parts_back == pytest.approx(back, rel=1e-11)
    with pytest.raises(ModelError, match=f"^{kernels.name}: {STEPS} steps are too many for second derivatives"):
        ncgen.hessian(kernels, DURATION, STEPS, lambda q, qd: (0.0, a, b, None), integrator=method, **at)


def test_steps_with_error_control(case):
    """Few instants and steps between them by tolerance, for which the tape has to grow: the derivatives of the motion, both ways."""
    kernels, rates, columns, method = case
    at = {"zd0": rates, "z": tuple(rates)}
    if kernels.name == "driven":
        with pytest.raises(ModelError, match="or to one that the emitted order of elimination does not suit.*; .* or take rk4"):
            ncgen.sensitivities(kernels, DURATION, 2, integrator="dopri5", rtol=1e-10, **at)
        return
    found = ncgen.sensitivities(kernels, DURATION, 2, integrator="dopri5", rtol=1e-11, **at)
    error = 1e-4 if method == "rk4" else 1e-8  # of what is wanted: these steps have order four
    for k, wanted in enumerate(columns.values()):
        by_q, by_qd = wanted.imag[:, :: STEPS // 2] / STEP
        assert np.max(np.abs(found.q_by[:, :, k] - by_q)) <= error * max(1.0, np.max(np.abs(by_q)))
        assert np.max(np.abs(found.qd_by[:, :, k] - by_qd)) <= error * max(1.0, np.max(np.abs(by_qd)))
    a, b = (w[:3] for w in weights(kernels))
    back = ncgen.gradient(kernels, DURATION, 2, lambda q, qd: (np.sum(a * q + b * qd), a, b), integrator="dopri5", rtol=1e-11, **at)
    wanted = np.einsum("kn,knd->d", a, found.q_by) + np.einsum("kn,knd->d", b, found.qd_by)
    assert list(back.derivatives.values()) == pytest.approx(wanted, rel=1e-11)
    with pytest.raises(ModelError, match="rtol: rk4 does not estimate its error; leave rtol out, or take .*dopri5"):
        ncgen.gradient(kernels, DURATION, 2, lambda q, qd: (0.0, None, None), rtol=1e-8, **at)


def test_a_tolerance_is_that_of_the_whole_motion(case, monkeypatch):
    """However many instants are looked at."""
    kernels, rates, _, method = case
    asked, promised = [], Tolerances.promised
    monkeypatch.setattr(Tolerances, "promised", lambda *given: asked.append(given) or promised(*given))
    for steps in (1, 3) if method != "rk4" else ():
        ncgen.sensitivities(kernels, DURATION, steps, integrator="dopri5", rtol=1e-6, zd0=rates, z=tuple(rates))
    assert asked == ([] if method == "rk4" else [(1e-6, DURATION)] * 2)


def test_a_singular_position_is_refused():
    """Jansen's linkage stands still where its start is singular but for rounding: the time is said."""
    with pytest.raises(ModelError, match="jansen: the motion is next to a singular position at t = .*; end the motion before"):
        ncgen.gradient(ncgen.compile(ncgen.load("jansen")), 0.2, 100, lambda q, qd: (0.0, None, None), integrator="dop853")


def test_integrators(case):
    kernels, rates, *_ = case
    with pytest.raises(ModelError, match="integrator: 'radau' given; derivatives go through steps of"):
        ncgen.sensitivities(kernels, 0.1, 2, integrator="radau", z=tuple(rates))


def test_a_motion_on_bad_coordinates_is_refused(monkeypatch):
    """Coordinates that cease to determine the motion are named, with the time."""
    kernels, rates = ncgen.compile(fourbar()), START["sprung"]
    monkeypatch.setattr("ncgen.solver.derivatives.partitioned_motion.LEAST_REGULARITY", 10.0)
    with pytest.raises(ModelError, match=rf"{next(iter(rates))} do not determine the motion any more at t = 0 s; choose other"):
        ncgen.sensitivities(kernels, DURATION, STEPS, zd0=rates, z=tuple(rates))


def test_a_motion_that_locks_is_refused():
    """A pendulum whose x is driven comes to its end where x is the length of the rod: the time is said."""
    model = Model("locking")
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (0.6, 0.8))
    model.distance(A, B)
    model.body("bob", points=[B], mass=model.parameter("m", 1.0))
    model.drive(B.x, 0.6 + model.time)
    with pytest.raises(ConvergenceError, match="does not converge at t = 0.4"):
        ncgen.sensitivities(ncgen.compile(model, backend="numpy"), 1.0, 100)


def test_what_has_no_derivative_is_refused(case):
    kernels = case[0]
    with pytest.raises(ModelError, match="zd0: the mechanism has no free coordinate nothing"):
        ncgen.sensitivities(kernels, 1.0, 10, zd0={"nothing": 1.0})
    with pytest.raises(ModelError, match="steps: 0 given; a motion has at least 1"):
        ncgen.gradient(kernels, 1.0, 0, lambda q, qd: (0.0, None, None))


def test_the_adjoint_costs_no_more_for_many_parameters(monkeypatch):
    """The state derivative is evaluated as often as without derivatives: once a stage."""
    kernels = ncgen.compile(fourbar(), backend="c")
    seen = []
    plain = kernels.force
    monkeypatch.setattr(kernels, "force", lambda *a: (seen.append(time.perf_counter()), plain(*a))[1])
    ncgen.gradient(kernels, 0.1, 10, lambda q, qd: (q[-1, 0], None, None), zd0={"psi": 1.0}, z=("psi",))
    assert len(seen) == 4 * 10 + 1
