"""The page that computes goes back and on in what it has recorded, draws traces, and is told by its address what to show."""

from __future__ import annotations

import io

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, nothing_said, place_of, settled, state_of
from matplotlib.image import imread

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

EVERYTHING = "[...living.mechanism.state, ...living.mechanism.p, living.drift(), living.recorded.at]"


def scrub(browser, index: int) -> None:
    settled(browser)
    browser.value(f"{{ const bar = document.getElementById('scrub'); bar.value = {index}; bar.dispatchEvent(new Event('input')); }}")


def picture(browser, path) -> np.ndarray:
    """What is seen of the mechanism (rows, columns, 3), without the frame of what has the focus."""
    browser.value("document.activeElement.blur()")
    settled(browser)
    browser.photograph(path)
    left, top, right, bottom = browser.value(
        "(({ left, top, right, bottom }) => [left, top, right, bottom])(document.getElementById('stage').getBoundingClientRect())"
    )
    return imread(io.BytesIO(path.read_bytes()))[round(top) : round(bottom), round(left) : round(right), :3]


def test_scrubbing_back_gives_the_same_numbers(browser, page_of):
    """States, parameters and drift, to the last bit; a step back, a step on, and the way on from there as before."""
    browser.open(page_of("doublependulum"))
    seen = [browser.value(EVERYTHING)]
    for _ in range(30):
        click(browser, "step")
        seen.append(browser.value(EVERYTHING))
    for k in (0, 17, 29, 30, 3):
        scrub(browser, k)
        assert browser.value(EVERYTHING) == seen[k]
    click(browser, "back")
    assert browser.value(EVERYTHING) == seen[2]
    browser.press(".")
    assert browser.value(EVERYTHING) == seen[3]
    click(browser, "step", 27)
    assert browser.value(EVERYTHING) == seen[30] and browser.value("living.samples.length") == 31
    click(browser, "back", 50)
    assert browser.value(EVERYTHING) == seen[0] and nothing_said(browser)


def test_what_is_changed_in_the_past_begins_anew(browser, page_of):
    """The slider shows what a parameter was, a change forgets what came after it, and the drift is counted anew."""
    browser.open(page_of("arm"))
    click(browser, "step", 10)
    enter(browser, "tau1", 3.0)
    click(browser, "step", 10)
    scrub(browser, 5)
    field = "[...document.querySelectorAll('input[type=number]')].find((e) => e.ariaLabel.startsWith('tau1')).value"
    assert browser.value(field) == "0" and browser.value("living.mechanism.p[0]") == 0
    scrub(browser, 15)
    assert browser.value(field) == "3" and browser.value("living.mechanism.p[0]") == 3
    scrub(browser, 5)
    enter(browser, "tau1", -1.0)
    assert browser.value("[living.samples.length, living.recorded.at]") == [6, 5] and nothing_said(browser)


def test_a_loop_plays_the_same_motion_again(browser, page_of):
    """It computes the motion once: later turns have its numbers."""
    browser.open(page_of("fourbar"))
    browser.value("{ const speed = document.getElementById('speed'); speed.value = 2; speed.dispatchEvent(new Event('change')); }")
    click(browser, "loop")
    click(browser, "play")
    browser.wait("living.mechanism.t >= 2", 30)
    count = browser.value("living.samples.length")
    browser.wait("living.mechanism.t < 1", 10)
    browser.wait("living.mechanism.t > 1.2", 10)
    click(browser, "play")
    at, n = browser.value("[living.recorded.at, living.samples.length]")
    q, kept = browser.value("[[...living.mechanism.q], [...living.samples[living.recorded.at].q]]")
    assert n - count <= 2 and 0 < at < n - 1 and q == kept and nothing_said(browser)


