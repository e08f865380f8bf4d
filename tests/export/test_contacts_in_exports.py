"""Contacts with friction in exports: they slide, stick, roll and bounce as in our own runs, and as closed forms say."""

from __future__ import annotations

import math
import sys
from functools import cache

import numpy as np
import pytest
from exported import STRICT, shell
from living import click, nothing_said, settled, state_of
from scipy.integrate import solve_ivp
from test_events_in_wasm import in_node, moved, shown
from test_events_of_exports import run_in_c
from test_held_in_exports import own_run
from touching import INERTIA, MODELS, RADIUS, SCENES, SLOPE, SPOKE, G, described, disc, rod, velocity

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.export import export


@cache
def expected(name: str) -> tuple[ncgen.Trajectory, list[float], float]:
    """Our own run of a model, the times of what exports count, and its duration."""
    run, end = own_run(MODELS[name]())
    return run, sorted({each.t for each in run.events if 0 < each.t < end and each.transition not in ("rests", "leaves")}), end


def some(names: dict, *usual: str) -> list:
    """Those names, all but a few of them among the longer proofs."""
    return [name if name in usual else pytest.param(name, marks=pytest.mark.slow) for name in names]


def same(name: str, last: np.ndarray, work: float) -> None:
    run, _, end = expected(name)
    n = run.kernels.n
    assert last[0] == end
    assert last[1 : 1 + n] == pytest.approx(run.q[-1], abs=1e-8) and last[1 + n : 1 + 2 * n] == pytest.approx(run.qd[-1], abs=1e-8)
    assert work == pytest.approx(run.work[-1], abs=1e-7)


@pytest.mark.parametrize("name", some(MODELS, "spins and drops", "rocking", "woodpecker", "stirred", "two tips"))
def test_c_is_our_own_run(tmp_path, name):
    """Times at which it hits, sticks, slips and turns, and the state at the end."""
    _, times, end = expected(name)
    events, last, _, stopped, said = run_in_c(MODELS[name](), tmp_path, end, 1e-13)
    assert said == "ok" and not stopped
    assert [row[0] for row in events if row[0] > 0] == pytest.approx(times, rel=1e-9, abs=1e-11)
    same(name, last, last[-1])


@in_node
@pytest.mark.parametrize("name", some(MODELS, "spins and drops", "rim", "woodpecker"))
def test_webassembly_is_our_own_run(tmp_path, name):
    _, times, end = expected(name)
    answer = moved(MODELS[name](), tmp_path, end)
    assert [row[0] for row in answer["found"][:-1]] == pytest.approx(times, rel=1e-9, abs=1e-11)
    for last in (answer["found"][-1], answer["again"]):
        same(name, np.array(last), answer["work"])


def test_a_spinning_sphere_is_where_the_closed_form_says(tmp_path):
    """T2: the impact's friction cannot stop it, it slides, and rolls from 0.728 s on."""
    model = described(disc(1.0), 1.0, velocity(0.0, 50.0))
    events, last, counts, *_ = run_in_c(model, tmp_path, 1.0, flags=f"-O1 {STRICT}")
    (hit, *first), (rolls, *second) = events
    assert [hit, rolls] == pytest.approx([0.4283529368781193, 0.72811999417504], rel=1e-10) and counts == [1, 1]
    assert first[4] == pytest.approx(-0.8404284621548701, rel=1e-9) and second[0] == pytest.approx(-0.3400857101250286, rel=1e-9)
    assert last[5] == pytest.approx(-10 / 7, rel=1e-9)


@pytest.mark.parametrize("flat", [True, False])
def test_a_sphere_slides_and_rolls(tmp_path, flat):
    """T3: rolling at 2 v₀/(7 μ g) with 5/7 of the velocity, after 3.12 m; no write beyond an array."""
    start = velocity(5.0, 0.0) if flat else {"C.x": 3.0, "C.y": 4.0, "C.z": 0.0}
    flags = "-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
    events, last, *_ = run_in_c(described(disc(RADIUS, flat=flat), 1.0, start), tmp_path, 1.0, flags=flags)
    share, n = (1.0, 4) if flat else (0.6, 9)
    assert events[-1][0] == pytest.approx(0.72811999417504, rel=1e-10)
    assert [events[-1][1], last[1 + n]] == pytest.approx([share * 3.120514260750172, share * 25 / 7], rel=1e-9)


