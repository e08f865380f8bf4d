"""Bad input at the command line: one line on standard error, an exit code, no traceback, and nothing written."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

HEAD = """
from ncgen import Model


def build():
    m = Model("bad")
    A = m.point("A", (0, 0), fixed=True)
"""

FILES = {
    "syntax": "x = 1\n\ndef build(:\n    pass\n",
    "fails": "def build():\n    return 1 / 0\n",
    "nobuild": "x = 1\n",
    "nothing": "def build():\n    pass\n",
    "open": HEAD
    + '    B, D = m.point("B", (1, 0.2)), m.point("D", (3, 0), fixed=True)\n'
    + '    m.body("b", [B], mass=1.0)\n    m.distance(A, B, 1.0)\n    m.distance(B, D, 1.5)\n    return m\n',
    "singular": HEAD
    + '    B, D = m.point("B", (1, 0)), m.point("D", (2, 0), fixed=True)\n'
    + '    m.body("b", [B], mass=1.0)\n    m.distance(A, B)\n    m.distance(B, D)\n    return m\n',
    "nan": HEAD + '    m.point("B", (float("nan"), 0))\n    return m\n',
    "massless": HEAD + '    B = m.point("B", (1, 0))\n    m.distance(A, B)\n    return m\n',
    "code": """
from ncgen import Model


def build():
    P = [[0, 0, 0, 1], [1, 0, 0, 4]]
    rows = [[1000, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 1.0], [1007, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 1.0]]
    return Model.from_tables(P, [], rows, fixed=[1, 2, 3])
""",
    "folder": "",
}

REFUSED = [
    # what is asked for, exit code, words of the message
    (("nosuch",), 2, ["nosuch", "the examples are "]),
    (("nosuch.py",), 2, ["nosuch.py: there is no such file"]),
    (("mine.txt",), 2, ["mine.txt"]),
    (("syntax.py",), 2, ["syntax.py, line 3: invalid syntax"]),
    (("fails.py",), 2, ["fails.py, line 2: ZeroDivisionError: division by zero"]),
    (("nobuild.py",), 2, ["nobuild.py: it has no function build()"]),
    (("nothing.py",), 2, ["nothing.py: build() returns NoneType"]),
    (("open.py",), 4, ["bad: the mechanism does not close", "distance B-D, user model"]),
    (("nan.py",), 2, ["nan.py, line 8: point B, x: nan is not a finite number"]),
    (("massless.py",), 4, ["bad: a motion of the mechanism has no inertia: "]),
    (("code.py",), 2, ["CONSTR row 2: code 1007 is unknown; the codes are 1000, 1001"]),
    (("mine.py", "--backend", "foo"), 2, ["backend 'foo' is unknown; choose one of auto, c, numpy"]),
    (("mine.py", "--integrator", "foo"), 2, ["integrator 'foo' is unknown; choose one of"]),
    (("mine.py", "--emission", "foo"), 2, ["emission 'foo' is unknown"]),
    (("mine.py", "--velocity", "B.y"), 2, ["--velocity B.y: write it as name=number"]),
    (("mine.py", "--velocity", "B.y=fast"), 2, ["--velocity B.y=fast: write it as name=number"]),
    (("mine.py", "--velocity", "A.x=1"), 2, ["--velocity A.x=1: the mechanism has no free coordinate A.x", "B.y"]),
    (("mine.py", "--duration", "-1"), 2, ["--duration: -1.0 given; it must be a positive number"]),
    (("mine.py", "--duration", "nan"), 2, ["--duration: nan given"]),
    (("mine.py", "--points", "1"), 2, ["--points: 1 given"]),
    (("mine.py", "--output", "mine.py"), 2, ["cannot be written", "choose another folder"]),
]


@pytest.fixture
def files(mine):
    """All the bad files beside a good one, in the current folder."""
    for name, text in FILES.items():
        (mine.parent / f"{name}.py").write_text(text, encoding="utf-8")
    (mine.parent / "mine.txt").write_text("text", encoding="utf-8")


def assert_refused(said, code, words):
    """One line on standard error that says these words; nothing on standard output."""
    assert said.code == code, said.err
    assert said.out == ""
    assert said.err.startswith("ncgen: ") and said.err.count("\n") == 1, said.err
    assert "Traceback" not in said.err
    assert all(word in said.err for word in words), said.err


@pytest.mark.parametrize(("arguments", "code", "words"), REFUSED, ids=[" ".join(arguments) for arguments, _, _ in REFUSED])
def test_refused(ncgen_main, files, written, arguments, code, words):
    before = written()
    assert_refused(ncgen_main("run", *arguments, "--json"), code, words)
    assert written() == before


@pytest.mark.parametrize("command", ["inspect", "generate"])
def test_other_commands_refuse_alike(ncgen_main, files, written, command):
    before = written()
    assert_refused(ncgen_main(command, "code.py"), 2, ["CONSTR row 2: code 1007 is unknown"])
    assert written() == before


def test_missing_compiler(ncgen_main, mine, monkeypatch):
    """CC names a program that does not exist: said so, and no other is taken, whatever else could compile."""
    monkeypatch.setenv("CC", "no-such-compiler -O3")
    assert_refused(ncgen_main("run", "mine.py", "--json", "--backend", "c"), 3, ["CC=no-such-compiler -O3: there is no such program"])
    said = ncgen_main("run", "mine.py", "--json", "--no-files")
    assert said.code == 0 and json.loads(said.out)["backend"] == "numpy"
    assert said.err.startswith("ncgen: CC=no-such-compiler -O3: there is no such program") and said.err.count("\n") == 1


def test_numpy_needs_no_compiler(ncgen_main, mine, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    said = ncgen_main("run", "mine.py", "--json", "--no-files", "--backend", "numpy")
    assert said.code == 0 and json.loads(said.out)["backend"] == "numpy"


def test_no_compiler_at_all(ncgen_main, mine, monkeypatch):
    """One line says that NumPy is used instead; asked for C by name, it is an error."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("ncgen.toolchain.compilers.find_compilers", lambda: iter(()))
    said = ncgen_main("run", "mine.py", "--json", "--no-files")
    assert said.code == 0 and json.loads(said.out)["backend"] == "numpy"
    assert said.err.startswith("ncgen: no C compiler found") and said.err.count("\n") == 1
    assert_refused(ncgen_main("run", "mine.py", "--json", "--backend", "c"), 3, ["no C compiler found"])


