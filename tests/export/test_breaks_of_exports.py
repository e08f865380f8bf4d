"""Exported motions end a step where a law of time changes its formula, whatever the parameters are and however far they go."""

from __future__ import annotations

import ctypes
import json
import math
import shutil

import numpy as np
import pytest
import scipy.integrate
import sympy
from exported import STRICT, shell
from sliding import sliding_block

import ncgen
from ncgen.exchange.export import export


def begun(m: ncgen.Model) -> object:
    return m.numbers.get("begin") or m.parameter("begin", 5.0)


def hat(m: ncgen.Model):
    """Above 0 from 40 to 42, and again every 60."""
    return m.table("hat", (0, 39, 41, 43, 60), (-1, -1, 1, -1, -1), periodic=True)


PULSES = {
    "Heaviside": lambda t, m: sympy.Heaviside(t - begun(m)) - sympy.Heaviside(t - begun(m) - 1),
    "Piecewise": lambda t, m: sympy.Piecewise((0.0, t < begun(m)), (1.0, t < begun(m) + 1), (0.0, True)),
    "falling": lambda t, m: sympy.Heaviside(2 * begun(m) + 2 - 2 * t) - sympy.Heaviside(begun(m) - t),
    "sign of a corner": lambda t, m: (sympy.sign(sympy.Max(0, t - begun(m)) - 1e-9) - sympy.sign(sympy.Max(0, t - begun(m)) - 1)) / 2,
    "smooth steps": lambda t, m: ncgen.smooth_step(t - begun(m), 0, 1e-6) - ncgen.smooth_step(t - begun(m), 1, 1.000001),
    "periodic table": lambda t, m: sympy.Heaviside(hat(m)(t + 40 - begun(m)))
    * sympy.Heaviside(1 - t + begun(m)),
    "square": lambda t, m: sympy.Heaviside((t - begun(m)) * (begun(m) + 1 - t)),
    "sine": lambda t, m: sympy.Heaviside(sympy.sin(sympy.pi * (t - begun(m)) / 40)) - sympy.Heaviside(t - begun(m) - 1),
}  # fmt: skip


def hanging(pulse: str) -> ncgen.Model:
    """2 kg on a massless rod of 1 m, at rest, pushed along x by 1 N for 1 s."""
    m = ncgen.Model("hanging")
    m.gravity((0, -9.81, 0))
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -1))
    m.body("mass", [A], mass=2.0)
    m.distance(O, A)
    m.force(A, (PULSES[pulse](m.time, m), 0, 0))
    m.simulation(duration=10.0)
    return m


def swung(t: float) -> float:
    """x (m) t seconds after the push began, by SciPy from break to break."""
    y = np.zeros(2)
    for force, a, b in ((1.0, 0.0, 1.0), (0.0, 1.0, t)):
        y = scipy.integrate.solve_ivp(
            lambda t, y, f=force: [y[1], -9.81 * np.sin(y[0]) + f / 2 * np.cos(y[0])], (a, b), y, "DOP853", rtol=1e-12, atol=1e-14
        ).y[:, -1]
    return float(np.sin(y[0]))


def towed() -> ncgen.Model:
    """2 kg hanging 1 m below a slide that begins to move at 1 m/s after 1 s."""
    m = ncgen.Model("towed")
    m.gravity((0, -9.81, 0))
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, C, A = m.point("O", (0, 0), fixed=True), m.point("C", (0, 0), fixed="y"), m.point("A", (0, -1))
    m.body("carriage", [C], mass=1.0)
    m.body("mass", [A], mass=2.0)
    m.distance(C, A)
    m.drive(m.slide("s", O, C, axis), sympy.Max(0, m.time - 1))
    m.simulation(duration=3.0)
    return m


def after_the_jerk(t: float) -> float:
    """x (m) of that mass, by SciPy: the jerk has no part along the slide on what hangs, which so begins to swing at -1 rad/s."""
    y = scipy.integrate.solve_ivp(lambda t, y: [y[1], -9.81 * np.sin(y[0])], (1.0, t), (0.0, -1.0), "DOP853", rtol=1e-12, atol=1e-14).y
    return float(t - 1 + np.sin(y[0, -1]))


