"""The generic kernels in WebAssembly move mechanisms, which they get as tables, as ncgen does; the file is what its sources give."""

from __future__ import annotations

import json
import shutil
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest
from exported import shell
from oracles.planar_models import Drawn
from oracles.term_tables import term_table

import ncgen
from ncgen.resources import folder
from ncgen.toolchain import generic_wasm

SCRIPT = """
const fs = require("node:fs");
const data = JSON.parse(fs.readFileSync("cases.json"));
const Motion = new Function(fs.readFileSync(data.script, "utf8") + "; return Motion;")();
const bytes = fs.readFileSync(data.binary);
async function moved(one) {
  const motion = await Motion.load(bytes), n = one.q.length, found = [];
  motion.begin(one.table, one.q, one.qd, one.sizes, 0, 1e-12, 1e-14);
  for (const t of one.t) {
    if (t > 0) motion.goOn(t);
    found.push([Array.from(motion.q.slice(0, n)), Array.from(motion.qd.slice(0, n)), Array.from(motion.energies)]);
  }
  return { found, rank: motion.rank };
}
(async () => {
  const imports = WebAssembly.Module.imports(new WebAssembly.Module(bytes));
  console.log(JSON.stringify({ imports, runs: await Promise.all(data.cases.map(moved)) }));
})();
"""


def watt() -> ncgen.Model:
    """A six-bar linkage of Watt: two four-bars that share a ternary coupler and a ternary rocker, its crank driven by its own speed."""
    m = ncgen.Model("watt")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (0.4, 0.0), fixed=True)
    B, C, E, F, G = (m.point(n, p) for n, p in zip("BCEFG", [(0.1, 0.0), (0.35, 0.3), (0.25, 0.5), (0.6, 0.25), (0.6, 0.5)], strict=True))
    m.body("crank", [A, B], mass=0.2, inertia="rod")
    m.body("coupler", [B, C, E], mass=0.8, com=(0.23, 0.27), inertia=0.02)
    m.body("rocker", [C, D, F], mass=0.9, com=(0.45, 0.18), inertia=0.02)
    m.body("bar", [E, G], mass=0.3, inertia="rod")
    m.body("link", [F, G], mass=0.2, inertia="rod")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.angle("psi", x, B - A, z)
    m.gravity((0, -9.81))
    return m


def case(model: ncgen.Model, duration: float, zd0: dict | None = None) -> tuple[dict, ncgen.Trajectory]:
    """What the script is given of a mechanism, and its motion by ncgen."""
    kernels = ncgen.compile(model)
    run = ncgen.simulate(kernels, duration, zd0=zd0, points=11, integrator="dop853", rtol=1e-12, atol=1e-14)
    arrays = {"table": term_table(kernels.programs.equations), "q": run.q[0], "qd": run.qd[0], "sizes": kernels.column_sizes, "t": run.t}
    return {name: array.tolist() for name, array in arrays.items()}, run


def answers(cases: list[dict], where) -> dict:
    """What the script finds of mechanisms."""
    data = {"script": str(folder("templates") / "editor/motion.js"), "binary": str(generic_wasm.FILE), "cases": cases}
    (where / "cases.json").write_text(json.dumps(data))
    (where / "script.cjs").write_text(SCRIPT)
    return json.loads(shell("node script.cjs", where))


def compare(cases: list[tuple[dict, ncgen.Trajectory]], where) -> None:
    """Positions and velocities, relative to their largest, over the whole run."""
    answer = answers([one for one, _ in cases], where)
    assert answer["imports"] == []
    for (_, run), got in zip(cases, answer["runs"], strict=True):
        assert got["rank"] == np.linalg.matrix_rank(run.kernels.jacobian(run.q[-1], run.t[-1]), tol=1e-9)
        for wanted, found in ((run.q, [f[0] for f in got["found"]]), (run.qd, [f[1] for f in got["found"]])):
            assert np.max(np.abs(wanted - found)) < 1e-9 * np.max(np.abs(wanted), initial=1.0), run.kernels.name


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_motion_is_that_of_ncgen(tmp_path):
    """A four-bar, a slider-crank, a Watt six-bar, a double pendulum and a driven leg."""
    compare(
        [
            case(ncgen.load("fourbar"), 0.5, {"psi": 12.0}),
            case(ncgen.load("slidercrank"), 0.05, {"psi": 150.0}),
            case(watt(), 0.5, {"psi": 6.0}),
            case(ncgen.load("doublependulum"), 0.5),
            case(ncgen.load("jansen"), 0.5),
        ],
        tmp_path,
    )


def parallelogram(height: float) -> ncgen.Model:
    """Two equal cranks and a coupler that a third crank, which adds no condition, holds in its middle."""
    m = ncgen.Model("parallelogram")
    ends = [
        (m.point(a, (x, 0), fixed=True), m.point(b, (x + 0.1, height))) for a, b, x in (("A", "B", 0), ("C", "D", 0.4), ("E", "F", 0.2))
    ]
    for k, (low, high) in enumerate(ends):
        m.body(f"crank{k}", [low, high], mass=0.1, inertia="rod")
    m.body("coupler", [high for _, high in ends], mass=0.3, com=(0.3, height), inertia=0.004)
    m.gravity((0, -9.81))
    return m


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_redundant_constraints_are_told_from_a_singular_position(tmp_path):
    """A third crank of a parallelogram is redundant everywhere; where all bars are in line they depend on each other there alone."""
    compare([case(parallelogram(0.05), 0.1)], tmp_path)
    flat = parallelogram(0.0)
    kernels = ncgen.compile(flat)
    arrays = {"table": term_table(kernels.programs.equations), "q": kernels.q0, "qd": 0 * kernels.q0, "sizes": kernels.column_sizes}
    with pytest.raises(AssertionError, match="the equations are singular here"):
        answers([{name: array.tolist() for name, array in arrays.items()} | {"t": [0.0]}], tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_random_planar_mechanisms_move_as_in_ncgen(tmp_path):
    """Those of 50 that have a motion: a drawing may be immobile, or begin in a singular position."""
    cases = []
    for seed in range(50):
        try:
            cases.append(case(Drawn(seed).model, 0.3))
        except ncgen.NcgenError:
            continue
    assert len(cases) > 35
    compare(cases, tmp_path)


@pytest.mark.slow  # .ci/run looks, too: a change of the runtime need not make it anew at once
def test_the_file_is_of_these_sources():
    """Where the catalogue, the emitter or the runtime has changed: python -m ncgen.toolchain.generic_wasm makes it anew."""
    for module in generic_wasm.NAMES:
        assert generic_wasm.binary(module).endswith(generic_wasm.section(generic_wasm.digest()))


@pytest.mark.slow
@pytest.mark.parametrize("module", generic_wasm.NAMES, ids=generic_wasm.NAMES.values())
def test_the_sources_give_the_file(module):
    try:
        installed = version("ziglang")
    except PackageNotFoundError:
        installed = "none"
    if installed != generic_wasm.COMPILER:
        pytest.skip(f"ziglang {generic_wasm.COMPILER} made the file, {installed} is installed")
    assert generic_wasm.built(module) == generic_wasm.binary(module)
