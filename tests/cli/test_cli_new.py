"""`ncgen new`: a file to begin with, which runs, teaches, and is never written over another."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from ncgen.exchange.first_model import start_text
from ncgen.exchange.words import words


@pytest.fixture
def start(ncgen_main, folder):
    assert ncgen_main("new", "mechanism.toml").code == 0
    return folder / "mechanism.toml"


def test_it_is_accepted_and_runs(ncgen_main, start):
    said = ncgen_main("check", start.name)
    assert (said.code, said.err) == (0, "") and said.out == "mechanism.toml: 19 coordinates, 4 constraints, 3 bodies\n"
    said = ncgen_main("run", start.name, "--no-files", "--json", "--backend", "numpy", "--param", "load=3", "--stop", "psi=1.5,rising")
    record = json.loads(said.out)
    assert said.code == 0 and record["dof"] == 1 and record["stopped"]
    assert record["final_position"]["psi"] == pytest.approx(1.5, abs=1e-9) and record["energy_drift"] < 1e-6


def test_the_motor_in_its_comments(ncgen_main, start):
    """What is commented out works as it says: the crank turns twice a second, so after half a second it is where it began."""
    text = start.read_text(encoding="utf-8")
    text = re.sub(r"# (\[\[drive\]\]\n)# (.*\n)# (.*\n)", r"\1\2\3", text).replace("zd0 = { psi = 12.0 }\n", "").replace("2.0\n", "0.5\n")
    start.write_text(text, encoding="utf-8")
    assert "\n[[drive]]\n" in text and ncgen_main("check", start.name).code == 0
    from ncgen import compile, load, simulate

    run = simulate(compile(load(start), "numpy"), 0.5, points=2)
    assert run["psi"][-1] - run["psi"][0] == pytest.approx(2 * math.pi, abs=1e-9)
    assert run.point("C")[-1] == pytest.approx(run.point("C")[0], abs=1e-9)


def test_its_vocabulary_is_the_builders():
    """Every word of model files has its line, and there is no other."""
    headers = re.findall(r"^# \[\[(\w+)\]\] ", start_text("m.toml"), re.M)
    assert headers == list(words())


def test_a_file_that_is_there_stays(ncgen_main, folder, start):
    before = start.read_bytes()
    said = ncgen_main("new", start.name)
    assert said.code == 2 and said.out == "" and said.err.startswith("ncgen: mechanism.toml: the file exists; choose another name")
    assert start.read_bytes() == before and [path.name for path in folder.iterdir()] == ["mechanism.toml"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("model.py", ["model.py: a model file ends in .toml; write model.toml"]),
        ("4bar.toml", ["model name '4bar'", "begins with a letter"]),
        ("ncgen.toml", ["model name 'ncgen'"]),
    ],
)
def test_names_that_cannot_be(ncgen_main, folder, name, words):
    said = ncgen_main("new", name)
    assert said.code == 2 and all(word in said.err for word in words) and said.err.count("\n") == 1
    assert list(folder.iterdir()) == []


def test_what_to_type_next_can_be_typed(ncgen_main, folder):
    assert "`ncgen watch 'my bars/bar.toml'`" in ncgen_main("new", "my bars/bar.toml").out


def test_a_name_with_a_hyphen_in_a_new_folder(ncgen_main, folder):
    assert ncgen_main("new", "a/my-bar.toml").code == 0
    assert 'name = "my_bar"' in Path("a/my-bar.toml").read_text(encoding="utf-8")
