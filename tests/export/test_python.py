"""Python packages need nothing of ours, and move as we do."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from exported import MODELS, SECONDS, commands, compare, reference, shell

import ncgen
from ncgen.exchange.export import export

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
steps = [*motion.q, *motion.qd, *motion.qdd, *motion.energies(), *motion.lam]
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


REFUSED = r"""
import gc
import numpy as np
import @ as mechanism
motion, other = mechanism.Motion(), mechanism.Motion()
places = {name: getattr(motion, name) for name in ("q", "qd", "qdd", "p")}

# What is assigned is copied into its place, and enters.
motion.q = [float(x) for x in motion.q]
motion.p = 1.5 * motion.p
assert all(getattr(motion, name) is place for name, place in places.items())
other.p[:] = motion.p
motion.project_state(), other.project_state()
assert np.array_equal(motion.qdd, other.qdd) and np.array_equal(motion.p, 1.5 * mechanism.DEFAULTS)
motion.t = 0.25
assert motion.t == 0.25

def refused(error, change, what=""):
    try:
        change()
    except error as said:
        assert "\n" not in str(said) and what in str(said), said
    else:
        raise AssertionError(change)

for wrong in ([1.0], "text", 1j * mechanism.DEFAULTS, [None] * len(mechanism.DEFAULTS), np.full(len(mechanism.DEFAULTS), np.nan)):
    refused(ValueError, lambda: setattr(motion, "p", wrong))
refused(ValueError, lambda: setattr(motion, "q", np.zeros(len(motion.q) + 1)))
refused(ValueError, lambda: setattr(motion, "t", "now"))
refused(ValueError, lambda: motion.advance(0.125), "t: 0.125 s given, and the motion has come to 0.25 s")
refused(ValueError, lambda: motion.advance("1"), "t: a finite number needed")
refused(ValueError, lambda: motion.advance(1.0, rtol=-1e-3), "rtol: -0.001 given")
refused(ValueError, lambda: motion.advance(1.0, atol=float("nan")), "atol: a finite number needed, nan given")
refused(ValueError, lambda: motion.step(0.0), "h: 0 given")
refused(AttributeError, lambda: setattr(motion, "work", 1.0))
refused(AttributeError, lambda: delattr(motion, "q"))
kept, q = motion.q.copy(), motion.q
del motion, places
gc.collect()
other.step(1e-3)
assert np.array_equal(q, kept)
"""


def test_arrays_stay_where_they_are(tmp_path):
    """Nothing that is assigned replaces what the code works on, and an array outlives its motion."""
    m = ncgen.Model("sprung")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("rod", [A, B], mass=1.0, inertia="point")
    m.spring(B, m.point("C", (1, 1), fixed=True), stiffness=m.parameter("stiffness", 40.0), free_length=m.parameter("free", 0.5))
    export(m, "python", tmp_path)
    shell(f"{sys.executable} setup.py --quiet build_ext --inplace", tmp_path)
    code = REFUSED.replace("@", "sprung")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_installs_and_runs_by_its_readme(fresh, tmp_path, name):
    """In an environment of its own, where there is no ncgen."""
    folder = fresh(name, "python")
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    install, run = commands(folder / "README.md")[0]
    path = f"{tmp_path / 'venv/bin'}:/usr/local/bin:/usr/bin:/bin"
    shell(f"{install} --quiet", folder, PATH=path)
    there = tmp_path / "elsewhere"
    there.mkdir()
    shell(run.replace(f"-m {name}", f"-m {name} {SECONDS[name]} 11"), there, PATH=path)
    compare(there / "motion.csv", name, 1e-6)
    use(there, name, tmp_path / "venv/bin/python")