def test_a_compiler_that_refuses(ncgen_main, mine, monkeypatch, folder):
    """Its own words follow the one line; nothing compiled stays in the cache, only what was generated."""
    compiler = folder / "grumpy"
    compiler.write_text("#!/bin/sh\necho 'error: not today' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(folder / "store"))
    said = ncgen_main("run", "mine.py", "--json", "--backend", "c")
    assert said.code == 3 and said.out == ""
    first, *rest = said.err.splitlines()
    assert first.startswith("ncgen: ") and "refused the generated C: error: not today" in first
    assert rest == ["error: not today"]
    assert [entry.name for entry in (folder / "store").iterdir()] == ["programs"]
    said = ncgen_main("run", "mine.py", "--json", "--no-files")
    assert said.code == 0 and json.loads(said.out)["backend"] == "numpy"
    assert "error: not today; the NumPy backend is used" in said.err and said.err.count("\n") == 1


def test_a_cache_that_cannot_be_written(ncgen_main, mine, monkeypatch, folder):
    """A file stands where the cache's folder should: said once, and nothing else is different."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(mine / "cache"))
    said = ncgen_main("run", "mine.py", "--json", "--no-files")
    assert said.code == 0 and json.loads(said.out)["backend"] == "c" and said.err.count("\n") == 1
    assert all(word in said.err for word in ("cache folder", "cannot be written", "NCGEN_CACHE_DIR"))
    for arguments in (("cache",), ("cache", "--clear")):
        said = ncgen_main(*arguments)
        assert said.code == 0 and "0 libraries" in said.out


USAGE = [(), ("frobnicate",), ("run",), ("run", "mine.py", "--nope"), ("run", "mine.py", "--duration", "abc")]


@pytest.mark.parametrize("arguments", USAGE, ids=" ".join)
def test_usage(ncgen_main, mine, written, arguments):
    """What the option parser refuses is one line as everything else; without any words there is help."""
    said = ncgen_main(*arguments)
    if arguments:
        command = "ncgen run" if arguments[0] == "run" else "ncgen"
        words = {("run",): "'MODEL'", ("run", "mine.py", "--duration", "abc"): "--duration"}.get(arguments, arguments[-1])
        assert_refused(said, 2, [words, f"`{command} --help` lists what there is"])
    else:
        assert said.code == 2 and "Usage: ncgen" in said.out + said.err
    assert written() == {"mine.py"}


ROBOTS = [
    (("run", "--floating"), "mine.py: --floating is for a robot's file"),
    (("convert", "--fixed"), "mine.py: --fixed is for a robot's file"),
    (("generate", "--with", "limits"), "mine.py: --with limits is for a robot's file"),
    (("inspect", "--parameters", "inertia"), "mine.py: --parameters is for a robot's file"),
    (("inspect", "--loops", "loops.toml"), "mine.py: --loops is for a robot's file"),
    (("export", "--to", "c", "--frame", "tool"), "mine.py: --frame tool is for a robot's file"),
    (("export", "--to", "c", "--platform", "win64"), "--platform win64: c is written as sources"),
]


@pytest.mark.parametrize("arguments, words", ROBOTS, ids=[" ".join(arguments) for arguments, _ in ROBOTS])
def test_every_command_names_the_option(ncgen_main, mine, arguments, words):
    command, *options = arguments
    assert_refused(ncgen_main(command, "mine.py", *options), 2, [f"ncgen: {words}"])


@pytest.mark.parametrize("name", ["out.yaml", "out.py", "out"])
def test_a_file_whose_ending_says_something_else(ncgen_main, mine, written, name):
    words = f"--output {name}: choose a name that ends in .toml, .urdf, .sdf, .xml or .mjcf"
    assert_refused(ncgen_main("convert", "mine.py", "-o", name), 2, [words])
    assert_refused(ncgen_main("bench", "mine.py", "--html", name), 2, [f"--html {name}: choose a name that ends in .html or .htm"])
    assert written() == {"mine.py"}


def test_a_folder_is_made_for_a_model(ncgen_main, mine, written):
    assert ncgen_main("convert", "mine.py", "-o", "new/out.toml").code == 0
    assert written() == {"mine.py", "new/out.toml"}


def test_no_traceback_reaches_the_user(files, folder):
    """As a program of its own, with nothing around it that could catch a stray exception."""
    command = [sys.executable, "-m", "ncgen", "run", "syntax.py"]
    done = subprocess.run(command, cwd=folder, env=dict(os.environ), capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "ncgen: syntax.py, line 3: invalid syntax\n")


# -- what should be refused in one line, and is not yet -----------------------------------------

OPTIONS = ["duration='long'", "points='many'", "colour=1", "integrator=5"]
ARGUMENTS = [("--velocity", "B.y=nan"), ("--atol", "-1"), ("--rtol", "-1"), ("--atol", "nan")]


@pytest.mark.parametrize("options", OPTIONS)
def test_options_of_the_model(ncgen_main, mine, options):
    mine.write_text(mine.read_text().replace("duration=0.1", options))
    said = ncgen_main("run", "mine.py", "--json")
    assert_refused(said, 2, [options.split("=")[0]])


@pytest.mark.parametrize("arguments", ARGUMENTS, ids=" ".join)
def test_numbers_without_sense(ncgen_main, mine, arguments):
    assert_refused(ncgen_main("run", "mine.py", "--json", *arguments), 2, [])


@pytest.mark.parametrize("text", ["x = 1\ny = x / 0\n", "import ncgen\nncgen.Model(' ')\n"])
def test_a_file_that_fails_while_it_is_read(ncgen_main, folder, text):
    (folder / "early.py").write_text(text)
    assert_refused(ncgen_main("run", "early.py", "--json"), 2, ["early.py, line 2: "])


def test_nothing_is_left_beside_the_users_file(mine, folder):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-m", "ncgen", "run", "mine.py", "--no-files", "--backend", "numpy", "--json"]
    subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=True, timeout=60)
    assert [path.name for path in folder.iterdir()] == ["mine.py"]


def test_a_study_that_is_stopped_tells_of_no_folder_that_is_not_there(ncgen_main, folder, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("ncgen.studies.running.carry_out", interrupted)
    (folder / "asked.toml").write_text('model = "pendulum"\nkeep = ["B.x"]\n[vary]\n"start(rate(B.x))" = [1.0, 2.0]\n')
    assert "stopped; no results yet" in ncgen_main("study", "asked.toml").err
    (folder / "asked-study").mkdir()
    assert "stopped; results so far are in asked-study" in ncgen_main("study", "asked.toml").err