def dragged() -> ncgen.Model:
    """1 kg at A, which a slide's velocity pushes by 2 N s/m; the slide moves at 1 m/s from t = 0 on, by |t|: x = t² then."""
    m = ncgen.Model("dragged")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, C, A = m.point("O", (0, 0), fixed=True), m.point("C", (0, 0), fixed="y"), m.point("A", (0, -1), fixed="y")
    m.body("carriage", [C], mass=1.0)
    m.body("mass", [A], mass=1.0)
    s = m.slide("s", O, C, axis)
    m.drive(s, sympy.Abs(m.time))
    m.force(A, (2 * s.rate, 0))
    m.simulation(duration=3.0)
    return m


class Moved:
    """An exported motion in C; state: t, work, power, h, q, qd, qdd."""

    def __init__(self, model: ncgen.Model, folder, flags: str = "-O0") -> None:
        self.name, self.size = model.name, 4 + 3 * ncgen.compile(model, "numpy").n
        export(model, "c", folder)
        shell(f"cc -std=c99 {STRICT} {flags} -fPIC -shared -Iinclude -Isrc src/*.c -lm -o lib.so", folder)
        self.library = ctypes.CDLL(str(folder / "lib.so"))
        self.call("next_break").restype = ctypes.c_double
        self.state, self.p = (ctypes.c_double * self.size)(), (ctypes.c_double * 8)()
        self.call("defaults")(self.p)
        self.start()

    def call(self, function: str):
        return getattr(self.library, f"{self.name}_{function}")

    def start(self, **p: float) -> Moved:
        for k, value in enumerate(p.values()):
            self.p[k] = value
        assert self.call("start")(self.state, self.p) == 0
        return self

    def advance(self, t: float, tolerance: float = 1e-9) -> Moved:
        assert self.call("advance")(self.state, self.p, *map(ctypes.c_double, (t, tolerance, tolerance))) == 0
        assert self.state[0] == t
        return self

    def step(self, h: float) -> Moved:
        assert self.call("step")(self.state, self.p, ctypes.c_double(h)) == 0
        return self

    def next_break(self, end: float) -> float:
        return self.call("next_break")(self.state, self.p, ctypes.c_double(end))


@pytest.mark.parametrize("pulse", PULSES)
def test_a_pendulum_at_rest_feels_a_push(pulse, tmp_path):
    """In one long step, in many short ones, by the step of fixed length, and with another parameter."""
    moved = Moved(hanging(pulse), tmp_path)
    late = 5e-7 if pulse == "smooth steps" else 0.0  # the middle of its ramps
    assert moved.advance(10.0).state[4] == pytest.approx(swung(5.0 - late), abs=1e-8)
    moved.start()
    for t in np.linspace(0.0, 10.0, 41)[1:]:  # some of which end at a break
        moved.advance(t)
    assert moved.state[4] == pytest.approx(swung(5.0 - late), abs=1e-8)
    moved.start()
    for _ in range(769):
        moved.step(0.013)
    assert moved.state[4] == pytest.approx(swung(moved.state[0] - 5.0 - late), abs=1e-8)
    assert moved.start(begin=21.7).advance(28.0).state[4] == pytest.approx(swung(6.3 - late), abs=1e-8)


def test_the_next_break(tmp_path):
    moved = Moved(hanging("Heaviside"), tmp_path)
    assert [moved.next_break(end) for end in (4.9, 10.0)] == [4.9, 5.0]
    assert moved.advance(5.0).next_break(10.0) == 6.0
    assert moved.advance(6.0).next_break(10.0) == 10.0
    moved.p[0] = 7.25
    assert moved.next_break(10.0) == 7.25


def sliding(law) -> ncgen.Model:
    """1 kg on a slide, pushed by law(t, begin, width) in N."""
    m, s = sliding_block("sliding")
    m.torque(s, law(m.time, m.parameter("begin", 1.0), m.parameter("width", 1.0)))
    m.simulation(duration=10.0)
    return m


