"""Pages for everybody: no rule of axe-core is broken, wide and narrow, light and dark; everything can be done by keys.

axe-core is no dependency: `npm install --no-save axe-core` in the repository, or NCGEN_AXE=FILE, and these tests run.
"""

from __future__ import annotations

import json

import pytest
from accessibility import AXE, VIOLATIONS
from browser import CHROMIUM
from living import nothing_said, state_of

shown = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
checked = pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed")


@shown
@checked
@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 800, False), (1280, 800, True), (390, 844, False), (390, 844, True)])
def test_no_rule_of_accessibility_is_broken(browser, page_of, width, height, dark):
    """With everything open, something plotted, and a message shown."""
    browser.open(page_of("fourbar"), width, height, dark)
    browser.value("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    browser.value("document.getElementById('problem').hidden = false; document.getElementById('problem').textContent = 'no'")
    browser.value("document.querySelectorAll('#rows li').forEach((each) => each.click())")
    browser.value(f"{AXE.read_text(encoding='utf-8')}; 0")
    passes, violations = json.loads(browser.value(VIOLATIONS))
    assert passes > 15 and violations == []


@shown
def test_every_control_has_a_name_and_is_reached_by_tab(browser, page_of):
    """What a screen reader says of it is not empty, and the way by Tab visits everything that is not disabled."""
    browser.open(page_of("fourbar"))
    browser.value("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    kinds = "button, select, input, canvas[tabindex], summary, li[tabindex]"
    controls = f"[...document.querySelectorAll('{kinds}')].filter((e) => e.checkVisibility())"
    name = "e.ariaLabel || [...(e.labels ?? [])].map((l) => l.textContent).join('') || e.textContent"
    assert browser.value(f"{controls}.every((e) => ({name}).trim().length > 0)")
    assert browser.value(f"{controls}.every((e) => e.tabIndex >= 0)")


@shown
def test_the_motion_is_run_by_keys(browser, page_of):
    """Space, full stop, comma and R; a control that has the focus keeps its own keys."""
    browser.open(page_of("fourbar"))
    for key, expected in ((".", 1), (".", 2), (",", 1), (".", 2)):
        browser.press(key)
        assert browser.value("living.recorded.at") == expected
    browser.press("r")
    assert state_of(browser)[0] == 0
    browser.value("document.getElementById('speed').focus()")
    browser.press("r")
    browser.press(" ", "Space")
    assert browser.value("living.state.running") is False and nothing_said(browser)
