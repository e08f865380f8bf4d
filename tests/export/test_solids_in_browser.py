"""Solids in a browser: what is in front hides what is behind, layers can be switched, pages are not blank and say nothing."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from matplotlib.image import imread

import ncgen
from ncgen.exchange.export import export
from ncgen.view.player import write_player

sys.path.append(str(Path(__file__).parents[1] / "view"))
from turning import TurningRun  # noqa: E402

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

RED, GREEN = "#e02020", "#20c020"


def towers() -> ncgen.Model:
    """Two boxes on a turning plate, the red one before the green one as seen first, with a spring and a telescope between points."""
    m = ncgen.Model("towers")
    O, A = m.point("O", (0, 0, 0), fixed=True), m.point("A", (1, 0, 0))
    top = m.point("T", (0, 0, 2), fixed=True)
    up = m.vector("up", (0, 0, 1), fixed=True)
    plate = m.body("plate", [O, A], [up], mass=1.0, com=(0, 0, 0), inertia=(1, 1, 1))
    east = m.vector("east", (1, 0, 0), fixed=True)
    m.independent(m.angle("psi", east, A - O, up))
    near = np.array([np.cos(np.radians(40)), np.sin(np.radians(40)), 0])
    m.box(plate, (0.8, 0.8, 0.8), 0.55 * near, colour=RED)
    m.box(plate, (0.8, 0.8, 0.8), -0.55 * near, colour=GREEN)
    m.cylinder(plate, 0.1, 0.2, (0.9, -0.9, 0))
    m.spring(A, top, 1.0)
    m.line(O, A)
    m.simulation(duration=2.0, zd0={"psi": 1.0})
    return m


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        yield found


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The player of a motion that turns half a turn, which brings the green box to the front."""
    run = TurningRun(towers(), np.linspace(0, np.pi, 61))
    return write_player(run, tmp_path_factory.mktemp("player") / "towers.html")


def picture(browser, tmp_path) -> np.ndarray:
    """What is seen of the mechanism's canvas, two refreshes later (rows, columns, 3), from 0 to 255."""
    browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
    browser.photograph(tmp_path / "seen.png")
    left, top, right, bottom = browser.value(
        "(({ left, top, right, bottom }) => [left, top, right, bottom])(stage.getBoundingClientRect())"
    )
    whole = imread(io.BytesIO((tmp_path / "seen.png").read_bytes()))
    return (255 * whole[round(top) : round(bottom), round(left) : round(right), :3]).round()


def redness(pixels: np.ndarray) -> np.ndarray:
    return pixels[..., 0] - pixels[..., 1]


def count(pixels: np.ndarray, colour: str) -> int:
    sign = 1 if colour == RED else -1
    return int((sign * redness(pixels) > 60).sum())


def at(browser, pixels: np.ndarray, place: str) -> np.ndarray:
    """The pixel at a place (m) as the page projects it."""
    x, y = browser.value(f"camera(stage.clientWidth, stage.clientHeight).project({place})")
    return pixels[round(y), round(x)]


@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 800, False), (390, 844, True)])
def test_the_player_shows_solids(browser, page, tmp_path, width, height, dark):
    """At the place of a box there is its colour; of two behind each other the nearer is seen; time turns them."""
    browser.open(page, width, height, dark)
    seen = picture(browser, tmp_path)
    assert browser.value("document.documentElement.scrollWidth") == width
    assert redness(at(browser, seen, "[0.42, 0.35, 0]")) > 60  # in the near box
    assert redness(at(browser, seen, "[-0.42, -0.35, 0.38]")) < -60  # in the far one, whose upper side is seen
    reds, greens = count(seen, RED), count(seen, GREEN)
    assert reds > 1.2 * greens > 0.005 * seen.shape[0] * seen.shape[1]
    for _ in range(60):
        browser.press("ArrowRight")
    turned = picture(browser, tmp_path)
    assert count(turned, GREEN) > 1.2 * count(turned, RED)
    assert browser.said == []


def test_layers_can_be_switched(browser, page, tmp_path):
    """Without bodies no colour of theirs is left, without the wireframe other pixels change; names are there when they are asked for."""
    browser.open(page)
    whole = picture(browser, tmp_path)
    browser.value("document.getElementById('wire').click()")
    bare = picture(browser, tmp_path)
    assert 50 < (np.abs(whole - bare).max(axis=-1) > 40).sum() < 5000
    browser.value("document.getElementById('bodies').click()")
    assert count(picture(browser, tmp_path), RED) < 20
    browser.value("document.getElementById('bodies').click()")
    assert browser.value("document.getElementById('names').checked") is False
    browser.value("document.getElementById('names').click()")
    assert (np.abs(picture(browser, tmp_path) - bare).max(axis=-1) > 40).sum() > 100
    assert browser.said == []


def test_there_are_shadows_on_the_ground(browser, page, tmp_path):
    """Seen from above and not from below."""
    browser.open(page)
    shade = browser.value("getComputedStyle(document.documentElement).getPropertyValue('--shadow').trim()")
    colour = np.array([int(shade[k : k + 2], 16) for k in (1, 3, 5)])
    here = int((np.abs(picture(browser, tmp_path) - colour).max(axis=-1) <= 1).sum())
    browser.value("(view.elevation = -0.3, requestDraw())")
    below = int((np.abs(picture(browser, tmp_path) - colour).max(axis=-1) <= 1).sum())
    assert here > 1000 and below < here / 10 and browser.said == []


def test_without_webgl_hulls_are_drawn(browser, page, tmp_path):
    browser.open(page)
    with_solids = picture(browser, tmp_path)
    browser.value("(solids = null, requestDraw())")
    without = picture(browser, tmp_path)
    assert count(with_solids, RED) > 1000 > count(without, RED)
    assert (without.max(axis=-1) - without.min(axis=-1) > 40).sum() > 300 and browser.said == []  # the bar from O to A


def test_the_living_page_shows_solids_that_move(browser, tmp_path):
    (path,) = export(towers(), "html", tmp_path)
    browser.open(path)
    before = picture(browser, tmp_path)
    assert count(before, RED) > 2000 and count(before, GREEN) > 1000
    browser.value("for (let k = 0; k < 60; ++k) document.getElementById('step').click()")
    after = picture(browser, tmp_path)
    assert (np.abs(redness(before) - redness(after)) > 60).sum() > 1000 and browser.said == []
