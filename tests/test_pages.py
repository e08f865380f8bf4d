"""Every block of code on the pages runs, here or in the test of its own that is named below, and prints what stands behind it."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"

BLOCK = re.compile(r"^```(?P<language>python|sh|toml)\n(?P<code>.*?)^```\n(?:\n```\n(?P<printed>.*?)^```\n)?", re.DOTALL | re.MULTILINE)

CARTPOLE = """
import math
import ncgen, numpy as np, scipy.signal
kernels = ncgen.compile(ncgen.load("cartpole"))
"""

ELSEWHERE = {
    "contributing.md": "tests/model/test_new_force.py and tests/emit/test_languages.py",
    "embedding.md": "tests/export/test_casadi.py",
    "models.md": "tests/exchange/test_toml.py",
    "paper.md": "tests/test_readme.py",
    "robots.md": "tests/test_readme.py",
}
"""Pages whose code has a test of its own."""

BEFORE = {
    "sensitivities.md": "import ncgen\nmodel = ncgen.load('fourbar')\n",
}
"""What a page takes for granted."""

spec = importlib.util.spec_from_file_location("execute", DOCS / "course" / "execute.py")


def blocks(page):
    return [found.groupdict() for found in BLOCK.finditer(page.read_text(encoding="utf-8"))]


def with_code():
    return [page.name for page in sorted(DOCS.glob("*.md")) if any(b["language"] == "python" for b in blocks(page))]


@pytest.mark.parametrize("name", [name for name in with_code() if name not in ELSEWHERE])
def test_code_of_a_page_runs_and_prints_what_is_shown(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(BEFORE.get(name, ""), names)
    for block in blocks(DOCS / name):
        if block["language"] == "python":
            exec(block["code"], names)
            printed = capsys.readouterr().out
            assert block["printed"] is None or printed == block["printed"]
        elif block["language"] == "sh":
            for command in block["code"].splitlines():
                subprocess.run([sys.executable, "-m", *command.split()], check=True, capture_output=True)
