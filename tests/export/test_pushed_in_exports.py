"""Blocks that rest at a stop without a load, and smooth forces later, in exports: they stay or leave as the closed form says."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported import shell
from pushed_later import END, Case, blocks, random_case
from test_events_in_wasm import in_node
from test_events_of_units import simulated

import ncgen
from ncgen.emit.naming import prefix_of
from ncgen.exchange.export import export

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@_single.h"
/* Lines of numbers: length of calls (s), place and speed of the first coordinates, parameters. */
int main(void)
{
    double frame, place, speed, value;
    while (scanf("%lf %lf %lf", &frame, &place, &speed) == 3) {
        @_state state;
        @_real p[#_N_PARAMETERS + 1];
        @_defaults(p);
        for (int i = 0; i < COUNT; ++i)
            if (scanf("%lf", &value) == 1) p[i] = value;
        int status = @_start(&state, p);
        for (int i = 0; i < 2; ++i) { state.q[i] = place; state.qd[i] = speed; }
        if (!status) status = @_project_state(&state, p);
        for (int k = 1; !status && state.t < END; ++k)
            status = @_advance(&state, p, k * frame < END ? k * frame : END, 1e-9, 1e-9);
        for (int i = 0; i < #_N_COORDINATES; ++i) printf("%.17g ", (double)state.q[i]);
        printf("%d\n", status);
    }
    return 0;
}
"""


def moved_in_c(model: ncgen.Model, folder: Path, cases: list[Case], frames: tuple[float, ...]) -> np.ndarray:
    """Rows of q at the end of every case with calls of every length, as exported C has them."""
    export(model, "c", folder)
    prefix, kernels = prefix_of(model.name), ncgen.compile(model)
    own = list(cases[0].parameters)
    assert set(kernels.coordinates[:2]) == {"s1", "A1.x"} and list(kernels.parameters[: len(own)]) == own
    text = DRIVER.replace("@", prefix).replace("#_", f"{prefix.upper()}_")
    (folder / "driver.c").write_text(f"#define {prefix.upper()}_IMPLEMENTATION\n{text}")
    shell(f"cc -std=c99 -O0 -DEND={END} -DCOUNT={len(own)} -Isingle driver.c -lm -o driver", folder)
    rows = [
        [frame, -case.side * case.gap, case.side * case.speed, *(case.parameters[name] for name in own)]
        for case in cases
        for frame in frames
    ]
    given = "\n".join(" ".join(map(repr, row)) for row in rows)
    done = subprocess.run(["timeout", "60", "./driver"], cwd=folder, input=given, capture_output=True, text=True, check=True)
    table = np.loadtxt(done.stdout.splitlines(), ndmin=2)
    assert not table[:, -1].any()
    return table[:, :-1].reshape(len(cases), len(frames), -1)


SOME = [(1, 1, ""), (2, -1, "lock"), pytest.param(2, 1, "ratchet", marks=pytest.mark.slow), pytest.param(2, 1, "", marks=pytest.mark.slow)]


@pytest.mark.parametrize(("count", "side", "is_held"), SOME)
def test_blocks_stay_or_leave_in_c(count, side, is_held, tmp_path):
    """In one call, and in calls of 10 ms, which begin anew with what rounding has left of gaps."""
    rng, model = np.random.default_rng(8 + count), blocks(count, side, is_held)
    cases = [random_case(rng, count, side, number % 2 == 1 and count == 1) for number in range(12)]
    index = ncgen.compile(model).index
    found = moved_in_c(model, tmp_path, cases, (END, 0.01))[:, :, [index[f"s{k}"] for k in range(1, count + 1)]]
    for case, rows in zip(cases, found, strict=True):
        assert rows == pytest.approx(np.array([case.places(is_held)] * 2), abs=1e-8), case


PUSHED = Case(forces=((2.0, -2.0, 3.0), (0.0, 0.0, 0.0)))
"""Pushed, let go, and pushed again."""

PULLED = Case(forces=((0.0, 0.0, 0.0), (0.0, 1.5, -4.0)))
"""Nothing pushes at first; then block 2 pushes both and leaves."""

CASES = pytest.mark.parametrize("case", [PUSHED, PULLED], ids=["pushed", "pulled"])


@pytest.mark.parametrize("version", [3, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("mode", ["ModelExchange", "CoSimulation"])
@CASES
def test_blocks_stay_or_leave_in_an_fmu(case, mode, version, tmp_path):
    export(blocks(2, case=case), f"fmu{version}", tmp_path)
    found = simulated(tmp_path, "blocks2above", mode, END, output=["s1", "s2"])
    assert [found["s1"][-1], found["s2"][-1]] == pytest.approx(case.places(), abs=1e-7)


SCRIPT = """
import { readFileSync } from "node:fs";
import { Blocks2above } from "./blocks2above.js";
const m = await Blocks2above.load(readFileSync("blocks2above.wasm"));
for (let k = 1; k <= 220; ++k) m.advance(k / 100, 1e-9, 1e-9);
console.log(JSON.stringify([...m.q]));
"""


@in_node
@CASES
def test_blocks_stay_or_leave_in_a_browser(case, tmp_path):
    model = blocks(2, case=case)
    export(model, "wasm", tmp_path)
    (tmp_path / "use.mjs").write_text(SCRIPT)
    q, index = json.loads(shell("node use.mjs", tmp_path)), ncgen.compile(model).index
    assert [q[index["s1"]], q[index["s2"]]] == pytest.approx(case.places(), abs=1e-7)
