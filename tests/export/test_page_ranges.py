"""Numbers that a model offers first in its page, and the ends of their sliders: the mechanism can be at each of them."""

from __future__ import annotations

import json
import re

import pytest
from browser import CHROMIUM
from living import enter, nothing_said

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_names, load
from ncgen.exchange.export import export
from ncgen.exchange.toml_writer import to_toml

shown = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
RANGED = [name for name in example_names() if load(name).drawing.ranges]


def sprung() -> ncgen.Model:
    m = ncgen.Model("sprung")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0), fixed="y")
    m.body("bob", [B], mass=1.0)
    m.spring(A, B, stiffness=m.parameter("k", 40.0, "N/m"), free_length=0.5)
    m.range("k", 10, 100)
    m.range("bob.mass", 0.5, 2)
    return m


def parameters_of(page) -> dict[str, dict]:
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="mechanism">(.*?)</script>', text, re.DOTALL)[1])["parameters"]


def test_they_stand_first_with_their_ends(tmp_path):
    (page,) = export(sprung(), "html", tmp_path)
    ranged = [each for each in parameters_of(page) if "range" in each]
    assert [(each["group"], each["range"]) for each in ranged] == [("parameters", [10, 100]), ("parameters", [0.5, 2])]


def test_a_file_holds_them(tmp_path):
    (tmp_path / "sprung.toml").write_text(to_toml(sprung()))
    assert load(tmp_path / "sprung.toml").drawing.ranges == {"k": (10, 100), "bob.mass": (0.5, 2)}


def test_what_is_no_range_is_refused(tmp_path):
    m = sprung()
    with pytest.raises(ModelError, match="^range of k: from 2 to 1; give two numbers that increase$"):
        m.range("k", 2, 1)
    m.range("mass", 0, 1)
    with pytest.raises(ModelError, match="^sprung: range 'mass' is unknown; choose one of k, .*bob.mass"):
        export(m, "html", tmp_path)


@shown
@pytest.mark.slow
@pytest.mark.parametrize("name", RANGED)
def test_an_example_can_be_at_both_ends(browser, page_of, name):
    """One number after the other, from where the example is described."""
    browser.open(page_of(name))
    for number, ends in load(name).drawing.ranges.items():
        before = browser.value(f"living.mechanism.p[globalThis.exported.parameters.indexOf({json.dumps(number)})]")
        assert ends[0] <= before <= ends[1]
        for value in (*ends, before):
            enter(browser, number, value)
            assert nothing_said(browser), (number, value, browser.value("document.getElementById('problem').textContent"))