def test_a_rimless_wheel_loses_what_its_spokes_take(tmp_path):
    """T7: ω after an impact is (J + cos 2α)/(J + 1) of that before."""
    model = MODELS["rimless wheel"]()
    events, *_ = run_in_c(model, tmp_path, 2.0)
    hit, n = events[0], len(ncgen.compile(model).coordinates)
    before = solve_ivp(falling, (0.0, hit[0]), [-SPOKE, 1.2], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert before[0] == pytest.approx(SPOKE, abs=1e-9)
    after = math.hypot(*hit[1 + n : 3 + n])  # of the centre, 1 m from where the spoke stands
    assert after == pytest.approx(before[1] * (INERTIA + math.cos(2 * SPOKE)) / (INERTIA + 1), rel=1e-9)


def falling(t: float, y: np.ndarray) -> list[float]:
    """The wheel on one spoke, by its angle to the normal of the slope."""
    return [y[1], G * math.sin(y[0] + SLOPE) / (INERTIA + 1)]


def test_a_load_that_is_not_determined_ends_the_motion(tmp_path):
    """Painlevé: a rod of 45° has a load for friction up to 5/3 where it is driven into the ground."""
    start = {"A.x": 1.0, "A.y": 0.0, "B.x": 1.0, "B.y": 0.0}
    *_, said = run_in_c(described(rod(1.66, math.radians(45)), 1e-3, start), tmp_path / "below", 1e-3)
    assert said == "ok"
    *_, said = run_in_c(described(rod(1.67, math.radians(45)), 1e-3, start), tmp_path / "above", 1e-3)
    assert said.startswith("the load that friction follows is not determined")


def test_of_every_part_of_contacts_that_slide_the_load_is_determined(tmp_path):
    """Two rods beyond the limit: each determinant is negative, and their product, that of both together, is positive."""
    model = ncgen.Model("rods")
    model.gravity((0, -G))
    ground = {"on": model.ground, "at": model.point("O", (0, 0), fixed=True), "normal": model.vector("up", (0, 1), fixed=True)}
    start = {}
    for k, x in enumerate((0.0, 5.0)):
        tip, end = model.point(f"A{k}", (x, 0)), model.point(f"B{k}", (x - math.sqrt(0.5), math.sqrt(0.5)))
        model.contact(f"tip{k}", model.body(f"rod{k}", [tip, end], mass=1.0, inertia="rod"), tip, friction=1.67, **ground)
        start |= {f"{P.name}.{axis}": speed for P in (tip, end) for axis, speed in (("x", 1.0), ("y", 0.0))}
    *_, said = run_in_c(described(model, 1e-3, start), tmp_path, 1e-3)
    assert said.startswith("the load that friction follows is not determined")


@pytest.mark.parametrize("number", ["SINGLE", "LONG_DOUBLE"])
def test_other_number_types(tmp_path, number):
    """A block in space that a push of t N begins to move where it exceeds μ m g."""
    model = ncgen.Model("block")
    P = model.point("P", (0, 0, 0))
    model.gravity((0, 0, -G))
    model.force(P, (model.time, 0, 0))
    up = model.vector("up", (0, 0, 1), fixed=True)
    body = model.body("block", [P], mass=1.0)
    model.contact("floor", body, P, model.ground, model.point("O", (0, 0, 0), fixed=True), normal=up, friction=0.2)
    tolerance, rel = (1e-5, 1e-5) if number == "SINGLE" else (1e-14, 1e-12)
    events, last, counts, _, said = run_in_c(model, tmp_path, 3.0, tolerance, number=f"-DBLOCK_NCGEN_{number}")
    assert said == "ok" and counts == [0, 2, 0] and events[-1][0] == pytest.approx(0.2 * G, rel=rel)
    assert last[1:3] == pytest.approx([(3.0 - 0.2 * G) ** 3 / 6, 0.0], rel=10 * rel)


def test_the_law_of_several_contacts_must_be_said(tmp_path):
    from test_contact_impacts import block

    start = {"A.x": 1.0, "B.x": 1.0, "A.y": 0.0, "B.y": 0.0}
    *_, said = run_in_c(described(block(), 1.0, start), tmp_path, 1.0)
    assert said.startswith("several impacts at one instant, where laws differ")


PACKAGE = r"""
import numpy, ball
motion = ball.Motion()
motion.next_event(1.0, 1e-12, 1e-12)
print(motion.t, motion.q[0], motion.qd[0], motion.happened["floor"], motion.happened["floor.friction"])
motion.next_event(1.0, 1e-12, 1e-12)
print(motion.t, motion.q[0], motion.qd[0], motion.happened["floor"], motion.happened["floor.friction"])
motion.p = ball.DEFAULTS  # what sticks stays so
motion.advance(motion.t + 0.1, 1e-12, 1e-12)
print(motion.t, motion.q[0], motion.qd[0], motion.happened["floor"], motion.happened["floor.friction"])
"""


def test_a_python_package_rolls(tmp_path):
    export(described(disc(1.0), 1.0, velocity(0.0, 50.0)), "python", tmp_path)
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", tmp_path)
    rows = [[float(x) for x in line.split()] for line in shell(f"{sys.executable} -c '{PACKAGE}'", tmp_path).splitlines()]
    hit, rolls = 0.4283529368781193, 0.72811999417504
    assert [row[0] for row in rows] == pytest.approx([hit, rolls, rolls + 0.1], rel=1e-10)
    assert [row[2] for row in rows] == pytest.approx([-0.8404284621548701, -10 / 7, -10 / 7], rel=1e-9)
    assert [row[3:] for row in rows] == [[1.0, 0.0], [1.0, 1.0], [1.0, 1.0]]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("mode", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("name", some(SCENES | {"in space": 0, "two tips": 0, "braked": 0}, "slides and rolls"))
def test_a_unit_is_our_own_run(tmp_path, name, mode, version):
    """In model exchange by FMPy's CVode, whose error of the same sphere in free flight is 9e-5 m/s."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    run, _, end = expected(name)
    model, coordinates = MODELS[name](), run.kernels.coordinates
    (file,) = export(model, f"fmu{version}", tmp_path)
    assert validate_fmu(str(file)) == []
    names = [*coordinates, *(f"rate({each})" for each in coordinates)]
    options = {"stop_time": end, "output_interval": end / 20, "relative_tolerance": 1e-12, "output": names}
    found = fmpy.simulate_fmu(str(file), fmi_type=mode, **options)
    tolerance = 1e-7 if mode == "CoSimulation" else 1e-4
    assert [found[each][-1] for each in names] == pytest.approx([*run.q[-1], *run.qd[-1]], abs=tolerance)


@shown
def test_the_page_of_a_sphere(browser, page_of):
    """It lists that the sphere hits the floor and that it rolls, keeps its energy, and has no sliders for what is held."""
    browser.open(page_of(described(disc(1.0), 1.0, velocity(0.0, 50.0))))
    while state_of(browser)[0] < 0.9:
        click(browser, "step")
    settled(browser)
    listed = browser.value("[...document.querySelectorAll('#happened li')].map((each) => each.textContent.split(' ')[2])")
    assert listed == ["floor", "floor.friction"]
    text = browser.value("document.body.innerText")
    assert "floor.on" not in text and "floor.sticks" not in text and "floor.slip" not in text
    assert state_of(browser)[2][0] == pytest.approx(-10 / 7, rel=1e-6)
    assert browser.value("living.drift()") < 1e-8 and nothing_said(browser)


def with_a_pin() -> ncgen.Model:
    """Friction of a load of two constraints beside a contact."""
    m = disc(RADIUS)
    A, B = m.point("A", (3, 0)), m.point("B", (4, 0))
    m.body("disc", [A, B], mass=1.0, com=(3, 0), inertia=0.1)
    angle = m.angle("turn", m.vector("x", (1, 0), fixed=True), B - A, m.vector("z", (0, 0, 1), fixed=True))
    m.friction(angle, coefficient=0.01, load=m.constrain(A.x - 3), across=m.constrain(A.y), name="pin")
    return m


def called_alike() -> ncgen.Model:
    m = disc(RADIUS)
    m.event("floor.friction", when=m.time - 1)
    return m


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (with_a_pin, "friction pin with across must be the only friction of loads, and contact floor has some; leave across out"),
        (called_alike, "friction of contact floor and another element are both called floor.friction; give that another name"),
    ],
    ids=lambda x: x if isinstance(x, str) else x.__name__,
)
def test_refused(model, message, tmp_path):
    with pytest.raises(ModelError) as refused:
        export(model(), "c", tmp_path)
    assert str(refused.value) == f"ball cannot be exported: {message}"


def test_a_contact_at_which_the_motion_ends(tmp_path):
    """Bounces with friction until they accumulate: nothing is held."""
    model = described(disc(0.5, restitution=0.5, rest="end"), 3.0, velocity(1.0, 20.0))
    with pytest.warns(UserWarning, match="bounces accumulate"):
        run = ncgen.simulate(ncgen.compile(model), 3.0, qd0=velocity(1.0, 20.0), rtol=1e-12, atol=1e-13, points=2)
    events, last, counts, stopped, said = run_in_c(model, tmp_path, 3.0, 1e-13)
    assert stopped and said == "ok" and len(events) == len(run.events) == counts[0]
    assert last[0] == pytest.approx(run.t[-1], abs=1e-9) and last[1:5] == pytest.approx(run.q[-1], abs=1e-8)
