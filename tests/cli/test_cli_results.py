"""Results at the command line: files of motions, places to write to, terminals of all kinds, and functions of the user's own."""

from __future__ import annotations

import errno
import io
import sys
import zipfile

import numpy as np
import pytest

import ncgen

CODE = "import os; os.makedirs('executed')"


@pytest.fixture
def recorded(folder):
    """A motion of the pendulum in a file."""
    return ncgen.simulate(ncgen.compile(ncgen.load("pendulum"), "numpy"), 0.1, points=3).to_npz(folder / "run.npz")


def refused(said, *words):
    """One line on standard error, nothing on standard output."""
    assert said.code == 2 and said.out == ""
    assert said.err.startswith("ncgen: ") and said.err.count("\n") == 1 and len(said.err) <= 300
    for word in words:
        assert word in said.err


# -- motions in files ---------------------------------------------------------------------------


def test_the_health_of_a_motion_in_a_file(ncgen_main, recorded):
    said = ncgen_main("inspect", "pendulum", "--along", recorded, "--backend", "numpy")
    assert said.code == 0 and "σ of Φ_q from 1 to 1" in said.out and "violation" in said.out


class Planted:
    """Unpickling it would make a folder."""

    def __reduce__(self):
        return exec, (CODE,)


def spoiled(path, kind):
    """A file that is no trajectory, in one of many ways."""
    with np.load(path) as archive:
        arrays = dict(archive)
    if kind == "empty":
        path.write_bytes(b"")
    elif kind == "text":
        path.write_text("no archive")
    elif kind == "cut":
        path.write_bytes(path.read_bytes()[:-200])
    elif kind == "zip of texts":
        with zipfile.ZipFile(path, "w") as archive:
            for name in arrays:
                archive.writestr(f"{name}.npy", "no array")
    elif kind == "array":
        with open(path, "wb") as file:
            np.save(file, arrays["t"])
    elif kind == "pickle":
        np.savez(path, **arrays | {"t": np.array([Planted()], dtype=object)})
    elif kind == "missing":
        np.savez(path, **{name: array for name, array in arrays.items() if name != "work"})
    elif kind == "shape":
        np.savez(path, **arrays | {"qd": arrays["qd"][1:]})
    elif kind == "nan":
        np.savez(path, **arrays | {"q": arrays["q"] * np.nan})
    elif kind == "names":
        np.savez(path, **arrays | {"coordinates": np.arange(2)})
    elif kind == "nothing":
        np.savez(path, **{name: array[:0] if array.ndim and len(array) == 3 else array for name, array in arrays.items()})
    return path


@pytest.mark.parametrize(
    "kind, words",
    [
        ("empty", "no readable archive"),
        ("text", "no readable archive"),
        ("cut", "no readable archive"),
        ("zip of texts", "t is no array"),
        ("array", "no readable archive"),
        ("pickle", "no readable archive"),
        ("missing", "it has no work"),
        ("shape", "qd has shape (2, 2), which does not fit the others"),
        ("nan", "q has a number that is not finite"),
        ("names", "coordinates is made of int64"),
        ("nothing", "it has no instant"),
    ],
)
def test_a_file_that_is_no_trajectory(ncgen_main, recorded, kind, words):
    """Said in a line; what could be executed is not."""
    refused(ncgen_main("inspect", "pendulum", "--along", spoiled(recorded, kind)), "run.npz: not a trajectory", words)
    assert not (recorded.parent / "executed").exists()


def test_a_motion_of_another_model(ncgen_main, recorded, mine):
    """The same coordinates are not enough: with another row it is another mechanism."""
    refused(ncgen_main("inspect", "fourbar", "--along", recorded), "a trajectory of other coordinates than those of fourbar")
    mine.write_text(mine.read_text().replace("m.distance(A, B)", 'm.constrain(B.x.symbol**2 + B.y.symbol**2 - 1, "circle")'))
    refused(ncgen_main("inspect", mine, "--along", recorded), "a trajectory of other constraints than those of mine")
    refused(ncgen_main("inspect", "pendulum", "--along", "nosuch.npz"), "nosuch.npz: it cannot be read: No such file or directory")


# -- places to write to -------------------------------------------------------------------------


