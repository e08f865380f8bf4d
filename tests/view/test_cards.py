"""What a notebook shows of models, kernels and trajectories: cards that say what is so, whatever state it is in."""

from __future__ import annotations

import subprocess
import sys
import time
from xml.etree import ElementTree

import numpy as np
import pytest

import ncgen
from ncgen.exchange.toml_writer import to_toml
from ncgen.model import Model
from ncgen.report import cards

SVG = "{http://www.w3.org/2000/svg}"


def parsed(html: str) -> ElementTree.Element:
    """A card is well-formed, so what is in it stays in its place; and it is small."""
    assert len(html.encode()) < 100_000
    return ElementTree.fromstring(html)


def words(html: str) -> str:
    return " ".join(" ".join(parsed(html).itertext()).split())


@pytest.fixture(scope="module")
def fourbar():
    return ncgen.compile(ncgen.load("fourbar"), "numpy")


@pytest.fixture(scope="module")
def run(fourbar):
    return ncgen.simulate(fourbar, 0.05, zd0={"psi": 12.0}, points=11)


def test_a_model(fourbar):
    html = fourbar.model._repr_html_()
    said = words(html)
    for fact in (
        "fourbar model",
        "5 of 19 coordinates free",
        "3 bodies",
        "1 degree of freedom",
        "4 constraints",
        "1000 distance B-C body coupler",
    ):
        assert fact in said
    assert [text.text for text in parsed(html).iter(f"{SVG}text")] == ["A", "B", "C", "D"]


def test_kernels(fourbar, robot_numpy):
    """Rods A-B and C-D have two numbers in Φ_q each, B-C four, the angle B's two and its own: eleven squares; the robot's row 16 is red."""
    html = fourbar._repr_html_()
    jacobian, mass = [["".join(path.get("d") for path in svg.iter(f"{SVG}path"))] for svg in parsed(html).iter(f"{SVG}svg")]
    assert jacobian[0].count("h1v1h-1z") == 2 + 2 + 4 + 3 and mass[0].count("h1v1h-1z") == fourbar.mass_pattern.nonzeros
    assert "fourbar kernels in numpy" in words(html) and "Φ_q 4 × 5, 11 nonzeros" in words(html)
    html = robot_numpy._repr_html_()
    assert "constraint 16 (angle u3, r4-r5) follows from 6, 10, 12" in words(html)
    (red,) = [path for path in parsed(html).iter(f"{SVG}path") if cards.spots.__globals__["RED"] in path.get("style", "")]
    assert {square.split()[1].partition("h")[0] for square in red.get("d").split("M")[1:]} == {"15"}


def test_a_trajectory(run):
    said = words(run._repr_html_())
    facts = ["fourbar trajectory", "11 instants from 0 to 0.05 s", "t = 0.05 s"]
    for fact in [*facts, f"energy error {run.energy_drift:.1e}", f"psi {run['psi'][-1]:.9g}"]:
        assert fact in said
    assert {"angle (rad)", "energy (J)", "kinetic", "total"} <= {text.text for text in parsed(run._repr_html_()).iter(f"{SVG}text")}


def test_a_model_on_its_way():
    """After every call there is a card, which changes nothing: the model becomes what it would have become."""
    shown, other = Model("bob"), Model("bob")
    steps = [
        lambda m: m.point("A", (0, 0), fixed=True),
        lambda m: m.point("B", (1, 0)),
        lambda m: m.body("bob", points=[m.elements["B"]], mass=1.0),
        lambda m: m.distance(m.elements["A"], m.elements["B"]),
    ]
    said = [words(shown._repr_html_())]
    for step in steps:
        step(shown)
        step(other)
        said.append(words(shown._repr_html_()))
    assert "there is no point to draw" in said[0] and "0 degrees of freedom" in said[1] and "2 degrees of freedom" in said[2]
    assert "no constraints" in said[3] and "1 degree of freedom" in said[4]
    assert to_toml(shown) == to_toml(other)


def test_what_is_wrong_is_said():
    """A rod that does not reach."""
    m = Model("open")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (3, 0), fixed=True)
    B = m.point("B", (1, 0.2))
    m.distance(A, B, 1.0)
    m.distance(B, D, 1.5)
    said = words(m._repr_html_())
    assert "degrees of freedom: open: the mechanism does not close" in said and "2 constraints" in said


@pytest.mark.parametrize("broken", ["freedom", "inspect", "spots", "sketch", "scene_of", "curves_of_motion"])
def test_a_part_that_fails_leaves_the_others(fourbar, run, monkeypatch, broken):
    def fail(*_: object) -> None:
        raise RuntimeError("<b>it & is</b> broken")

    monkeypatch.setattr(cards, broken, fail)
    said = "".join(words(thing._repr_html_()) for thing in (fourbar.model, fourbar, run))
    assert ": <b>it & is</b> broken" in said and all(kind in said for kind in ("fourbar model", "fourbar kernels", "fourbar trajectory"))


def test_a_motion_that_is_no_number(run):
    from dataclasses import replace

    broken = replace(run, q=np.full_like(run.q, np.nan), qd=np.full_like(run.qd, np.nan))
    assert "is not a finite number" in words(broken._repr_html_())
    assert "fourbar trajectory" in words(replace(run, t=run.t[:0], q=run.q[:0], qd=run.qd[:0], work=run.work[:0])._repr_html_())


def test_names_stay_in_their_places(hostile_run):
    """Every name tries to leave its place; the run has little else, so most parts say what they lack."""
    hostile_run.thinned = lambda _: hostile_run
    card = parsed(cards.of_trajectory(hostile_run))
    assert not list(card.iter("script")) and not list(card.iter("img"))
    assert hostile_run.name in "".join(card.itertext())


def test_a_large_model_is_quick():
    """Freedoms of a mechanism that was never compiled are not waited for where it is large; tables end."""
    m = Model("large")
    points = [m.point(f"P{k}", (k, 0), fixed=k == 0) for k in range(400)]
    for a, b in zip(points, points[1:]):
        m.distance(a, b)
    begun = time.perf_counter()
    said = words(m._repr_html_())
    assert time.perf_counter() - begun < 1.0
    assert "399 degrees of freedom or more" in said and "299 more" in said


def test_matplotlib_is_not_needed():
    """What cards are made of brings neither matplotlib nor sympy along."""
    code = "import sys, ncgen.report.cards\nprint({'matplotlib', 'sympy'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"
