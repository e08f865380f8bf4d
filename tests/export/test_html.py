"""The page that computes: what is in it, and what it does in a browser, judged by closed forms, by our own kernels and by the C export."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np
import pytest
from browser import CHROMIUM
from exported import shell
from living import click, enter, fixed_steps, nothing_said, place_of, settled, state_of
from scipy.special import ellipj, ellipk

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_names, load
from ncgen.exchange.export import export

FETCHING = ("http:", "https:", " src=", "url(", "@import", "import(", 'fetch("', "XMLHttpRequest", "WebSocket")
HOSTILE = "</script><script>document.body.dataset.broken='yes'</script><!--<img src=x onerror=\"document.title='broken'\">&'\""

shown = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


def linkage() -> ncgen.Model:
    """A four-bar linkage whose crank and base are parameters, with a motor on the crank; its words are as unkind as words can be."""
    m = ncgen.Model("linkage")
    crank, base = m.parameter("crank", 0.1, "m"), m.parameter("base", 0.4, HOSTILE)
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (base, 0), fixed=True)
    B, C = m.point("B", (crank, 0)), m.point("C", (0.35, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", points=[A, B], mass=0.2, inertia=1.7e-4)
    m.body("coupler", points=[B, C], mass=0.8, inertia=0.01)
    m.body("rocker", points=[C, D], mass=0.6, inertia=4.6e-3)
    psi = m.angle("psi", start=x, end=B - A, axis=z)
    m.torque(psi, m.input("motor", "N m"))
    m.output(f"height {HOSTILE}", C.y, HOSTILE)
    m.gravity((0, -9.81, 0))
    m.simulation(duration=2.0, z=["psi"], zd0={"psi": 12.0})
    return m


def data_of(page):
    return json.loads(re.search(r'id="mechanism">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)[1])


def unpacked(page, part: str) -> bytes:
    """What is compressed in a page."""
    letters = re.search(f'id="{part}">([^<]*)<', page.read_text(encoding="utf-8"))[1]
    return zlib.decompress(base64.a85decode(letters.replace("v", "<")))


# -- what is in it ---------------------------------------------------------------------------------


def test_one_small_file_that_asks_for_nothing(page_of):
    """No address, no external script, style, font or picture, and a policy that would forbid them."""
    page = page_of("pendulum")
    text = page.read_text(encoding="utf-8") + unpacked(page, "script").decode()
    assert page.name == "pendulum.html" and page.stat().st_size < 95_000
    assert [word for word in FETCHING if word in text] == []
    assert "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; img-src data:" in text


def test_the_module_is_in_it(page_of):
    """Its bytes, compressed, with the kernels that the page calls and the runtime that moves them."""
    binary = unpacked(page_of(linkage()), "binary")
    assert binary.startswith(b"\0asm\1\0\0\0")
    assert all(f"linkage_{name}".encode() in binary for name in ("phi", "phi_q", "mass", "energy", "described"))
    assert b"ncgen_linked_advance" in binary


def test_the_same_model_gives_the_same_page(page_of, tmp_path):
    (again,) = export(linkage(), "html", tmp_path)
    assert again.read_bytes() == page_of(linkage()).read_bytes()


def test_rows_are_told_in_the_users_words(page_of):
    """With what they speak of, the body that owns them, and those that share an element."""
    rows = {row["label"]: row for row in data_of(page_of(linkage()))["rows"]}
    assert rows["distance B-C"]["text"].startswith("|a|^2 - L^2 = 0 with a = B-C")
    assert rows["distance B-C"]["bodies"] == ["coupler"] and rows["distance B-C"]["touched"] == ["crank", "coupler", "rocker"]
    assert rows["angle psi"]["bodies"] == [] and rows["angle psi"]["elements"] == ["x", "B", "A", "z", "psi"]


def test_what_has_no_motion_is_refused_in_one_line(tmp_path):
    model = load("pendulum")
    model.callbacks.append(print)
    with pytest.raises(ModelError, match="^pendulum cannot be exported: it calls a Python function$"):
        export(model, "html", tmp_path)
    assert list(tmp_path.iterdir()) == []


# -- what it does ----------------------------------------------------------------------------------


@shown
def test_the_pendulum_moves_by_elliptic_functions(browser, page_of):
    """1000 steps of a millisecond, from the horizontal; energy and rod hold."""
    browser.open(page_of("pendulum"))
    fixed_steps(browser, 1e-3)
    click(browser, "step", 1000)
    t, q, _ = state_of(browser)
    assert t == pytest.approx(1.0, abs=1e-12)
    (q0,), length = [load("pendulum").elements["B"].initial[:2]], 1.0
    k = np.sqrt((1 - -q0[1] / length) / 2)
    sn = ellipj(ellipk(k**2) - np.sqrt(9.81 / length) * t, k**2)[0]
    expected = 2 * np.arcsin(k * sn)
    assert np.arctan2(abs(q[0]), -q[1]) == pytest.approx(abs(expected), abs=1e-9)
    assert browser.value("living.drift()") < 1e-9 and nothing_said(browser)


@shown
def test_hostile_words_are_text(browser, page_of):
    """Units and labels are shown as they are and do nothing."""
    browser.open(page_of(linkage()))
    assert browser.value("document.body.dataset.broken ?? document.title") == "linkage"
    assert browser.value("document.querySelectorAll('img').length") == 0
    assert f"base ({HOSTILE})" in browser.value("[...document.querySelectorAll('#parameters span')].map((e) => e.textContent)")
    assert f"height {HOSTILE}" in browser.value("[...document.querySelectorAll('#more option')].map((e) => e.textContent)")
    assert nothing_said(browser)


@shown
def test_sliders_change_the_motion(browser, page_of):
    """A length, a base, a motor and a start velocity: the page goes on as our own run with these numbers does."""
    browser.open(page_of(linkage()))
    for name, value in (("crank", 0.12), ("base", 0.37), ("motor", 0.05), ("psi", 10.0)):
        enter(browser, name, value)
    click(browser, "restart")
    kernels = ncgen.compile(linkage(), backend="numpy")
    p = np.array([0.12, 0.37, 0.05])
    t, q, qd = state_of(browser)
    assert t == 0 and qd[kernels.index["psi"]] == pytest.approx(10.0, rel=1e-12)
    assert np.max(np.abs(kernels.phi(q, 0.0, p))) < 1e-14
    assert browser.value("living.presentPose().positions[1]") == [0.37, 0, 0]
    fixed_steps(browser, 1e-3)
    click(browser, "step", 200)
    run = ncgen.simulate(kernels, 0.2, z=["psi"], zd0={"psi": 10.0}, p=p, rtol=1e-10, atol=1e-11, points=2)
    np.testing.assert_allclose(state_of(browser)[1], run.q[-1], atol=1e-7)
    click(browser, "defaults")
    assert state_of(browser)[2][kernels.index["psi"]] == pytest.approx(12.0, rel=1e-12) and nothing_said(browser)


@shown
def test_a_number_that_cannot_be_is_told_and_taken_back(browser, page_of):
    """A crank without length has no angle."""
    browser.open(page_of(linkage()))
    enter(browser, "crank", 0)
    assert browser.value("document.getElementById('problem').textContent").startswith("Mechanism, t = 0 s: the loops cannot be closed")
    assert browser.value("[...living.mechanism.p].slice(0, 3)") == [0.1, 0.4, 0.0] and browser.said == []


@shown
def test_a_point_is_dragged_in_a_pause(browser, page_of):
    """The linkage stays closed by our own Φ; a point that can goes where the pointer goes."""
    kernels = ncgen.compile(load("doublependulum"), backend="numpy")
    browser.open(page_of("doublependulum"))
    (x, y), (ax, ay) = place_of(browser, "C"), place_of(browser, "A")
    browser.mouse("mousePressed", x, y)
    for share in np.linspace(0, 0.4, 12):
        browser.mouse("mouseMoved", x + share * (ax - x) + 40 * share, y + share * (ay - y) + 60 * share)
        settled(browser)
        assert np.max(np.abs(kernels.phi(state_of(browser)[1]))) < 1e-12
    settled(browser)
    np.testing.assert_allclose(place_of(browser, "C"), [x + 0.4 * (ax - x) + 16, y + 0.4 * (ay - y) + 24], atol=0.5)
    browser.mouse("mouseReleased", x, y)
    assert state_of(browser)[0] == 0 and nothing_said(browser)


@shown
def test_a_loop_stays_closed_where_the_pointer_cannot_be_followed(browser, page_of):
    kernels = ncgen.compile(linkage(), backend="numpy")
    browser.open(page_of(linkage()))
    before, (x, y) = state_of(browser)[1], place_of(browser, "C")
    browser.mouse("mousePressed", x, y)
    for k in range(12):
        browser.mouse("mouseMoved", x + 15 * k, y - 10 * k)
        settled(browser)
        assert np.max(np.abs(kernels.phi(state_of(browser)[1]))) < 1e-12
    browser.mouse("mouseReleased", x + 165, y - 110)
    assert np.max(np.abs(state_of(browser)[1] - before)) > 0.02 and nothing_said(browser)


@shown
def test_a_body_is_pushed_while_it_moves(browser, page_of):
    """The work of the pointer is in the balance; the body follows it."""
    browser.open(page_of("doublependulum"))
    click(browser, "play")
    x, y = place_of(browser, "C")
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x + 60, y + 60)
    browser.wait("living.mechanism.t > 0.5", 20)
    worst = browser.value("living.violation()")
    browser.mouse("mouseReleased", x + 60, y + 60)
    assert abs(browser.value("living.mechanism.work")) > 1e-3
    assert browser.value("living.drift()") < 1e-6 and worst < 1e-10 and nothing_said(browser)


@shown
def test_rows_light_up(browser, page_of):
    """Those of the body that is pointed at, also by keys; and what the row that is pointed at speaks of."""
    browser.open(page_of(linkage()))
    lit = "[...document.querySelectorAll('#rows li.lit b')].map((e) => e.textContent)"
    browser.mouse("mouseMoved", *(place_of(browser, "B") + place_of(browser, "C")) / 2, held=False)
    assert browser.value(lit) == ["distance B-C"]
    browser.mouse("mouseMoved", 5, 60, held=False)
    assert browser.value(lit) == []
    browser.value("document.getElementById('stage').focus()")
    browser.press("n")
    browser.press("n")
    browser.press("n")
    assert browser.value(lit) == ["distance C-D"]
    x, y = browser.value("(({ left, top }) => [left + 20, top + 8])(document.querySelector('#rows li').getBoundingClientRect())")
    browser.mouse("mouseMoved", x, y, held=False)
    points = browser.value("[...living.lit().points].map((i) => living.scene.points[i])")
    assert sorted(points) == ["A", "B"] and browser.value(lit) == []
    assert nothing_said(browser)


@shown
def test_keys_and_touch(browser, page_of):
    """Space starts and pauses, r resets, a full stop is one step; a finger takes hold of a point, two change the view. Narrow and dark."""
    browser.open(page_of("doublependulum"), width=390, height=844, dark=True)
    assert browser.value("document.documentElement.scrollWidth") == 390
    browser.press(" ", "Space")
    browser.wait("living.mechanism.t > 0.05")
    browser.press(" ", "Space")
    assert browser.value("living.state.running") is False
    browser.press("r")
    assert state_of(browser)[0] == 0
    browser.press(".")
    assert 0 < state_of(browser)[0] < 0.1
    before, (x, y) = state_of(browser)[1], place_of(browser, "C")
    browser.touch("touchStart", (x, y))
    browser.touch("touchMove", (x - 20, y + 30))
    settled(browser)
    browser.touch("touchEnd")
    assert np.max(np.abs(state_of(browser)[1] - before)) > 1e-3
    near = np.linalg.norm(place_of(browser, "C") - place_of(browser, "A"))
    browser.touch("touchStart", (60, 110), (100, 110))
    browser.touch("touchMove", (30, 110), (140, 110))
    browser.touch("touchEnd")
    settled(browser)
    assert np.linalg.norm(place_of(browser, "C") - place_of(browser, "A")) > 1.5 * near and nothing_said(browser)


# -- longer proofs ---------------------------------------------------------------------------------

NATIVE = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@_motion.h"
int main(int count, char **given)
{
    @_state s;
    double p[100];
    @_defaults(p);
    if (count < 3 || @_start(&s, p)) return 1;
    for (int k = atoi(given[1]); k > 0; --k) if (@_step(&s, p, atof(given[2]))) return 2;
    printf("%.17g\n", s.t);
    for (int i = 0; i < N; ++i) printf("%.17g\n", s.q[i]);
    for (int i = 0; i < N; ++i) printf("%.17g\n", s.qd[i]);
    return 0;
}
"""


