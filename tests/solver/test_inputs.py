"""Inputs and outputs: a mass on a slide against closed forms, engines against each other, and what is refused."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
import scipy.integrate
import sympy
from driven_models import GRAVITY, LENGTH, MASS, mass_on_a_slide, pendulum

import ncgen
from ncgen import DomainError, ModelError


@pytest.fixture(scope="module")
def slider():
    return ncgen.compile(mass_on_a_slide())


@pytest.fixture(scope="module")
def rod():
    return ncgen.compile(pendulum())


def angle_of_the_rod(tau, breaks, end):
    """ψ(end) of J ψ̈ = τ − m g l/2 cos ψ with SciPy, from break to break."""
    inertia = LENGTH**2 / 3
    y = np.zeros(2)
    for a, b in zip(breaks, [*breaks[1:], end], strict=True):
        rates = lambda t, y, a=a: [y[1], (tau(t, a) - GRAVITY * LENGTH / 2 * math.cos(y[0])) / inertia]  # noqa: E731
        y = scipy.integrate.solve_ivp(rates, (a, b), y, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return y[0]


METHODS = [
    {},
    {"engine": "c"},
    {"engine": "python"},
    {"formalism": "coordinate-partitioning", "integrator": "dopri5"},
    {"formalism": "coordinate-partitioning", "integrator": "dopri5", "engine": "emitted"},
    {"formalism": "coordinate-partitioning", "integrator": "radau", "engine": "c"},
    {"formalism": "coordinate-partitioning", "engine": "python"},
    {"formalism": "lagrange", "integrator": "rk4", "max_step": 1e-3},
]


@pytest.mark.parametrize("asked", METHODS, ids=str)
def test_a_function_of_time(slider, asked):
    """m ẍ = sin 3t from rest: x = (3t − sin 3t) / (9 m)."""
    run = ncgen.simulate(slider, 1.0, inputs={"F": lambda t: math.sin(3 * t)}, points=11, **asked)
    assert np.allclose(run["s"], (3 * run.t - np.sin(3 * run.t)) / (9 * MASS), rtol=0, atol=2e-9)
    assert np.allclose(run["F"], np.sin(3 * run.t), rtol=1e-15)
    assert np.allclose(run.qdd[:, slider.index["s"]], np.sin(3 * run.t) / MASS, rtol=0, atol=1e-12)
    assert run.energy_drift < 1e-7


@pytest.mark.parametrize("hold", ["zero", "linear", "cubic"])
@pytest.mark.parametrize("asked", METHODS[:7], ids=str)
def test_tables(rod, asked, hold, recwarn):
    """Steps end where a table jumps or has a corner, so the error is that of smooth motions."""
    times = np.array([0.0, 0.11, 0.3, 0.37, 0.8])
    values = np.array([1.0, 4.0, -2.0, 3.0, 5.0])
    if hold == "zero":
        tau = lambda t, a: values[np.searchsorted(times, a, side="right") - 1]  # noqa: E731
    elif hold == "linear":
        tau = lambda t, a: np.interp(t, times, values)  # noqa: E731
    else:
        spline = scipy.interpolate.CubicSpline(times, values)
        tau = lambda t, a: spline(min(t, times[-1]))  # noqa: E731
    run = ncgen.simulate(rod, 1.0, inputs={"tau": (times, values, hold)}, rtol=1e-10, points=23, **asked)
    assert run["psi"][-1] == pytest.approx(angle_of_the_rod(tau, [*times], 1.0), rel=0, abs=2e-8)
    assert run.energy_drift < 1e-7
    assert not [w for w in recwarn if issubclass(w.category, UserWarning)]


JUMPS = {"zero": [(0.37, 2.0, 2.0), (0.81, -3.0, -3.0), (1.0, 1.0, 1.0)]}
BENDS = {"linear": [(0.2, 2.0, 2.0), (0.37, 2.0, -3.0), (0.81, -3.0, 1.0), (1.0, 1.0, 1.0)]}
"""The force of a table at the start and the end of what it has between its times; before them and after them it stays."""


@pytest.mark.parametrize(("hold", "parts"), [*JUMPS.items(), *BENDS.items()])
@pytest.mark.parametrize("integrator", ["rk23", "dopri5", "dop853", "rk4"])
@pytest.mark.parametrize("engine", ["c", "python"])
def test_steps_end_where_an_input_jumps_or_bends(slider, engine, integrator, hold, parts):
    """In between a mass moves as a polynomial, which methods of order three and more follow whatever their tolerance."""
    table = np.array([0.2, 0.37, 0.81]), np.array([2.0, -3.0, 1.0]), hold
    asked = {"rtol": 1e-2, "points": 2, "integrator": integrator, "engine": engine, "formalism": "lagrange"}
    if integrator == "rk4":
        asked["max_step"] = 0.01  # so that steps end there
    run = ncgen.simulate(slider, 1.0, inputs={"F": table}, **asked)
    place, speed, now = 0.0, 0.0, 0.0
    for end, first, last in parts:
        h, a, change = end - now, first / MASS, (last - first) / MASS
        place, speed, now = place + h * speed + h**2 * (a / 2 + change / 6), speed + h * (a + change / 2), end
    assert run["s"][-1] == pytest.approx(place, abs=1e-12)
    assert run["rate(s)"][-1] == pytest.approx(speed, abs=1e-12)


def test_splines_are_scipys(slider):
    """10,000 random times, and beyond the ends."""
    generator = np.random.default_rng(3)
    times = np.sort(generator.uniform(0, 10, 40))
    values = generator.normal(size=40)
    from ncgen.solver.runs.signals import signals_of

    signals = signals_of(slider, {"F": (times, values, "cubic")}, slider.p0.copy())
    at = generator.uniform(times[0], times[-1], 10_000)
    found = np.array([signals(t, slider.p0)[-1] for t in at])
    assert np.allclose(found, scipy.interpolate.CubicSpline(times, values)(at), rtol=1e-12, atol=1e-13)
    assert signals(times[0] - 1, slider.p0)[-1] == values[0]
    assert signals(times[-1] + 1, slider.p0)[-1] == pytest.approx(values[-1], rel=1e-12)


def test_a_number_and_no_input_at_all(slider):
    push = ncgen.simulate(slider, 1.0, inputs={"F": 4.0}, points=2)
    assert push["s"][-1] == pytest.approx(4.0 / MASS / 2, rel=1e-9)
    assert ncgen.simulate(slider, 1.0, p={"F": 4.0}, points=2)["s"][-1] == push["s"][-1]
    assert abs(ncgen.simulate(slider, 1.0, points=2)["s"][-1]) < 1e-15
    assert slider.parameters == ("c", "F")
    assert slider.inputs == ("F",)


def test_outputs(slider):
    run = ncgen.simulate(slider, 1.0, inputs={"F": lambda t: math.sin(3 * t)}, points=6)
    t, x = run.t, run["s"]
    speed = (1 - np.cos(3 * t)) / (3 * MASS)
    assert np.allclose(run["place"], 10 * x + 1, rtol=1e-14)
    assert np.allclose(run["pull"], np.sin(3 * t) * speed + np.sin(3 * t) / MASS, atol=1e-8)
    numpy = ncgen.compile(mass_on_a_slide(), backend="numpy")
    again = ncgen.simulate(numpy, 1.0, inputs={"F": lambda t: math.sin(3 * t)}, points=6)
    assert np.allclose(again["pull"], run["pull"], atol=1e-8)


def test_a_driven_run_travels(slider):
    times = np.linspace(0, 1, 5)
    run = ncgen.simulate(slider, 1.0, inputs={"F": (times, np.sin(times))}, points=5)
    arrived = pickle.loads(pickle.dumps(run))
    assert np.array_equal(arrived["F"], np.sin(times))
    assert np.array_equal(arrived.qdd, run.qdd)


def test_kernels_of_a_driven_run_begin_without_its_signals(slider):
    """What one run was driven by drives no other one."""
    run = ncgen.simulate(slider, 0.5, inputs={"F": lambda t: 5.0})
    again = ncgen.simulate(run.kernels, 0.5, points=3)
    assert np.max(np.abs(again["s"])) < 1e-15
    assert np.array_equal(again["F"], np.zeros(3))
    sim = ncgen.start(run.kernels)
    sim.step(0.1)
    assert abs(sim["s"]) < 1e-15
    assert sim.outputs["pull"] == pytest.approx(0.0, abs=1e-12)


def test_files_keep_inputs_and_outputs(slider, tmp_path):
    run = ncgen.simulate(slider, 0.5, inputs={"F": lambda t: 5.0 + t}, points=4)
    kept = np.load(run.to_npz(tmp_path / "run.npz"))
    assert kept["input_names"].tolist() == ["F"]
    assert kept["output_names"].tolist() == ["place", "pull"]
    assert np.array_equal(kept["inputs"][:, 0], run["F"])
    assert np.array_equal(kept["outputs"][:, 1], run["pull"])
    text = run.to_csv(tmp_path / "run.csv").read_text().splitlines()
    assert text[0].split(",")[-3:] == ["F", "place", "pull"]
    assert float(text[-1].split(",")[-3]) == run["F"][-1]


def test_joint_loads_feel_the_input(slider):
    """The couple along the slide is no load of a joint, so nothing else pulls on the block along x."""
    run = ncgen.simulate(slider, 0.5, inputs={"F": lambda t: 5.0 + t}, points=3)
    assert np.allclose(ncgen.inverse_dynamics(run, "s").forces, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        ({"G": 1.0}, "inputs: the mechanism has no input G; it has F"),
        ({"F": "1"}, "inputs: F is '1'; it must be a finite number"),
        ({"F": math.nan}, "inputs: F is nan; it must be a finite number"),
        ({"F": ([0, 1], [1])}, "inputs: F: 2 times and 1 value; give as many of both, 2 or more"),
        ({"F": ([0, 0], [1, 2])}, "inputs: F: time 1 is 0 s after 0 s; times must ascend"),
        ({"F": ([0, 1], [1, 2], "wavy")}, "inputs: F: hold 'wavy' is unknown; choose one of zero, linear, cubic"),
        (3, "inputs: 3 given; give {name: number, function of time, or (times, values)}"),
    ],
)
def test_what_is_no_signal(slider, inputs, said):
    with pytest.raises(ModelError) as refused:
        ncgen.simulate(slider, 1.0, inputs=inputs)
    assert str(refused.value) == said


@pytest.mark.parametrize("asked", METHODS, ids=str)
def test_a_function_that_gives_no_number(slider, asked):
    with pytest.raises(DomainError, match=r"slider: the input F is nan at t = 0\.[5-9]\d* s; its function must give a finite number"):
        ncgen.simulate(slider, 1.0, inputs={"F": lambda t: 1.0 if t < 0.5 else math.nan}, **asked)


@pytest.mark.parametrize("asked", METHODS, ids=str)
def test_what_a_function_raises_comes_out(slider, asked):
    def broken(t: float) -> float:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        ncgen.simulate(slider, 1.0, inputs={"F": broken}, **asked)


def test_inputs_stand_in_forces_only():
    m = mass_on_a_slide()
    F, s = m.inputs["F"], m.elements["s"]
    for act in (
        lambda: m.drive(s, F),
        lambda: m.constrain(s + F),
        lambda: m.potential(F * s),
        lambda: m.body("other", [m.elements["B"]], mass=F),
        lambda: m.torsion_spring(s, 1.0, law=lambda x, v: F * x),
        lambda: m.point("P", (F, 0)),
    ):
        with pytest.raises(ModelError, match="F is an input, which stands in forces, torques, couples and outputs only"):
            act()


def test_an_output_of_what_there_is_not():
    m = mass_on_a_slide()
    m.output("lost", sympy.Symbol("nowhere", real=True))
    kernels = ncgen.compile(m)
    with pytest.raises(ModelError, match="output lost: nowhere is neither a coordinate"):
        ncgen.simulate(kernels, 0.1).outputs  # noqa: B018


def test_a_file_says_the_same(tmp_path):
    from ncgen.exchange.toml_writer import to_toml

    text = to_toml(mass_on_a_slide())
    assert 'expression = "F*rate(s) + rate(rate(s))"' in text
    (tmp_path / "slider.toml").write_text(text)
    again = ncgen.load(tmp_path / "slider.toml")
    assert to_toml(again) == text
    a, b = (ncgen.simulate(ncgen.compile(m), 1.0, inputs={"F": 1.0}, points=3) for m in (mass_on_a_slide(), again))
    assert np.array_equal(a["pull"], b["pull"])


@pytest.mark.parametrize("signal", [2.0, lambda t: np.sin(3 * t), ([0.0, 0.3, 1.0], [0.0, 5.0, -1.0]), ([0.0, 0.4], [1.0, -2.0], "zero")])
def test_what_drives_a_batch_drives_every_state_of_it(signal):
    """As in `simulate`, state by state; a number as one in p."""
    kernels = ncgen.compile(ncgen.load("cartpole"))
    starts = np.array([[0.0, 0.5], [0.2, -0.4], [0.0, 0.0]])
    given = dict(integrator="dop853", rtol=1e-10, z=["s", "phi"], inputs={"F": signal})
    batch = ncgen.simulate(kernels, 1.0, zd0=starts, points=11, **given)
    assert batch.ok.all()
    for k, zd0 in enumerate(starts):
        run = ncgen.simulate(kernels, 1.0, zd0=zd0, points=11, formalism="coordinate-partitioning", **given)
        assert np.max(np.abs(batch.q[k] - run.q)) < 1e-8
    if isinstance(signal, float):
        plain = given | {"inputs": None}
        same = ncgen.simulate(kernels, 1.0, zd0=starts, points=11, p={"F": signal}, **plain)
        assert np.array_equal(batch.q, same.q)


def test_a_batch_refuses_inputs_in_the_words_of_simulate():
    kernels = ncgen.compile(ncgen.load("cartpole"))
    for wrong in ({"G": 1.0}, {"F": "much"}, {"F": ([0, 1], [0.0])}, [1.0]):
        words = []
        for door, more in ((ncgen.simulate, {}), (ncgen.simulate, {"zd0": np.zeros((2, 2))})):
            with pytest.raises(ncgen.ModelError) as refused:
                door(kernels, 1.0, inputs=wrong, **more)
            words.append(str(refused.value))
        assert words[0] == words[1]
