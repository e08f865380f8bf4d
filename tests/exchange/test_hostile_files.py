"""What is no file of its kind is refused in one line with its name, whatever reads it, and nothing waits for it or never ends."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.cli import main
from ncgen.exchange.checking import checked
from ncgen.exchange.examples import load
from ncgen.studies.file import read_study
from ncgen.view.meshes import mesh_of

DEEP = 100_000
"""Brackets within each other: more than Python's readers of TOML and JSON, and its own, have room for."""

ROBOT = '<robot name="r"><link name="a"/></robot>'
STUDY = 'model = "pendulum"\nkeep = ["psi"]\nvary = "given.csv"\n[simulation]\nduration = 0.1\n'


def _loops(path: Path) -> object:
    robot = path.with_name("robot.urdf")
    robot.write_text(ROBOT)
    return load(robot, loops=path)


def _table(path: Path) -> object:
    study = path.with_name("study.toml")
    study.write_text(STUDY.replace("given.csv", path.name))
    return read_study(study)


def _mesh(path: Path) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert mesh_of(path) is None
    raise ncgen.NcgenError(str(caught[0].message))


def _checked(path: Path) -> None:
    problems = checked(path)[1]
    raise ncgen.NcgenError(problems[0])


def _said_by(command: str) -> Callable[[Path], None]:
    def run(path: Path) -> None:
        said = io.StringIO()
        with pytest.raises(SystemExit) as left, contextlib.redirect_stderr(said), pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", ["ncgen", command, str(path)])
            main()
        *before, last = said.getvalue().splitlines()
        assert left.value.code == 2 and last.startswith("ncgen: ") and len(before) <= 1
        raise ncgen.NcgenError(last)

    return run


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "model": ("m.toml", load),
    "program": ("m.py", load),
    "urdf": ("m.urdf", load),
    "sdf": ("m.sdf", load),
    "mjcf": ("m.xml", load),
    "loops": ("m.loops.toml", _loops),
    "study": ("m.toml", read_study),
    "table": ("m.csv", _table),
    "trajectory": ("m.npz", ncgen.read),
    "manifest": ("study.json", lambda path: ncgen.read(path.parent)),
    "mesh": ("m.stl", _mesh),
    "dae": ("m.dae", _mesh),
    "problems": ("m.toml", _checked),
    "check": ("m.toml", _said_by("check")),
    "inspect": ("m.urdf", _said_by("inspect")),
    "command study": ("m.toml", _said_by("study")),
}


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _link_to(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def _holding(data: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(data)


def _array(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.arange(10.0))


DAMAGE: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "pipe": _pipe,
    "folder": lambda path: path.mkdir(),
    "device": _link_to("/dev/zero"),
    "dangling link": _link_to("nowhere"),
    "circle of links": lambda path: path.symlink_to(path.name),
    "empty": _holding(b""),
    "brackets": _holding(b"[" * DEEP),
    "braces": _holding(b"a = " + b"{a=" * DEEP),
    "closed brackets": _holding(b"a = " + b"[" * DEEP + b"]" * DEEP),
    "elements": _holding(b"<a>" * DEEP),
    "zeros": _holding(bytes(100_000)),
    "not UTF-8": _holding(b"name = \"\xff\xfe\""),
    "one long line": _holding(b"x" * 1_000_000),
    "a long number": _holding(b"a = 1" + b"0" * DEEP),
    "array": _array,
}  # fmt: skip


@contextlib.contextmanager
def bounded(seconds: int) -> Iterator[None]:
    """Fails what takes longer, also where it waits."""

    def late(*_: object) -> None:
        raise AssertionError(f"no end after {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def refused(read: Callable[[Path], object], path: Path) -> None:
    with bounded(60), pytest.raises(ncgen.NcgenError) as caught:
        read(path)
    said = str(caught.value)
    assert "\n" not in said and len(said) <= 300 and said.isprintable()
    assert path.name[:40] in said.replace("\ufffd", "\0")


CASES = [(reader, damage) for reader in READERS for damage in DAMAGE if (reader, damage) != ("loops", "empty")]
"""Every reader with every damage; an empty table of loops is a table that closes none."""


@pytest.mark.parametrize(("reader", "damage"), CASES)
def test_one_line(tmp_path, reader, damage):
    name, read = READERS[reader]
    DAMAGE[damage](tmp_path / name)
    refused(read, tmp_path / name)


@pytest.mark.parametrize("name", ["m" * 5000, "a/" * 3000])
@pytest.mark.parametrize("reader", READERS)
def test_names_that_no_file_can_have(tmp_path, reader, name):
    suffix, read = READERS[reader]
    if reader not in ("loops", "table", "manifest"):
        with bounded(60), pytest.raises(ncgen.NcgenError) as caught:
            read(tmp_path / f"{name}{suffix}")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["(" * DEEP, "-" * DEEP + "psi", "sin(" * DEEP + "psi" + ")" * DEEP, "(psi" + "**psi" * DEEP + ")"])
def test_deep_expressions(tmp_path, text):
    """In a model's file, where sympy would be no match for them."""
    path = tmp_path / "m.toml"
    path.write_text(ncgen_text().replace('"2*x"', f'"{text}"'))
    began = time.process_time()
    refused(load, path)
    assert time.process_time() - began < 30


def ncgen_text() -> str:
    from ncgen.exchange.toml_writer import to_toml

    model = load("pendulum")
    return to_toml(model) + '\n[[output]]\nname = "twice"\nvalue = "2*psi"\n'
