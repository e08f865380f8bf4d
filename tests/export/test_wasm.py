"""WebAssembly moves in node as compiled code moves here, to the last bit, and imports nothing but Math."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from exported import MODELS, SECONDS, SOME, commands, compare, shell

import ncgen
from ncgen.exchange.examples import example_names, load

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")

# Prints kernels a little off the start, in JSON, after some uses and misuses of the wrapper.
SCRIPT = r"""
import { readFileSync } from "node:fs";
import { @, coordinates } from "./%.js";
const bytes = readFileSync("%.wasm");
const m = await @.load(bytes);
const imports = WebAssembly.Module.imports(await WebAssembly.compile(bytes));
const kept = m.state;
for (let i = 0; i < 100; ++i) m.step(1 / 65536);
const moved = m.state;
m.state = kept;
for (let i = 0; i < 100; ++i) m.step(1 / 65536);
const again = m.state.every((x, i) => x === moved[i]);
let said = "";
try { m.step(1e8); } catch (error) { said = error.message; }
const stayed = m.state.every((x, i) => x === moved[i]);
const other = await @.load(bytes);
other.t = 0.375;
for (let i = 0; i < coordinates.length; ++i) {
  other.q[i] = INITIAL[i] + ((i % 7) - 3) / 64;
  other.qd[i] = ((i % 5) - 2) / 2;
}
const kernels = Object.fromEntries(NAMES.map((name) => [name, Array.from(other.kernel(name))]));
console.log(JSON.stringify({ imports, again, stayed, said, kernels, steps: Array.from(moved) }));
"""

NATIVE = r"""
#include <stdio.h>
#include "@_motion.h"
int main(void)
{
    @_state s;
    double p[100];
    @_defaults(p);
    if (@_start(&s, p)) return 1;
    for (int i = 0; i < 100; ++i) if (@_step(&s, p, 1.0 / 65536)) return 2;
    for (int i = 0; i < 2 * N; ++i) printf("%.17g\n", s.q[i]);
    return 0;
}
"""


ALL = [*SOME, *(pytest.param(name, marks=pytest.mark.slow) for name in example_names() if name not in MODELS)]
"""Every example; those that the other targets do not take are among the longer proofs."""


@pytest.mark.parametrize("name", ALL)
def test_as_native(fresh, built, name):
    """100 steps are those of the C export, which finds accelerations in another way; every kernel equals ours."""
    kernels = ncgen.compile(load(name))
    folder = fresh(name, "wasm")
    lists = f"const INITIAL = {json.dumps(kernels.q0.tolist())}, NAMES = {json.dumps(list(kernels.programs.programs))};\n"
    script = SCRIPT.replace("@", name.capitalize()).replace("%.", f"{name}.")
    (folder / "use.mjs").write_text(lists + script)
    found = json.loads(shell("node use.mjs", folder))
    assert {imported["module"] for imported in found["imports"]} <= {"Math", "ncgen"} and found["again"] and found["stayed"]
    assert found["said"].startswith(f"{name.capitalize()}, t = 0.00152587890625 s: ")
    native = built(name)
    (native / "examples/main.c").write_text(f"enum {{ N = {kernels.n} }};\n{NATIVE.replace('@', name)}")
    expected = np.array(shell("make -s && ./main", native).split(), dtype=float)
    np.testing.assert_allclose(found["steps"][4 : 4 + 2 * kernels.n], expected, rtol=1e-10, atol=1e-10 * np.max(np.abs(expected)))
    i = np.arange(kernels.n)
    for kernel, values in found["kernels"].items():
        ours = kernels.values(kernel, 0.375, kernels.q0 + (i % 7 - 3) / 64, (i % 5 - 2) / 2.0, None)
        np.testing.assert_allclose(values, ours, rtol=1e-12, atol=1e-12 * np.max(np.abs(ours)))


def test_readme_runs_and_tells_the_size(fresh):
    folder = fresh("pendulum", "wasm")
    ((command,),) = commands(folder / "README.md")
    shell(command.replace("main.mjs", f"main.mjs {SECONDS['pendulum']} 11"), folder)
    compare(folder / "motion.csv", "pendulum", 1e-6)
    assert f"has {(folder / 'pendulum.wasm').stat().st_size} bytes" in (folder / "README.md").read_text()


def test_types_name_what_there_is(fresh):
    """Every member of the declaration is in the class, and the other way round."""
    folder = fresh("pendulum", "wasm")
    body = (folder / "pendulum.d.ts").read_text().split("export class")[1]
    declared = set(re.findall(r"^  (?:static |readonly )*(\w+)[(:]", body, re.MULTILINE))
    script = 'import { Pendulum } from "./pendulum.js"; console.log([...Object.getOwnPropertyNames(Pendulum.prototype), "load"].join(" "))'
    (folder / "names.mjs").write_text(script)
    assert set(shell("node names.mjs", folder).split()) - {"constructor"} == declared