def test_a_trace_is_the_path_of_its_point(browser, page_of, tmp_path):
    """The crank's end draws its circle: what is drawn lies on it, to two pixels, all around."""
    browser.open(page_of("fourbar"))
    for box in ("names", "bodies", "wire"):
        click(browser, box)
    plain = picture(browser, tmp_path / "plain.png")
    browser.value("document.querySelector('#traces input').click()")
    click(browser, "step", 120)
    drawn = np.argwhere(np.abs(picture(browser, tmp_path / "traced.png") - plain).max(axis=-1) > 0.3)[:, ::-1] + 0.5
    corner = browser.value("(({ left, top }) => [left, top])(document.getElementById('stage').getBoundingClientRect())")
    center, radius = place_of(browser, "A") - corner, np.hypot(*(place_of(browser, "B") - place_of(browser, "A")))
    from_center = drawn - center
    off = np.hypot(*from_center.T) - radius
    assert len(drawn) > 3 * radius and np.abs(off).max() < 2
    assert np.histogram(np.arctan2(*from_center.T), 8, (-np.pi, np.pi))[0].all() and nothing_said(browser)


def shared(browser, page, **how) -> None:
    """The address that the page has now is opened as a fresh page."""
    browser.wait("window.location.hash.length > 1", 5)
    address = browser.value("location.hash")
    browser.open(page, **how)
    assert browser.value("location.hash") == ""
    browser.open(page, fragment=address, **how)


def test_a_link_opens_to_the_same_picture(browser, page_of, tmp_path):
    """Velocity, view, traces, charts, switches and time are in the address; the position is the same to 1e-12, the picture nearly so."""
    page = page_of("fourbar")
    browser.open(page)
    enter(browser, "psi", 14.5)
    browser.value("document.querySelectorAll('#traces input').forEach((box) => box.click())")
    click(browser, "names")
    browser.value("{ const more = document.getElementById('more'); more.value = 'C.y'; more.dispatchEvent(new Event('change')); }")
    click(browser, "step", 25)
    browser.mouse("mousePressed", 860, 300)
    browser.mouse("mouseMoved", 830, 340)
    browser.mouse("mouseReleased", 830, 340)
    seen, before = picture(browser, tmp_path / "before.png"), state_of(browser)
    shared(browser, page)
    after = state_of(browser)
    assert before[0] == after[0]
    np.testing.assert_allclose(after[1], before[1], atol=1e-12)
    np.testing.assert_allclose(after[2], before[2], atol=1e-10)
    difference = np.abs(picture(browser, tmp_path / "after.png") - seen).max(axis=-1)
    assert (difference > 0.1).mean() < 1e-3
    assert browser.value("[...document.querySelectorAll('.curve.key')].length") == 2 and nothing_said(browser)
    click(browser, "defaults")
    browser.wait("window.location.hash === ''", 5)
    assert state_of(browser)[0] == 0 and browser.value("living.samples.length") == 1


def test_a_link_holds_what_was_moved_by_hand(browser, page_of):
    """A dragged position of a chaotic pendulum, and where it went from there."""
    page = page_of("doublependulum")
    browser.open(page)
    x, y = place_of(browser, "C")
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x - 60, y - 50)
    settled(browser)
    browser.mouse("mouseReleased", x - 60, y - 50)
    click(browser, "step", 150)
    before = state_of(browser)
    shared(browser, page)
    np.testing.assert_allclose(np.concatenate(state_of(browser)[1:]), np.concatenate(before[1:]), atol=1e-10)
    assert browser.value("living.samples.length") > 100 and browser.value("living.drift()") < 1e-5 and nothing_said(browser)


@pytest.mark.parametrize("address", ["#p.nothing=3&now=AAAA", "#view=1,2,x,4,5", "#from=.&now=", "#%%%", "#v.psi=1e999"])
def test_an_address_that_is_none_is_told_in_a_line(browser, page_of, address):
    """The page works on."""
    browser.open(page_of("fourbar"), fragment=address)
    assert browser.value("document.getElementById('problem').textContent.split('\\n').length") == 1
    click(browser, "defaults")
    click(browser, "step")
    assert state_of(browser)[0] > 0 and nothing_said(browser)