def native(fresh, name, steps, h):
    """t, q and q̇ after some steps in the exported C."""
    folder = fresh(name)
    (folder / "examples/main.c").write_text(f"enum {{ N = {len(ncgen.compile(load(name)).coordinates)} }};\n{NATIVE.replace('@', name)}")
    return np.array(shell(f"make -s CFLAGS='-O1 -ffp-contract=off' && ./main {steps} {h!r}", folder).split(), dtype=float)


def test_pages_are_small(page_of):
    assert page_of("fourbar").stat().st_size < 100_000 and page_of("robot").stat().st_size < 400_000


@shown
@pytest.mark.slow
@pytest.mark.parametrize(("name", "h", "seconds"), [("robot", 2.0**-11, 1.0), ("fourbar", 2.0**-14, 5.0), ("suspension", 2.0**-11, 5.0)])
def test_the_page_moves_as_c_does(browser, page_of, fresh, name, h, seconds):
    """To 1e-9. The robot falls through a singular position of its loop after 1.03 s, where any two programs lose seven digits."""
    browser.open(page_of(name))
    fixed_steps(browser, h)
    click(browser, "play")
    browser.wait(f"living.mechanism.t > {0.8 * seconds} || !living.state.running")
    click(browser, "play")
    click(browser, "step", round((seconds - state_of(browser)[0]) / h))
    found = np.concatenate([np.atleast_1d(part) for part in state_of(browser)])
    expected = native(fresh, name, round(seconds / h), h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))
    assert nothing_said(browser)


