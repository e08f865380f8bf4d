"""What docs/contributing.md adds, added: each text of the guide has one place in a copy of the package, and nothing else is edited."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
GUIDE = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")


def texts(section: str, language: str = "python") -> list[str]:
    """The pieces of code in a section of the guide."""
    return re.findall(rf"```{language}\n(.*?)```", GUIDE.partition(f"## {section}\n")[2].partition("\n## ")[0], re.DOTALL)


def inserted(path: Path, before: str, text: str) -> None:
    """Insert a text before a line that occurs once."""
    source = path.read_text(encoding="utf-8")
    assert source.count(before) == 1, before
    path.write_text(source.replace(before, f"{text.rstrip()}\n\n{before}"), encoding="utf-8")


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """A copy of the package with a row type, a joint and two methods more; the catalogue is derived anew, as the guide says."""
    root = tmp_path_factory.mktemp("edited")
    for name in ("ncgen", "templates", "examples"):
        shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    model, (formula, entry, method), (joint,), (explicit,) = (
        root / "ncgen" / "model",
        *map(texts, ("A row type", "A joint", "An explicit integrator")),
    )
    inserted(model / "catalogue.py", "def _unit(", formula + "\n")
    inserted(model / "catalogue.py", '        RowType(\n            key="unit"', textwrap.indent(entry.rstrip() + ",\n", " " * 8))
    inserted(model / "own_constraints.py", "    @fact\n    def unit(", textwrap.indent(method, " " * 4))
    inserted(model / "joints.py", "    @fact\n    def revolute(", textwrap.indent(joint, " " * 4))
    inserted(root / "ncgen" / "methods" / "explicit.py", '    "rk4": Published(', explicit)
    source, entry = (*texts("A method that steps the constraints", "c"), *texts("A method that steps the constraints"))
    (root / "ncgen" / "runtime" / "src" / "ncgen_implicit_euler.c").write_text(source, encoding="utf-8")
    inserted(root / "ncgen" / "methods" / "table.py", '        Integrator(name="adams"', textwrap.indent(entry.rstrip() + ",", " " * 8))
    ran(root, "-m", "ncgen.program.ir.catalogued")
    return root


def ran(root: Path, *command: str) -> str:
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, cwd=root, env=os.environ | {"PYTHONPATH": str(root)})
    assert done.returncode == 0, done.stderr
    return done.stdout


ROW_TYPE = """
import pathlib
import numpy as np
import ncgen
from ncgen.exchange.toml_writer import to_toml

# Where distances from (0, 0) and (3, 0) are as 1 to 2, points lie on a circle about (-1, 0) with the radius 2.
def build(joined):
    m = ncgen.Model("apollonius")
    A, B, centre = (m.point(name, (x, 0), fixed=True) for name, x in (("A", 0), ("B", 3), ("centre", -1)))
    P = m.point("P", (1, 0))
    m.body("bob", [P], mass=2.0)
    m.ratio(P, A, B) if joined else m.distance(centre, P)
    m.gravity((0, -9.81))
    return m

runs = [ncgen.simulate(ncgen.compile(build(joined), "c"), 1.5, rtol=1e-11) for joined in (True, False)]
assert np.abs(runs[0].q - runs[1].q).max() < 1e-8 and runs[0].q[:, 1].min() < -1.9
assert runs[0].engine == runs[1].engine
text, file = to_toml(build(True)), pathlib.Path("apollonius.toml")
file.write_text(text)
assert "[[ratio]]" in text and to_toml(ncgen.load(file)) == text
"""

JOINT = """
import pathlib
import numpy as np
import ncgen
from ncgen.exchange.toml_writer import to_toml
from ncgen.solver.positions.rank import freedom

m = ncgen.Model("lift")
u, v = m.vector("u", (1, 0, 0), fixed=True), m.vector("v", (0, 1, 0), fixed=True)
P = m.point("P", (0, 0, 0))
box = m.body("box", [P], [u, v], mass=2.0, com=(0, 0.3, 0), inertia=(1, 2, 3))
m.translational(m.ground, box, u, v)
m.gravity((0, -9.81, 0))
kernels = ncgen.compile(m, "c")
assert freedom(kernels).dof == 3
run = ncgen.simulate(kernels, 1.0, qd0={"P.x": 0.5})
assert np.allclose(run.point("P")[-1], (0.5, -9.81 / 2, 0), atol=1e-9)  # it is thrown, and does not turn
text, file = to_toml(m), pathlib.Path("lift.toml")
file.write_text(text)
assert "[[translational]]" in text and to_toml(ncgen.load(file)) == text
"""

EXPLICIT = """
import numpy as np
import ncgen

kernels = ncgen.compile(ncgen.load("pendulum"), "c")
exact = ncgen.simulate(kernels, 1.0, rtol=1e-12, points=2).q[-1]
runs = [ncgen.simulate(kernels, 1.0, integrator="heun", max_step=h, points=2) for h in (0.004, 0.002)]
errors = [np.abs(run.q[-1] - exact).max() for run in runs]
assert 3.6 < errors[0] / errors[1] < 4.4, errors
assert not runs[0].engine.startswith("python"), runs[0].engine
try:
    ncgen.simulate(kernels, 1.0, integrator="hen", max_step=0.01)
except ncgen.NcgenError as error:
    assert "heun" in str(error)
"""


IMPLICIT = """
import numpy as np
import ncgen

# On a plane that slopes by 45 degrees a mass falls with g/2 along either axis, and k steps of h from rest take it k (k + 1) h^2 g/4 there.
m = ncgen.Model("slope")
P, normal = m.point("P", (0, 0)), 0.5**0.5
m.body("bob", [P], mass=2.0)
m.constrain(normal * (P.x + P.y), "slope")
m.gravity((0, -9.81))
kernels = ncgen.compile(m, "c")
run = ncgen.simulate(kernels, 1.0, integrator="implicit-euler", max_step=0.1, points=11)
k = np.arange(11)
assert np.allclose(run["P.y"], -k * (k + 1) * 0.01 * 9.81 / 4, rtol=0, atol=1e-12), run["P.y"]
assert np.allclose(run["P.x"], -run["P.y"], rtol=0, atol=1e-12)

# A pendulum loses energy, and comes twice as near with half the steps.
kernels = ncgen.compile(ncgen.load("pendulum"), "c")
exact = ncgen.simulate(kernels, 1.0, rtol=1e-12, points=2).q[-1]
errors = [
    np.abs(ncgen.simulate(kernels, 1.0, integrator="implicit-euler", max_step=h, points=2).q[-1] - exact).max() for h in (0.002, 0.001)
]
assert 1.9 < errors[0] / errors[1] < 2.1, errors
try:
    ncgen.sensitivities(kernels, 1.0, 10, integrator="implicit-euler")
except ncgen.NcgenError as error:
    assert "'implicit-euler' given; derivatives go through steps of" in str(error)
else:
    raise AssertionError("derivatives of steps whose equations nobody gave")
"""


@pytest.mark.parametrize("program", [ROW_TYPE, JOINT, EXPLICIT, IMPLICIT], ids=["row type", "joint", "explicit method", "implicit method"])
def test_the_guide_is_complete(program, package):
    ran(package, "-c", program)
