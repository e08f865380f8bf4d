"""Outputs that mention joint loads and driver forces: closed forms, in runs, steps and state spaces, and where a load is not unique."""

from __future__ import annotations

import csv
import warnings
from typing import Any

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model, ModelError
from ncgen.model.elements import Angle, Point, Vector

MASS, LENGTH, GRAVITY = 2.0, 0.7, 9.81
TIGHT = {"rtol": 1e-11, "points": 21}


def pendulum() -> Model:
    """A point mass on a massless rod, driven by a couple; ψ counts from below."""
    m = Model("pendulum")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -LENGTH))
    y, z = m.vector("y", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", y, A - O, z)
    rod = m.body("rod", [O, A], mass=MASS, com=(0, -LENGTH), inertia="point")
    m.gravity((0, -GRAVITY, 0))
    m.torque(psi, m.input("tau", "N m"))
    pin, _ = rod.wrench(O)
    m.output("pin", sympy.sqrt(pin.x**2 + pin.y**2), "N")
    m.output("along", -(pin.x * A.x + pin.y * A.y) / LENGTH, "N")
    m.output("across", (pin.y * A.x - pin.x * A.y) / LENGTH, "N")
    m.independent(psi)
    return m


def tension(psi, rate):
    """m g cos ψ + m l ω²: what holds the mass on its circle."""
    return MASS * (GRAVITY * np.cos(psi) + LENGTH * rate**2)


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_the_pin_of_a_pendulum(backend):
    """Nothing turns the rod but gravity, so that the pin pulls along it and never across."""
    run = ncgen.simulate(ncgen.compile(pendulum(), backend), 1.5, zd0={"psi": 6.0}, **TIGHT)
    expected = tension(run["psi"], run["rate(psi)"])
    assert np.allclose(run["along"], expected, rtol=0, atol=1e-9)
    assert np.allclose(run["pin"], np.abs(expected), rtol=0, atol=1e-9)
    assert np.allclose(run["across"], 0.0, rtol=0, atol=1e-9)


def test_a_couple_pushes_across():
    """The mass cannot take a couple τ by itself: the rod pushes it with τ/l across, and the pin pushes back."""
    run = ncgen.simulate(ncgen.compile(pendulum(), "numpy"), 0.5, inputs={"tau": lambda t: 3.0 * t}, **TIGHT)
    assert np.allclose(run["along"], tension(run["psi"], run["rate(psi)"]), rtol=0, atol=1e-9)
    assert np.allclose(np.abs(run["across"]), 3.0 * run.t / LENGTH, rtol=0, atol=1e-9)


def test_steps_see_what_runs_see():
    """One motion and three that go on together, at their own speeds and couples."""
    kernels = ncgen.compile(pendulum())
    sim = ncgen.start(kernels, zd0={"psi": 2.0})
    sims = ncgen.start(kernels, 3)
    sims.qd[:] *= 0
    for _ in range(5):
        sim.step(0.02, tau=1.0)
        sims.step(0.02, tau=np.array([0.0, 1.0, 2.0]))
        assert sim["along"] == pytest.approx(tension(sim["psi"], sim["rate(psi)"]), abs=1e-9)
        assert abs(sim.outputs["across"]) == pytest.approx(1.0 / LENGTH, abs=1e-9)
        assert sims["along"] == pytest.approx(tension(sims["psi"], sims["rate(psi)"]), abs=1e-9)
        assert np.abs(sims["across"]) == pytest.approx(np.array([0.0, 1.0, 2.0]) / LENGTH, abs=1e-9)


def test_the_state_space_of_a_pin():
    """Held at ψ₀ by τ = m g l sin ψ₀: the pull along changes by −m g sin ψ₀ with ψ, by nothing with ω; across by 1/l with τ."""
    held, m = 0.4, pendulum()
    tau = MASS * GRAVITY * LENGTH * np.sin(held)
    near = ncgen.linearise(ncgen.compile(m), q0=_position(held), p={"tau": tau})
    assert (near.outputs, near.states) == (("pin", "along", "across"), ("psi", "rate(psi)"))
    assert near.C[1] == pytest.approx([-MASS * GRAVITY * np.sin(held), 0.0], abs=1e-9)
    assert near.C[2] == pytest.approx([0.0, 0.0], abs=1e-9)
    # The pin has m g cos ψ₀ along and τ/l = m g sin ψ₀ across, m g together: 1/l across is sin ψ₀/l of it.
    assert near.D[:, 0] == pytest.approx([np.sin(held) / LENGTH, 0.0, 1 / LENGTH], abs=1e-9)


def _position(psi):
    return {"A.x": LENGTH * np.sin(psi), "A.y": -LENGTH * np.cos(psi), "psi": psi}


SPEED = 4.0


def crank() -> Model:
    """A rod with its mass along it, turned at constant speed in gravity."""
    m = Model("crank")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (LENGTH, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", x, A - O, z)
    rod = m.body("rod", [O, A], mass=MASS, inertia=MASS * LENGTH**2 / 12)
    m.gravity((0, -GRAVITY, 0))
    m.output("couple", psi.driver, "N m")
    m.output("power", psi.driver * psi.rate, "W")
    force, moment = rod.wrench(O)
    m.output("pin.x", force.x, "N")
    m.output("turning", moment.z, "N m")
    m.drive(psi, SPEED * m.time)
    return m


def test_the_driver_of_a_crank(tmp_path):
    """Gravity alone is to be held: m g l/2 cos ψ, which is all that turns the rod about its pin. The pin keeps the centre of mass on its
    circle: −m ω² l/2 cos ψ along x."""
    run = ncgen.simulate(ncgen.compile(crank()), 1.0, **TIGHT)
    couple = MASS * GRAVITY * LENGTH / 2 * np.cos(SPEED * run.t)
    assert np.allclose(run["couple"], couple, rtol=0, atol=1e-9)
    assert np.allclose(run["power"], SPEED * couple, rtol=0, atol=1e-9)
    assert np.allclose(run["turning"], couple, rtol=0, atol=1e-9)
    assert np.allclose(run["pin.x"], -MASS * SPEED**2 * LENGTH / 2 * np.cos(SPEED * run.t), rtol=0, atol=1e-9)
    assert np.allclose(run.driver_forces()["psi"], couple, rtol=0, atol=1e-9)
    rows = list(csv.DictReader(run.to_csv(tmp_path / "crank.csv").open()))
    assert np.allclose([float(row["couple"]) for row in rows], couple, rtol=0, atol=1e-9)
    with np.load(run.to_npz(tmp_path / "crank.npz")) as kept:
        assert np.allclose(kept["outputs"][:, 0], couple, rtol=0, atol=1e-9)
        assert list(kept["output_names"]) == ["couple", "power", "pin.x", "turning"]


def door() -> Model:
    """10 kg on two ball joints of a vertical axis."""
    m = Model("door")
    A, B, C = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0, 0, 2), fixed=True), m.point("C", (1, 0, 0.5))
    m.body("leaf", [A, B, C], mass=10.0, com=(0.5, 0, 1), inertia=(3.4, 4.2, 0.9))
    m.gravity((0, 0, -GRAVITY))
    return m