@pytest.mark.parametrize("command", [("compare", "pendulum"), ("bench", "pendulum", "--precision")])
@pytest.mark.parametrize(
    "option, place, words",
    [
        ("--html", "nowhere/report.html", "--html nowhere/report.html: there is no folder nowhere; make it, or choose another"),
        ("--plot", "nowhere/plot.png", "--plot nowhere/plot.png: there is no folder nowhere"),
        ("--plot", "plot.gif", "--plot plot.gif: choose a name that ends in .svg or .png"),
        ("--html", ".", "--html .: that is a folder; name a file in it"),
    ],
)
def test_places_are_looked_at_before_the_work(ncgen_main, folder, monkeypatch, command, option, place, words):
    def work(*_, **__):
        raise AssertionError("work was done")

    monkeypatch.setattr("ncgen.compiler.generate", work)
    monkeypatch.setattr("ncgen.exchange.examples.load", work)
    refused(ncgen_main(*command, option, place), words)
    assert list(folder.iterdir()) == []


# -- terminals ----------------------------------------------------------------------------------


class Stream(io.StringIO):
    """An output that takes nothing."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def write(self, _):
        raise OSError(self.number, "No space left on device") if self.number != errno.EPIPE else BrokenPipeError(self.number, "Broken pipe")


@pytest.mark.parametrize("command", [("convert", "pendulum"), ("inspect", "pendulum", "--json", "--backend", "numpy")])
def test_a_full_disc_is_said_in_a_line(ncgen_main, monkeypatch, command):
    monkeypatch.setattr(sys, "stdout", Stream(errno.ENOSPC))
    said = ncgen_main(*command)
    assert (said.code, said.err) == (2, "ncgen: the output cannot be written: No space left on device; choose another place for it\n")


def test_a_reader_who_has_enough_is_no_mistake(ncgen_main, monkeypatch):
    monkeypatch.setattr(sys, "stdout", Stream(errno.EPIPE))
    said = ncgen_main("convert", "pendulum")
    assert (said.code, said.err) == (1, "")


def test_a_terminal_without_greek_letters(ncgen_main, monkeypatch):
    """It gets the numbers of the letters that it lacks, and everything else as it is."""
    plain = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", plain)
    assert ncgen_main("inspect", "pendulum", "--backend", "numpy").code == 0
    text = plain.buffer.getvalue().decode("ascii")
    assert "6 coordinates, 2 free \\xb7 1 constraint, rank 1" in text


# -- functions of the user's own ----------------------------------------------------------------

FUNCTIONS = """
def narrow():
    return 0

def wide(q, qd, more):
    return 0

def broken(q):
    return 1 / 0

number = 3
"""


@pytest.mark.parametrize(
    "text, words",
    [
        ("os:system", "it is a built-in function; give a Python function of your own, f(q)"),
        ("gamma=math:hypot", "it is a built-in function; give a Python function of your own, f(q, qd)"),
        ("pathlib:Path", "it is a type; give a Python function of your own, f(q)"),
        ("own:number", "it is a int; give a Python function of your own"),
        ("own:narrow", "it cannot be called as f(q) (too many positional arguments)"),
        ("gamma=own:wide", "it cannot be called as f(q, qd) (missing a required argument: 'more')"),
        ("own:nosuch", "module 'own' has no attribute 'nosuch'"),
        ("fails:f", "ZeroDivisionError: division by zero"),
        ("time=own:wide", "there is no kernel time to compare with"),
    ],
)
def test_functions_are_looked_at_before_they_are_called(ncgen_main, folder, monkeypatch, text, words):
    (folder / "own.py").write_text(FUNCTIONS)
    (folder / "fails.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "own", raising=False)
    monkeypatch.setattr("ncgen.comparisons.comparison.compare.compare", lambda *_: pytest.fail("work was done"))
    refused(ncgen_main("compare", "pendulum", "--with", text), f"--with {text}: ", words)


def test_a_function_that_fails_is_said_in_a_line():
    from ncgen.comparisons.rivals.user import UserFunction

    def broken(q):
        return q / 0

    with pytest.raises(ncgen.ModelError, match="^--with mine:broken: it fails with ZeroDivisionError: division by zero$"):
        UserFunction("mine:broken", "phi_q", broken)(1)
