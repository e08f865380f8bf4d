"""One controller at 1 kHz around one mechanism, in every target: the motion is that of `ncgen.start`, to 1e-9."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from exported import shell

import ncgen
from ncgen.exchange.examples import load
from ncgen.exchange.export import export

GAINS = (-19.8, 94.8, -18.8, 21.0)
"""Of [s, phi, rate(s), rate(phi)]."""

STEPS, PERIOD, SPIN = 1000, 1e-3, 0.5


@pytest.fixture(scope="module")
def expected():
    """[s, phi, rate(s), rate(phi), tip height] after a second, by small steps of the default."""
    sim = ncgen.start(ncgen.compile(load("cartpole")), zd0={"phi": SPIN}, rtol=1e-12)
    for _ in range(STEPS):
        sim.step(PERIOD, F=-sum(k * sim[name] for k, name in zip(GAINS, ("s", "phi", "rate(s)", "rate(phi)"), strict=True)))
    return np.array([sim["s"], sim["phi"], sim["rate(s)"], sim["rate(phi)"], sim["tip height"]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """folder(target): the export, with a model that starts spinning."""

    def made(target: str):
        model = load("cartpole")
        model.simulation(zd0={"phi": SPIN})
        place = tmp_path_factory.mktemp(target)
        export(model, target, place)
        return place

    return made


def check(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


IN_C = r"""
#include <stdio.h>
#include "cartpole_motion.h"
int main(void)
{
    const double k[4] = {-19.8, 94.8, -18.8, 21.0};
    cartpole_state x;
    double p[CARTPOLE_N_PARAMETERS], out[2];
    cartpole_defaults(p);
    if (cartpole_start(&x, p)) return 1;
    for (int i = 0; i < 1000; ++i) {
        p[CARTPOLE_P_F] = -(k[0] * x.q[CARTPOLE_Q_S] + k[1] * x.q[CARTPOLE_Q_PHI]);
        p[CARTPOLE_P_F] -= k[2] * x.qd[CARTPOLE_Q_S] + k[3] * x.qd[CARTPOLE_Q_PHI];
        if (cartpole_step(&x, p, 1e-3)) return 2;
    }
    if (cartpole_outputs(&x, p, out)) return 3;
    printf("%.17g %.17g %.17g %.17g %.17g\n", x.q[CARTPOLE_Q_S], x.q[CARTPOLE_Q_PHI], x.qd[CARTPOLE_Q_S], x.qd[CARTPOLE_Q_PHI],
        out[CARTPOLE_OUTPUT_TIP_HEIGHT]);
    return 0;
}
"""


IN_CPP = r"""
#include <cstdio>
#include "cartpole.hpp"
int main()
{
    cartpole::mechanism m;
    auto &q = m.state.q, &qd = m.state.qd;
    for (int i = 0; i < 1000; ++i) {
        m.p[CARTPOLE_P_F] = 19.8 * q[CARTPOLE_Q_S] - 94.8 * q[CARTPOLE_Q_PHI] + 18.8 * qd[CARTPOLE_Q_S] - 21.0 * qd[CARTPOLE_Q_PHI];
        m.step(1e-3);
    }
    std::printf("%.17g %.17g %.17g %.17g %.17g\n", q[CARTPOLE_Q_S], q[CARTPOLE_Q_PHI], qd[CARTPOLE_Q_S], qd[CARTPOLE_Q_PHI],
        m.outputs()[CARTPOLE_OUTPUT_TIP_HEIGHT]);
    const auto kept = m.state.t;
    try {
        m.advance(-1.0);
        return 1;
    } catch (const std::runtime_error &) {
        return m.state.t != kept || m.multipliers().size() != CARTPOLE_N_ROWS || !(m.energies()[0] >= 0);
    }
}
"""


def test_in_c_and_cpp(folder, expected):
    place = folder("c")
    (place / "examples/main.c").write_text(IN_C)
    check(list(map(float, shell("make -s main && ./main", place).split())), expected)
    (place / "main.cpp").write_text(IN_CPP)
    flags = "-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror"
    shell(f"g++ -std=c++11 -O1 {flags} -Iinclude main.cpp libcartpole.a -o cpp", place)
    check(list(map(float, shell("./cpp", place).split())), expected)


IN_PYTHON = """
import cartpole
motion = cartpole.Motion()
s, phi = (cartpole.COORDINATES.index(name) for name in ("s", "phi"))
for _ in range(1000):
    motion.p = [19.8 * motion.q[s] - 94.8 * motion.q[phi] + 18.8 * motion.qd[s] - 21.0 * motion.qd[phi]]
    motion.step(1e-3)
