"""Events of mock-up units: in model exchange by indicators, in co-simulation by the unit itself, against closed forms and our own runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from eventful import G, ball, fourbar, sliding_block, wheel
from exported import STRICT, shell

import ncgen
from ncgen.exchange.export import export

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
from fmpy import simulate_fmu  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

VERSIONS = pytest.mark.parametrize("version", [2, 3])
MODES = pytest.mark.parametrize("mode", ["ModelExchange", "CoSimulation"])


def simulated(folder, name: str, mode: str, seconds: float, interval: float = 0.1, **options):
    """What FMPy records, with rows at events; its CVode is what locates these in model exchange."""
    return simulate_fmu(
        str(folder / f"{name}.fmu"), fmi_type=mode, stop_time=seconds, output_interval=interval, relative_tolerance=1e-12,
        record_events=True, **options,
    )  # fmt: skip


@pytest.fixture(scope="module", params=[2, 3])
def bouncing(request, tmp_path_factory):
    """The folder of a ball's unit."""
    folder = tmp_path_factory.mktemp(f"ball{request.param}")
    export(ball(rest="end"), f"fmu{request.param}", folder)
    return folder


def test_the_description_is_valid(bouncing):
    assert validate_fmu(str(bouncing / "ball.fmu")) == []


@MODES
def test_a_ball_bounces(bouncing, mode):
    """T1: y(0.7) after one bounce; impacts at t₁ and 2 t₁ where the importer sees them; it ends where bounces accumulate."""
    found = simulated(bouncing, "ball", mode, 2.0, output=["P.y", "rate(P.y)", "count(floor)"])
    row = np.argmin(np.abs(found["time"] - 0.7))
    assert found["P.y"][row] == pytest.approx(0.2474692639735212, abs=1e-9) and found["count(floor)"][row] == 1
    assert found["count(floor)"][-1] >= 18 and found["P.y"][-1] == pytest.approx(0.0, abs=1e-9)
    if mode == "ModelExchange":
        seen = [found["time"][found["count(floor)"] >= k][0] for k in (1, 2, 10)]
        assert seen == pytest.approx([0.4515236409857309, 0.9030472819714618, 1.352807158734592], rel=1e-9)
        assert found["time"][-1] == pytest.approx(1.354570922957193, abs=1e-5)


@MODES
def test_parameters_of_a_unit(bouncing, mode):
    """Another restitution, and another height to begin with."""
    found = simulated(bouncing, "ball", mode, 0.4, start_values={"e": 0.25, "P.y": 0.5}, output=["P.y", "rate(P.y)", "count(floor)"])
    fall, speed = math.sqrt(2 * 0.5 / G), math.sqrt(2 * 0.5 * G)
    assert found["count(floor)"][-1] == 1 and found["time"][-1] == 0.4
    assert found["rate(P.y)"][-1] == pytest.approx(speed / 4 - G * (0.4 - fall), abs=1e-8)


@VERSIONS
@MODES
def test_a_ball_that_comes_to_rest(mode, version, tmp_path):
    """Its gap is held closed from then on: it neither sinks nor ends the simulation."""
    export(ball(), f"fmu{version}", tmp_path)
    assert validate_fmu(str(tmp_path / "ball.fmu")) == []
    found = simulated(tmp_path, "ball", mode, 3.0, output=["P.y", "rate(P.y)", "count(floor)", "load(floor)"])
    assert found["time"][-1] == pytest.approx(3.0) and 18 <= found["count(floor)"][-1] <= 20
    at_rest = found["time"] > 1.4
    assert np.sum(at_rest) > 10 and np.max(np.abs(found["P.y"][at_rest])) < 1e-9
    assert found["load(floor)"][at_rest] == pytest.approx(G, rel=1e-9) and found["load(floor)"][0] == 1.0


@VERSIONS
@MODES
def test_a_block_pushed_against_its_stop(mode, version, tmp_path):
    """The push turns at 2 s, and the block leaves at once."""
    m, s = sliding_block("stop")
    m.torque(s, 2 - m.time)
    m.stop(s, upper=0.5)
    export(m, f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "stop", mode, 3.0, output=["s", "count(s.stop.upper)", "load(s.stop.upper)"])
    assert found["count(s.stop.upper)"][-1] == 1 and found["s"][-1] == pytest.approx(0.5 - 1 / 6, abs=1e-8)
    row = np.argmin(np.abs(found["time"] - 1.5))
    assert found["s"][row] == pytest.approx(0.5, abs=1e-10) and found["load(s.stop.upper)"][row] == pytest.approx(0.5, rel=1e-9)


@VERSIONS
@MODES
def test_changes_of_parameters_and_velocities(mode, version, tmp_path):
    """T7: four steps of the wheel's limit cycle; what its event changes is a variable of the unit's own."""
    export(wheel(), f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "wheel_", mode, 5.0, output=["s", "rate(s)", "feet", "count(foot)"])
    assert found["feet"][-1] == 4.0 and found["count(foot)"][-1] == 4.0
    kernels = ncgen.compile(wheel())
    options = kernels.model.simulation_options
    own = ncgen.simulate(kernels, 5.0, rtol=1e-12, q0=options["q0"], qd0=options["qd0"])
    assert [found["s"][-1], found["rate(s)"][-1]] == pytest.approx([own["s"][-1], own["rate(s)"][-1]], abs=1e-8)
    if mode == "ModelExchange":
        steps = [found["time"][found["count(foot)"] >= k][0] for k in range(1, 5)]
        assert np.diff([0.0, *steps]) == pytest.approx([1.034549811423279] * 4, rel=1e-9)