@shown
@pytest.mark.slow
@pytest.mark.parametrize("step", [None, 5e-4])
def test_the_robot_runs_in_its_page(browser, page_of, step):
    """5 s at true speed: 30 pictures a second or more, by the page's own processor time; energy to 1e-6."""
    browser.open(page_of("robot"))
    fixed_steps(browser, step or 1e-3)
    if step is None:
        click(browser, "adaptive")
    browser.value("(living.began = performance.now())")
    click(browser, "play")
    before = browser.worked(), *browser.value("[living.state.frames, living.mechanism.t]")
    browser.wait("living.mechanism.t >= 5 || !living.state.running")
    frames, seconds = browser.value("[living.state.frames, (performance.now() - living.began) / 1000]")
    worked, drawn, moved = (np.array([browser.worked(), *browser.value("[living.state.frames, living.mechanism.t]")]) - before).tolist()
    click(browser, "play")
    print(f"{frames / seconds:.0f} pictures a second; of its own time {drawn / worked:.0f}, and {moved / worked:.2f} of true speed")
    assert drawn / worked >= 30 and moved / worked > 1
    assert browser.value("living.drift()") < 1e-6 and nothing_said(browser)


@shown
@pytest.mark.slow
@pytest.mark.parametrize("name", example_names())
def test_every_example_has_a_page(browser, page_of, name):
    """It starts, runs for a second, closes its loops by our own Φ, keeps its energy, and says nothing."""
    browser.open(page_of(name))
    click(browser, "play")
    browser.wait("living.state.frames > 30")
    click(browser, "play")
    t, q, _ = state_of(browser)
    kernels = ncgen.compile(load(name), backend="numpy")
    assert t > 0 and np.max(np.abs(kernels.phi(q, t)) / kernels.row_sizes) < 1e-10
    assert browser.value("living.drift()") < 1e-3 and nothing_said(browser)
