"""A mechanism over its joints in C, beside Pinocchio and beside the same programs here."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.export import export

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")

ROBOTS = Path(__file__).parents[1] / "robots"

ASK = r"""
#include <stdio.h>
#include "@_joints.h"
static double given[4][@UPPER@_JOINTS], inverse[@UPPER@_JOINTS], forward[@UPPER@_JOINTS];
int main(void)
{
    for (int k = 0; k < 4; ++k)
        for (int i = 0; i < @UPPER@_JOINTS; ++i)
            if (scanf("%lf", &given[k][i]) != 1) return 99;
    int status = @_inverse_dynamics(given[0], given[1], given[2], @_joint_parameters, inverse);
    if (!status) status = @_forward_dynamics(0, given[0], given[1], given[3], @_joint_parameters, forward);
    for (int i = 0; i < @UPPER@_JOINTS; ++i) printf("%.17g %.17g\n", inverse[i], forward[i]);
    return status;
}
"""


def built(model, folder: Path) -> Path:
    """A program that answers questions, compiled without a warning."""
    export(model, "joints", folder)
    (folder / "main.c").write_text(ASK.replace("@UPPER@", model.name.upper()).replace("@", model.name))
    flags = "CFLAGS=-O1 -ffp-contract=off -Wall -Wextra -Wpedantic -Werror"
    subprocess.run(["make", flags], cwd=folder, check=True, capture_output=True, text=True)
    return folder / "main"


def answered(program: Path, *numbers: np.ndarray) -> np.ndarray:
    asked = " ".join(repr(float(x)) for x in np.concatenate(numbers))
    done = subprocess.run([program], input=asked, check=True, capture_output=True, text=True)
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float).T


def test_a_crane_from_its_file_equals_pinocchio(tmp_path):
    model = ncgen.load(ROBOTS / "crane.urdf")
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    program = built(model, tmp_path)
    for record in json.loads((ROBOTS / "crane.json").read_text())["states"]:
        if record["floating"]:
            continue
        order = np.array([record["joints"].index(name) for name in space.rates])
        x = np.array([record["values"][name] for name in space.rates])
        v, a, forces = (np.array(record[name])[order] for name in ("v", "a", "forces"))
        damped = forces.copy()  # ncgen's model has the damping of the file, Pinocchio's equations have not
        damped[space.rates.index("roll")] += 0.7 * v[space.rates.index("roll")]
        inverse, forward = answered(program, x, v, a, damped)
        np.testing.assert_allclose(inverse, np.array(record["inverse"])[order], rtol=0, atol=1e-11)
        np.testing.assert_allclose(forward, np.array(record["forward"])[order], rtol=0, atol=1e-10)


def test_its_own_program_runs_by_the_readme(tmp_path):
    export(ncgen.load("arm"), "joints", tmp_path)
    done = subprocess.run("make && ./main", shell=True, cwd=tmp_path, check=True, capture_output=True, text=True)
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("psi")]
    kernels = ncgen.compile(ncgen.load("arm"), "numpy")
    space = ncgen.joint_space(kernels)
    assert [name for name, *_ in lines] == list(space.rates)
    found = np.array([numbers for _, *numbers in lines], dtype=float)
    np.testing.assert_allclose(found[:, 0], space.gravity(kernels.q0), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found[:, 1], space.forward_dynamics(kernels.q0), rtol=0, atol=1e-10)


def test_names_that_are_equal_in_capitals_stay_apart(tmp_path):
    text = (ROBOTS / "crane.urdf").read_text().replace('name="luff"', 'name="ROLL"')
    (tmp_path / "crane.urdf").write_text(text)
    export(ncgen.load(tmp_path / "crane.urdf"), "joints", tmp_path / "c")
    header = (tmp_path / "c" / "crane_joints.h").read_text()
    assert "CRANE_JOINT_ROLL = 1," in header and "CRANE_JOINT_ROLL_2 = 2," in header


def test_loops_are_refused(tmp_path):
    with pytest.raises(ModelError, match="robot: joint space is that of an open tree"):
        export(ncgen.load("robot"), "joints", tmp_path)
    assert not list(tmp_path.iterdir())
