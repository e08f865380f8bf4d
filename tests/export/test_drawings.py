"""Random drawings move in the editor's script as ncgen moves the model files that it writes of them."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from exported import shell

import ncgen
from ncgen.emit.environment import render
from ncgen.exchange.editor import SCRIPTS
from ncgen.program.term_tables import types
from ncgen.toolchain import generic_wasm

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")

SECONDS = np.linspace(0, 0.3, 4)
SCRIPT = """
const fs = require("node:fs");
const data = JSON.parse(fs.readFileSync("drawings.json"));
const names = "Motion, begin, tidy, tomlOf, pythonOf, addSliderOf, motorOf, addGearOf, named";
const page = new Function(fs.readFileSync("page.js", "utf8") + `; return { ${names} };`)();
function completed(drawing) {
  for (const [point, start, end, turns] of drawing.rails) Object.assign(page.addSliderOf(drawing, point, start, end), { turns });
  for (const [body, mode, value] of drawing.drives) Object.assign(page.motorOf(drawing, page.named(drawing.bodies, body), mode), { value });
  for (const [first, second] of drawing.wheels)
    page.addGearOf(drawing, ...[first, second].map((name) => page.named(drawing.bodies, name))).radii = [0.1, 0.17];
  page.tidy(drawing);
}
async function moved(drawing) {
  completed(drawing);
  const motion = await page.Motion.load(fs.readFileSync(data.binary));
  const found = { toml: page.tomlOf(drawing), python: page.pythonOf(drawing) };
  try {
    const { names } = page.begin(motion, drawing, data.types, 1e-12, 1e-14);
    found.moved = data.t.map((t) => {
      if (t > 0) motion.goOn(t);
      return Object.fromEntries(names.map((name, i) => [name, [motion.q[i], motion.qd[i]]]));
    });
  } catch (error) {
    found.message = error.message;
  }
  return found;
}
(async () => console.log(JSON.stringify(await Promise.all(data.drawings.map(moved)))))();
"""


def random_drawing(seed: int) -> dict:
    """A drawing as the page holds it, and what its script is to add."""
    random = np.random.default_rng(seed)
    drawing = {
        "name": f"drawing{seed}",
        "gravity": bool(random.random() < 0.8),
        **{k: [] for k in ("sliders", "springs", "motors", "gears")},
    }
    points, bodies = [], []

    def point(fixed: bool = False) -> str:
        x, y = (round(float(c), 3) for c in random.uniform(-0.5, 0.5, 2))
        points.append({"name": f"P{len(points)}", "x": x, "y": y, "fixed": fixed, "traced": False})
        return points[-1]["name"]

    grounds = [point(True), point(True)]
    ends = list(grounds)
    for k in range(random.integers(2, 5)):
        own = [ends[random.integers(len(ends))], *(point() for _ in range(random.integers(1, 4)))]
        bodies.append({"name": f"body{k}", "points": own, "mass": float(random.uniform(0.1, 1)) if random.random() < 0.5 else None})
        ends += own[1:]
    moving = [name for name in ends if name not in grounds]
    if random.random() < 0.5:  # a bar that closes a loop
        bodies.append({"name": "closing", "points": [grounds[1], moving[-1]], "mass": None})
    for _ in range(random.integers(0, 3)):
        spring = {"stiffness": 30.0, "damping": float(random.choice([0.0, 0.4])), "free": [None, 0.0, 0.2][random.integers(3)]}
        pair = {"start": grounds[0], "end": moving[random.integers(len(moving))]}
        drawing["springs"].append({"name": f"spring{len(drawing['springs'])}", **pair, **spring})
    rails = [[moving[-1], point(True), point(True), bool(random.random() < 0.6)]] if random.random() < 0.4 else []
    mode = ["drive", "start", "torque", "measure"][random.integers(4)]
    drives = [["body0", mode, 2.0 if mode != "torque" else 0.2]]
    wheels = [["body0", "body1"]] if random.random() < 0.3 else []
    return drawing | {"points": points, "bodies": bodies, "rails": rails, "drives": drives, "wheels": wheels}


def simulated(kernels: ncgen.Kernels, **options: object) -> ncgen.Trajectory:
    """A motion with the tolerances of this test."""
    return ncgen.simulate(kernels, SECONDS[-1], points=len(SECONDS), integrator="dop853", rtol=1e-12, atol=1e-14, **options)


def check(seeds: range, where) -> int:
    """Compare the motions of drawings; returns how many move."""
    (where / "page.js").write_text("\n".join(render(f"editor/{name}.js") for name in SCRIPTS))
    (where / "script.cjs").write_text(SCRIPT)
    keys = [template.key for template in types()]
    data = {"drawings": [random_drawing(k) for k in seeds], "types": keys, "binary": str(generic_wasm.FILE), "t": SECONDS.tolist()}
    (where / "drawings.json").write_text(json.dumps(data))
    count = 0
    for seed, found in zip(seeds, json.loads(shell("node script.cjs", where)), strict=True):
        (where / "drawing.toml").write_text(found["toml"])
        model = ncgen.load(str(where / "drawing.toml"))
        asked = {name: value for name, value in model.simulation_options.items() if name != "duration"}
        try:
            run = simulated(ncgen.compile(model), **asked)
        except ncgen.NcgenError:
            continue  # it cannot move, or comes to a singular position
        assert "moved" in found, (seed, found["message"])
        q, qd = np.moveaxis([[row[name] for name in run.kernels.coordinates] for row in found["moved"]], 2, 0)
        # A speed that leaves others open gives them the least kinetic energy, which the page's matrix, with its penalty, finds to 8 digits.
        assert np.max(np.abs(qd[0] - run.qd[0])) < 1e-7 * max(1.0, np.max(np.abs(qd[0]))), seed
        run = simulated(run.kernels, qd0=qd[0])
        assert np.max(np.abs(q - run.q)) < 1e-9 * max(1.0, np.max(np.abs(q))), seed
        count += 1
    return count


def test_a_start_has_the_least_energy(tmp_path):
    """A speed of one of three bars in a loop, whose matrix has small pivots."""
    assert check(range(17, 18), tmp_path) == 1


@pytest.mark.slow
def test_random_drawings(tmp_path):
    assert check(range(3), tmp_path) > 1


@pytest.mark.slow
def test_more_random_drawings(tmp_path):
    assert check(range(3, 50), tmp_path) > 30
