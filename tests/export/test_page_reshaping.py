"""Every number of a model can be turned in its page, and points can be dragged to other places: it then moves as that mechanism does."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import CHROMIUM
from living import click, enter, fixed_steps, nothing_said, place_of, settled, state_of

import ncgen
from ncgen.exchange.examples import load
from ncgen.exchange.turnable import MAX_PARAMETERS, turnable

shown = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

PLACES = {"A": (0.0, 0.0), "B": (0.1, 0.0), "C": (0.35, 0.3), "D": (0.4, 0.0)}
MASSES = {"crank": (0.2, 0.2 * 0.1**2 / 12), "coupler": (0.8, 0.8 * 0.1525 / 12), "rocker": (0.6, 0.6 * 0.0925 / 12)}


def fourbar(places=PLACES, masses=MASSES, gravity=-9.81) -> ncgen.Model:
    """The example with other numbers, written once more."""
    m = ncgen.Model("other")
    A, B, C, D = (m.point(name, place, fixed=name in "AD") for name, place in places.items())
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    for (name, (mass, inertia)), ends in zip(masses.items(), ([A, B], [B, C], [C, D]), strict=True):
        m.body(name, points=ends, mass=mass, inertia=inertia)
    m.independent(m.angle("psi", start=x, end=B - A, axis=z))
    m.gravity((0, gravity, 0))
    return m


def moves_as(browser, model, speed=12.0, seconds=0.2):
    """The page's motion from now on is that of a model, by our own run."""
    fixed_steps(browser, 1e-3)
    click(browser, "step", round(seconds / 1e-3))
    run = ncgen.simulate(ncgen.compile(model, backend="numpy"), seconds, zd0={"psi": speed}, rtol=1e-10, atol=1e-11, points=2)
    t, q, qd = state_of(browser)
    assert t == pytest.approx(seconds, abs=1e-12)
    np.testing.assert_allclose(q, run.q[-1], atol=1e-7)
    np.testing.assert_allclose(qd, run.qd[-1], atol=1e-5)


def drag(browser, start, *ends):
    browser.mouse("mousePressed", *start)
    for end in ends:
        browser.mouse("mouseMoved", *end)
        settled(browser)
    browser.mouse("mouseReleased", *ends[-1])
    settled(browser)


def reshape(browser):
    browser.value("{ const mode = document.getElementById('dragging'); mode.value = 'reshape'; mode.dispatchEvent(new Event('change')); }")
    settled(browser)


def values_of(browser) -> dict[str, float]:
    return dict(browser.value("globalThis.exported.parameters.map((name, i) => [name, living.mechanism.p[i]])"))


# -- the model ----------------------------------------------------------------------------------------


def test_every_number_is_a_parameter_with_its_value_as_default():
    """Those of the model come first; the kernels at the defaults are those of the model."""
    model = fourbar()
    turned = turnable(model)
    expected = {f"{name}.position.{axis}": value for name, place in PLACES.items() for axis, value in zip("xy", place, strict=True)}
    expected |= {f"{name}.{word}": value for name, pair in MASSES.items() for word, value in zip(("mass", "inertia"), pair, strict=True)}
    assert {name: number.default for name, number in turned.numbers.items()} == expected | {"gravity.y": -9.81}
    was, now = (ncgen.compile(m, backend="numpy") for m in (model, turned))
    q = np.linspace(0.1, 0.9, was.n)
    np.testing.assert_allclose(now.phi(q), was.phi(q), atol=1e-15)
    np.testing.assert_allclose(now.mass_matrix(q), was.mass_matrix(q), rtol=1e-14)


def test_own_parameters_come_first_and_names_that_are_taken_are_numbered():
    m = ncgen.Model("own")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (m.parameter("reach", 1.0, "m"), 0.5))
    C = m.point("C", (2.0, 0))
    m.parameter("rod.mass", 3.0)
    m.body("rod", [A, B], mass=2.0, inertia="rod")
    m.body("end", [B, C], mass=m.parameter("load", 0.5, "kg"), inertia="rod")
    m.spring(A, C, 10.0, free_length=0.5)
    turned = turnable(m)
    assert list(turned.numbers)[:3] == ["reach", "rod.mass", "load"]
    assert turned.numbers["rod.mass_2"].default == 2.0 and "B.position.x" not in turned.numbers
    assert turned.numbers["A_C.stiffness"].default == 10.0 and turned.numbers["A_C.free_length"].unit == "m"


