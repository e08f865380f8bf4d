"""Studies as TOML files, on the command line, as tables for other programs and as pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from study_models import swing
from typer.testing import CliRunner

import ncgen
from ncgen.cli import app
from ncgen.exchange.toml_writer import to_toml
from ncgen.studies.file import read_study

STUDY = """model = "swing.toml"
keep = ["psi", "max(psi)"]

[vary]
length = [0.9, 1.0, 1.1]
"start(rate(psi))" = { low = 1.0, high = 2.0, count = 4 }

[simulation]
duration = 0.5
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("studies")
    (folder / "swing.toml").write_text(to_toml(swing()), encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def found():
    vary = {"length": [0.9, 1.0, 1.1], "start(rate(psi))": {"low": 1.0, "high": 2.0, "count": 4}}
    return ncgen.study(swing(), vary, keep=["psi", "max(psi)"], duration=0.5)


def test_a_file_says_what_python_says(place, found):
    """The command gives the bits of the call, prints what came out, draws and writes a table; again it has nothing to do."""
    arguments = [
        "study",
        str(place / "study.toml"),
        "-o",
        str(place / "out"),
        "--plot",
        str(place / "map.png"),
        "--table",
        str(place / "t.csv"),
    ]
    for _ in range(2):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0 and "swing: 12 of 12 variants completed" in done.output
    again = ncgen.read(place / "out")
    assert all(np.array_equal(again[name], found[name]) for name in found.keys())
    assert (place / "map.png").stat().st_size > 10_000
    rows = np.genfromtxt(place / "t.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert np.array_equal(rows["psi"], found["psi"])
    told = json.loads(CliRunner().invoke(app, [*arguments[:4], "--json"]).output)
    assert told["ok"] == 12 and told["failures"] == {} and told["shape"] == [3, 4]


def test_a_table_of_variants(place, found):
    table = found.table()
    lines = [f"{a!r},{b!r}" for a, b in zip(table["length"].tolist(), table["start(rate(psi))"].tolist(), strict=True)]
    (place / "table.csv").write_text("\n".join(["length,start(rate(psi))", *lines]))
    (place / "listed.toml").write_text(
        STUDY.replace("[vary]", 'vary = "table.csv"\n[ignored]').split("[ignored]")[0] + "[simulation]\nduration = 0.5\n"
    )
    study = read_study(place / "listed.toml")
    assert study.design.kind == "list" and np.array_equal(study.design.rows(0, 12)[:, 0], found["length"])


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("length =", "lenght =", "bad.toml, line 5: vary: the mechanism has no parameter lenght"),
        ("[0.9, 1.0, 1.1]", '"long"', "bad.toml, line 5: vary, length: long given; give a list of numbers"),
        ("duration = 0.5", "duration = -1", "bad.toml, line 9: duration: -1 given"),
        ("duration = 0.5", "durations = 1", "bad.toml, line 9: .*there is no argument 'durations'; did you mean duration"),
        ("keep = ", "kept = ", "bad.toml, line 2: kept: unknown; did you mean keep"),
        ('keep = ["psi"', 'keep = ["phi"', "bad.toml, line 2: keep: swing has no coordinate or output phi"),
        ('model = "swing.toml"', 'model = "swing.py"', "bad.toml, line 1: model: swing.py is a program, which a study file does not run"),
        ('model = "swing.toml"', "model = 3", "bad.toml, line 1: model: it is a text"),
        ('model = "swing.toml"', "", "bad.toml, line 1: model is missing"),
        ("[vary]", "[vary", "bad.toml, line 4: not TOML"),
        ("[vary]", 'count = 3\n[vary]', "bad.toml, line 4: count: 3 given, but a grid has 12 variants by itself"),
    ],
)  # fmt: skip
def test_mistakes_have_a_line(place, old, new, said):
    (place / "bad.toml").write_text(STUDY.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        read_study(place / "bad.toml")
    assert "\n" not in str(caught.value)


def test_pandas_and_xarray(found, tmp_path):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    frame, data = found.dataframe(), found.dataset()
    assert list(frame["psi"]) == found["psi"].tolist() and frame.index.name == "variant"
    assert data["psi"].dims == ("length", "start(rate(psi))") and float(data["psi"][1, 2]) == found["psi"][6]
    assert float(data["length"][1]) == 1.0 and isinstance(data, xarray.Dataset)
    pytest.importorskip("pyarrow")
    read = pandas.read_parquet(found.to_parquet(tmp_path / "t.parquet"))
    assert read["max(psi)"].tolist() == found["max(psi)"].tolist()


def test_tables_follow_no_link(found, tmp_path):
    """A Parquet file is written under a name that nobody can guess: not into a link that waits under that of before."""
    parquet = pytest.importorskip("pyarrow.parquet")
    (tmp_path / "letter.txt").write_text("dear")
    (tmp_path / ".t.parquet.part").symlink_to("letter.txt")
    assert parquet.read_table(found.to_parquet(tmp_path / "t.parquet"))["psi"].to_pylist() == found["psi"].tolist()
    assert (tmp_path / "letter.txt").read_text() == "dear"


def test_packages_that_are_not_there(found, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ncgen.NcgenError, match=r"pandas is not installed; pip install 'ncgen\[tables\]'"):
        found.dataframe()
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ncgen.NcgenError, match=r"a cluster needs Dask, which is not installed; pip install 'ncgen\[cluster\]'"):
        ncgen.study(swing(), {"length": [1.0]}, keep="psi", duration=0.1, workers="local")


