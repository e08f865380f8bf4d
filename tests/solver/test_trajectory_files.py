"""What a trajectory answers by name, and what it writes."""

from __future__ import annotations

import csv
import json
import subprocess

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError, NcgenError
from ncgen.solver.trajectories.trajectory_files import _cell


def test_names(turning, fourbar):
    assert turning.name == "fourbar"
    assert turning.coordinates == ("B.x", "B.y", "C.x", "C.y", "psi")
    assert np.array_equal(turning["C.y"], turning.q[:, 3])
    assert np.array_equal(turning["rate(psi)"], turning.qd[:, 4])
    assert np.array_equal(turning.point("B"), np.column_stack([turning["B.x"], turning["B.y"], np.zeros(21)]))
    assert np.array_equal(turning.point("D"), np.tile([0.4, 0.0, 0.0], (21, 1)))
    assert np.array_equal(turning.vector("z"), np.tile([0.0, 0.0, 1.0], (21, 1)))
    assert turning.independent == ("psi",)
    assert turning.lam.shape == (21, fourbar.m)


UNKNOWN = ["phi", "A.x", "rate(phi)", ""]
LOOSE = "rate(psi"


@pytest.mark.parametrize("name", [*UNKNOWN, LOOSE])
def test_unknown_coordinates(turning, name):
    """Fixed components are no coordinates of a run; a rate is written with both brackets."""
    with pytest.raises(ModelError, match="fourbar has no free coordinate"):
        turning[name]


def test_unknown_elements(turning):
    with pytest.raises(ModelError, match="fourbar has no point E; it has A, B, C, D"):
        turning.point("E")


def test_statistics_are_plausible(turning):
    """DOP853 needs twelve evaluations a step, its dense output three more; Newton needs a step or two an evaluation."""
    s = turning.statistics
    assert s.steps > 20
    assert 11 * s.steps <= s.evaluations <= 20 * s.steps
    assert s.newton_steps <= 6 * s.evaluations
    assert s.repeated_steps == 0
    assert s.seconds > 0


def test_npz_round_trip(turning, tmp_path):
    path = turning.to_npz(tmp_path / "new" / "run.npz")
    with np.load(path, allow_pickle=False) as archive:
        for name in ("t", "q", "qd", "qdd", "lam", "work", "p"):
            assert np.array_equal(archive[name], getattr(turning, name)), name
        assert tuple(archive["coordinates"]) == turning.coordinates
        assert list(archive["constraints"]) == [row.label for row in turning.kernels.rows]
        assert archive["parameters"].size == 0
    assert [p.name for p in path.parent.iterdir()] == ["run.npz"]


def test_csv_round_trip(turning, tmp_path):
    """Every digit: the numbers read back are the same to the last bit."""
    path = turning.to_csv(str(tmp_path / "run.csv"))
    with open(path, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == ["t", *turning.coordinates, *(f"rate({name})" for name in turning.coordinates)]
    assert np.array_equal(np.array(rows, dtype=float), np.column_stack([turning.t, turning.q, turning.qd]))


@pytest.mark.parametrize("write", ["to_npz", "to_csv"])
def test_what_cannot_be_written_says_so(turning, tmp_path, write):
    """A file where a folder should be: one error, and the file as it was."""
    (tmp_path / "file").write_text("mine")
    with pytest.raises(NcgenError, match="cannot be written"):
        getattr(turning, write)(tmp_path / "file" / "run")
    assert (tmp_path / "file").read_text() == "mine"
    with pytest.raises(NcgenError, match="output: '' given; name a file"):
        getattr(turning, write)("")
    with pytest.raises(NcgenError, match="output: 3 given; name a file"):
        getattr(turning, write)(3)


@pytest.mark.parametrize("label", ["psi", "force of A, B", 'the "arm"', '"a", b'])
def test_labels_are_cells(label):
    """Whatever stands in a label, a reader of tables finds it."""
    assert list(csv.reader([f"t,{_cell(label)},q"])) == [["t", label, "q"]]


def test_a_thinned_motion_keeps_its_ends(turning):
    """Five of 21 instants, evenly; all of them where more are asked for."""
    few = turning.thinned(5)
    for name in ("t", "q", "qd", "work"):
        assert np.array_equal(getattr(few, name), getattr(turning, name)[[0, 5, 10, 15, 20]])
    assert np.array_equal(turning.thinned(22).t, turning.t)


def about(path) -> dict:
    with np.load(path) as archive:
        return json.loads(str(archive["about"]))


def test_an_archive_says_what_last_bits_depend_on(tmp_path):
    """The processor as its system calls it, and of compiled kernels the compiler as it calls itself, with the flags that it was given."""
    model = ncgen.load("pendulum")
    compiled, plain = (ncgen.compile(model, backend) for backend in ("c", "numpy"))
    said = about(ncgen.simulate(compiled, 0.01, points=2).to_npz(tmp_path / "c.npz"))
    command = json.loads((compiled.library.parent / "build.json").read_text(encoding="utf-8").partition("\n")[2])["command"]
    version = subprocess.run([command[0], "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    assert said["compiler"] == version and "-march=native" in said["flags"].split() and set(said["flags"].split()) <= set(command)
    assert said["processor"]
    said = about(ncgen.simulate(plain, 0.01, points=2, engine="python").to_npz(tmp_path / "numpy.npz"))
    assert said["processor"] and not {"compiler", "flags"} & set(said)
