"""Events in exported C: times and states of our own runs, and of closed forms; what exports do not have is refused by name."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from eventful import G, ball, fourbar, sliding_block, wheel
from exported import STRICT, shell

import ncgen
from ncgen.emit.naming import prefix_of
from ncgen.errors import ModelError
from ncgen.exchange.export import export

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@_motion.h"
#define EVENTS (int)(sizeof state.happened / sizeof *state.happened)
static void print(const char *word, const @_state *state, const @_real *p)
{
    printf("%s %.17g", word, (double)state->t);
    for (int i = 0; i < #_N_COORDINATES; ++i) printf(" %.17g", (double)state->q[i]);
    for (int i = 0; i < #_N_COORDINATES; ++i) printf(" %.17g", (double)state->qd[i]);
    for (int i = 0; i < #_N_PARAMETERS; ++i) printf(" %.17g", (double)p[i]);
    printf(" %.17g\n", (double)state->work);
}
int main(int count, char **arguments)
{
    @_state state;
    @_real p[#_N_PARAMETERS + 1];
    const @_real end = (@_real)atof(arguments[1]);
    @_defaults(p);
    int status = @_start(&state, p), before = -1;
    while (!status && state.t < end && !state.stopped) {
        status = @_next_event(&state, p, end, (@_real)TOLERANCE, (@_real)TOLERANCE);
        int sum = 0;
        for (int k = 0; k < EVENTS; ++k) sum += state.happened[k];
        if (!status && sum != before && state.t < end) print("event", &state, p);
        before = sum;
    }
    print("end", &state, p);
    for (int k = 0; k < EVENTS; ++k) printf("%s%d", k ? " " : "", state.happened[k]);
    printf("\n%d %s\n", state.stopped, @_message(status));
    (void)count;
    return 0;
}
"""


def run_in_c(model: ncgen.Model, folder: Path, seconds: float, tolerance: float = 1e-12, flags: str = "-O0", number: str = ""):
    """(rows of events, last row, how often each event happened, whether it stopped, message) of an exported model.

    Under STRICT its sources are compiled one by one, else as the one file that the package has of them, in half the time.
    """
    export(model, "c", folder)
    prefix, is_apart = prefix_of(model.name), STRICT in flags
    header = "@_motion.h" if is_apart else "@_single.h"
    text = DRIVER.replace("@_motion.h", header).replace("@", prefix).replace("#_", f"{prefix.upper()}_")
    (folder / "driver.c").write_text(text if is_apart else f"#define {prefix.upper()}_IMPLEMENTATION\n{text}")
    sources = "-Iinclude -Isrc driver.c src/*.c" if is_apart else "-Isingle driver.c"
    shell(f"cc -std=c99 {flags} {number} -DTOLERANCE={tolerance} {sources} -lm -o driver", folder)
    *rows, counts, last = shell(f"timeout 60 ./driver {seconds!r}", folder).splitlines()
    table = [(line.split()[0], np.array(line.split()[1:], dtype=float)) for line in rows]
    events = [row for word, row in table if word == "event"]
    return events, table[-1][1], [int(n) for n in counts.split()], last[0] == "1", last[2:]


def test_a_ball_bounces(tmp_path):
    """Closed form: impacts at t₁ and 2 t₁ and so on, the end where bounces accumulate."""
    events, last, counts, stopped, said = run_in_c(ball(rest="end"), tmp_path, 2.0, flags=f"-O1 {STRICT}")
    assert [row[0] for row in events[:2]] == pytest.approx([0.4515236409857309, 0.9030472819714618], rel=1e-12)
    assert events[9][0] == pytest.approx(1.352807158734592, rel=1e-12)
    assert stopped and said == "ok" and counts == [len(events)] and last[0] == pytest.approx(1.354570922957193, abs=1e-5)
    with pytest.warns(UserWarning, match="bounces accumulate"):
        own = ncgen.simulate(ncgen.compile(ball(rest="end")), 2.0)
    assert len(own.events) == len(events) and last[0] == pytest.approx(own.t[-1], abs=1e-10)
    assert events[0][-1] == pytest.approx(-0.75 * G, rel=1e-10)  # work: what the impact takes


def test_a_ball_that_comes_to_rest(tmp_path):
    """The gap is held closed from the time on at which infinitely many bounces end."""
    events, last, counts, stopped, said = run_in_c(ball(), tmp_path, 3.0, flags=f"-O1 {STRICT}")
    own = [each.t for each in ncgen.simulate(ncgen.compile(ball()), 3.0).events if not each.transition]
    assert [row[0] for row in events] == pytest.approx(own, abs=1e-11) and counts == [len(own)] and not stopped and said == "ok"
    assert last[0] == 3.0 and abs(last[1]) < 1e-15 and last[2] == 0.0


