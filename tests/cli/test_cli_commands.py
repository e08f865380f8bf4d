"""What the commands print and write when all is well. JSON is a contract: its keys are those of docs and design."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
GENERATED = ROOT / "generated"

INSPECT_KEYS = {
    "name", "coordinates", "free_coordinates", "constraints", "rank", "dof", "redundant", "simplified", "initial_angles", "kernels",
}  # fmt: skip
RUN_KEYS = {
    "name", "dof", "duration", "final_position", "final_velocity", "constraint_violation", "energy_drift", "steps", "wall_seconds",
    "preparation_seconds", "backend", "outputs",
}  # fmt: skip
ARTEFACTS = {"trajectory.npz", "trajectory.csv", "drawing.svg", "motion.svg", "animation.html"}


def sources(name):
    return {f"sources/{file}" for file in (f"{name}.c", f"{name}.h", f"{name}.py", "ncgen.h", "ncgen_math.h")}


def as_user(*arguments, cwd, **environment):
    """The command line as a program of its own."""
    command = [sys.executable, "-m", "ncgen", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, timeout=120)


# -- list and inspect ---------------------------------------------------------------------------


def test_list(ncgen_main):
    said = ncgen_main("list", "--json")
    assert said.code == 0 and said.err == ""
    records = {record["name"]: record for record in json.loads(said.out)}
    assert {"robot", "fourbar", "pendulum"} <= set(records)
    assert (records["robot"]["coordinates"], records["robot"]["constraints"]) == (45, 31)
    assert all(record["teaches"] for record in records.values())


def test_list_for_people(ncgen_main):
    said = ncgen_main("list")
    lines = said.out.splitlines()
    assert said.code == 0
    assert [line.split()[0] for line in lines] == sorted(line.split()[0] for line in lines)
    (robot,) = [line for line in lines if line.startswith("robot")]
    assert "6 dof" in robot and "31 constraints (1 redundant)" in robot


def test_inspect_the_robot(ncgen_main, written):
    """The numbers of the paper, and the redundancy of rows 6, 10, 12 and 16."""
    said = ncgen_main("inspect", "robot", "--json")
    assert said.code == 0 and said.err == "" and written() == set()
    facts = json.loads(said.out)
    assert set(facts) >= INSPECT_KEYS
    assert {key: facts[key] for key in ("name", "coordinates", "free_coordinates", "constraints", "rank", "dof", "singular")} == {
        "name": "robot", "coordinates": 45, "free_coordinates": 36, "constraints": 31, "rank": 30, "dof": 6, "singular": False,
    }  # fmt: skip
    (redundant,) = facts["redundant"]
    assert (redundant["constraint"], sorted(redundant["implied_by"])) == (16, [6, 10, 12])
    assert redundant["owner"] == "body5"
    degrees = {name: math.degrees(value) for name, value in facts["initial_angles"].items()}
    expected = {"psi1": -90, "psi2": 0, "psi3": 76.7007, "psi4": 0, "psi5": -150.0015, "psi6": -90}
    assert degrees == pytest.approx(expected, abs=1e-4)
    kernels = facts["kernels"]
    assert {"phi", "phi_q", "gamma", "mass", "force"} <= set(kernels)
    assert (kernels["phi"]["nonzeros"], kernels["gamma"]["nonzeros"], kernels["force"]["nonzeros"]) == (31, 31, 36)
    assert all(record["operations"] > 0 for record in kernels.values())
    assert [(link["body"], link["parent"], link["dof"]) for link in facts["tree"][:3]] == [
        ("body2", "ground", 1), ("body3", "body2", 1), ("body4", "body2", 1),
    ]  # fmt: skip
    counts = facts["derivative"]
    assert counts["chosen"] == "composite" and 0 < counts["positions"] < counts["composite"] < 0.7 * counts["all coordinates"]
    motion = facts["motion"]
    assert 0 < motion["positions"] < motion["velocities"] < motion["derivative"] < 0.8 * counts["all coordinates"]


def test_inspect_for_people(ncgen_main):
    """Every row by number, the redundancy in words, degrees instead of radians."""
    said = ncgen_main("inspect", "robot", "--backend", "numpy")
    assert said.code == 0
    assert "45 coordinates, 36 free · 31 constraints, rank 30 · 6 degrees of freedom" in said.out
    assert "redundant: constraint 16 (angle u3, r4-r5, body5)" in said.out
    assert "psi3 76.7007" in said.out
    assert [line.split()[0] for line in said.out.splitlines()[:31]] == [str(i) for i in range(1, 32)]


def test_inspect_tells_what_acts(ncgen_main):
    """Every force, couple, spring and potential with its law and the numbers that were given, after the rows."""
    said = ncgen_main("inspect", "suspension", "--backend", "numpy")
    assert "spring C-S: k (|a| - L0)^2 / 2, damper c with a = S-C, k = 369149, c = 0, L0 = 0.339\n" in said.out
    assert "rack: " in said.out and "weight" not in said.out.partition("suspension\n")[0]


# -- run ----------------------------------------------------------------------------------------


def test_run_the_robot_from_anywhere(tmp_path):
    """One command in an empty folder: everything is written into one folder there, and nothing elsewhere."""
    done = as_user("run", "robot", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    record = json.loads(done.stdout)
    assert set(record) >= RUN_KEYS
    assert (record["name"], record["dof"], record["duration"], record["backend"]) == ("robot", 6, 0.5, "c")
    published = {"psi2": 0.26154171434234150, "psi3": 0.30810884512921474, "psi5": -3.4044318734841151}
    assert {name: record["final_position"][name] for name in published} == pytest.approx(published, abs=1e-6)
    assert record["final_velocity"]["psi2"] == pytest.approx(1.4083669901829394, abs=1e-5)
    assert set(record["final_position"]) == set(record["final_velocity"]) == {f"psi{i}" for i in range(1, 7)}
    assert record["constraint_violation"] < 1e-11 and record["energy_drift"] < 1e-7
    assert record["steps"] > 0 and record["wall_seconds"] > 0
    assert set(record["outputs"]) == ARTEFACTS | sources("robot")
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {f"robot-output/{name}" for name in record["outputs"]}
    assert all((tmp_path / name).stat().st_size > 100 for name in found)
    with np.load(tmp_path / "robot-output" / "trajectory.npz") as archive:
        assert archive["q"].shape == (101, 36)


def test_run_a_file_of_ones_own(ncgen_main, mine, written):
    """The path relative to where one is; every option given, none of the model's used."""
    said = ncgen_main(
        "run", "mine.py", "--json", "--duration", "0.2", "--integrator", "ode113", "--rtol", "1e-9", "--atol", "1e-11",
        "--points", "5", "--velocity", "B.y=-2", "--backend", "numpy", "--emission", "unrolled", "-o", "out/here",
    )  # fmt: skip
    assert said.code == 0 and said.err == ""
    record = json.loads(said.out)
    assert (record["name"], record["dof"], record["duration"]) == ("mine", 1, 0.2)
    assert (record["backend"], record["integrator"]) == ("numpy", "adams")
    assert set(record["outputs"]) == ARTEFACTS | sources("mine")
    assert written() == {"mine.py"} | {f"out/here/{name}" for name in record["outputs"]}
    with np.load("out/here/trajectory.npz") as archive:
        assert archive["t"] == pytest.approx(np.linspace(0, 0.2, 5))
        assert archive["qd"][0] == pytest.approx([0, -2], abs=1e-15)


