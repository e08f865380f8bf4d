"""Trajectories that are read back: the same motion, which can be looked at, drawn and continued; and two of them compared."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from study_models import swing

import ncgen
from ncgen.report.along import Recorded


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(swing())


@pytest.fixture(scope="module")
def run(kernels):
    return ncgen.simulate(kernels, 0.5, zd0={"psi": 1.0}, p={"length": 0.9}, points=11)


@pytest.fixture(scope="module")
def path(run, tmp_path_factory):
    return run.to_npz(tmp_path_factory.mktemp("run") / "trajectory.npz")


def test_a_trajectory_is_read_back(run, path, tmp_path):
    found = ncgen.read(path)
    for name in ("t", "q", "qd", "qdd", "lam", "work", "p"):
        assert np.array_equal(getattr(found, name), getattr(run, name)), name
    for name in ("formalism", "integrator", "engine", "made_with", "stopped", "statistics", "independent", "coordinates", "name"):
        assert getattr(found, name) == getattr(run, name), name
    assert np.array_equal(found["square"], run["square"]) and found.energy_drift == run.energy_drift
    assert np.array_equal(found.point("B"), run.point("B"))
    assert found.plot(tmp_path / "motion.png").stat().st_size > 10_000
    assert "swing" in found.animate(tmp_path / "motion.html").read_text(encoding="utf-8")


def test_it_goes_on(run, path):
    """From its end, with its parameters, as the motion itself does."""
    found = ncgen.read(path)

    def on(from_):
        return ncgen.simulate(from_.kernels, 0.5, t0=from_.t[-1], q0=from_.q[-1], qd0=from_.qd[-1], p=from_.p, points=11)

    whole = ncgen.simulate(run.kernels, 1.0, zd0={"psi": 1.0}, p={"length": 0.9}, points=21)
    assert np.array_equal(on(found).q, on(run).q)
    assert on(found).compared(whole).largest["psi"][0] < 1e-7


def test_a_driven_motion_and_independent_coordinates(tmp_path):
    """Inputs are those of every instant, and accelerations are found from them; coordinate partitioning has its coordinates again."""
    m = ncgen.Model("driven")
    tau = m.input("tau")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0, -1))
    x, z = m.vector("x", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [A, B], mass=1.0, inertia=0.1)
    psi = m.angle("psi", x, B - A, z)
    m.torque(psi, tau)
    run = ncgen.simulate(ncgen.compile(m), 0.5, inputs={"tau": ([0, 0.25, 0.5], [0, 1, 3])}, points=6, formalism="coordinate-partitioning")
    found = ncgen.read(run.to_npz(tmp_path / "trajectory.npz"))
    assert found.inputs["tau"] == pytest.approx(run.inputs["tau"], abs=1e-15) and found.independent == run.independent
    del vars(found)["qdd"]
    assert found.qdd == pytest.approx(run.qdd, abs=1e-12)


def rewritten(path, target, **changes):
    """A copy of a file with other arrays, or without those that are None."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files} | changes
    np.savez(target, **{name: array for name, array in arrays.items() if array is not None})
    return target


def test_files_of_before(path, run, tmp_path):
    """Without a model their arrays and names, with one the trajectory."""
    old = rewritten(path, tmp_path / "old.npz", about=None, model=None)
    recorded = ncgen.read(old)
    assert isinstance(recorded, Recorded) and np.array_equal(recorded.arrays["q"], run.q)
    assert np.array_equal(ncgen.read(old, swing())["psi"], run["psi"])
    assert np.array_equal(ncgen.read(old, run.kernels).qdd, run.qdd)
    with np.load(path) as archive:
        older = {"rows" if name == "constraints" else name: archive[name] for name in archive.files}
    np.savez(old, **older)
    assert np.array_equal(ncgen.read(old).qdd, run.qdd)


def test_a_model_with_a_function_is_asked_for(tmp_path):
    model = swing()
    model.callback(lambda t, q, qd, kernels: np.zeros_like(q))
    path = ncgen.simulate(ncgen.compile(model), 0.1, points=3).to_npz(tmp_path / "trajectory.npz")
    assert isinstance(ncgen.read(path), Recorded) and ncgen.read(path, model).t[-1] == 0.1