def test_a_ball_that_is_lifted(tmp_path):
    """A force of 4 t N lifts it where it exceeds its weight, at g/4."""
    m = ncgen.Model("lifted")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, 4 * m.time))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=0.5))
    *_, last, _, _, said = run_in_c(m, tmp_path, 4.0)
    assert said == "ok" and last[1] == pytest.approx(2 * (4.0 - G / 4) ** 3 / 3, rel=1e-9)


def test_a_rope_becomes_slack_and_taut(tmp_path):
    """T11: it is taut from the start, slack 30° above horizontal, and taut again at the bottom."""
    m = ncgen.Model("rope")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, -1))
    m.body("bob", [P], mass=1.0)
    m.gravity((0, -G))
    m.rope(O, P, 1.0, name="rope")
    m.simulation(duration=1.3, qd0={"P.x": math.sqrt(3.5 * G), "P.y": 0.0})
    events, last, counts, _, said = run_in_c(m, tmp_path, 1.3)
    assert said == "ok" and counts == [1] and events[0][0] == pytest.approx(0.4819942834614219 + 0.782061887005775, rel=1e-10)
    assert events[0][1:5] == pytest.approx([0.0, -1.0, -1.107361729517505, 0.0], abs=1e-8)
    kernels = ncgen.compile(m)
    own = ncgen.simulate(kernels, 1.3, rtol=1e-12, qd0=m.simulation_options["qd0"])
    assert last[1:5] == pytest.approx([*own.q[-1], *own.qd[-1]], abs=1e-8)


def test_a_block_pushed_against_its_stop(tmp_path):
    """The push turns at 2 s, and the block leaves at once."""
    m, s = sliding_block("stop")
    m.torque(s, 2 - m.time)
    m.stop(s, upper=0.5)
    _, last, counts, _, said = run_in_c(m, tmp_path, 3.0)
    assert said == "ok" and counts == [1] and last[1] == pytest.approx(0.5 - 1 / 6, rel=1e-9)


def test_a_ball_in_a_corner(tmp_path):
    """Two gaps are held at the end; one after the other comes to rest."""
    m = ncgen.Model("corner")
    P = m.point("P", (0.3, 1))
    m.body("ball", [P], mass=1.0)
    m.gravity((-2.0, -G))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=0.4, order="simultaneous"))
    m.event("wall", when=P.x, do=ncgen.impact(restitution=0.3, order="simultaneous"))
    _, last, counts, _, said = run_in_c(m, tmp_path, 4.0)
    own = ncgen.simulate(ncgen.compile(m), 4.0)
    assert said == "ok" and last[1:5] == pytest.approx(0.0, abs=1e-12)
    assert counts == [sum(each.name == name and not each.transition for each in own.events) for name in ("floor", "wall")]


def test_a_push_that_changes_between_steps(tmp_path):
    """A block that its input pushes against its stop leaves it in the step in which the push turns round."""
    m, s = sliding_block("pushed")
    m.torque(s, m.input("push"))
    m.stop(s, upper=0.5)
    export(m, "c", tmp_path)
    (tmp_path / "driver.c").write_text(PUSHED)
    shell("cc -std=c99 -O0 -g -fsanitize=address,undefined -Iinclude -Isrc driver.c src/*.c -lm -o driver", tmp_path)
    first, second = ([float(x) for x in line.split()] for line in shell("./driver", tmp_path).splitlines())
    assert first == pytest.approx([2.0, 0.5, 0.0], abs=1e-12) and second == pytest.approx([3.0, 0.0, -1.0], abs=1e-12)


PUSHED = r"""
#include <stdio.h>
#include "pushed_motion.h"
int main(void)
{
    pushed_state state;
    double p[PUSHED_N_PARAMETERS];
    pushed_defaults(p);
    p[PUSHED_P_PUSH] = 1;
    int status = pushed_start(&state, p);
    for (int k = 0; k < 4 && !status; ++k) status = pushed_step(&state, p, 0.5);
    printf("%.17g %.17g %.17g\n", state.t, state.q[PUSHED_Q_S], state.qd[PUSHED_Q_S]);
    p[PUSHED_P_PUSH] = -1;
    for (int k = 0; k < 2 && !status; ++k) status = pushed_step(&state, p, 0.5);
    printf("%.17g %.17g %.17g\n", state.t, state.q[PUSHED_Q_S], state.qd[PUSHED_Q_S]);
    return status;
}
"""


