"""Outputs that mention joint loads, in every target that has outputs: the pull of a pendulum's pin is m g cos ψ + m l ω²."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from exported import shell

import ncgen
from ncgen import ModelError
from ncgen.exchange.export import export

MASS, LENGTH, GRAVITY, SPIN, TAU = 2.0, 0.7, 9.81, 3.0, 1.5


def pendulum() -> ncgen.Model:
    """A point mass on a massless rod, pushed by a couple; ψ counts from below."""
    m = ncgen.Model("swing")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, -LENGTH))
    y, z = m.vector("y", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", y, A - O, z)
    rod = m.body("rod", [O, A], mass=MASS, com=(0, -LENGTH), inertia="point")
    m.gravity((0, -GRAVITY, 0))
    m.torque(psi, m.input("tau", "N m", TAU))
    pin, _ = rod.wrench(O)
    m.output("along", -(pin.x * A.x + pin.y * A.y) / LENGTH, "N")
    m.output("across", (pin.y * A.x - pin.x * A.y) / LENGTH, "N")
    m.independent(psi)
    m.simulation(zd0={"psi": SPIN}, duration=0.5)
    return m


def check(psi: float, rate: float, along: float, across: float) -> None:
    """It has moved, the pin holds the mass on its circle, and τ/l pushes it along."""
    assert psi > 0.1
    assert along == pytest.approx(MASS * (GRAVITY * np.cos(psi) + LENGTH * rate**2), abs=1e-9)
    assert abs(across) == pytest.approx(TAU / LENGTH, abs=1e-9)


IN_C = r"""
#include <stdio.h>
#include "swing_motion.h"
int main(void)
{
    swing_state x;
    double p[SWING_N_PARAMETERS], out[2];
    swing_defaults(p);
    if (swing_start(&x, p)) return 1;
    for (int i = 0; i < 50; ++i)
        if (swing_step(&x, p, 1e-3)) return 2;
    if (swing_outputs(&x, p, out)) return 3;
    printf("%.17g %.17g %.17g %.17g\n", x.q[SWING_Q_PSI], x.qd[SWING_Q_PSI], out[SWING_OUTPUT_ALONG], out[SWING_OUTPUT_ACROSS]);
    return 0;
}
"""


def test_in_c(tmp_path):
    export(pendulum(), "c", tmp_path)
    (tmp_path / "examples/main.c").write_text(IN_C)
    check(*map(float, shell("make -s main && ./main", tmp_path).split()))


IN_PYTHON = """
import swing
motion = swing.Motion()
psi = swing.COORDINATES.index("psi")
for _ in range(50):
    motion.step(1e-3)
print(motion.q[psi], motion.qd[psi], *motion.outputs.values())
"""


def test_in_python(tmp_path):
    export(pendulum(), "python", tmp_path)
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", tmp_path)
    done = subprocess.run([sys.executable, "-c", IN_PYTHON], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    check(*map(float, done.stdout.split()))


IN_JAVASCRIPT = """
import { readFile } from "node:fs/promises";
import { Swing } from "./swing.js";
const m = await Swing.load(await readFile("swing.wasm"));
for (let i = 0; i < 50; ++i) m.step(1e-3);
const { along, across } = m.outputs();
console.log(JSON.stringify([m.q[PSI], m.qd[PSI], along, across]));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_in_javascript(tmp_path):
    export(pendulum(), "wasm", tmp_path)
    place = ncgen.compile(pendulum(), "numpy").coordinates.index("psi")
    (tmp_path / "use.mjs").write_text(f"const PSI = {place};\n" + IN_JAVASCRIPT)
    check(*json.loads(shell("node use.mjs", tmp_path)))


@pytest.mark.parametrize("version", [2, 3])
def test_as_a_unit(tmp_path, version):
    """The outputs beside the unit's own loads of the same names; a couple moves them by 0 and 1/l, although the motion is far from rest."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    export(pendulum(), f"fmu{version}", tmp_path)
    there = fmpy.extract(str(tmp_path / "swing.fmu"), str(tmp_path / "unit"))
    told = fmpy.read_model_description(there)
    refs = {v.name: v.valueReference for v in told.modelVariables}
    kind = fmpy.fmi2.FMU2Slave if version == 2 else fmpy.fmi3.FMU3Slave
    unit = kind(guid=told.guid, unzipDirectory=there, modelIdentifier="swing", instanceName="unit")
    get = getattr(unit, f"get{'Real' if version == 2 else 'Float64'}")
    unit.instantiate()
    if version == 2:
        unit.setupExperiment(startTime=0.0, tolerance=1e-10)
        unit.enterInitializationMode()
    else:
        unit.enterInitializationMode(startTime=0.0, tolerance=1e-10)
    unit.exitInitializationMode()
    unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.05)
    check(*get([refs[name] for name in ("psi", "rate(psi)", "along", "across")]))
    x, y, across = get([refs[name] for name in ("A.x", "A.y", "across")])
    fx, fy = (sum(get([refs[f"force(rod,{point}).{axis}"] for point in "OA"])) for axis in "xy")
    assert (fy * x - fx * y) / LENGTH == pytest.approx(across, abs=1e-9)
    slope = unit.getDirectionalDerivative([refs["along"], refs["across"]], [refs["tau"]], [1.0])
    assert slope == pytest.approx([0.0, np.sign(across) / LENGTH], abs=1e-9)
    unit.terminate()
    unit.freeInstance()


def test_casadi_has_no_multipliers(tmp_path):
    with pytest.raises(ModelError, match="swing cannot be exported to casadi: its outputs mention loads"):
        export(pendulum(), "casadi", tmp_path)


def test_a_shared_load_is_told_at_export(tmp_path):
    """A door of 10 kg on two ball joints: nobody knows which of them carries it."""
    m = ncgen.Model("door")
    A, B, C = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0, 0, 2), fixed=True), m.point("C", (1, 0, 0.5))
    leaf = m.body("leaf", [A, B, C], mass=10.0, com=(0.5, 0, 1), inertia=(3.4, 4.2, 0.9))
    m.gravity((0, 0, -GRAVITY))
    m.output("low", leaf.force(A).z, "N")
    with pytest.warns(UserWarning, match=r"output low: force\(leaf,A\)\.z is not unique \(leaf: A\.z and B\.z share 98\.1 N\)"):
        export(m, "wasm", tmp_path)
