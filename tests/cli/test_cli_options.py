"""What stands behind a command: numbers by name, methods, the version, and what the shell is told while it is typed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import ncgen
from ncgen.comparisons.hard_cases import CASES
from ncgen.errors import ModelError
from ncgen.exchange.toml_writer import to_toml
from ncgen.methods.table import FORMALISMS, INTEGRATORS

SPRING = """
from ncgen import Model


def build():
    m = Model("swing")
    k, c = m.parameter("k", 100.0, "N/m"), m.parameter("c", 0.0, "N s/m")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (1, 0), fixed="yz")
    m.body("bob", points=[B], mass=1.0)
    m.spring(A, B, stiffness=k, damping=c, free_length=0.5)
    m.simulation(duration=0.1, p=P)
    return m
"""


@pytest.fixture
def swing(folder):
    """A mass on a spring, whose own simulation says `P`."""

    def write(own: str = "None") -> str:
        Path("swing.py").write_text(SPRING.replace("P)", f"{own})"), encoding="utf-8")
        return "swing.py"

    return write


def end(ncgen_main, *arguments) -> float:
    said = ncgen_main("run", *arguments, "--no-files", "--json")
    assert said.code == 0, said.err
    return json.loads(said.out)["final_position"]["B.x"]


def swung(k: float, t: float = 0.1) -> float:
    """x at t of a unit mass at rest at 1 on a spring of stiffness k without length beyond 0.5."""
    import math

    return 0.5 + 0.5 * math.cos(math.sqrt(k) * t)


def test_parameters(ncgen_main, swing):
    """What is typed goes before the model's own, which goes before defaults; by name and in order."""
    assert end(ncgen_main, swing(), "--param", "k=400") == pytest.approx(swung(400), abs=1e-7)
    damped = end(ncgen_main, swing("{'c': 20.0}"))
    assert abs(damped - swung(100)) > 1e-2
    assert end(ncgen_main, swing("{'c': 20.0}"), "--param", "k=100") == pytest.approx(damped, abs=1e-9)
    assert end(ncgen_main, swing("[7.0, 20.0]"), "--param", "k=400", "--param", "c=0") == pytest.approx(swung(400), abs=1e-7)


def test_methods(ncgen_main, swing):
    """Formalism, integrator, engine and step are those asked for."""
    methods = ("--formalism", "null-space", "--integrator", "rk4", "--max-step", "0.01", "--engine", "python")
    record = json.loads(ncgen_main("run", swing(), "--no-files", "--json", *methods).out)
    assert (record["formalism"], record["integrator"]) == ("null-space", "rk4")
    assert record["steps"] in (10, 11)  # the sum of ten steps may end an ulp before the run does
    assert record["engine"].startswith("python") and record["final_position"]["B.x"] == pytest.approx(swung(100), abs=1e-4)


def test_an_end(ncgen_main, swing):
    """A velocity's zero from below is half a period on; from above there is none before."""
    arguments = ("run", swing(), "--no-files", "--json", "--duration", "1", "--stop")
    record = json.loads(ncgen_main(*arguments, "rate(B.x)=0,rising").out)
    assert record["stopped"] and record["duration"] == pytest.approx(0.31415926535, abs=1e-7)
    assert not json.loads(ncgen_main(*arguments, "B.x=5").out)["stopped"]
    assert "ended by its stop" in ncgen_main("run", swing(), "--no-files", "--stop", "B.x=0.9").out


OPTION = {"p": "param", "zd0": "velocity", "stop": "stop"}
"""Options whose values are repeated in messages, by the argument; the last one that is typed is wrong."""

FORM = "write it as name=number, for example psi1=2.5"

REFUSED = [
    (("--param", "k"), {}, f"--param k: {FORM}"),
    (("--param", "k=stiff"), {}, f"--param k=stiff: {FORM}"),
    (("--param", "=3"), {}, f"--param =3: {FORM}"),
    (("--param", "k=1", "--param", "k=2"), {}, "--param k=2: k is given twice; give it once"),
    (("--stop", "B.x"), {}, f"--stop B.x: {FORM} or psi1=2.5,rising"),
    (("--param", "m=3"), {"p": {"m": 3.0}}, "p"),
    (("--param", "c=1", "--param", "k=nan"), {"p": {"c": 1.0, "k": float("nan")}}, "p"),
    (("--velocity", "B.x=1", "--velocity", "phi=12"), {"zd0": {"B.x": 1.0, "phi": 12.0}}, "zd0"),
    (("--stop", "B.q=1"), {"stop": {"B.q": 1.0}}, "stop at B.q"),
    (("--stop", "B.x=1,up"), {"stop": {"B.x": (1.0, "up")}}, "stop at B.x"),
    (("--stop", "B.x=nan"), {"stop": {"B.x": float("nan")}}, "stop at B.x"),
    (("--duration", "-1"), {"duration": -1.0}, "duration"),
    (("--points", "1"), {"points": 1}, "points"),
    (("--rtol", "-1"), {"rtol": -1.0}, "rtol"),
    (("--atol", "nan"), {"atol": float("nan")}, "atol"),
    (("--formalism", "newton"), {"formalism": "newton"}, "formalism"),
    (("--engine", "steam"), {"engine": "steam"}, "engine"),
    (("--number", "int"), {"number": "int"}, "number"),
    (("--max-step", "-1"), {"max_step": -1.0}, "max_step"),
    (("--integrator", "adams", "--engine", "c"), {"integrator": "adams", "engine": "c"}, "engine"),
    (("--max-step", "0", "--integrator", "rk4"), {"integrator": "rk4", "max_step": 0.0}, "max_step"),
]
"""Words of the command line, the arguments of `simulate` that they mean, and what begins the message of `simulate`, or the message."""