def test_a_large_model_keeps_its_places():
    m = ncgen.Model("large")
    points = [m.point(f"P{k}", (k, 0), fixed=k == 0) for k in range(MAX_PARAMETERS // 2 + 1)]
    m.body("rod", points[:2], mass=1.0, inertia="rod")
    m.body("bar", points[1:3], mass=1.0, inertia="rod")
    assert list(turnable(m).numbers) == ["rod.mass", "bar.mass"]


def test_what_no_file_can_hold_is_left_as_it_is():
    m = fourbar()
    m.callback(lambda t, q, qd, p: np.zeros(len(q)))
    assert turnable(m) is m


# -- the page -----------------------------------------------------------------------------------------


@shown
def test_a_pivot_is_dragged(browser, page_of):
    """The base goes with it, the coupler and the rocker get the lengths between their points, and it moves as that linkage."""
    browser.open(page_of("fourbar"))
    click(browser, "step", 5)
    reshape(browser)
    start = place_of(browser, "D")
    drag(browser, start, start + (20, 5), start + (40, 30))
    found = values_of(browser)
    D = (found["D.position.x"], found["D.position.y"])
    np.testing.assert_allclose(place_of(browser, "D"), start + (40, 30), atol=1)
    assert D[0] > 0.42 and D[1] < -0.01 and state_of(browser)[0] == 0
    assert {name: value for name, value in found.items() if not name.startswith("D.")} == {
        name: value.default for name, value in turnable(load("fourbar")).numbers.items() if not name.startswith("D.")
    }
    moves_as(browser, fourbar({**PLACES, "D": D}))
    assert nothing_said(browser)


@shown
def test_a_moving_point_is_dragged_and_pushed_by_keys(browser, page_of):
    """Both bars that meet there change their lengths."""
    browser.open(page_of("fourbar"))
    reshape(browser)
    drag(browser, place_of(browser, "C"), place_of(browser, "C") + (-30, 40))
    browser.value("document.getElementById('stage').focus()")
    browser.press("n")
    browser.press("n")
    browser.press("ArrowLeft")
    found = values_of(browser)
    places = {name: (found[f"{name}.position.x"], found[f"{name}.position.y"]) for name in PLACES}
    assert places["C"][0] < 0.34 and places["C"][1] < 0.28 and places["B"] == pytest.approx((0.096, 0.0), abs=1e-9)
    moves_as(browser, fourbar(places))
    assert nothing_said(browser)


@shown
def test_each_slider_acts(browser, page_of):
    """Places, masses, moments of inertia, gravity and the start velocity, all at once: it moves as the model with these numbers."""
    browser.open(page_of("fourbar"))
    places = {name: (x + 0.01 * k, y - 0.004 * k) for k, (name, (x, y)) in enumerate(PLACES.items(), start=1)}
    masses = {name: (mass * 1.5, inertia * 0.8) for name, (mass, inertia) in MASSES.items()}
    for name, place in places.items():
        for axis, value in zip("xy", place, strict=True):
            enter(browser, f"{name}.position.{axis}", value)
    for name, pair in masses.items():
        for word, value in zip(("mass", "inertia"), pair, strict=True):
            enter(browser, f"{name}.{word}", value)
    enter(browser, "gravity.y", -3.7)
    enter(browser, "psi", 10.0)
    moves_as(browser, fourbar(places, masses, -3.7), 10.0)
    assert nothing_said(browser)


@shown
def test_a_slider_has_a_range_from_the_model(browser, page_of):
    """The value lies within, masses are not negative, places reach half the mechanism's size."""
    browser.open(page_of("fourbar"))
    numbers = "['min', 'max', 'value'].map((key) => Number(row.children[1][key]))"
    rows = browser.value(f"[...document.querySelectorAll('.slider')].map((row) => [row.textContent, {numbers}])")
    found = {name.split(" ")[0]: numbers for name, numbers in rows}
    assert all(low < value < high for low, high, value in found.values())
    assert found["coupler.mass"][0] == 0 and found["gravity.y"][:2] == pytest.approx([-19.62, -1.962])
    low, high, _ = found["A.position.x"]
    assert 0.1 < high - low < 1 and low + high == pytest.approx(0)
    assert found["B.position.x"] == [0.03, 0.3, 0.1]


@shown
def test_bodies_that_cannot_be_closed_are_told_and_taken_back(browser, page_of):
    """A crank whose ends are one point has no direction."""
    browser.open(page_of("fourbar"))
    reshape(browser)
    drag(browser, place_of(browser, "B"), place_of(browser, "A"))
    assert "cannot be closed" in browser.value("document.getElementById('problem').textContent")
    assert values_of(browser)["B.position.x"] != 0 and browser.said == []


@shown
def test_a_link_holds_the_lengths(browser, page_of):
    page = page_of("fourbar")
    browser.open(page)
    reshape(browser)
    drag(browser, place_of(browser, "D"), place_of(browser, "D") + (35, 0))
    before = values_of(browser), state_of(browser)[1].tolist()
    browser.wait("window.location.hash.includes('D.position.x')", 5)
    address = browser.value("location.hash")
    browser.open(page, fragment=address)
    assert (values_of(browser), state_of(browser)[1].tolist()) == before
    assert json.loads(browser.value("JSON.stringify(document.getElementById('dragging').value)")) == "reshape" and nothing_said(browser)