def test_no_push_is_missed(tmp_path):
    """Two thousand random ones, the shortest 1e-9 of the run: the velocity is their impulse, from steps of all lengths."""
    moved = Moved(sliding(lambda t, b, w: (sympy.Heaviside(t - b) - sympy.Heaviside(t - b - w)) / w), tmp_path)
    random = np.random.default_rng(7)
    for _ in range(2000):
        begin, width = random.uniform(0.1, 9.0), 10.0 ** random.uniform(-8, -0.1)
        moved.start(begin=begin, width=width)
        for t in (*sorted(random.uniform(0.0, 10.0, random.integers(3))), 10.0):
            moved.advance(t)
        speed = moved.state[4 + (moved.size - 4) // 3]
        assert speed == pytest.approx(1.0, abs=1e-13 / width + 1e-7)


SMOOTH = {
    "gaussian": (lambda u: sympy.exp(-(u**2) / 2), math.sqrt(2 * math.pi)),
    "sech": (lambda u: 1 / sympy.cosh(u), math.pi),
    "lorentzian": (lambda u: (1 + u**2) ** -2, math.pi / 2),
    "two tanh": (lambda u: sympy.tanh(u + 2) - sympy.tanh(u - 2), 8.0),
}
"""Laws of (t - begin) / width, and their areas."""


def test_no_smooth_pulse_is_missed(tmp_path):
    """Hundreds of random ones from 1e-6 of the run on, in few parts; and by steps of fixed length, which are much wider."""
    m = sliding(lambda t, b, w: 0 * t)
    u = (m.time - m.numbers["begin"]) / m.numbers["width"]
    m.torque(m.elements["s"], sum(m.parameter(f"size{k}", 0.0) * law(u) for k, (law, _) in enumerate(SMOOTH.values())))
    moved, random = Moved(m, tmp_path), np.random.default_rng(3)
    speed = 4 + (moved.size - 4) // 3
    for case in range(400):
        begin, width = random.uniform(0.2, 9.8), 10.0 ** random.uniform(-5, -2)
        sizes = {f"size{k}": (case % 4 == k) / (area * width) for k, (_, area) in enumerate(SMOOTH.values())}
        moved.start(begin=begin, width=width, **sizes)
        for t in (*sorted(random.uniform(0.0, 10.0, random.integers(3))), 10.0):
            moved.advance(t, 1e-6)
        assert moved.state[speed] == pytest.approx(1.0, abs=1e-5), (sizes, begin, width)
        if case % 10 < 4:
            moved.start(begin=begin, width=width, **sizes)
            for _ in range(100):
                moved.step(0.1)
            assert moved.state[speed] == pytest.approx(1.0, abs=0.05), (sizes, begin, width)


def test_a_law_that_switches_too_often_is_left_to_error_control(tmp_path):
    """1e9 teeth in a second would be as many steps; a few are."""
    law = lambda t, b, w: w + 0 * b  # noqa: E731
    m = sliding(law)
    saw = m.table("saw", (0, 0.5, 1), (0, 1, 0), periodic=True)
    m.torque(m.elements["s"], 1e-9 * saw(m.numbers["begin"] * m.time))
    moved = Moved(m, tmp_path)
    assert moved.start(begin=8.0, width=0.0).next_break(10.0) == 0.0625
    assert moved.start(begin=1e9, width=0.0).next_break(10.0) == 10.0


def test_a_step_that_fails_behind_a_break_leaves_the_state(tmp_path):
    moved = Moved(sliding(lambda t, b, w: sympy.Heaviside(t - b) * sympy.sqrt(w - t)), tmp_path)
    moved.start(begin=1.0, width=2.0)
    before = list(moved.state)
    assert moved.call("advance")(moved.state, moved.p, *map(ctypes.c_double, (3.0, 1e-9, 1e-9))) != 0
    assert list(moved.state) == before
    assert moved.call("step")(moved.state, moved.p, ctypes.c_double(3.0)) != 0
    assert list(moved.state) == before


def test_a_driver_whose_velocity_jumps(tmp_path):
    """The smallest change of velocities in the sense of kinetic energy is the impulse that the driver gives."""
    moved = Moved(towed(), tmp_path)
    names = ncgen.compile(towed(), "numpy").coordinates
    assert moved.advance(3.0).state[4 + names.index("A.x")] == pytest.approx(after_the_jerk(3.0), abs=1e-7)
    moved.start()
    for _ in range(230):
        moved.step(0.013)
    assert moved.state[4 + names.index("A.x")] == pytest.approx(after_the_jerk(2.99), abs=1e-6)


def test_a_driver_that_jumps_at_the_start(tmp_path):
    """What depends on velocities sees the driver's after t = 0 in the first step, too."""
    moved = Moved(dragged(), tmp_path)
    names = ncgen.compile(dragged(), "numpy").coordinates
    assert moved.advance(3.0).state[4 + names.index("A.x")] == pytest.approx(9.0, abs=1e-9)


def gained(t: float) -> float:
    """Kinetic and potential energy (J) of carriage and mass more than at rest, by SciPy."""
    angle, rate = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], -9.81 * np.sin(y[0])], (1.0, t), (0.0, -1.0), "DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]
    kinetic = 0.5 + (1 + rate * np.cos(angle)) ** 2 + (rate * np.sin(angle)) ** 2
    return float(kinetic + 2 * 9.81 * (1 - np.cos(angle)))