@pytest.mark.parametrize(("arguments", "options", "message"), REFUSED, ids=[" ".join(entry[0]) for entry in REFUSED])
def test_refused_before_anything_is_made(ncgen_main, swing, monkeypatch, arguments, options, message):
    """In the words of `ncgen.simulate`, but for the option in the place of the argument, and without generating."""
    path = swing()
    if options:
        with pytest.raises(ModelError) as refused:
            ncgen.simulate(ncgen.compile(ncgen.load(path), "numpy"), **{"duration": 0.1} | options)
        named = [word for word in arguments if word.startswith("--")].index(
            f"--{OPTION.get(message.split()[0], message).replace('_', '-')}"
        )
        said = str(refused.value)
        assert said.startswith(message)
        shown = " ".join(arguments[-2:]) if message.split()[0] in OPTION else arguments[2 * named]
        message = shown + said.removeprefix(message)
    monkeypatch.setattr("ncgen.compiler.sources_of", lambda *_, **__: pytest.fail("something was generated"))
    said = ncgen_main("run", path, "--json", *arguments)
    assert (said.code, said.out, said.err) == (2, "", f"ncgen: {message}\n")


def test_version(ncgen_main):
    said = ncgen_main("--version")
    assert (said.code, said.out, said.err) == (0, f"ncgen {ncgen.__version__}\n", "")


# -- completion ----------------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def offered(folder, monkeypatch, capsys):
    """The shell's protocol: what is offered for a line whose last word is unfinished, [(word, what it is)]."""
    from ncgen import cli

    def ask(line: str) -> dict[str, str]:
        for name, value in {
            "_NCGEN_COMPLETE": "complete_fish",
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
            "_TYPER_COMPLETE_ARGS": line,
        }.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr("sys.argv", ["ncgen"])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code in (0, None)
        return dict(entry.partition("\t")[::2] for entry in capsys.readouterr().out.splitlines() if entry)

    return ask


def test_models_are_offered(offered):
    """Examples with what they teach, and the model files of the folder; for what is neither the shell looks itself."""
    for name in ("robin.toml", "roof.urdf", "rocks.txt"):
        Path(name).write_text("")
    found = offered("ncgen run ro")
    assert set(found) == {"robot", "robin.toml", "roof.urdf"} and found["robot"].startswith("The ")
    assert "fourbar" in offered("ncgen inspect ")
    assert offered("ncgen run some/") == offered("ncgen run nothing") == {}


def test_words_are_offered(offered):
    """From where they are defined, so that none is missing."""
    assert set(offered("ncgen run robot --integrator ")) == set(INTEGRATORS)
    formalisms = offered("ncgen run robot --formalism ")
    assert formalisms["lagrange"] == FORMALISMS["lagrange"].help and set(formalisms) == set(FORMALISMS)
    assert set(offered("ncgen run robot --engine ")) == {"auto", "compiled", "c", "emitted", "refined", "python"}
    assert set(offered("ncgen export robot --to fmu")) == {"fmu2", "fmu3"}
    assert set(offered("ncgen inspect robot --backend ")) == {"auto", "c", "numpy"}
    assert set(offered("ncgen hard --case ")) == set(CASES)
    assert {"run", "watch", "new"} <= set(offered("ncgen "))


def test_names_of_the_model_are_offered(offered):
    """Parameters, coordinates and their rates of the model that is named, but of no file that would have to be run."""
    assert set(offered("ncgen run pendulum --velocity ")) == {"B.x=", "B.y="}
    assert set(offered("ncgen run pendulum --rtol 1e-3 --stop rate")) == {"rate(B.x)=", "rate(B.y)="}
    text = to_toml(ncgen.load("pendulum")) + '[[parameter]]\nname = "k"\ndefault = 1.0\n'
    Path("mine.toml").write_text(text, encoding="utf-8")
    assert set(offered("ncgen run mine.toml --param ")) == {"k="}
    Path("mine.py").write_text("raise SystemExit('it was run')", encoding="utf-8")
    assert offered("ncgen run mine.py --param ") == offered("ncgen run nothing.toml --param ") == offered("ncgen run --param ") == {}


