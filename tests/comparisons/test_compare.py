"""`ncgen compare`: errors are what theory says, mistakes are named, and the report needs nothing but a browser."""

import csv
import io
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

import ncgen
from ncgen.comparisons.compare import compare
from ncgen.comparisons.comparison import Comparison
from ncgen.comparisons.mistakes import find_mistakes
from ncgen.comparisons.rivals import Inputs, by_differences, exact, relative_error
from ncgen.errors import ModelError
from ncgen.report import clock
from ncgen.resources import folder


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Few samples: the times are not looked at."""
    monkeypatch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
    monkeypatch.setattr(clock.measure, "__defaults__", (1,))


@pytest.fixture(scope="module")
def fourbar():
    """A whole comparison of a small mechanism."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clock, "MIN_SAMPLE_SECONDS", 1e-6)
        patch.setattr(clock.measure, "__defaults__", (1,))
        comparison = Comparison(ncgen.load("fourbar"), [])
        list(comparison.sections())
    return comparison


def of(records, tool):
    return next(r for r in records if r["tool"] == tool)


@pytest.mark.slow
def test_errors_of_the_robot(robot_model):
    """Generated code at rounding, differences at the square and cube root of it, complex steps at rounding again."""
    sections = dict(compare(robot_model))
    assert set(sections) == {"phi_q", "gamma", "mass", "all"}
    for kernel in ("phi_q", "gamma", "mass"):
        generated = [r for r in sections[kernel] if r["tool"].startswith("generated")]
        assert {r["tool"] for r in generated} >= {"generated C, auto", "generated C, float", "generated C, long double", "generated NumPy"}
        assert all(r["ulps_max"] <= 4 for r in generated)
        assert of(sections[kernel], "generated C, long double")["error"] < 2e-18 or np.finfo(np.longdouble).eps > 1e-18
    for kernel in ("phi_q", "gamma"):
        assert 1e-10 < of(sections[kernel], "finite differences, 2 points")["error"] < 1e-4
        assert 1e-13 < of(sections[kernel], "finite differences, 3 points")["error"] < 1e-7
        assert of(sections[kernel], "complex step, NumPy")["ulps_max"] < 8
        assert of(sections[kernel], "hand-written C")["ulps_max"] < 8


def test_references_are_independent_and_agree(robot):
    """Derivatives by differences of Φ with 50 digits are those of the generated program with 50 digits."""
    inputs = Inputs.typical(robot)
    for kernel in ("phi_q", "gamma"):
        assert relative_error(by_differences(robot, kernel, inputs), exact(robot, kernel, inputs)) < 1e-18


def test_records_for_machines(fourbar):
    records = fourbar.records
    assert json.loads(json.dumps(records)) == records
    lines = list(csv.DictReader(io.StringIO(fourbar.csv())))
    assert len(lines) == len(records)
    assert float(lines[0]["seconds"]) == records[0]["seconds"]


def test_functions_of_the_user(tmp_path, monkeypatch, fourbar):
    (tmp_path / "mine_for_compare.py").write_text(
        "import ncgen\nk = ncgen.compile(ncgen.load('fourbar'), 'numpy')\n"
        "def dense(q):\n    return k.jacobian(q) + 1e-5\n"
        "def short(q):\n    return k.phi(q)[:1]\n"
    )
    monkeypatch.chdir(tmp_path)
    sections = dict(compare(fourbar.model, ["mine_for_compare:dense"]))
    assert of(sections["phi_q"], "mine_for_compare:dense")["error"] == pytest.approx(1e-5, rel=0.9)
    for text, words in (
        ("mine_for_compare:short", "shape"),
        ("nowhere:f", "nowhere"),
        ("energy=mine_for_compare:dense", "no kernel energy"),
    ):
        with pytest.raises(ModelError, match=words):
            list(compare(fourbar.model, [text]))


# -- mistakes ------------------------------------------------------------------------------------------------------------

