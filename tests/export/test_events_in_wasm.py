"""Events in WebAssembly and in the page that computes: times and states of closed forms and of our own runs; the list of what happened."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM
from exported import shell
from living import click, enter, nothing_said, settled, state_of

import ncgen
from ncgen.emit.naming import prefix_of
from ncgen.errors import ModelError
from ncgen.exchange.export import export

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "events"))

from bouncing import ball  # noqa: E402
from test_events_of_exports import wheel  # noqa: E402

FIRST, SECOND, TENTH = 0.4515236409857309, 0.9030472819714618, 1.352807158734592
"""When the ball hits the floor."""

in_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
shown = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

SCRIPT = """
import { readFileSync } from "node:fs";
import { @, events } from "./%.js";
const m = await @.load(readFileSync("%.wasm")), end = #, found = [];
while (m.t < end && !m.stopped) {
  m.nextEvent(end, 1e-12, 1e-12);
  found.push([m.t, ...m.q, ...m.qd, ...m.p]);
}
const { happened, stopped, work } = m;
m.start();
m.advance(end, 1e-12, 1e-12);
const again = [m.t, ...m.q, ...m.qd, ...m.p], kept = m.state;
let said = "";
try { m.advance(end + 1); } catch (error) { said = error.message; }
console.log(JSON.stringify({ found, happened, stopped, work, again, said, events, stays: m.state.every((x, i) => x === kept[i]) }));
"""


def moved(model: ncgen.Model, folder: Path, end: float) -> dict:
    export(model, "wasm", folder)
    prefix = prefix_of(model.name)
    (folder / "use.mjs").write_text(SCRIPT.replace("@", prefix.capitalize()).replace("%", prefix).replace("#", repr(end)))
    return json.loads(shell("node use.mjs", folder))


@in_node
def test_a_ball_bounces_until_bounces_accumulate(tmp_path):
    answer = moved(ball(rest="end"), tmp_path, 2.0)
    times = [row[0] for row in answer["found"]]
    assert times[:2] == pytest.approx([FIRST, SECOND], rel=1e-12) and times[9] == pytest.approx(TENTH, rel=1e-12)
    assert answer["stopped"] and answer["happened"] == {"floor": len(times)} and answer["events"] == ["floor"]
    assert answer["again"][0] == times[-1] and answer["said"].endswith("an event has ended the motion") and answer["stays"]
    assert answer["work"] == pytest.approx(-9.81, rel=1e-10)  # all that it had


@in_node
def test_parameters_and_velocities_change_as_in_our_run(tmp_path):
    model = wheel()
    answer = moved(model, tmp_path, 5.0)
    run = ncgen.simulate(
        ncgen.compile(model), 5.0, rtol=1e-11, atol=1e-12, **{k: v for k, v in model.simulation_options.items() if k != "duration"}
    )
    found = np.array(answer["found"])
    assert found[:-1, 0] == pytest.approx([event.t for event in run.events], rel=1e-10) and answer["happened"] == {"foot": 4}
    np.testing.assert_allclose(found[-1, 1 : 1 + run.kernels.n], run.q[-1], rtol=1e-8)
    assert found[-1, -1] == 4.0  # feet


def test_what_is_not_exported_is_refused_by_name(tmp_path):
    m = ball()
    m.event("told", when=m.time - 0.5, do=print)
    with pytest.raises(ModelError, match="cannot be exported: event told calls a Python function"):
        export(m, "html", tmp_path)


@shown
def test_the_page_lists_what_has_happened(browser, page_of):
    """With the time of each; going back and on in another way forgets what came later; a click goes there; the end is told."""
    listed = "[...document.querySelectorAll('#happened li')].map((each) => each.textContent)"
    browser.open(page_of(ball(rest="end")))
    while state_of(browser)[0] < 1.0:
        click(browser, "step")
    settled(browser)
    assert browser.value(listed) == [f"{FIRST:.4f} s floor", f"{SECOND:.4f} s floor"]
    assert browser.value("living.samples.map(({ t }) => t)").count(FIRST) <= 1 and browser.value("living.drift()") < 1e-9
    browser.value("document.querySelector('#happened button').click()")
    settled(browser)
    assert state_of(browser)[0] <= FIRST + 1e-12
    enter(browser, "gravity.y", -5.0)
    settled(browser)
    assert len(browser.value(listed)) <= 1
    click(browser, "defaults")
    assert state_of(browser)[0] == 0 and nothing_said(browser)
    click(browser, "play")
    browser.wait("!living.state.running", 20)
    settled(browser)
    assert browser.value(listed)[-1].endswith("the motion has ended") and nothing_said(browser)


@shown
def test_a_mechanism_without_constraints_has_a_page(browser, page_of):
    browser.open(page_of(ball(rest="end")))
    assert browser.value("living.violation()") == 0 and nothing_said(browser)