def test_completion_in_bash(folder):
    """As bash asks, of a program of its own, and the script that makes it ask."""
    environment = {**os.environ, "_NCGEN_COMPLETE": "complete_bash", "COMP_WORDS": "ncgen run slidercrank", "COMP_CWORD": "2"}
    code = "import sys; sys.argv = ['ncgen']; from ncgen.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["slidercrank", "slidercrank3d"]


STOPPED = """<robot name="bar"><link name="a"/>
<link name="b"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="0.01" iyy="0.3" izz="0.3"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/>
<limit lower="-0.4" upper="1.1" effort="1" velocity="1"/><dynamics friction="1.5"/></joint></robot>"""


@pytest.mark.parametrize(
    ("command", "times"), [(["inspect"], (1, 0)), (["inspect", "--json"], (0, 0)), (["run", "--no-files", "--duration", "0.1"], (1, 0)),
                           (["run", "--no-files", "--duration", "0.1", "--json"], (0, 1)), (["convert"], (0, 1))]
)  # fmt: skip
def test_what_a_robot_lacks_is_said_once(ncgen_main, folder, command, times):
    """In a list, apart from what does not change the motion and what the generator left out; where there is no list, in a warning."""
    Path("bar.urdf").write_text(STOPPED, encoding="utf-8")
    backend = () if command == ["convert"] else ("--backend", "numpy")
    said = ncgen_main(command[0], "bar.urdf", *command[1:], *backend)
    assert said.code == 0
    listed = "  of the file, not modelled, and it changes the motion: limits of joints (1), friction of joints (1), velocity limits (1)\n"
    warned = "ncgen: bar.urdf: 3 things that change the motion are not modelled, limits of joints first; "
    assert (said.out.count(listed), said.err.count(warned)) == times
    assert said.out.count("  of the file, without effect on the motion: effort limits (1)\n") == times[0]


def test_parameters_inertias_frames_and_loops_of_a_robot(ncgen_main, folder):
    """Where a robot's file is read; `convert` writes what was asked for as a model's parameters, inputs and outputs."""
    Path("bar.urdf").write_text(STOPPED, encoding="utf-8")
    asked = ncgen_main("convert", "bar.urdf", "--parameters", "b", "--parameters", "geometry", "--with", "motors", "--frame", "b").out
    for name in ("b.mass", "hinge.origin.x", "motor_hinge", "b.r33"):
        assert f'"{name}"' in asked
    Path("odd.urdf").write_text(STOPPED.replace('izz="0.3"', 'izz="3"'), encoding="utf-8")
    refused = ncgen_main("convert", "odd.urdf")
    assert refused.code == 2 and "inertia" in refused.err
    for word in ("as given", "as-given", "balanced"):
        assert ncgen_main("convert", "odd.urdf", "--inertias", word).code == 0
    for arguments, said in (
        (("--inertias", "guessed"), "inertias: 'guessed' given; give 'refused', 'balanced' or 'as given'"),
        (("--parameters", "leg"), "parameters: there is no link or joint 'leg'"),
        (("--frame", "leg"), "bar has no frame leg"),
        (("--loops", "none.toml"), "none.toml"),
    ):
        refused = ncgen_main("convert", "bar.urdf", *arguments)
        assert refused.code == 2 and said in refused.err


def test_stops_and_friction_of_a_robot(ncgen_main, folder):
    """What is asked for is no longer left out; a bar with a stop at −0.4 rad comes to rest there."""
    Path("bar.urdf").write_text(STOPPED, encoding="utf-8")
    left_out = json.loads(ncgen_main("inspect", "bar.urdf", "--with", "limits", "--json").out)["left_out"]
    assert left_out == [
        {"feature": what, "count": 1, "changes_motion": changes}
        for what, changes in (("friction of joints", True), ("effort limits", False), ("velocity limits", True))
    ]
    both = "--with", "limits", "--with", "friction"
    said = ncgen_main("run", "bar.urdf", *both, "--duration", "3", "--rtol", "1e-6", "--no-files", "--json")
    assert json.loads(said.out)["final_position"]["hinge"] == pytest.approx(-0.4, abs=2e-3)
    refused = ncgen_main("convert", "bar.urdf", "--with", "limit")
    said = "ncgen: --with limit: a robot can have limits, friction, motors, sensors, rigid-limits, exact-friction"
    assert refused.code == 2 and refused.err.strip() == said
    refused = ncgen_main("convert", "pendulum", "--with", "limits")
    assert refused.code == 2 and "limits is for a robot's file" in refused.err
