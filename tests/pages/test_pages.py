"""Every block of code on the pages runs, here or in the test of its own that is named below, and prints what stands behind it."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import ncgen

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

BLOCK = re.compile(r"^```(?P<language>python|sh)\n(?P<code>.*?)^```\n(?:\n```\n(?P<printed>.*?)^```\n)?", re.DOTALL | re.MULTILINE)

ELSEWHERE = {
    "contributing.md": "tests/model/test_new_force.py",
    "embedding.md": "tests/export/test_casadi.py",
    "models.md": "tests/exchange/test_toml.py",
    "paper.md": "tests/test_readme.py",
    "robots.md": "tests/test_readme.py",
}
"""Pages whose code has a test of its own."""

BEFORE = {
    "control.md": """
import math
import numpy as np, scipy.signal
import ncgen
from ncgen.exchange.examples import example_module
m = ncgen.Model("taken")
O, x = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
B, c = m.point("B", (0.5, 0), fixed="y"), 0.1
cart = m.body("cart", points=[B], mass=1.0)
s = m.slide("s", O, B, x)
""",
    "sensitivities.md": "import ncgen\nmodel = ncgen.load('fourbar')\n",
}
"""What a page takes for granted."""

FOR_BLOCKS = {
    ("control.md", 1): "kernels = ncgen.compile(m)\ntimes, values = np.linspace(0, 1, 11), np.sin(np.linspace(0, 1, 11))\n",
    ("control.md", 2): "kernels = ncgen.compile(ncgen.load('cartpole'))\ncontroller = lambda s, phi, rate: 0.0\n",
    ("control.md", 3): "policy = lambda s, phi: 0 * s\n",
    ("control.md", 4): """
car = ncgen.Model("car")
ground, up = car.point("ground", (0, 0), fixed=True), car.vector("up", (0, 1, 0), fixed=True)
wheel, body = car.point("wheel", (0, 0.3), fixed="x"), car.point("body", (0, 0.7), fixed="x")
car.body("axle", points=[wheel], mass=40.0)
car.body("chassis", points=[body], mass=300.0)
car.spring(ground, wheel, 2e5)
car.spring(wheel, body, 2e4, 1e3)
low, high = car.slide("low", ground, wheel, up), car.slide("high", ground, body, up)
car.independent(low, high)
car.force(body, (0, car.input("F", "N"), 0))
car.output("comfort", high.acceleration, "m/s2")
kernels = ncgen.compile(car)
""",
}
"""What single blocks take for granted, counted from 0."""

NEEDS = {("studies.md", 1): "joblib"}
"""What a block needs that ncgen does not."""


def blocks(page):
    return [found.groupdict() for found in BLOCK.finditer(page.read_text(encoding="utf-8"))]


PAGES = [page.name for page in sorted(DOCS.glob("*.md")) if any(block["language"] == "python" for block in blocks(page))]


def test_lists_name_what_there_is():
    assert all((ROOT / test).is_file() for test in ELSEWHERE.values())
    assert {*ELSEWHERE, *BEFORE, *(name for name, _ in (*FOR_BLOCKS, *NEEDS))} <= {*PAGES, "models.md"}


@pytest.mark.parametrize("name", [name for name in PAGES if name not in ELSEWHERE])
def test_code_of_a_page_runs_and_prints_what_is_shown(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {"__name__": "page"}
    exec(BEFORE.get(name, ""), names)
    for number, block in enumerate(blocks(DOCS / name)):
        if (needed := NEEDS.get((name, number))) and importlib.util.find_spec(needed) is None:
            continue
        if block["language"] == "python":
            exec(FOR_BLOCKS.get((name, number), ""), names)
            exec(block["code"], names)
            printed = capsys.readouterr().out
            assert block["printed"] is None or printed == block["printed"], block["code"]
        else:
            for command in block["code"].splitlines():
                subprocess.run([sys.executable, "-m", *command.split()], check=True, capture_output=True)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
@pytest.mark.parametrize(
    "page, model, target, header", [("embedding.md", "robot", "c", "robot_motion.h"), ("robots.md", "crane", "joints", "crane_joints.h")]
)
def test_c_of_a_page_compiles(page, model, target, header, tmp_path):
    """The lines of a block are those of a function, in which t is a time."""
    robot = ROOT / "tests" / "robots" / "crane.urdf"
    ncgen.export(ncgen.load(model) if target == "c" else ncgen.load(robot, frames=["hook"]), target, tmp_path / "export")
    blocks = re.findall(r"```c\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)
    code = "\n".join(f"{{\n{block}}}" for block in blocks)
    assert blocks
    lines = "\n".join(line for line in code.splitlines() if not line.startswith("#include"))
    (tmp_path / "page.c").write_text(f'#include "{header}"\nint main(void)\n{{\n    double t = 0.0;\n{lines}\n    return t > 1.0;\n}}\n')
    include = next(path.parent for path in (tmp_path / "export").rglob(header))
    subprocess.run(["cc", "-std=c99", "-fsyntax-only", f"-I{include}", tmp_path / "page.c"], check=True)