@VERSIONS
@MODES
def test_a_loop_hits_a_stop(mode, version, tmp_path):
    model = fourbar()
    export(model, f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "fourbar", mode, 0.6, 0.02, output=["psi", "rate(psi)", "count(stop.upper)"])
    options = {k: v for k, v in model.simulation_options.items() if k in ("zd0", "z")}
    own = ncgen.simulate(ncgen.compile(model), 0.6, rtol=1e-12, **options)
    assert found["count(stop.upper)"][-1] == len(own.events) > 0
    assert found["psi"][-1] == pytest.approx(own["psi"][-1], abs=1e-7)


@VERSIONS
def test_an_event_that_ends_the_motion(version, tmp_path):
    m, s = sliding_block("ended")
    m.event("wall", when=s - 0.5, direction="rising", do="stop")
    m.simulation(duration=1.0, qd0={"s": 1.0})
    export(m, f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "ended", "ModelExchange", 1.0, output=["s"])
    assert found["time"][-1] == pytest.approx(0.5, rel=1e-9) and found["s"][-1] == pytest.approx(0.5, rel=1e-9)
    found = simulated(tmp_path, "ended", "CoSimulation", 1.0, 0.3, output=["s"])
    assert found["s"][-1] == pytest.approx(0.5, rel=1e-9) and found["time"][-1] < 1.0


@VERSIONS
def test_compilers_have_nothing_to_say(version, bouncing, tmp_path):
    shell(f"unzip -q {bouncing / 'ball.fmu'}", tmp_path)
    for name in (f"fmi{version}.c", "ball_motion.c", "ball_ncgen_events.c"):
        if (tmp_path / "sources" / name).exists():
            shell(f"cc -std=c99 {STRICT} -c sources/{name} -Isources -o /dev/null", tmp_path)


@VERSIONS
@MODES
def test_friction_that_sticks(mode, version, tmp_path):
    """T5: it rests at 1 − (√205 − 14) from 22.42 s on; the direction of slip is a variable of the unit's own."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    m.simulation(duration=30.0, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 6.0})
    export(m, f"fmu{version}", tmp_path)
    assert validate_fmu(str(tmp_path / "oscillator.fmu")) == []
    found = simulated(tmp_path, "oscillator", mode, 30.0, 0.5, output=["s", "rate(s)", "count(s.friction)", "s.friction.slip"])
    assert found["s"][-1] == pytest.approx(1 - (math.sqrt(205) - 14), abs=1e-8) and found["count(s.friction)"][-1] == 8
    at_rest = found["time"] > 22.43
    assert np.max(np.abs(found["rate(s)"][at_rest])) < 1e-12 and np.all(found["s.friction.slip"][at_rest] == 0.0)
    if mode == "ModelExchange":
        assert found["time"][found["count(s.friction)"] >= 8][0] == pytest.approx(22.42355635069909, rel=1e-8)


@VERSIONS
@MODES
def test_a_clutch_and_a_ratchet(mode, version, tmp_path):
    """Two discs, J 2 and 3: the clutch closes at 0.5 s, both have (2 · 10)/5 rad/s, and it opens at 1 s, where a torque begins that turns
    the first one back; a ratchet holds it."""
    m = ncgen.Model("drive")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for k, inertia in enumerate((2.0, 3.0), 1):
        P = m.point(f"P{k}", (1, 0))
        m.body(f"disc{k}", [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"psi{k}", x, P - O, z))
    m.clutch(*angles, when=0.5 - m.time, until=1.0 - m.time, name="clutch")
    m.torque(angles[0], -16.0 * ncgen.smooth_step((m.time - 1.0) / 0.01))
    m.ratchet(angles[0], name="pawl")
    m.simulation(duration=2.5, qd0={"psi1": 10.0, "psi2": 0.0})
    export(m, f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "drive", mode, 2.5, 0.1, output=["rate(psi1)", "rate(psi2)", "count(pawl)"])
    together = (found["time"] > 0.55) & (found["time"] < 0.95)
    for name in ("rate(psi1)", "rate(psi2)"):
        assert found[name][together] == pytest.approx(4.0, abs=1e-8)
    assert found["rate(psi2)"][-1] == pytest.approx(4.0, abs=1e-8) and found["rate(psi1)"][-1] == pytest.approx(0.0, abs=1e-10)
    assert found["count(pawl)"][-1] == 1


@VERSIONS
@MODES
def test_friction_that_follows_a_load(mode, version, tmp_path):
    """A block of 2 kg on a guide that bears 4 N, μ 0.5: from 1 m/s it stops after 1 s, and a push of t N exceeds 2 N at 2 s."""
    m, s = sliding_block("guided", mass=2.0)
    B = m.point("B", (0, 1), fixed="x")
    m.body("rider", [B], mass=1.0)
    m.force(B, (0, 4.0))
    m.torque(s, m.time * ncgen.smooth_step((m.time - 1.5) / 0.1))
    m.friction(s, coefficient=0.5, load=m.constrain(B.y - 1, label="guide"))
    m.simulation(duration=3.0, qd0={"s": 1.0})
    export(m, f"fmu{version}", tmp_path)
    assert validate_fmu(str(tmp_path / "guided.fmu")) == []
    found = simulated(tmp_path, "guided", mode, 3.0, 0.1, output=["s", "rate(s)", "count(s.friction)"])
    assert found["s"][-1] == pytest.approx(0.5 + 1 / 12, abs=1e-8) and found["count(s.friction)"][-1] == 2
    assert np.max(np.abs(found["rate(s)"][(found["time"] > 1.05) & (found["time"] < 1.95)])) < 1e-12