def test_run_without_files(ncgen_main, mine, written):
    said = ncgen_main("run", "mine.py", "--json", "--no-files")
    assert said.code == 0
    assert json.loads(said.out)["outputs"] == []
    assert written() == {"mine.py"}


def test_run_for_people(ncgen_main, mine):
    """The mechanism, the kernels with their times, the motion's end and the files, on standard output alone."""
    said = ncgen_main("run", "mine.py")
    assert said.code == 0 and said.err == ""
    expected = ["2 free · 1 constraint,", "1 degree of freedom\n", "ns per call (c)", "B.y", "constraint error", "written to mine-output:"]
    assert [words for words in expected if words not in said.out] == []


def test_run_twice_gives_the_same_files(ncgen_main, mine):
    """Trajectory and sources repeat byte by byte; a folder that is there is written over."""

    def contents():
        assert ncgen_main("run", "mine.py", "--json").code == 0
        found = [path for path in Path("mine-output").rglob("*") if path.suffix in (".csv", ".c", ".py", ".html")]
        return {path.name: path.read_bytes() for path in found}

    assert contents() == contents()


# -- generate and cache -------------------------------------------------------------------------


@pytest.mark.skipif(not GENERATED.is_dir(), reason="the committed sources are not in this distribution")
@pytest.mark.parametrize("name", ["robot", "fourbar", "pendulum"])
def test_generate_repeats_the_committed_sources(ncgen_main, folder, name):
    """The same bytes as generated/: no date, no path, no hash order."""
    said = ncgen_main("generate", name)
    assert said.code == 0 and said.err == ""
    fresh = {path.name: path.read_bytes() for path in (folder / "generated" / name).iterdir()}
    committed = {path.name: path.read_bytes() for path in (GENERATED / name).iterdir() if path.is_file()}
    assert fresh == committed
    assert sorted(Path(line).name for line in said.out.split()) == sorted(fresh)


def test_all_examples_are_committed():
    if not GENERATED.is_dir():
        pytest.skip("the committed sources are not in this distribution")
    examples = {path.parent.name for path in (ROOT / "examples").glob("*/model.py")}
    assert {path.name for path in GENERATED.iterdir()} == examples


def test_generate_where_it_is_told(ncgen_main, mine, written):
    said = ncgen_main("generate", "mine.py", "--output", "code", "--emission", "tabled")
    assert said.code == 0
    assert written() == {"mine.py"} | {f"code/{Path(name).name}" for name in sources("mine")}
    assert sorted(said.out.split()) == sorted(f"code/{Path(name).name}" for name in sources("mine"))


def test_cache(ncgen_main, mine, monkeypatch, written):
    """Empty, then the model and the runtime, kept by a second run, then none. What is not the cache's own stays."""
    from ncgen.mechanism import runtime_library

    runtime_library.runtime_of.cache_clear()  # as in a new process: the runtime is looked for in this cache, too
    monkeypatch.setattr(runtime_library, "FLAGS", ("-std=c99", "-O0", "-fPIC", "-shared"))  # however it is compiled
    monkeypatch.setenv("NCGEN_CACHE_DIR", "store")
    assert "0 libraries" in ncgen_main("cache").out
    for _ in range(2):
        assert ncgen_main("run", "mine.py", "--no-files", "--json", "--backend", "c").code == 0
        said = ncgen_main("cache")
        assert "2 libraries" in said.out and "mine.c" in said.out and "ncgen_run.c" in said.out
    Path("store/notes.txt").write_text("mine")
    Path("store/folder").mkdir()
    said = ncgen_main("cache", "--clear")
    assert said.code == 0 and said.out.startswith("2 libraries removed")
    assert "0 libraries" in ncgen_main("cache").out
    assert written() == {"mine.py", "store/notes.txt"}
    assert Path("store/folder").is_dir()
    runtime_library.runtime_of.cache_clear()


def test_help_names_every_command(ncgen_main):
    said = ncgen_main("--help")
    assert said.code == 0
    assert all(f" {command} " in said.out for command in ("list", "inspect", "generate", "run", "cache"))