PLANTED = {
    "sign": ("    J[DROW, DJ] = -a", "    J[DROW, DJ] = a", "vector_phi_q", 2, {"r3.x", "r3.y", "r3.z"}),
    "factor": ("    J[NROW, NU] = x[NU]", "    J[NROW, NU] = 2 * x[NU]", "vector_phi_q", 4, {"u3.x", "u3.y", "u3.z"}),
    "missing entry": ("    J[VROW, VJ] = x[VI]\n", "", "vector_phi_q", 7, {"u3.z"}),
    "missing term": ("dots(a, b) + s[:, 0] * dots(ab, n)", "dots(a, b)", "vector_phi_q", 26, {"psi1"}),
    "exchanged columns": (
        "    J[SROW, SJ] = u\n    J[SROW, SK] = -u", "    J[SROW, SK] = u\n    J[SROW, SJ] = -u", "vector_phi_q", 6, {"r2.x", "r3.x"},
    ),
    "sine and cosine": ("s * b - c * crosses(b, n), s * a", "c * b - s * crosses(b, n), s * a", "vector_phi_q", 28,
        {"r4.x", "r4.y", "r4.z"}),
    "sign of a term": ("psi) * dots(a, b) - np.cos(psi)", "psi) * dots(a, b) + np.cos(psi)", "vector_phi", 26, set()),
}  # fmt: skip


@pytest.fixture(scope="module")
def by_hand():
    return (folder("examples") / "robot" / "handwritten.py").read_text(encoding="utf-8")


def test_no_mistakes_are_found_in_what_is_right(robot):
    found = find_mistakes(robot, folder("examples") / "robot" / "handwritten.py")
    assert set(found) == {f"{kind}_{kernel}" for kind in ("loop", "vector") for kernel in ("phi", "phi_q", "gamma")}
    assert not any(found.values())


@pytest.mark.parametrize("kind", PLANTED)
def test_planted_mistakes_are_named(kind, robot, by_hand, tmp_path):
    """Row, column and kind of a mistake in one line of a right file."""
    right, wrong, function, row, columns = PLANTED[kind]
    assert by_hand.count(right) == 1
    path = tmp_path / "handwritten.py"
    path.write_text(by_hand.replace(right, wrong), encoding="utf-8")
    found = find_mistakes(robot, path)
    named = [m for m in found[function] if m.row == row and set(m.columns) == columns]
    assert [m.kind for m in named] == [kind], found[function]
    assert f"row {row} (" in str(named[0]) and all(column in str(named[0]) for column in columns)
    assert not any(mistakes for name, mistakes in found.items() if name != function)


def test_files_that_are_no_help(robot, tmp_path):
    path = tmp_path / "mine.py"
    for text, words in (
        ("x = 1", "no function called"),
        ("def phi(q):\n    return q[0, 0]", "it fails"),
        ("def phi(q):\n    return 1", "shape"),
        ("(", "cannot be run"),
    ):
        path.write_text(text)
        with pytest.raises(ModelError, match=words):
            find_mistakes(robot, path)
    with pytest.raises(ModelError, match="no such file"):
        find_mistakes(robot, tmp_path / "none.py")


# -- the report ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(fourbar):
    return fourbar.html()


def test_the_report_asks_nobody(fourbar, page):
    """No address to load anything from; the same measurement gives the same text."""
    text = fourbar.html()
    assert text == page
    assert text.count("<svg") == 4 == len(fourbar.measured)
    assert "default-src 'none'" in text
    assert not re.search(r"(src|href)=[\"'](?!#)", text)
    assert fourbar.machine["processor"] in text


@pytest.mark.skipif(not any(map(shutil.which, ("chromium", "google-chrome"))), reason="no Chromium here to open the report with")
def test_the_report_opens_in_a_browser(page, tmp_path):
    """All plots and tables are there, nothing is fetched, and the console says nothing."""
    path, log = tmp_path / "report.html", tmp_path / "net.json"
    path.write_text(page, encoding="utf-8")
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        f"--log-net-log={log}",
        "--disable-background-networking",
    ]
    done = subprocess.run([browser, *options, "--dump-dom", path.as_uri()], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.count("<svg") == 4 and done.stdout.count("<table>") == 4
    assert "CONSOLE" not in done.stderr
    asked = re.findall(r'"url":"(https?://[^"]+)"', log.read_text(encoding="utf-8"))
    assert not [url for url in asked if "google" not in url and "gvt1" not in url], asked
