"""Arrows, charts and units of the page that computes: their numbers are our own, and a chart's cursor moves the mechanism."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, nothing_said, place_of, settled, state_of
from matplotlib.image import imread

import ncgen
from ncgen.exchange.examples import load

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


def select(browser, name: str, value: str) -> None:
    browser.value(
        f"{{ const e = document.getElementById('{name}'); e.value = {json.dumps(value)}; e.dispatchEvent(new Event('change')); }}"
    )
    settled(browser)


def texts(browser, chosen: str) -> list[str]:
    return browser.value(f"[...document.querySelectorAll({json.dumps(chosen)})].map((e) => e.textContent)")


def number_beside(browser, name: str) -> float:
    found = f"[...document.querySelectorAll('input[type=number]')].find((e) => e.ariaLabel.startsWith({json.dumps(name)})).value"
    return float(browser.value(found))


@pytest.fixture(scope="module")
def run():
    """The first 0.4 s of the four-bar, by our own simulation."""
    kernels = ncgen.compile(load("fourbar"), backend="numpy")
    return ncgen.simulate(kernels, 0.4, zd0={"psi": 12.0}, rtol=1e-11, atol=1e-12, points=2)


def test_velocities_accelerations_and_joint_forces_are_our_own(browser, page_of, run):
    """Of points and joints, to the page's tolerance."""
    browser.open(page_of("fourbar"))
    click(browser, "step", 24)
    assert state_of(browser)[0] == pytest.approx(0.4, abs=1e-12)
    index = run.kernels.index
    of_C = [np.hypot(*values[-1, [index["C.x"], index["C.y"]]]) for values in (run.qd, run.qdd)]
    forces = run.reactions()
    expected = {"speed of C": of_C[0], "acceleration of C": of_C[1]}
    for body, point in (("crank", "A"), ("coupler", "C"), ("rocker", "D")):
        expected[f"force on {body} at {point}"] = np.linalg.norm(forces.force(body, point)[-1])
    found = {label: browser.value(f"living.read({json.dumps(label)})") for label in expected}
    assert found == pytest.approx(expected, rel=2e-5)


def test_arrows_are_drawn(browser, page_of, tmp_path):
    """B's velocity is at right angles to the crank, and its arrow lies there in the colour of its kind."""
    browser.open(page_of("fourbar"))
    for name in ("names", "bodies", "wire"):
        click(browser, name)
    A, B = place_of(browser, "A"), place_of(browser, "B")
    along = np.array([(B - A)[1], -(B - A)[0]]) / np.hypot(*(B - A))  # to the left of the crank, up on the screen
    x, y = np.round(B + 15 * along).astype(int)

    def blueness():
        """Of the pixel where the arrow is expected."""
        settled(browser)
        browser.photograph(tmp_path / "seen.png")
        red, _, blue = imread(tmp_path / "seen.png")[y, x, :3]
        return blue - red

    before = blueness()
    click(browser, "velocities")
    assert blueness() > before + 0.25
    click(browser, "velocities")
    click(browser, "accelerations")
    click(browser, "forces")
    click(browser, "play")
    browser.wait("living.state.frames > 10")
    click(browser, "play")
    assert nothing_said(browser)


def test_units_are_chosen(browser, page_of):
    """In sliders, captions and axes; what is typed is taken in the unit that is shown."""
    browser.open(page_of("fourbar"))
    select(browser, "more", "rate(psi)")
    select(browser, "angles", "° and rpm")
    select(browser, "lengths", "mm")
    assert number_beside(browser, "psi (rpm)") == pytest.approx(12 * 30 / np.pi, rel=1e-5)
    assert number_beside(browser, "B.position.x (mm)") == 100
    enter(browser, "psi (rpm)", 60)
    enter(browser, "D.position.x (mm)", 410)
    index = ncgen.compile(load("fourbar"), backend="numpy").index["psi"]
    assert state_of(browser)[2][index] == pytest.approx(2 * np.pi, rel=1e-6)
    assert browser.value("living.presentPose().positions[3]") == [0.41, 0, 0]
    settled(browser)
    assert texts(browser, ".curve.key") == ["psi 0 °", "rate(psi) 60 rpm"]
    select(browser, "angles", "rad")
    assert texts(browser, ".curve.key") == ["psi 0 rad", f"rate(psi) {2 * np.pi:.4g} rad/s"] and nothing_said(browser)