print(motion.q[s], motion.q[phi], motion.qd[s], motion.qd[phi], motion.outputs["tip height"])
"""


def test_in_python(folder, expected):
    place = folder("python")
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", place)
    done = subprocess.run([sys.executable, "-c", IN_PYTHON], cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    check(list(map(float, done.stdout.split())), expected)


IN_JAVASCRIPT = """
import { readFile } from "node:fs/promises";
import { Cartpole } from "./cartpole.js";
const m = await Cartpole.load(await readFile("cartpole.wasm"));
const [s, phi] = ["s", "phi"].map((name) => NAMES.indexOf(name));
for (let i = 0; i < 1000; ++i) {
  m.p[0] = 19.8 * m.q[s] - 94.8 * m.q[phi] + 18.8 * m.qd[s] - 21.0 * m.qd[phi];
  m.step(1e-3);
}
console.log(JSON.stringify([m.q[s], m.q[phi], m.qd[s], m.qd[phi], m.outputs()["tip height"]]));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_in_javascript(folder, expected):
    place = folder("wasm")
    names = json.dumps(ncgen.compile(load("cartpole"), "numpy").coordinates)
    (place / "use.mjs").write_text(f"const NAMES = {names};\n" + IN_JAVASCRIPT)
    check(json.loads(shell("node use.mjs", place)), expected)


@pytest.mark.parametrize("version", [2, 3])
def test_as_a_unit(folder, expected, version, tmp_path):
    """Co-simulation with an input; then the state is kept and restored, and the input's slope is that of the linearised model."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    path = str(folder(f"fmu{version}") / "cartpole.fmu")
    assert validate_fmu(path) == []
    there = fmpy.extract(path, str(tmp_path))
    told = fmpy.read_model_description(there)
    kinds = {v.name: (v.causality, v.variability) for v in told.modelVariables}
    assert kinds["F"] == ("input", "continuous")
    assert kinds["tip height"] == ("output", "continuous")
    refs = {v.name: v.valueReference for v in told.modelVariables}
    names = ("s", "phi", "rate(s)", "rate(phi)", "tip height")
    kind = fmpy.fmi2.FMU2Slave if version == 2 else fmpy.fmi3.FMU3Slave
    unit = kind(guid=told.guid, unzipDirectory=there, modelIdentifier="cartpole", instanceName="unit")
    get, put = (getattr(unit, f"{verb}{'Real' if version == 2 else 'Float64'}") for verb in ("get", "set"))
    unit.instantiate()
    if version == 2:
        unit.setupExperiment(startTime=0.0, tolerance=1e-12)
        unit.enterInitializationMode()
    else:
        unit.enterInitializationMode(startTime=0.0, tolerance=1e-12)
    unit.exitInitializationMode()
    for i in range(STEPS):
        state = get([refs[name] for name in names[:4]])
        put([refs["F"]], [-sum(k * x for k, x in zip(GAINS, state, strict=True))])
        unit.doStep(currentCommunicationPoint=i * PERIOD, communicationStepSize=PERIOD)
    check(get([refs[name] for name in names]), expected)
    slope = unit.getDirectionalDerivative([refs["der(rate(s))"], refs["cart acceleration"]], [refs["F"]], [1.0])
    near = ncgen.linearise(ncgen.compile(load("cartpole")))  # nearly upright and nearly at rest by now
    np.testing.assert_allclose(slope, [near.B[2, 0], near.D[1, 0]], rtol=1e-3)
    unit.terminate()
    unit.freeInstance()