def test_pictures(found):
    """What is drawn follows from what there is: a map of a grid of two, points over one number, bands of histories, parallel lines."""
    from ncgen.view.variant_pictures import picture

    mesh = found.plot().axes[0].collections[0].get_array()
    assert np.array_equal(np.ravel(mesh), found["psi"].reshape(3, 4).T.ravel())
    b = np.linspace(0, 1, 30)
    (line,) = picture("t", {"a": b}, {"x": b**2}, np.empty(0), None).axes[0].get_lines()
    assert np.array_equal(line.get_ydata(), b**2)
    histories = b[:, None] + np.arange(3.0)
    (median,) = picture("t", {"a": b}, {"h": histories}, np.arange(3.0), None).axes[0].get_lines()
    assert median.get_ydata() == pytest.approx([0.5, 1.5, 2.5])
    lines = [x for x in picture("t", {"a": b, "b": b, "c": b}, {"x": b}, np.empty(0), None).axes[0].get_lines() if x.get_gid() == "variant"]
    assert len(lines) == 30
    with pytest.raises(ncgen.NcgenError, match="nothing to draw"):
        picture("t", {"a": b}, {"x": np.full(30, np.nan)}, np.empty(0), None)


def named(name: str) -> ncgen.Model:
    m = ncgen.Model("named")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0, -1))
    m.body("bob", [B], mass=m.parameter(name, 1.0))
    m.distance(A, B)
    m.gravity((1, -9.81, 0))
    return m


@pytest.mark.parametrize("name", ["file", "said", "allow_pickle"])
def test_parameters_of_any_name_are_written(tmp_path, name):
    """Also those that NumPy's own writer takes for its arguments."""
    found = ncgen.study(named(name), {name: [1.0, 2.0]}, keep="B.x", duration=0.1, output=tmp_path / "study")
    assert ncgen.read(tmp_path / "study")[name].tolist() == found[name].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("name", ["ok", "steps"])
def test_columns_have_names_of_their_own(name):
    """What varies is not replaced in silence by what the results call so."""
    with pytest.raises(ncgen.ModelError, match=f"vary, {name}: the results have another column of that name; rename the parameter"):
        ncgen.study(named(name), {name: [1.0, 2.0]}, keep="steps", duration=0.1)


def test_durations_that_no_double_holds():
    with pytest.raises(ncgen.ModelError, match="duration: a number of 401 digits given; it must be a positive number of seconds"):
        ncgen.study(named("m"), {"m": [1.0]}, keep="B.x", duration=10**400)
