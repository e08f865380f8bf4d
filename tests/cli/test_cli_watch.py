"""`ncgen watch`: every save is seen once, whatever way the editor writes, and what is different is told."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path

import pytest

from ncgen.cli.watching import Saved, _blocks, _ender
from ncgen.exchange.first_model import start_text
from ncgen.report.rounds import Round, check_and_run, differences, summary_of
from ncgen.report.saves import MAX_MISSED_POLLS, POLL_SECONDS, saves


class Enough(Exception):
    """The script of a test is at its end."""


def heard(path: Path, *deeds) -> list[bool]:
    """What `saves` says while a deed is done between every two looks; None is no deed."""
    waiting, said = iter(deeds), []

    def wait(seconds: float) -> None:
        assert seconds == POLL_SECONDS
        try:
            deed = next(waiting)
        except StopIteration:
            raise Enough from None
        if deed:
            deed()

    with pytest.raises(Enough):
        for is_there in islice(saves(path, wait), 20):
            said.append(is_there)
    return said


def test_a_save_is_told_when_it_is_whole(tmp_path):
    """The first content, then one that is written in three pieces: two things to be told and no piece."""
    path = tmp_path / "m.toml"
    path.write_text("a")
    pieces = [lambda text=text: path.write_text(text) for text in ("b", "bc", "bcd")]
    assert heard(path, None, None) == [True]
    assert heard(path, None, None, *pieces, None, None, None) == [True, True]


def test_a_save_of_the_same_is_none(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text("a")
    assert heard(path, None, None, lambda: path.write_text("a"), None, None, None) == [True]


def test_another_file_in_its_place(tmp_path):
    """An editor that writes beside the file and renames, with a moment in which there is none."""
    path, other = tmp_path / "m.toml", tmp_path / "m.toml~"
    path.write_text("a")
    other.write_text("b")
    assert heard(path, None, path.unlink, None, lambda: other.rename(path), None, None, None) == [True, True]


def test_a_file_that_is_taken_away_and_comes_back(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text("a")
    said = heard(path, None, path.unlink, *[None] * (MAX_MISSED_POLLS + 3), lambda: path.write_text("a"), None, None, None)
    assert said == [True, False, True]


def test_a_run_ends_where_the_file_is_saved(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text("a")
    go_on = _ender(path)
    go_on(0.0)
    path.write_text("b")
    with pytest.raises(Saved):
        go_on(0.1)


def record(**other) -> dict:
    ends = {"final_position": {"psi": 1.5}, "final_velocity": {"psi": 0.0}, "duration": 2.0, "wall_seconds": 0.01}
    counts = {"name": "m", "dof": 1, "constraints": 4, "redundant": 0, "bodies": 3}
    return counts | ends | {"energy_drift": 1e-9, "constraint_violation": 1e-12, "integrator": "i", "formalism": "f"} | other


def test_differences():
    assert differences(record(), record(wall_seconds=9.0, energy_drift=2e-9)) == []
    assert differences(record(), record(constraints=5, duration=3.0)) == ["constraints 4 → 5", "seconds 2 → 3"]
    assert differences(record(), record(final_position={"psi": 1.75})) == ["psi 1.5 → 1.75"]
    assert differences(record(), record(name="n", final_position={"s": 1.5})) == ["name m → n", "psi 1.5 → none", "s none → 1.5"]


def test_what_is_told_stays_short():
    """Six numbers of many, six problems of many."""
    many = {f"q{k}": float(k) for k in range(40)}
    lines = summary_of(Round((), record(final_position=many, final_velocity=many)), Round((), record()))
    assert len(lines) == 4 and "q5 5 and 74 more" in lines[1]
    assert summary_of(Round(tuple(f"problem {k}" for k in range(40))), None)[-1] == "and 34 more; `ncgen check` lists all"


@pytest.mark.filterwarnings("ignore:no C compiler")
def test_blocks(tmp_path, monkeypatch):
    """Run, wrong, right again with another number, gone: what is different is told beside the last one that ran."""
    monkeypatch.setattr("ncgen.toolchain.compilers.find_compilers", lambda: iter(()))  # nothing is to be waited for
    path = tmp_path / "mine.toml"
    text = start_text(path.name).replace("duration = 2.0", "duration = 0.01")

    def script():
        for content in (text, text.replace('"B - A"', '"B - Q"'), text.replace("duration = 0.01", "duration = 0.02")):
            path.write_text(content, encoding="utf-8")
            yield True
        yield False

    first, wrong, other, gone = _blocks(path, script())
    assert first[0] == "mine: 1 degree of freedom, 4 constraints, 0 redundant, 3 bodies" and len(first) == 3
    line = text.splitlines().index('end = "B - A"') + 1
    assert wrong == [f"mine.toml, line {line}: angle.end: “B - Q”: there is no point or vector Q; define it first"]
    assert other[-1].startswith("different: seconds 0.01 → 0.02, psi 0.1") and len(other) == 4
    assert gone == [f"{path}: the file is gone; waiting for it"]


def test_a_python_file_that_fails(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("def build():\n    return 1 / 0\n")
    assert check_and_run(path).problems == ("mine.py, line 2: ZeroDivisionError: division by zero",)


def test_no_such_file(ncgen_main, folder):
    said = ncgen_main("watch", "none.toml")
    assert (said.code, said.out, said.err) == (2, "", "ncgen: none.toml: there is no such file\n")


def test_ctrl_c_ends_it(tmp_path):
    """As a program of its own: one block, then the signal, then one line."""
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\nnonsense = 1\n')
    command = [sys.executable, "-m", "ncgen", "watch", "mine.toml"]
    heard = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731  who runs the tests in the background ignores it
    with subprocess.Popen(
        command, cwd=tmp_path, env=dict(os.environ), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=heard
    ) as process:
        assert process.stdout and "mine.toml, line 2: nonsense: unknown" in process.stdout.readline()
        time.sleep(POLL_SECONDS)
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()  # one that does not end would be waited for
    assert (process.returncode, out, err) == (130, "", "ncgen: stopped watching mine.toml\n")