def about(path, **changes) -> np.ndarray:
    with np.load(path) as archive:
        return np.array(json.dumps(json.loads(str(archive["about"])) | changes))


@pytest.mark.parametrize(
    "changes, said",
    [
        (lambda path: {"about": np.array("{")}, "no JSON"),
        (lambda path: {"about": np.array("[" * 100_000)}, "no JSON"),
        (lambda path: {"about": np.array("[]")}, "not what this ncgen knows"),
        (lambda path: {"about": np.array(["a", "b"])}, "about has shape"),
        (lambda path: {"about": about(path, formalism="magic")}, "not what this ncgen knows: 'magic'"),
        (lambda path: {"about": about(path, statistics={"steps": "many"})}, "not what this ncgen knows"),
        (lambda path: {"model": np.array('name = "x"\n[[point]]\nname = "__import__(\'os\')"')}, "trajectory.npz, line"),
        (lambda path: {"model": np.array('name = "other"')}, "a trajectory of other coordinates than those of other"),
        (lambda path: {"model": np.array([print], dtype=object)}, "no readable archive"),
        (lambda path: {"qdd": np.full((11, 3), np.nan)}, "qdd has a number that is not finite"),
        (lambda path: {"lam": np.zeros((11, 5))}, "lam has shape"),
    ],
)
def test_broken_and_hostile_files(path, tmp_path, changes, said):
    """One line; nothing of a file is run."""
    with pytest.raises(ncgen.NcgenError, match=said) as caught:
        ncgen.read(rewritten(path, tmp_path / "trajectory.npz", **changes(path)))
    assert "\n" not in str(caught.value)


def test_a_file_that_unpacks_to_far_more(path, tmp_path):
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("q.npy", bytes(50_000_000))
    with pytest.raises(ncgen.NcgenError, match="no readable archive"):
        ncgen.read(tmp_path / "bomb.npz")


def test_parquet(run, tmp_path, monkeypatch):
    pandas, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    path = run.to_parquet(tmp_path / "run.parquet")
    frame = pandas.read_parquet(path)
    assert np.array_equal(frame["rate(psi)"], run["rate(psi)"]) and np.array_equal(frame["square"], run["square"])
    metadata = parquet.read_schema(path).metadata
    assert json.loads(metadata[b"ncgen"])["formalism"] == run.formalism and b'name = "swing"' in metadata[b"ncgen.model"]
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(ncgen.NcgenError, match=r"pyarrow is not installed; pip install 'ncgen\[tables\]'"):
        run.to_parquet(path)


def test_two_motions_beside_each_other(kernels, run):
    """A difference is where it was put; on other instants what is left is the error of cubics, h⁴/384 times the fourth derivative."""
    from dataclasses import replace

    q = run.q.copy()
    q[4, kernels.index["psi"]] += 0.25
    found = replace(run, q=q).compared(run)
    assert next(iter(found.largest.items())) == ("psi", (pytest.approx(0.25), run.t[4]))
    assert str(found).splitlines()[1].split() == ["psi", "2.500e-01", "at", "0.2", "s"]
    fine = ncgen.simulate(kernels, 0.5, zd0={"psi": 1.0}, p={"length": 0.9}, points=37)
    between = fine.compared(run)
    assert len(between.t) == 37 and 0 < between.largest["psi"][0] < 20**2 * 0.05**4 / 384
    half = ncgen.simulate(kernels, 0.25, zd0={"psi": 1.0}, p={"length": 0.9}, points=6)
    assert run.compared(half).t.tolist() == run.t[:6].tolist()


def test_motions_that_cannot_be_compared(kernels, run):
    other = ncgen.simulate(ncgen.compile(ncgen.load("fourbar")), 0.1, points=3)
    later = ncgen.simulate(kernels, 0.1, t0=2.0, points=3)
    for two, said in (
        (other, "swing and fourbar cannot be compared: the models differ"),
        (later, "without a common instant, 0 to 0.5 s and 2"),
    ):
        with pytest.raises(ncgen.ModelError, match=said) as caught:
            run.compared(two)
        assert "\n" not in str(caught.value)