def test_the_work_of_an_impulse_counts(tmp_path):
    """0.5 J at the jerk, which sets the carriage of 1 kg in motion and leaves the mass at rest; later that of the force, too."""
    moved = Moved(towed(), tmp_path)
    assert moved.advance(1.0 + 1e-9).state[1] == pytest.approx(0.5, abs=1e-6)
    assert moved.advance(3.0).state[1] == pytest.approx(gained(3.0), abs=1e-7)
    moved.start()
    for _ in range(230):
        moved.step(0.013)
    assert moved.state[1] == pytest.approx(gained(2.99), abs=1e-6)


@pytest.mark.parametrize("flags, tolerance", [("-DHANGING_NCGEN_SINGLE", 1e-3), ("-DHANGING_NCGEN_LONG_DOUBLE", 1e-6)])
def test_every_number_type_compiles(flags, tolerance, tmp_path):
    export(hanging("sine"), "c", tmp_path)
    shell(f"cc -std=c99 {STRICT} -O0 {flags} -Iinclude -Isrc examples/main.c src/*.c -lm -o main", tmp_path)
    last = shell("./main 10 11", tmp_path).splitlines()[-1].split(",")
    assert float(last[1]) == pytest.approx(swung(5.0), abs=tolerance)


def test_a_mechanism_without_laws_of_time_has_nothing_of_this(exports):
    text = "".join(path.read_text() for path in exports("robot").rglob("*.[ch]"))
    assert "robot_switches" not in text and "robot_next_break" not in text


NODE = """
import { readFileSync } from "node:fs";
import { %s as Mechanism, coordinates } from "./%s.js";
const m = await Mechanism.load(readFileSync(new URL("./%s.wasm", import.meta.url)));
const x = () => m.q[coordinates.indexOf("A.x")], found = [], [end, ...p] = %s;
p.forEach((value, k) => { m.p[k] = value; });
found.push(m.start().advance(end, 1e-9, 1e-9) && x());
m.start();
for (let k = 1; k <= 20; ++k) m.advance((end * k) / 20, 1e-9, 1e-9);
found.push(x());
m.start();
while (m.t + 0.013 < end) m.step(0.013);
found.push(m.t, x());
console.log(JSON.stringify(found));
"""


def by_node(model: ncgen.Model, folder, end: float, *p: float) -> list[float]:
    """x at the end of one long step, of twenty, and [time, x] of steps of 13 ms."""
    if not shutil.which("node"):
        pytest.skip("node is not installed")
    export(model, "wasm", folder)
    (folder / "x.mjs").write_text(NODE % (model.name.title(), model.name, model.name, json.dumps([end, *p])))
    return json.loads(shell("node x.mjs", folder))


@pytest.mark.parametrize("pulse", PULSES)
def test_others_feel_a_push(pulse, tmp_path):
    """In WebAssembly, with the parameter of the description and, in what is quick, with another one."""
    late = 5e-7 if pulse == "smooth steps" else 0.0
    long, many, t, steps = by_node(hanging(pulse), tmp_path, 10.0)
    assert [long, many] == pytest.approx([swung(5.0 - late)] * 2, abs=5e-8)
    assert steps == pytest.approx(swung(t - 5.0 - late), abs=5e-8)
    assert by_node(hanging(pulse), tmp_path, 28.0, 21.7)[0] == pytest.approx(swung(6.3 - late), abs=5e-8)


def test_others_feel_a_jerk(tmp_path):
    long, many, t, steps = by_node(towed(), tmp_path, 3.0)
    assert [long, many] == pytest.approx([after_the_jerk(3.0)] * 2, abs=2e-7)
    assert steps == pytest.approx(after_the_jerk(t), abs=1e-6)


def test_others_feel_a_jerk_at_the_start(tmp_path):
    long, many, t, steps = by_node(dragged(), tmp_path, 3.0)
    assert [long, many, steps] == pytest.approx([9.0, 9.0, t**2], abs=1e-7)


def test_others_count_the_work_of_an_impulse(tmp_path):
    model = towed()
    if not shutil.which("node"):
        pytest.skip("node is not installed")
    export(model, "wasm", tmp_path / "wasm")
    head, _ = NODE.split("const x = ")
    (tmp_path / "wasm" / "x.mjs").write_text(head % ("Towed", "towed", "towed") + "console.log(m.advance(3.0).work);")
    assert float(shell("node x.mjs", tmp_path / "wasm")) == pytest.approx(gained(3.0), abs=1e-6)
