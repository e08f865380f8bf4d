"""The site: built by its command, with no dead link, nothing fetched from elsewhere, and a place for everything that is public."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

SITE = Path(__file__).resolve().parents[2] / "docs" / "site"
sys.path[:0] = [str(SITE), str(SITE.parents[1] / "tests" / "export")]

import links  # noqa: E402 (it needs nothing else)
from accessibility import AXE, VIOLATIONS  # noqa: E402
from browser import CHROMIUM, Browser  # noqa: E402

import ncgen  # noqa: E402

LIMIT = 120
"""Seconds that the command may take."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site as the documented command makes it, without a network."""
    pytest.importorskip("mkdocs", reason="the site needs pip install '.[docs]'")
    pytest.importorskip("mkdocstrings", reason="the site needs pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("built") / "site"
    begun = time.monotonic()
    proxies = {f"{name}_proxy": "http://127.0.0.1:9" for name in ("http", "https")}
    done = subprocess.run([sys.executable, SITE / "build.py", folder], capture_output=True, text=True, env={**os.environ, **proxies})
    assert done.returncode == 0, done.stdout + done.stderr
    assert time.monotonic() - begun < LIMIT
    return folder


@pytest.mark.slow
def test_no_link_is_dead_and_nothing_comes_from_elsewhere(site):
    assert links.problems(site) == []


@pytest.mark.slow
def test_everything_public_has_a_page(site):
    """Functions with what they return, words, methods, examples, notebooks, with their own texts."""
    from ncgen.exchange.examples import example_names
    from ncgen.exchange.words import words
    from ncgen.methods.table import FORMALISMS, INTEGRATORS

    for name in ncgen.__all__:
        assert f'id="{ncgen._HOMES[name]}.{name}"' in (site / "docs/reference/ncgen" / f"{name}.html").read_text(encoding="utf-8")
    pages = "".join(path.read_text(encoding="utf-8") for path in (site / "docs/reference/ncgen").glob("*.html"))
    for path in ("mechanism.kernels.Kernels", "solver.trajectories.trajectory.Trajectory", "solver.linear.linearise.Linearisation"):
        assert f'id="ncgen.{path}"' in pages
    vocabulary = (site / "docs/reference/words.html").read_text(encoding="utf-8")
    assert all(f"[{word}]" in vocabulary for word in words())
    methods = (site / "docs/reference/methods.html").read_text(encoding="utf-8")
    assert all(f"<code>{name}</code>" in methods for name in (*FORMALISMS, *INTEGRATORS))
    assert all((site / "examples" / name / "index.html").is_file() for name in example_names())
    for path in (SITE.parent / "course").glob("*.ipynb"):
        page = (site / "docs/course" / path.with_suffix(".html").name).read_text(encoding="utf-8")
        assert "<details" in page and 'class="output' in page and "arithmatex" not in page and "```" not in page


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
def test_pages_fit_and_search_finds_without_a_server(site, tmp_path):
    """Opened from files, wide and as a telephone: nothing is too wide, nothing is said on the console, and search finds."""
    with Browser(tmp_path) as browser:
        for name in ("index", "docs/course/08-methods", "docs/reference/words", "docs/reference/ncgen/simulate", "examples/index"):
            for width in (1400, 390):
                go(browser, site / f"{name}.html", width)
                assert browser.value("document.documentElement.scrollWidth") <= width, name
        assert browser.said == []
        browser.value("document.querySelector('[data-md-toggle=search]').click()")
        field = "document.querySelector('input.md-search__input')"
        browser.value(f"{field}.value = 'redundant'; {field}.dispatchEvent(new Event('keyup'))")
        browser.wait("document.querySelectorAll('.md-search-result__item').length > 3")


MAIN = (
    "index", "docs/tutorial", "docs/models", "docs/embedding", "examples/index", "examples/fourbar/index", "docs/course/index",
    "docs/course/lesson", "docs/reference/ncgen/simulate",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed")
@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (1400, "dark"), (390, "light"), (390, "dark")])
def test_main_pages_break_no_rule_of_accessibility(site, tmp_path, width, scheme):
    """By axe-core, frames apart, which have a test of their own."""
    with Browser(tmp_path) as browser:
        browser._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        for name in MAIN:
            go(browser, site / f"{name}.html", width)
            browser.value(f"{AXE.read_text(encoding='utf-8')}; 0")
            passes, violations = json.loads(browser.value(VIOLATIONS))
            assert passes > 15 and violations == [], name


def go(browser, path, width):
    browser._call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 500)
    browser._call("Page.navigate", url=path.as_uri())
    browser.wait(f"location.href === {json.dumps(path.as_uri())} && document.readyState === 'complete'")


def test_a_folder_of_somebody_elses_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work", encoding="utf-8")
    done = subprocess.run([sys.executable, SITE / "build.py", tmp_path], capture_output=True, text=True)
    assert done.returncode == 1 and "is there and is no site; give another folder" in done.stderr
    assert (tmp_path / "thesis.tex").is_file()


def test_dead_links_are_seen(tmp_path):
    """Files, folders and places in a page that are not there, and what a page would fetch."""
    (tmp_path / "there.html").write_text('<p id="here">', encoding="utf-8")
    good = (
        '<a href="there.html#here"><a href="#top"><a href="https://elsewhere.org"><p id="top"><link rel="canonical" href="https://own.org">'
    )
    bad = '<a href="gone.html"><a href="there.html#gone"><img src="gone.png"><script src="https://elsewhere.org/a.js"></script>'
    (tmp_path / "good.html").write_text(good, encoding="utf-8")
    assert links.problems(tmp_path) == []
    (tmp_path / "bad.html").write_text(bad, encoding="utf-8")
    assert [re.sub(r"^\S+ ", "", line) for line in links.problems(tmp_path)] == [
        "loads https://elsewhere.org/a.js",
        "links to gone.html",
        "links to there.html#gone",
        "links to gone.png",
    ]


def test_docstrings_become_lists():
    """An entry a line, entries within entries, lines that go on; prose that begins with a name stays prose."""
    pytest.importorskip("griffe", reason="the site needs pip install '.[docs]'")
    import docstrings

    said = 'Do it.\n\nq: where it begins, numbers\n    or names\nformalism: one of\n    "auto": ours\n    "a" (b), "c": theirs\nRaises it.'
    assert docstrings.listed(said).splitlines() == [
        "Do it.", "", "- `q`: where it begins, numbers or names", "- `formalism`: one of", '    - `"auto"`: ours',
        '    - `"a"` (b), `"c"`: theirs', "", "Raises it.",
    ]  # fmt: skip
    prose = "A run.\n\nIt has t and q,\nengine: what it was."
    assert docstrings.listed(prose) == prose


def test_docstrings_in_numpys_style_become_tables():
    """A group's arguments are in the table of the function that takes them."""
    pytest.importorskip("griffe", reason="the site needs pip install '.[docs]'")
    import docstrings
    import griffe

    module = griffe.load("ncgen.solver.linear.linearise")
    text = docstrings.whole(module["linearise"], module["linearise"].docstring.value)
    lines = docstrings.tabled(text).splitlines()
    assert "| `t0` | float | Start time in s. |" in lines and "| SingularError | At a singular position. |" in lines
    assert [line for line in lines if line.startswith("**")][:3] == ["**Parameters**", "**Returns**", "**Raises**"]
    assert docstrings.tabled("Add.\n\nReturns\n-------\nint\n    The sum, a | b.\n").splitlines()[2:] == [
        "**Returns**",
        "",
        "| type | meaning |",
        "|---|---|",
        "| int | The sum, a \\| b. |",
    ]