@pytest.mark.parametrize("number", ["SINGLE", "LONG_DOUBLE"])
def test_other_number_types(tmp_path, number):
    tolerance = 1e-5 if number == "SINGLE" else 1e-15
    events, *_ = run_in_c(ball(), tmp_path, 0.7, tolerance, number=f"-DBALL_NCGEN_{number}")
    assert events[0][0] == pytest.approx(0.4515236409857309, rel=1e-6 if number == "SINGLE" else 1e-15)


def test_changes_of_parameters_and_velocities(tmp_path):
    events, last, counts, *_ = run_in_c(wheel(), tmp_path, 5.0)
    assert np.diff([0.0, *(row[0] for row in events)]) == pytest.approx([1.034549811423279] * 4, rel=1e-10)
    assert counts == [4] and last[5] == 4.0  # feet


def test_one_event_sets_several_velocities(tmp_path):
    """More of them than there are events."""
    m = ncgen.Model("kicked")
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    m.body("a", [A], mass=1.0)
    m.body("b", [B], mass=2.0)
    m.event("kick", when=A.x - 0.5, direction="rising", do={"rate(A.x)": 0.0, "rate(A.y)": 1.0, "rate(B.x)": -1.0, "rate(B.y)": 0.5})
    m.simulation(duration=1.0, qd0={"A.x": 1.0, "A.y": 0.0, "B.x": 0.0, "B.y": 0.0})
    *_, last, counts, _, said = run_in_c(m, tmp_path, 1.0, flags="-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all")
    assert said == "ok" and counts == [1] and last[1:10] == pytest.approx([0.5, 0.5, 0.5, 0.25, 0.0, 1.0, -1.0, 0.5, 1.25], abs=1e-12)


def three_balls(order: str) -> ncgen.Model:
    m = ncgen.Model("balls")
    for k, x in enumerate((-1.0, 0.0, 0.1)):
        m.body(f"ball{k}", [m.point(f"P{k}", (x, 0), fixed="y")], mass=1.0)
    x = [m.elements[f"P{k}"].x for k in range(3)]
    for k in (1, 2):
        m.event(f"gap{k}", when=x[k] - x[k - 1] - 0.1, do=ncgen.impact(restitution=1.0, order=order, rest="end"))
    m.simulation(duration=1.5, qd0={"P0.x": 1.0, "P1.x": 0.0, "P2.x": 0.0})
    return m


@pytest.mark.parametrize(
    ("order", "expected"), [("simultaneous", (-1 / 3, 2 / 3, 2 / 3)), ("in turn", (0.0, 0.0, 1.0)), ("", "several impacts")]
)
def test_the_law_of_several_impacts(tmp_path, order, expected):
    events, last, _, _, said = run_in_c(three_balls(order), tmp_path, 1.5)
    if order:
        assert last[4:7] == pytest.approx(expected, abs=1e-12) and events[0][0] == pytest.approx(0.9, rel=1e-12)
    else:
        assert said.startswith(expected)


def against(model: ncgen.Model, folder: Path, seconds: float, rtol: float) -> None:
    """Events and the end of a motion in C are those of our own run."""
    kernels = ncgen.compile(model)
    options = {k: v for k, v in model.simulation_options.items() if k in ("zd0", "z", "qd0", "q0")}
    run = ncgen.simulate(kernels, seconds, rtol=1e-12, points=2, **options)
    events, last, _, _, said = run_in_c(model, folder, seconds, 1e-13)
    assert said == "ok" and len(events) == len({each.t for each in run.events}) > 0
    assert [row[0] for row in events] == pytest.approx(sorted({each.t for each in run.events}), rel=rtol)
    n = kernels.n
    assert last[1 : 1 + n] == pytest.approx(run.q[-1], abs=rtol) and last[1 + n : 1 + 2 * n] == pytest.approx(run.qd[-1], abs=10 * rtol)


def test_a_loop_hits_a_stop(tmp_path):
    against(fourbar(), tmp_path, 0.6, 1e-9)


def test_a_compliant_stop(tmp_path):
    """Hunt-Crossley: inputs that events change say whether it touches."""
    m, s = sliding_block("stop")
    m.stop(s, upper=0.5, stiffness=1e4, damping=0.5, exponent=1.5, name="stop")
    m.simulation(duration=0.8, qd0={"s": 1.0})
    events, last, counts, *_ = run_in_c(m, tmp_path, 0.8)
    assert events[0][0] == pytest.approx(0.5, rel=1e-11) and counts == [1, 1]
    assert -last[3] == pytest.approx(0.7484349315974342, rel=1e-9)


