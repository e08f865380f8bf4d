"""The lesson in the browser, as a class does it: the answers are what the page shows, and closed forms say so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, nothing_said, settled

from ncgen.exchange.examples import load
from ncgen.exchange.export import export

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

LESSON = Path(__file__).parents[2] / "docs" / "course" / "lesson.md"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    (found,) = export(load(LESSON.with_name("linkage.py")), "html", tmp_path_factory.mktemp("lesson"))
    return found


@pytest.fixture
def lesson(browser, page):
    """The page of the lesson, as it opens."""
    browser.open(page)
    yield browser
    assert nothing_said(browser)


def history(browser, label: str, steps: int) -> np.ndarray:
    """Values of something that can be plotted, at so many steps of a sixtieth of a second from the start."""
    values = [browser.value(f"living.read({json.dumps(label)})")]
    for _ in range(steps):
        click(browser, "step")
        values.append(browser.value(f"living.read({json.dumps(label)})"))
    return np.array(values)


def test_the_rocker_swings_as_the_law_of_cosines_says(lesson):
    ends = [np.degrees(np.arccos((0.3**2 + 0.25**2 - AC**2) / (2 * 0.3 * 0.25))) for AC in (0.4, 0.2)]
    theta = np.degrees(history(lesson, "theta", 80))
    assert [theta.min(), theta.max()] == pytest.approx([180 - ends[0], 180 - ends[1]], abs=0.3)
    text = LESSON.read_text(encoding="utf-8")
    assert f"Between {180 - ends[0]:.1f}° and {180 - ends[1]:.1f}°" in text and f"swings by {ends[0] - ends[1]:.1f}°" in text
    assert lesson.value("document.getElementById('freedom').textContent").endswith("1 degree of freedom, nothing redundant.")


@pytest.mark.parametrize(("base", "turns"), [(0.44, True), (0.46, False)])
def test_grashof_says_whether_the_crank_turns(lesson, base, turns):
    """0.1 + base ≤ 0.3 + 0.25."""
    enter(lesson, "base", base)
    enter(lesson, "psi", 20.0)
    psi = history(lesson, "psi", 60)
    assert bool(np.abs(psi - psi[0]).max() > 2 * np.pi) is turns


def test_the_crank_swings_between_its_dead_centres(lesson):
    enter(lesson, "base", 0.5)
    psi = history(lesson, "psi", 150)
    most = np.arccos((0.1**2 + 0.5**2 - 0.55**2) / (2 * 0.1 * 0.5))
    assert np.degrees(most) == pytest.approx(115.15, abs=0.005)
    assert np.abs(psi).max() <= most + 1e-6 and psi.max() > most - 0.05 and psi.min() < -most + 0.05


@pytest.mark.parametrize("flywheel", [0.0, 0.05])
def test_a_flywheel_makes_the_crank_run_evenly(lesson, flywheel):
    """By the energies: ½ (J + ...) ω² is least at the start, and with the flywheel ω changes by a quarter instead of threefold."""
    enter(lesson, "flywheel", flywheel)
    speeds = history(lesson, "rate(psi)", 60)
    expected = {0.0: 34.0, 0.05: 12.4}[flywheel]  # samples miss the peak by some percent
    assert 0.96 * expected < speeds.max() < 1.005 * expected and speeds.min() > 9.8


def test_the_ends_of_the_coupler_draw_a_circle_and_an_arc(lesson):
    """P at B and at C, and in between a curve that is neither."""
    for along, across, center, radius in ((0.0, 0.0, (0.0, 0.0), 0.1), (0.3, 0.0, (0.3, 0.0), 0.25)):
        enter(lesson, "along", along)
        enter(lesson, "across", across)
        click(lesson, "restart")
        click(lesson, "step", 30)
        settled(lesson)
        P = np.array(lesson.value("living.samples.map(({ places }) => places[living.scene.points.indexOf('P')].slice(0, 2))"))
        np.testing.assert_allclose(np.hypot(*(P - center).T), radius, rtol=1e-9)


def test_the_address_of_the_sites_home_runs_at_once(browser, page):
    """The linkage moves, slowly and in a loop, and P draws its curve."""
    browser.open(page, fragment="#traces=P&loop=1&speed=0.2&play=1", width=700, height=560)
    browser.wait("living.mechanism.t > 0.02")
    assert browser.value("[living.state.running, living.state.speed, document.getElementById('loop').checked]") == [True, 0.2, True]
    assert nothing_said(browser)
