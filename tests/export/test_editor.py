"""In the editor's page mechanisms are drawn with a pointer or by keys; they move as ncgen moves the model files that the page writes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser

import ncgen
from ncgen.exchange.editor import editor_page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

AXE = Path(os.environ.get("NCGEN_AXE") or Path(__file__).parents[2] / "node_modules" / "axe-core" / "axe.min.js")
SECONDS = np.linspace(0, 1, 11)
MOVED = """(() => {
  editor.play(false); editor.restart();
  const names = editor.terms.names;
  const state = () => Object.fromEntries(names.map((name, i) => [name, editor.motion.q[i]]));
  return TIMES.map((t) => { if (t > 0) editor.motion.goOn(t); return state(); });
})()"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return editor_page().save(tmp_path_factory.mktemp("editor") / "draw.html")


class Sheet:
    """The page with an empty drawing in a view that does not move, and hands."""

    def __init__(self, browser: Browser, page) -> None:
        self.browser = browser
        browser.open(page)
        browser.value("page_of_test = (editor.open(emptyDrawing()), editor.picture.centre = [0.3, 0.2], editor.picture.scale = 800, 0)")

    def tool(self, name: str) -> None:
        self.browser.value(f"document.getElementById('tool-{name}').click()")

    def client(self, x: float, y: float) -> tuple[float, float]:
        """Where a place (m) is in the window."""
        box, at = "editor.picture.canvas.getBoundingClientRect()", f"editor.picture.screen([{x}, {y}])"
        at = f"(([x, y], box) => [x + box.left, y + box.top])({at}, {box})"
        return tuple(self.browser.value(at))

    def click(self, *places: tuple[float, float]) -> None:
        for place in places:
            x, y = self.client(*place)
            for kind in ("mousePressed", "mouseReleased"):
                self.browser.mouse(kind, x, y)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.browser.mouse("mousePressed", *self.client(*start))
        for share in (0.5, 1.0):
            self.browser.mouse("mouseMoved", *self.client(*(a + share * (b - a) for a, b in zip(start, end, strict=True))))
        self.browser.mouse("mouseReleased", *self.client(*end))

    def draw(self, **uses: list[tuple[float, float]]) -> None:
        """Click with one tool after the other."""
        for tool, places in uses.items():
            self.tool(tool.rstrip("_"))
            self.click(*places)

    def text(self, kind: str) -> str:
        """What the page offers to copy."""
        self.browser.value(f"document.getElementById('{kind}').click()")
        text = self.browser.value("document.getElementById('text-body').value")
        self.browser.value("document.getElementById('close').click()")
        return text

    @property
    def status(self) -> str:
        return self.browser.value("document.getElementById('status').textContent")


@pytest.fixture
def sheet(browser, page):
    found = Sheet(browser, page)
    yield found
    assert browser.said == []


def check_motion(sheet: Sheet, folder, suffix: str = ".toml") -> ncgen.Trajectory:
    """The page's motion is that of the file that it writes, run as `ncgen run` would."""
    file = folder / f"drawing{suffix}"
    file.write_text(sheet.text(suffix[1:] if suffix == ".toml" else "python"))
    model = ncgen.load(str(file))
    options = {name: value for name, value in model.simulation_options.items() if name != "duration"}
    run = ncgen.simulate(ncgen.compile(model), SECONDS[-1], points=len(SECONDS), integrator="dop853", rtol=1e-12, atol=1e-14, **options)
    moved = sheet.browser.value(MOVED.replace("TIMES", json.dumps(SECONDS.tolist())))
    found = np.array([[row[name] for name in run.kernels.coordinates] for row in moved])
    assert np.max(np.abs(found - run.q)) < 1e-9 * max(1.0, np.max(np.abs(run.q)))
    assert np.ptp(run.q, axis=0).max() > 0.05  # it does move
    return run


A, B, C, D, E = (0, 0), (0.1, 0.1), (0.4, 0.3), (0.5, 0), (0.25, 0.5)


def test_a_four_bar_is_drawn_and_moves(sheet, tmp_path):
    sheet.draw(bar=[A, B, C, D, D], pivot=[A, D])
    assert sheet.status == "1 degree of freedom"
    sheet.draw(motor=[(0.05, 0.05)])
    assert sheet.browser.value("editor.playing") and sheet.status == "1 degree of freedom, 1 driven"
    run = check_motion(sheet, tmp_path)
    torque = float(run.lam[-1][[row.label for row in run.kernels.rows].index("driver of psi1")])
    sheet.browser.value("page_of_test = document.getElementById('time').textContent")
    row = "editor.motion.multipliers[editor.terms.labels.indexOf('drive of psi1')]"
    assert sheet.browser.value(row) == pytest.approx(torque, rel=1e-7)


def test_a_slider_crank_is_drawn_and_moves(sheet, tmp_path):
    sheet.draw(bar=[A, B, D, D], pivot=[A, (0.7, 0)], slider=[D, A, (0.7, 0)], motor=[(0.05, 0.05)])
    sheet.browser.value("editor.change((d) => Object.assign(d.motors[0], { mode: 'start', value: 8 }))")
    assert sheet.status == "1 degree of freedom"
    check_motion(sheet, tmp_path)


def test_a_six_bar_of_watt_is_drawn_and_moves(sheet, tmp_path):
    F, G = (0.7, 0.25), (0.6, 0.5)
    sheet.draw(bar=[A, B, B], plate=[B, C, E, B])
    sheet.draw(plate=[C, D, F, C], bar=[E, G, F, F], pivot=[A, D], motor=[(0.05, 0.05)])
    assert sheet.status == "1 degree of freedom, 1 driven"
    check_motion(sheet, tmp_path)


