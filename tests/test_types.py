"""What editors and type checkers see: the names of ncgen, and annotations that hold wherever a user can look."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import ncgen

ROOT = Path(__file__).resolve().parent.parent


def test_one_list_has_the_public_names():
    """ncgen loads its names late, by the list that editors and type checkers read; it must be what Python reads in it."""
    tree = ast.parse((ROOT / "ncgen" / "__init__.pyi").read_text(encoding="utf-8"))
    shown = {name.asname: node.module for node in tree.body if isinstance(node, ast.ImportFrom) for name in node.names}
    assert shown == ncgen._HOMES and len(shown) > 35
    assert sorted(shown) == ncgen.__all__ == dir(ncgen)
    assert all(getattr(ncgen, name).__name__ == name for name in shown)
    with pytest.raises(AttributeError, match="module 'ncgen' has no attribute 'simulat'"):
        getattr(ncgen, "simulat")  # noqa: B009


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pyright") is None, reason="pyright is not there; run pip install '.[style]'")
def test_annotations_hold(tmp_path):
    """pyright finds nothing in ncgen, in the examples and in what the README shows."""
    snippets = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)
    assert snippets
    for number, snippet in enumerate(snippets, 1):
        (tmp_path / f"readme_{number}.py").write_text(snippet, encoding="utf-8")
    command = ["pyright", "--pythonpath", sys.executable, "ncgen", "examples", *tmp_path.glob("readme_*.py")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


ONE_OR_MANY = """
import numpy as np
import ncgen

kernels = ncgen.compile(ncgen.load("fourbar"))
reveal_type(ncgen.simulate(kernels, 1.0, zd0={"psi": 1.0}, rtol=1e-6))
reveal_type(ncgen.simulate(kernels, 1.0, zd0=np.zeros((3, 1))))
reveal_type(ncgen.start(kernels))
reveal_type(ncgen.start(kernels, 3))
reveal_type(ncgen.gradient(kernels, 1.0, 3, lambda q, qd: (0.0, None, None)))
reveal_type(ncgen.accelerations(kernels, [1.0], [2.0]))
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pyright") is None, reason="pyright is not there; run pip install '.[style]'")
def test_one_state_and_rows_have_types(tmp_path):
    """Calls of one state have the type of its result; of arrays no checker knows how many dimensions they have."""
    file = tmp_path / "calls.py"
    file.write_text(ONE_OR_MANY, encoding="utf-8")
    done = subprocess.run(["pyright", "--pythonpath", sys.executable, file], cwd=ROOT, capture_output=True, text=True)
    types = re.findall(r'is "(\w+)"$', done.stdout, re.MULTILINE)
    assert types == ["Trajectory", "Any", "Simulation", "Simulations", "Gradient", "StateAccelerations"], done.stdout
