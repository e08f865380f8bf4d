"""A mechanism over its joints in C, beside Pinocchio and beside the same programs here."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import ncgen
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


def library(model, folder: Path) -> ctypes.CDLL:
    """The sources as a shared library, compiled without a warning."""
    export(model, "joints", folder)
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, f"{model.name}_joints.c", "-o", "joints.so", "-lm"], cwd=folder, check=True, capture_output=True)
    return ctypes.CDLL(str(folder / "joints.so"))


def called(function, *arguments):
    """A function of C on numbers, integers and arrays, which it may write to."""
    kinds = {float: ctypes.c_double, int: ctypes.c_int}
    given = [kinds[type(a)](a) if type(a) in kinds else a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in arguments]
    return function(*given)


def test_slopes_of_the_crane_equal_pinocchio(tmp_path):
    """But for the damper, which only the model has: it changes accelerations by rates, and those by forces are checked with it."""
    model = ncgen.load(ROBOTS / "crane.urdf")
    lib, names = library(model, tmp_path), ncgen.joint_space(ncgen.compile(model, "numpy")).rates
    record = next(r for r in json.loads((ROBOTS / "crane.json").read_text())["states"] if not r["floating"])
    order = np.array([record["joints"].index(name) for name in names])
    x = np.array([record["values"][name] for name in names])
    v, a, forces = (np.array(record[name])[order] for name in ("v", "a", "forces"))
    p, roll = np.zeros(1), names.index("roll")
    by_x, by_v, by_forces = np.zeros((3, len(x), len(x)))
    assert called(lib.crane_inverse_dynamics_derivatives, x, v, a, p, by_x, by_v) == 0
    for found, expected in zip((by_x, by_v), record["inverse_slopes"], strict=True):
        np.testing.assert_allclose(found, np.array(expected)[np.ix_(order, order)], rtol=0, atol=1e-11)
    forces[roll] += 0.7 * v[roll]
    assert called(lib.crane_forward_dynamics_derivatives, 0.0, x, v, forces, p, by_x, by_v, by_forces) == 0
    by_v[:, roll] += 0.7 * by_forces[:, roll]
    for found, expected in zip((by_x, by_v, by_forces), record["forward_slopes"], strict=True):
        np.testing.assert_allclose(found, np.array(expected)[np.ix_(order, order)], rtol=0, atol=1e-9 * np.max(np.abs(expected)))


def test_a_loop_in_c(tmp_path):
    """A Stewart platform beside the same programs here, whose tests have a closed form: everything but loops' closing is theirs, and
    positions are looked at."""
    model = ncgen.load("stewart")
    lib = library(model, tmp_path)
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    kernels, n = space.kernels, space.n
    rates = int((tmp_path / "stewart_joints.h").read_text().split("STEWART_ALL = ")[1].split()[0])
    everything = np.array((ctypes.c_double * rates).in_dll(lib, "stewart_joint_start"))
    rng = np.random.default_rng(2)
    for _ in range(3):
        x = space.values(kernels.q0) + rng.uniform(-0.2, 0.2, n)
        v, a, found, q = rng.normal(size=n), rng.normal(size=n), np.zeros(n), np.zeros(kernels.n)
        p = kernels.p0.copy() if len(kernels.p0) else np.zeros(1)
        assert called(lib.stewart_close, 0.0, x, p, everything, q) == 0
        assert np.max(np.abs(kernels.phi(q) / kernels.row_sizes)) < 1e-13
        np.testing.assert_allclose(space.values(q), x, rtol=0, atol=1e-15)
        assert called(lib.stewart_inverse_dynamics, x, v, a, p, everything, found) == 0
        np.testing.assert_allclose(found, space.inverse_dynamics(q, v, a), rtol=0, atol=1e-9)
        assert called(lib.stewart_forward_dynamics, 0.0, x, v, a, p, everything, found) == 0
        np.testing.assert_allclose(found, space.forward_dynamics(q, v, a), rtol=0, atol=1e-9)
        point = next(each for each in model.bodies["platform"].points)
        jacobian = np.zeros((6, n))
        assert called(lib.stewart_jacobian, kernels.index[point.x.name], q, p, jacobian) == 0
        np.testing.assert_allclose(jacobian, space.jacobian(point.name, q), rtol=0, atol=1e-12)
        parts = np.zeros((3, n, n))
        assert called(lib.stewart_forward_dynamics_derivatives, 0.0, x, v, a, p, everything, *parts) == 0
        for part, expected in zip(parts, space.forward_dynamics_derivatives(q, v, a), strict=True):
            np.testing.assert_allclose(part, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))
    assert called(lib.stewart_close, 0.0, x + 50.0, p, everything, q) == 1  # legs that long do not meet
