"""The player: its data, its safety, and that its script runs."""

import html
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from turning import HOSTILE, TurningRun

from ncgen.errors import NcgenError
from ncgen.view.player import player, write_player

CHROMIUM = shutil.which("chromium")
FETCHING = ("http:", "https:", " src=", "url(", "@import", "import(", "fetch(", "XMLHttpRequest", "WebSocket")


class Page(HTMLParser):
    """The elements of a page: their tags, and the text of the title, the heading and the data."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.open = [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.open = dict(attributes).get("id", tag)

    def handle_endtag(self, tag):
        self.open = None

    def handle_data(self, data):
        self.texts[self.open] = self.texts.get(self.open, "") + data


def embedded(text):
    return json.loads(Page(text).texts["run"])


def close(a, b):
    """Equal to 1e-6 of the larger of 1 and the number."""
    return np.allclose(a, b, rtol=1e-6, atol=1e-6)


def test_the_data_are_those_of_the_run(robot_run):
    """Every number, to 1e-6."""
    data = embedded(player(robot_run))
    assert data["points"] == [f"r{i}" for i in range(1, 9)]
    assert close(data["t"], robot_run.t)
    assert close(data["positions"], np.stack([robot_run.point(name) for name in data["points"]], axis=1))
    assert close(data["directions"], np.stack([robot_run.vector(name) for name in data["vectors"]], axis=1))
    assert close([data["energy"]["kinetic"], data["energy"]["potential"]], robot_run.energy()[:, :2].T)
    assert data["vectors"] == ["u1", "u2", "u3", "u4", "u5"]
    assert [8, 4] not in data["arrows"] and [7, 4] in data["arrows"] and len(data["arrows"]) == 9
    assert len(data["segments"]) == 10 and data["springs"] == []
    assert data["fixed"] == [True] + [False] * 7
    assert data["planar"] is False
    assert data["bodies"][3] == {"name": "body5", "points": [3, 5, 4]} and len(data["bodies"]) == 8


def test_numbers_have_seven_digits(robot_run):
    """No more than the eye and the screen need."""
    data = Page(player(robot_run)).texts["run"]
    digits = [len(re.sub(r"e.*|[-.]", "", number).lstrip("0")) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", data)]
    assert len(digits) > 1000 and max(digits) == 7


def test_a_planar_run_says_so(flat_run):
    assert embedded(player(flat_run))["planar"] is True


def test_long_runs_are_thinned_evenly(flat_model):
    """300 times of 10000, the first and the last among them."""
    data = embedded(player(TurningRun(flat_model, np.linspace(0, 5, 10_000))))
    assert len(data["t"]) == len(data["positions"]) == len(data["energy"]["kinetic"]) == 300
    assert (data["t"][0], data["t"][-1]) == (0.0, 5.0)
    assert np.ptp(np.diff(data["t"])) < 2 * 5 / 9999


def test_without_masses_there_is_no_energy(flat_model):
    assert embedded(player(TurningRun(flat_model, [0, 1], massless=True)))["energy"] is None


def test_the_page_asks_for_nothing(robot_run):
    """No address, no external script, style, font or picture, and a policy that would forbid them."""
    text = player(robot_run)
    assert [word for word in FETCHING if word in text] == []
    assert "default-src 'none'" in text


def test_hostile_names_are_text(hostile_run):
    """In the title, in the heading and in the data they are what they were, and no element more is made."""
    text = player(hostile_run)
    page = Page(text)
    assert page.tags == Page(player(TurningRun(hostile_run.model, [0.0]))).tags
    assert page.tags.count("script") == 2 and "img" not in page.tags
    assert page.texts["title"] == page.texts["h1"] == HOSTILE
    data = embedded(text)
    assert data["name"] == HOSTILE
    assert data["points"] == [f"p{HOSTILE}", f"q{HOSTILE}"]
    assert data["vectors"] == [f"u{HOSTILE}"]


def test_the_same_run_gives_the_same_page(robot_run):
    assert player(robot_run) == player(robot_run)


def test_what_is_not_finite_is_refused(flat_model):
    """Before a page is written that could not be read."""
    run = TurningRun(flat_model, [0.0, 1.0])
    run.energy = lambda: np.array([[1.0, 2.0, 0.0], [np.inf, 0.0, 0.0]])
    with pytest.raises(NcgenError, match="^flat: the energy is not a finite number at all times"):
        player(run)


def test_writing(flat_run, tmp_path):
    """Into a folder that is made if missing."""
    path = write_player(flat_run, tmp_path / "new" / "flat.html")
    assert path.read_text(encoding="utf-8") == player(flat_run)


@pytest.mark.parametrize("name", ["motion.gif", "motion.mp4", "motion"])
def test_a_page_is_no_film(flat_run, tmp_path, name):
    with pytest.raises(NcgenError, match="a page is saved as .html or .htm; choose a name that ends so"):
        write_player(flat_run, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on the path")
def test_the_script_runs_in_a_browser(hostile_run, tmp_path):
    """To its last line, and the hostile names do nothing."""
    path = write_player(hostile_run, tmp_path / "hostile.html")
    options = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    options += f" --disable-component-update --disable-sync --user-data-dir={tmp_path / 'profile'} --dump-dom"
    page = subprocess.run([CHROMIUM, *options.split(), path.as_uri()], capture_output=True, text=True, timeout=60).stdout
    body = re.search(r"<body[^>]*>", page).group()
    assert 'data-ready="true"' in body
    assert "data-broken" not in body
    assert f"<title>{html.escape(HOSTILE, quote=False)}</title>" in page
    assert page.count("<option") == 5 + 1 + 2
    assert '<output id="time">t = 0.00 s</output>' in page
