"""`ncgen check`: the run that a file describes is refused with the line of the option, before anything moves."""

from __future__ import annotations

import pytest

MODEL = """name = "bob"
gravity = [0, -9.81, 0]
[[parameter]]
name = "k"
default = 2.0
[[point]]
name = "A"
position = [0, 0]
fixed = true
[[point]]
name = "B"
position = [1, 0]
[[body]]
name = "b"
points = ["B"]
mass = 1
[[distance]]
start = "A"
end = "B"
[simulation]
duration = 0.5
"""
LINE = MODEL.count("\n") + 1
"""Where the next line of the file stands."""

WRONG = {
    "duraton = 3": ["duraton: unknown", "duration"],
    "rtol = -1": ["rtol: -1 given; it must be a positive number"],
    "atol = 'fine'": ["atol: 'fine' given"],
    'integrator = "nope"': ["integrator 'nope' is unknown"],
    'formalism = "nope"': ["formalism 'nope' is unknown"],
    'points = "AB"': ["points: 'AB' given"],
    "points = 1": ["points: 1 given; a trajectory has at least 2"],
    'zd0 = { "A.x" = 1 }': ["zd0: the mechanism has no free coordinate A.x; it has B.x, B.y"],
    'zd0 = { "B.y" = nan }': ["zd0: B.y is nan"],
    'zd0 = { "B.y" = 1 }\nqd0 = { "B.y" = 1 }': ["zd0 and qd0 are both given"],
    'z = ["B.w"]': ["z: the mechanism has no free coordinate B.w"],
    "p = { nobody = 1 }": ["p: the mechanism has no parameter nobody; it has k"],
    'q0 = { "B.x" = "far" }': ["q0: B.x is 'far'"],
    't0 = "now"': ["t0 is 'now'"],
    'engine = "steam"': ["engine 'steam' is unknown"],
    "closing = 2": ["closing tolerance: 2 given"],
    'stop = { "B.w" = 0 }': ["stop at B.w: bob has no free coordinate B.w"],
    'integrator = "rk4"': ["max_step: rk4 has a fixed step"],
    'formalism = "lagrange"\nintegrator = "dopri5"\noptions = { beta = 1 }': ["option beta: lagrange with dopri5 has no such option"],
}
RIGHT = {
    'integrator = "rk4"\nmax_step = 0.01': 'integrator = "rk4"',
    'stop = { "B.y" = [-0.5, "falling"] }': "stop in a list",
    'zd0 = { "B.y" = 1 }\nz = ["B.y"]\np = { k = 3 }': "names",
    "max_step = inf": "no bound",
}


@pytest.fixture
def check(ncgen_main, folder):
    def call(text: str):
        (folder / "bob.toml").write_text(text, encoding="utf-8")
        return ncgen_main("check", "bob.toml")

    return call


@pytest.mark.parametrize("option", WRONG)
def test_a_run_that_cannot_be(check, written, option):
    """One problem on the option's line, exit code 2, and no second word about it; the last of several options is the one to blame."""
    said = check(MODEL + option + "\n")
    assert said.code == 2 and said.out == ""
    problem, total = said.err.splitlines()
    assert problem.startswith(f"bob.toml, line {LINE + option.count(chr(10))}: ") and len(problem) <= 300
    assert all(word in problem for word in WRONG[option])
    assert total == "ncgen: bob.toml: 1 problem"
    assert written() == {"bob.toml"}


@pytest.mark.parametrize("options", RIGHT)
def test_a_run_that_can_be(check, options):
    said = check(MODEL + options + "\n")
    assert (said.code, said.err) == (0, "") and said.out.startswith("bob.toml: ")


def test_all_options_at_once(check):
    """Every wrong option is told, in the order of the lines."""
    said = check(MODEL + 'rtol = -1\nformalism = "nope"\npoints = 0\n')
    assert [line.split(":")[0] for line in said.err.splitlines()] == [f"bob.toml, line {LINE + k}" for k in range(3)] + ["ncgen"]


def test_an_option_in_a_table_of_its_own(check):
    said = check(MODEL + 'points = 5\n[simulation.zd0]\n"B.w" = 1\n')
    assert said.code == 2 and said.err.startswith(f"bob.toml, line {LINE + 1}: zd0: the mechanism has no free coordinate B.w")


def test_mistakes_of_the_model_come_first(check):
    """While the model is wrong nothing is said about its run."""
    said = check(MODEL.replace('end = "B"', 'end = "Q"') + "rtol = -1\n")
    assert said.code == 2 and "no point Q" in said.err and "rtol" not in said.err
