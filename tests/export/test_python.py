"""Python packages need nothing of ours, and move as we do."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from exported import MODELS, SECONDS, commands, compare, reference, shell

USE = r"""
import json, sys
import numpy as np
import @ as mechanism
motion = mechanism.Motion()
for _ in range(20):
    motion.step(1e-3)
kept = motion.q.copy()
try:
    motion.step(1e8)
except mechanism.MotionError as error:
    said = str(error)
assert np.array_equal(motion.q, kept) and said
assert not [name for name in sys.modules if name.split(".")[0] in ("ncgen", "scipy", "sympy")]
q = np.array(json.loads(sys.argv[1]))
steps = [*motion.q, *motion.qd, *motion.qdd, *motion.lam, *motion.energies()]
print(json.dumps({"steps": steps, "phi": mechanism.phi(0.0, q, mechanism.DEFAULTS).tolist()}))
"""


def use(folder, name, python=sys.executable):
    """What the package in a folder says of 20 steps and of one kernel."""
    kernels, _ = reference(name)
    done = subprocess.run(
        [python, "-c", USE.replace("@", name), json.dumps(kernels.q0.tolist())], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    np.testing.assert_allclose(found["phi"], kernels.phi(kernels.q0), atol=1e-12)
    return np.array(found["steps"])


STATE = r"""
#include <stdio.h>
#include "@_motion.h"
int main(void)
{
    @_state s;
    double p[100], e[2];
    @_defaults(p);
    if (@_start(&s, p)) return 1;
    for (int i = 0; i < 20; ++i) if (@_step(&s, p, 1e-3)) return 2;
    for (int i = 0; i < (int)(sizeof s / sizeof s.t) - 4; ++i) printf("%.17g\n", s.q[i]);
    @_energies(&s, p, &e[0], &e[1]);
    printf("%.17g\n%.17g\n", e[0], e[1]);
    return 0;
}
"""


@pytest.mark.parametrize("name", [*MODELS[:1], *MODELS[2:]])
def test_numpy_steps_are_those_of_c(fresh, name):
    """Another elimination, other rounding, the same steps to 1e-9 of their size."""
    native = fresh(name)
    (native / "examples/main.c").write_text(STATE.replace("@", name))
    expected = np.array(shell("make -s CFLAGS=-O0 && ./main", native).split(), dtype=float)
    np.testing.assert_allclose(use(fresh(name, "numpy"), name), expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


@pytest.mark.slow
@pytest.mark.parametrize("target", ["python", "numpy"])
@pytest.mark.parametrize("name", MODELS)
def test_installs_and_runs_by_its_readme(fresh, tmp_path, name, target):
    """In an environment of its own, where there is no ncgen."""
    folder = fresh(name, target)
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    install, run = commands(folder / "README.md")[0]
    path = f"{tmp_path / 'venv/bin'}:/usr/local/bin:/usr/bin:/bin"
    shell(f"{install} --quiet", folder, PATH=path)
    there = tmp_path / "elsewhere"
    there.mkdir()
    shell(run.replace(f"-m {name}", f"-m {name} {SECONDS[name]} 11"), there, PATH=path)
    compare(there / "motion.csv", name, 1e-6)
    use(there, name, tmp_path / "venv/bin/python")