def test_a_law_of_time_with_breaks(tmp_path):
    m, s = sliding_block("pushed")
    m.torque(s, 4 * ncgen.smooth_step((m.time - 0.2) / 0.2))
    m.event("half", when=s - 0.5, direction="rising", do={"rate(s)": -s.rate})
    m.event("late", when=m.time - 0.3, direction="rising")
    against(m, tmp_path, 1.5, 1e-9)


def test_an_event_that_ends_the_motion(tmp_path):
    m, s = sliding_block("ended")
    m.event("wall", when=s - 0.5, direction="rising", do="stop")
    m.simulation(duration=1.0, qd0={"s": 1.0})
    events, last, counts, stopped, said = run_in_c(m, tmp_path, 1.0)
    assert stopped and said == "ok" and counts == [1] and last[0] == pytest.approx(0.5, rel=1e-13)


def shared() -> ncgen.Model:
    m, s = sliding_block("shared")
    A = m.elements["A"]
    pressed = m.constrain(s - A.x, label="nut")
    m.friction(s, coefficient=0.1, load=pressed)
    return m


def called() -> ncgen.Model:
    m, s = sliding_block("called")
    m.event("seen", when=s - 0.5, do=lambda at, kernels: None)
    return m


@pytest.mark.parametrize(
    ("model", "target", "message"),
    [
        (shared, "c", "shared cannot be exported: the load of friction s.friction is shared with redundant constraints; leave these out"),
        (called, "c", "called cannot be exported: event seen calls a Python function"),
        (ball, "casadi", "ball cannot be exported: this export does not support events yet (floor); take c,"),
    ],
    ids=lambda x: x if isinstance(x, str) else x.__name__,
)
def test_refused(model, target, message, tmp_path):
    with pytest.raises(ModelError) as refused:
        export(model(), target, tmp_path)
    assert str(refused.value).startswith(message)


PYTHON = r"""
import ball
motion = ball.Motion()
motion.next_event(2.0, 1e-12, 1e-12)
print(motion.t, *motion.q, *motion.qd, motion.happened["floor"])
motion.p = [0.25]
motion.next_event(2.0, 1e-12, 1e-12)
print(motion.t, motion.qd[0], motion.happened["floor"])
motion.advance(2.0)
print(motion.stopped, motion.t)
try:
    motion.step(0.1)
except ball.MotionError as error:
    print(error)
"""


def test_a_python_package(tmp_path):
    """Restitution 0.5, then 0.25 from the second impact on."""
    export(ball(rest="end"), "python", tmp_path)
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", tmp_path)
    first, second, third, said = shell(f"{sys.executable} -c '{PYTHON}'", tmp_path).splitlines()
    fall, speed = math.sqrt(2 / G), math.sqrt(2 * G)
    assert [float(x) for x in first.split()] == pytest.approx([fall, 0.0, speed / 2, 1.0], abs=1e-11)
    assert [float(x) for x in second.split()] == pytest.approx([2 * fall, speed / 8, 2.0], abs=1e-11)
    assert third.split()[0] == "True" and float(third.split()[1]) == pytest.approx(2 * fall + speed / 4 / G / 0.75, abs=1e-5)
    assert said == "an event has ended the motion"


SINGLE = r"""
#define BALL_IMPLEMENTATION
#include "ball_single.h"
#include <stdio.h>
int main(void)
{
    ball_state state;
    double p[BALL_N_PARAMETERS];
    ball_defaults(p);
    int status = ball_start(&state, p);
    while (!status && state.t < 2) status = ball_step(&state, p, 0.01);
    printf("%d %d %.17g\n", status, p[BALL_P_FLOOR_ON] > 0, state.q[0]);
    return 0;
}
"""


def test_one_header_and_cpp(tmp_path):
    """In one file as in many, and from C++."""
    export(ball(), "c", tmp_path)
    (tmp_path / "main.c").write_text(SINGLE)
    status, mode, y = shell(f"cc -std=c99 -O0 {STRICT} -Isingle main.c -lm -o main && ./main", tmp_path).split()
    assert (status, mode) == ("0", "1") and abs(float(y)) < 1e-15
    (tmp_path / "main.cpp").write_text(
        '#include "ball.hpp"\n#include <cstdio>\nint main() { ball::mechanism m; m.next_event(2.0); std::printf("%.17g", m.state.t); }\n'
    )
    said = shell("make -s libball.a && g++ -std=c++11 -Iinclude main.cpp libball.a -lm -o other && ./other", tmp_path)
    assert float(said) == pytest.approx(0.4515236409857309, rel=1e-12)