def test_two_hinges_share_a_weight_and_say_so():
    """What each of them carries is told; what both carry is unique, and so is what pulls the door to the wall, m g/4 at either hinge."""
    m = door()
    leaf = m.bodies["leaf"]
    m.output("low", leaf.force("A").z, "N")
    m.output("pull", leaf.force("B").x, "N")
    m.output("weight", leaf.force("A").z + leaf.force("B").z, "N")
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 0.1, points=3)
    with pytest.warns(UserWarning) as said:
        assert run["pull"] == pytest.approx(-10 * GRAVITY / 4, abs=1e-9)
    assert run["weight"] == pytest.approx(10 * GRAVITY, abs=1e-9)
    words = "door: output low: force(leaf,A).z is not unique (leaf: A.z and B.z share 98.1 N); one of many possible distributions is given"
    assert [str(each.message) for each in said] == [words]
    sim = ncgen.start(kernels)
    with pytest.warns(UserWarning, match=r"output low: force\(leaf,A\)\.z is not unique"):
        assert sim["pull"] == pytest.approx(-10 * GRAVITY / 4, abs=1e-9)
    sim.step(0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is told once
        assert sim["pull"] == pytest.approx(-10 * GRAVITY / 4, abs=1e-9)


@pytest.mark.filterwarnings("ignore:crank. output (power|both)")
def test_two_drivers_of_one_angle_share_a_couple():
    """The same angle twice, both driven alike: each is arbitrary, their sum is m g l/2 cos ψ."""
    m = crank()
    psi, x, z = m.elements["psi"], m.elements["x"], m.elements["z"]
    A, O = m.elements["A"], m.elements["O"]
    assert isinstance(psi, Angle) and isinstance(A, Point) and isinstance(O, Point) and isinstance(x, Vector) and isinstance(z, Vector)
    again = m.angle("again", x, A - O, z)
    m.drive(again, SPEED * m.time)
    m.output("both", psi.driver + again.driver, "N m")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of redundant drivers
        run = ncgen.simulate(ncgen.compile(m, "numpy"), 0.2, **TIGHT)
    with pytest.warns(
        UserWarning,
        match=r"crank: output couple: other constraints do what driver\(psi\) does; one of many possible distributions is given",
    ):
        both = run["both"]
    assert np.allclose(both, MASS * GRAVITY * LENGTH / 2 * np.cos(SPEED * run.t), rtol=0, atol=1e-9)


def test_what_an_output_cannot_mention():
    m = pendulum()
    rod = m.bodies["rod"]
    with pytest.raises(ModelError, match=r"body rod has no point 'z'; give one of its own: O, A"):
        rod.force("z")
    with pytest.raises(ModelError, match=r"body rod has no vector 'O'; give one of its own: it has none"):
        rod.moment("O")
    psi = m.elements["psi"]
    assert isinstance(psi, Angle)
    m.output("motor", psi.driver)
    kernels = ncgen.compile(m, "numpy")
    run = ncgen.simulate(kernels, 0.1, points=2)
    with pytest.raises(ModelError, match=r"output motor: driver\(psi\): nothing drives that coordinate; m.drive does"):
        run["motor"]


def test_a_load_is_no_force():
    m = pendulum()
    psi = m.elements["psi"]
    assert isinstance(psi, Angle)
    m.torque(psi, m.bodies["rod"].force("O").x)
    with pytest.raises(ModelError, match=r"force\(rod,O\)\.x"):
        ncgen.compile(m, "numpy")


def watched(name: str) -> Model:
    """An example with the wrench on each of its first bodies about one of its points as outputs."""
    model = ncgen.load(name)
    for body in list(model.bodies.values())[:3]:
        force, moment = body.wrench(body.points[0])
        model.output(f"{body.name} force", force.x + 2 * force.y + 3 * force.z, "N")
        model.output(f"{body.name} moment", moment.x + 2 * moment.y + 3 * moment.z, "N m")
    return model


WEIGHTS = np.array([1.0, 2.0, 3.0])


@pytest.mark.parametrize("name", ["fourbar", "excavator", "suspension"])
def test_wrenches_are_those_of_reactions(name):
    """Which Newton and Euler confirm (`test_reactions.py`); those come from kernels of every body, these from one program. Bearings of the
    suspension share loads, but no wrench on a whole body depends on it, and nothing is told."""
    model = watched(name)
    options: dict[str, Any] = {key: value for key, value in model.simulation_options.items() if key in ("zd0", "z", "qd0")}
    run = ncgen.simulate(ncgen.compile(model), 0.3, points=4, **options)
    loads = run.reactions()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(run.outputs) == 6
    for body in list(model.bodies.values())[:3]:
        for word, vector in zip(("force", "moment"), loads.wrench(body.name, body.points[0].name), strict=True):
            expected = vector @ WEIGHTS
            assert np.allclose(run[f"{body.name} {word}"], expected, rtol=1e-9, atol=1e-9 * (1 + np.max(np.abs(expected))))


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
@pytest.mark.parametrize("name", ["fourbar", "excavator"])
def test_state_spaces_are_differences(name):
    """C beside a motion, against central differences of a stepper's outputs over independent positions and rates."""
    model = watched(name)
    kernels = ncgen.compile(model)
    z = ncgen.linearise(kernels, z=model.chosen_independent).positions
    start = dict(zip(z, kernels.q0[[kernels.index[c] for c in z]].tolist(), strict=True))
    rates = {c: 0.3 + 0.1 * k for k, c in enumerate(z)}

    def outputs(q: dict[str, float], zd: dict[str, float]) -> np.ndarray:
        sim = ncgen.start(kernels, q0=_closed(kernels, q), zd0=zd, z=z)
        return np.array(list(sim.outputs.values()))

    moving = ncgen.start(kernels, zd0=rates, z=z)
    found = ncgen.linearise(kernels, q0=moving.q.copy(), qd0=moving.qd.copy(), z=z)
    columns, h = [], 1e-4
    for at in (start, rates):
        for c in z:
            ends = []
            for sign in (1, -1):
                moved = {**at, c: at[c] + sign * h}
                ends.append(outputs(moved, rates) if at is start else outputs(start, moved))
            columns.append((ends[0] - ends[1]) / (2 * h))
    expected = np.array(columns).T
    assert np.allclose(found.C, expected, rtol=0, atol=1e-5 * np.max(np.abs(expected), axis=1, keepdims=True))


def _closed(kernels, z: dict[str, float]) -> np.ndarray:
    """The position with these independent coordinates, beside the first."""
    q = kernels.q0.copy()
    dependent = [k for name, k in kernels.index.items() if name not in z]
    for name, value in z.items():
        q[kernels.index[name]] = value
    for _ in range(20):
        phi, jacobian = kernels.phi(q, 0.0, kernels.p0), kernels.jacobian(q, 0.0, kernels.p0)
        q[dependent] -= np.linalg.lstsq(jacobian[:, dependent], phi, rcond=None)[0]
    return q
