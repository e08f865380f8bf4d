"""Two versions of a mechanism side by side in its page: one that was kept, and the present one, at the same time."""

from __future__ import annotations

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, nothing_said, settled, state_of

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

DRAWN = """((canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0))"""
KEPT = "living.kept() && [living.kept().t, [...living.kept().q]]"


def compared(browser, page):
    """The page of a mechanism that was kept after ten steps."""
    browser.open(page)
    click(browser, "step", 10)
    before = state_of(browser)
    click(browser, "keep")
    browser.wait("living.kept()")
    return before


def test_a_version_is_kept_and_the_other_changes(browser, page_of):
    """The kept one moves as it did, to its usual end; the present one begins anew with other numbers."""
    t, q, _ = compared(browser, page_of("fourbar"))
    assert state_of(browser)[0] == 0
    enter(browser, "B.position.x", 0.15)
    enter(browser, "psi", 8.0)
    click(browser, "step", 10)
    settled(browser)
    kept_t, kept_q = browser.value(KEPT)
    assert kept_t == state_of(browser)[0] == t and np.array_equal(kept_q, q)
    assert np.max(np.abs(state_of(browser)[1] - q)) > 0.01
    assert browser.value("document.getElementById('difference').textContent") == "B.position.x: 0.1 → 0.15 m · rate(psi): 12 → 8 rad/s"
    assert browser.value(f"{DRAWN}(document.getElementById('kept-stage'))") and nothing_said(browser)
    click(browser, "end-comparison")
    assert browser.value(KEPT) is None and browser.value("document.getElementById('kept-stage').checkVisibility()") is False


def test_both_go_back_together(browser, page_of):
    """The bar of time is that of both."""
    compared(browser, page_of("fourbar"))
    enter(browser, "crank.mass", 2.0)
    click(browser, "step", 8)
    click(browser, "back", 3)
    assert browser.value(KEPT)[0] == state_of(browser)[0] > 0 and nothing_said(browser)


def test_where_the_kept_version_ends_it_is_told(browser, page_of):
    """A second after its end the last position of the kept one is seen."""
    compared(browser, page_of("slidercrank"))
    end = browser.value("living.scene.duration")
    browser.value("{ living.mechanism.advance(living.scene.duration + 1); }")
    click(browser, "step")
    assert browser.value(KEPT)[0] == pytest.approx(end) and nothing_said(browser)


@pytest.mark.parametrize("name", ["fourbar", "flyball"])
def test_reset_ends_a_comparison(browser, page_of, name):
    compared(browser, page_of(name))
    click(browser, "defaults")
    assert browser.value(KEPT) is None and nothing_said(browser)