@pytest.mark.parametrize("against", ["time", "C.x"])
def test_the_cursor_of_a_chart_moves_the_mechanism(browser, page_of, against):
    """Where a curve is pointed at, there the mechanism stands, at a sample that was recorded."""
    browser.open(page_of("fourbar"))
    click(browser, "step", 40)
    select(browser, "against", against)
    canvas = "document.querySelector('#charts canvas')"
    (x, (y,)), left, top = browser.value(f"(({{ left, top }}) => [{canvas}.places[13], left, top])({canvas}.getBoundingClientRect())")
    x, y = left + x, top + y
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseReleased", x, y)
    settled(browser)
    assert browser.value("[living.recorded.at, living.mechanism.t === living.samples[13].t]") == [13, True]
    assert browser.value(f"{canvas}.ariaLabel") == f"psi against {against}" and nothing_said(browser)


def test_the_potential_energy_counts_from_the_start(browser, page_of):
    """The sum stays, while it runs and when it is scrubbed back; the drift is a number of its own."""
    browser.open(page_of("fourbar"))
    settled(browser)
    start = browser.value("Number(document.getElementById('total').textContent)")
    assert browser.value("document.getElementById('potential').textContent") == "0" and start > 0
    click(browser, "step", 30)
    settled(browser)
    assert browser.value("Number(document.getElementById('total').textContent)") == pytest.approx(start, rel=1e-3)
    assert browser.value("document.getElementById('potential').textContent") != "0"
    assert 0 < browser.value("Number(document.getElementById('drift').textContent)") < 1e-6


def test_degrees_of_freedom_and_redundant_equations_are_told(browser, page_of):
    """As ncgen.freedom finds them."""
    browser.open(page_of("bennett"))
    kernels = ncgen.compile(load("bennett"), backend="numpy")
    found = ncgen.freedom(kernels)
    text = browser.value("document.getElementById('freedom').textContent")
    assert text.startswith(f"{kernels.m} equations, {kernels.n} coordinates: {found.dof} degree of freedom")
    assert found.redundant and all(kernels.rows[each.row].label in text for each in found.redundant)
    browser.open(page_of("fourbar"))
    assert (
        browser.value("document.getElementById('freedom').textContent")
        == "4 equations, 5 coordinates: 1 degree of freedom, nothing redundant."
    )


def test_beside_a_plane_mechanism_dragging_moves_the_view(browser, page_of):
    """It is not tipped out of its plane; with Shift it is."""
    browser.open(page_of("fourbar"))
    before = place_of(browser, "A")
    browser.mouse("mousePressed", 860, 120)
    browser.mouse("mouseMoved", 830, 140)
    browser.mouse("mouseReleased", 830, 140)
    settled(browser)
    np.testing.assert_allclose(place_of(browser, "A") - before, (-30, 20), atol=1e-6)
    assert nothing_said(browser)


def test_a_telephone_has_the_controls_below_and_one_chart_at_a_time(browser, page_of):
    """Start is in the lowest fifth of the screen; charts lie beside each other, each as wide as the screen."""
    browser.open(page_of("fourbar"), width=390, height=844)
    assert browser.value("document.documentElement.scrollWidth") == 390
    top, bottom = browser.value("(({ top, bottom }) => [top, bottom])(document.getElementById('play').getBoundingClientRect())")
    assert 0.8 * 844 < top < bottom <= 844
    frame = "(({ left, width }) => [left, width])(e.getBoundingClientRect())"
    frames = browser.value(f"[...document.querySelectorAll('.plots > *')].map((e) => {frame})")
    assert all(width > 330 for _, width in frames) and np.all(np.diff([left for left, _ in frames]) > 330)
