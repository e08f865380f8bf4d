"""A mechanism that is driven in its page: positions, accelerations, joint forces and what the drive takes are those of our driven model."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, nothing_said, state_of

import ncgen
from ncgen.exchange.examples import load

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


def choose(browser, law: str) -> None:
    browser.value(f"{{ const e = document.getElementById('drive'); e.value = '{law}'; e.dispatchEvent(new Event('change')); }}")


def read(browser, label: str) -> float:
    return browser.value(f"living.read({json.dumps(label)})")


def smooth(t):
    """The way after t seconds of a start that takes one second (3 s² − 2 s³), at a final speed of 1."""
    import sympy

    return sympy.Piecewise((t**3 - t**4 / 2, t < 1), (t - sympy.Rational(1, 2), True))


@pytest.mark.parametrize(("law", "way"), [("constant", lambda t: 12 * t), ("smooth", lambda t: 12 * smooth(t))])
def test_it_moves_and_takes_what_our_driven_model_does(browser, page_of, law, way):
    """After 0.4 s."""
    browser.open(page_of("fourbar"))
    choose(browser, law)
    click(browser, "step", 24)
    t, q, qd = state_of(browser)
    m = load("fourbar")
    m.drive(m.elements["psi"], way(m.time))
    m.output("torque", m.elements["psi"].driver)
    kernels = ncgen.compile(m, backend="numpy")
    run = ncgen.simulate(kernels, t, points=2)
    np.testing.assert_allclose(q, run.q[-1], atol=1e-9)
    np.testing.assert_allclose(qd, run.qd[-1], atol=1e-8)
    np.testing.assert_allclose(browser.value("[...living.mechanism.qdd]"), run.qdd[-1], atol=1e-6)
    forces = run.reactions()
    for body, point in (("crank", "A"), ("rocker", "D")):
        assert read(browser, f"force on {body} at {point}") == pytest.approx(np.linalg.norm(forces.force(body, point)[-1]), rel=1e-7)
    assert read(browser, "drive of psi") == pytest.approx(run["torque"][-1], rel=1e-6)
    assert browser.value("living.drift()") < 1e-9 and nothing_said(browser)


def test_by_hand_it_goes_where_the_slider_stands(browser, page_of):
    browser.open(page_of("fourbar"))
    choose(browser, "hand")
    enter(browser, "psi by hand", 2.0)
    kernels = ncgen.compile(load("fourbar"), backend="numpy")
    _, q, qd = state_of(browser)
    assert q[kernels.index["psi"]] == pytest.approx(2.0, abs=1e-12) and np.max(np.abs(kernels.phi(q))) < 1e-12 and not qd.any()
    assert nothing_said(browser)


def test_a_dead_centre_is_told_with_its_place(browser, page_of):
    """A crank of 0.3 m stops where coupler and rocker are one line, a piece of the way (0.05 rad) before it at most."""
    browser.open(page_of("fourbar"))
    enter(browser, "B.position.x", 0.3)
    choose(browser, "constant")
    click(browser, "play")
    browser.wait("!living.state.running", 20)
    a, b, c, d = 0.3, np.hypot(0.05, 0.3), np.hypot(0.05, 0.3), 0.4
    most = np.arccos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d))
    assert most - 0.06 < state_of(browser)[1][-1] <= most
    text = browser.value("document.getElementById('problem').textContent")
    assert text.startswith("psi cannot go on from ") and "dead centre" in text and browser.said == []


def test_a_link_holds_the_drive(browser, page_of):
    page = page_of("fourbar")
    browser.open(page)
    choose(browser, "smooth")
    click(browser, "step", 30)
    before = state_of(browser)
    browser.wait("location.hash.includes('drive=smooth') && location.hash.includes('now=')", 5)
    address = browser.value("location.hash")
    browser.open(page, fragment=address)
    after = state_of(browser)
    np.testing.assert_allclose(after[1], before[1], atol=1e-12)
    np.testing.assert_allclose(browser.value("[...living.mechanism.qdd]"), browser.value("[...living.samples.at(-1).qdd]"), rtol=1e-12)
    click(browser, "step")
    assert state_of(browser)[0] > before[0] and nothing_said(browser)
