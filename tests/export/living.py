"""What tests do with pages that compute: buttons, fields, keys and pointers, and what they read of the mechanism."""

from __future__ import annotations

import json

import numpy as np
from browser import Browser


def fixed_steps(browser: Browser, h: float) -> None:
    """Runge-Kutta steps of h seconds, at true speed."""
    browser.value(f"(document.getElementById('constant').click(), document.getElementById('length').value = {h})")
    browser.value("{ const speed = document.getElementById('speed'); speed.value = 1; speed.dispatchEvent(new Event('change')); }")


def click(browser: Browser, element: str, times: int = 1) -> None:
    browser.value(f"for (let k = 0; k < {times}; ++k) document.getElementById('{element}').click()")


def enter(browser: Browser, name: str, value: float) -> None:
    """A number in the field beside a slider."""
    field = f"[...document.querySelectorAll('input[type=number]')].find((e) => e.ariaLabel.startsWith({json.dumps(name)}))"
    browser.value(f"{{ const field = {field}; field.value = {value}; field.dispatchEvent(new Event('change')); }}")


def state_of(browser: Browser) -> tuple[float, np.ndarray, np.ndarray]:
    """(t, q, q̇) as the page has them."""
    t, q, qd = browser.value("[living.mechanism.t, [...living.mechanism.q], [...living.mechanism.qd]]")
    return t, np.array(q), np.array(qd)


def place_of(browser: Browser, point: str) -> np.ndarray:
    """Where a point is on the screen (pixels)."""
    script = """((name) => {
      const frame = document.getElementById("stage").getBoundingClientRect();
      const [x, y] = living.onScreen(living.scene.points.indexOf(name));
      return [frame.left + x, frame.top + y];
    })"""
    return np.array(browser.value(f"{script}({json.dumps(point)})"))


def settled(browser: Browser) -> None:
    """Two refreshes of the screen later."""
    browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")


def nothing_said(browser: Browser) -> bool:
    return browser.said == [] and browser.value("document.getElementById('problem').textContent") == ""