def test_a_block_that_does_not_turn_springs_and_python(sheet, tmp_path):
    """A bar whose end slides without turning, on a spring; the file in Python moves alike."""
    sheet.draw(bar=[A, B, D, D], slider=[B, (0, 0.3), (0.3, 0.0)], spring=[(0.5, 0.5), D])
    sheet.browser.value("editor.change((d) => { d.sliders[0].turns = false; d.points.find((p) => p.name === 'A').fixed = false; })")
    check_motion(sheet, tmp_path, ".py")


def test_gears_turn_together(sheet, tmp_path):
    sheet.draw(bar=[A, B, B], pivot=[A, D])
    sheet.draw(bar=[D, C, C], gear=[(0.05, 0.05), (0.45, 0.15)], motor=[(0.05, 0.05)])
    sheet.browser.value("editor.change((d) => (d.gears[0].radii = [0.1, 0.4]))")
    run = check_motion(sheet, tmp_path)
    assert np.ptp(0.1 * run["psi1"] + 0.4 * run["psi2"]) < 1e-12


def test_a_dragged_point_changes_lengths_and_undo_brings_them_back(sheet):
    sheet.draw(bar=[A, B, C, D, D], pivot=[A, D], move=[])
    sheet.drag(C, (0.45, 0.4))
    assert sheet.browser.value("place(editor.drawing, 'C')") == [0.45, 0.4]
    sheet.browser.value("document.getElementById('undo').click()")
    assert sheet.browser.value("place(editor.drawing, 'C')") == [0.4, 0.3]


def test_parts_that_go_take_along_what_speaks_of_them(sheet):
    sheet.draw(bar=[A, B, C, D, D], pivot=[A, D], motor=[(0.05, 0.05)], spring=[(0.1, 0.4), C], delete=[B])
    drawing = sheet.browser.value("editor.drawing")
    assert [b["points"] for b in drawing["bodies"]] == [["C", "D"]] and not drawing["motors"] and len(drawing["springs"]) == 1


def test_the_keyboard_draws(sheet):
    """A pendulum without a pointer: the cross goes by arrows, Enter clicks, Space runs."""
    browser = sheet.browser
    browser.value("editor.picture.canvas.focus()")
    step = browser.value("editor.picture.step")
    for key in ("b", "ArrowRight", "Enter", "ArrowRight", "ArrowRight", "Enter", "Escape", "p", "ArrowLeft", "ArrowRight", "Enter"):
        browser.press(key)
    drawing = browser.value("editor.drawing")
    assert [p["fixed"] for p in drawing["points"]] == [False, True] and len(drawing["bodies"]) == 1
    assert abs(drawing["points"][1]["x"] - drawing["points"][0]["x"]) == pytest.approx(2 * step)
    browser.press(" ", "Space")
    browser.wait("editor.motion.t > 0.1")
    browser.press(" ", "Space")
    assert not browser.value("editor.playing")


def test_the_address_holds_the_drawing(sheet, page, tmp_path):
    sheet.draw(bar=[A, B, C, D, D], pivot=[A, D], motor=[(0.05, 0.05)])
    drawing = sheet.browser.value("editor.drawing")
    assert sheet.browser.value("drawingFrom(location.hash)") == drawing
    for wrong in (
        "#{}",
        "#null",
        "#%",
        "#" + json.dumps(drawing | {"name": "a b"}),
        "#" + json.dumps(drawing | {"points": [{"name": "A"}]}),
    ):
        assert sheet.browser.value(f"drawingFrom({json.dumps(wrong)})") is None


def test_numbers_that_no_part_can_have_are_marked(sheet):
    sheet.draw(bar=[A, B, B], move=[(0.05, 0.05)])
    sheet.browser.value("{ const f = document.getElementById('field-mass'); f.value = '-1'; f.dispatchEvent(new Event('change')); }")
    assert sheet.browser.value("[document.getElementById('field-mass').ariaInvalid, editor.drawing.bodies[0].mass]") == ["true", None]
    sheet.browser.value("{ const f = document.getElementById('field-mass'); f.value = '2.5'; f.dispatchEvent(new Event('change')); }")
    assert sheet.browser.value("editor.drawing.bodies[0].mass") == 2.5


def test_a_start_in_a_singular_position_is_refused(sheet):
    """All bars of a parallelogram in line: it could go on as a parallelogram or crossed. A point that is moved a little decides."""
    sheet.draw(bar=[A, (0.1, 0), D, (0.4, 0), (0.4, 0)], pivot=[A, (0.4, 0)])
    assert sheet.status == "It cannot begin to move here: the equations are singular here; move a point a little."
    sheet.browser.value("editor.change((d) => (named(d.points, 'B').y = 0.02))")
    assert sheet.status == "1 degree of freedom"


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed: npm install --no-save axe-core, or NCGEN_AXE=FILE")
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (390, False), (390, True)])
def test_no_rule_of_accessibility_is_broken(browser, page, width, dark):
    """With a part chosen, and with the text of the model."""
    browser.open(page, width, 800, dark)
    browser.value("editor.play(false); editor.choose('motor', editor.drawing.motors[0]); 0")
    browser.value(f"{AXE.read_text(encoding='utf-8')}; 0")
    for opened in ("0", "document.getElementById('toml').click(); 0"):
        browser.value(opened)
        passes, violations = json.loads(
            browser.value("axe.run().then((f) => JSON.stringify([f.passes.length, f.violations.map((v) => v.id)]))")
        )
        assert passes > 15 and violations == []


def test_the_page_is_one_small_file(page):
    text = page.read_text()
    assert len(text) < 600_000 and "://" not in text.replace("http://www.w3.org", "")
