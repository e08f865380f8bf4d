"""The command line inside this process, and model files to give it."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import NamedTuple

import pytest

PENDULUM = """
from ncgen import Model


def build():
    m = Model("mine")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (1, 0))
    m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))
    m.simulation(duration=0.1)
    return m
""".lstrip()


class Said(NamedTuple):
    """What a command left behind: exit code, standard output and standard error."""

    code: int
    out: str
    err: str


@pytest.fixture
def ncgen_main(monkeypatch, capsys):
    """Call the command line in this process, as `ncgen_main("run", "robot", "--json")`."""
    from ncgen import cli

    def call(*arguments) -> Said:
        monkeypatch.setattr("sys.argv", ["ncgen", *map(str, arguments)])
        capsys.readouterr()
        with warnings.catch_warnings():  # main shows warnings in its own way
            try:
                code = cli.main()
            except SystemExit as end:
                code = end.code
        said = capsys.readouterr()
        return Said(code or 0, said.out, said.err)

    return call


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty folder that is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def mine(folder) -> Path:
    """A user's own model in a file."""
    path = folder / "mine.py"
    path.write_text(PENDULUM, encoding="utf-8")
    return path


@pytest.fixture
def written(folder):
    """All files under the current folder, but for what Python itself keeps."""

    def names() -> set[str]:
        paths = (p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts)
        return {p.relative_to(folder).as_posix() for p in paths}

    return names
