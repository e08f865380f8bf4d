"""What a mistyped text was meant to be: one suggestion, which is right when it is taken."""

from __future__ import annotations

import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.grammar import parse_expression
from ncgen.exchange.toml_reader import read_toml
from ncgen.exchange.words import signature_of, words

KNOWN = ("t", "k", "psi1", "B.x")

MEANT = {
    "10 t": "10*t",
    "2t": "2*t",
    "2 sin(t)": "2*sin(t)",
    "2 sin (t)": "2*sin(t)",
    "sin t": "sin(t)",
    "k psi1": "k*psi1",
    "2 k B.x": "2*k*B.x",
    "3 (t + 1)": "3*(t + 1)",
    "3(t + 1)": "3*(t + 1)",
    "B.x^2": "B.x**2",
    "2,5": "2.5",
    "1.5e3 t": "1.5e3*t",
}


@pytest.mark.parametrize("text", MEANT)
def test_an_expression_is_suggested(text):
    with pytest.raises(ModelError) as refused:
        parse_expression(text, KNOWN)
    assert str(refused.value).endswith(f"; write {MEANT[text]}")
    parse_expression(MEANT[text], KNOWN)


@pytest.mark.parametrize("text", ["2 kg", "-1.5 m", "3 N*m", "90 deg", ".5 s"])
def test_a_unit_is_called_a_unit(text):
    with pytest.raises(ModelError, match="has a unit; give the bare number"):
        parse_expression(text, KNOWN)


def test_a_name_of_the_model_is_no_unit():
    with pytest.raises(ModelError, match=r"is not an expression; write 2\*m$"):
        parse_expression("2 m", ("m",))


REST = """colour = 3
gravity = 9.81
[[joint]]
name = "x"
[[point]]
name = "A"
position = [0, 0]
fixed = 3
[[body]]
name = "b"
points = ["Q"]
mass = 1
"""


@pytest.mark.parametrize("head", ['name = "4 bar!"\n', "name = 4\n", 'name = "bar"\nscale = 7\n', ""])
def test_a_bad_head_hides_nothing(tmp_path, head):
    """All problems of the rest are found, with their lines, as in a file whose head is right."""
    path = tmp_path / "bar.toml"

    def found(begin: str) -> list[tuple[int, str]]:
        path.write_text(begin + REST, encoding="utf-8")
        return [(problem.line - begin.count("\n"), problem.message) for problem in read_toml(path)[1]]

    right = found('name = "bar"\n')
    assert len(right) == 5
    several = found(head)
    assert len(several) == 6 and set(right) <= set(several)


def test_gravity_takes_one_attempt(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text('name = "bar"\ngravity = 9.81\n', encoding="utf-8")
    (problem,) = read_toml(path)[1]
    assert (problem.line, problem.message.split(";")[0]) == (2, "gravity: 9.81 given")
    path.write_text(f'name = "bar"\ngravity = {problem.message.split("example ")[1].split(" in the plane")[0]}\n', encoding="utf-8")
    assert read_toml(path)[1] == []


@pytest.mark.parametrize(
    "word, meant",
    [("joint", "revolute"), ("hinge", "revolute"), ("weld", "rigid"), ("damper", "spring"), ("motor", "drive"), ("link", "body")],
)
def test_a_word_of_other_programs(tmp_path, word, meant):
    path = tmp_path / "bar.toml"
    path.write_text(f'name = "bar"\n[[{word}]]\nname = "x"\n', encoding="utf-8")
    (problem,) = read_toml(path)[1]
    assert problem.message.startswith(f"[[{word}]]: unknown; did you mean ") and meant in problem.message
    named = problem.message.rpartition("did you mean ")[2].removeprefix("one of ").rstrip("?").split(", ")
    assert set(named) <= set(words()) and all(signature_of(each) for each in named)


@pytest.mark.parametrize("name, meant", [("forbar", "fourbar"), ("pendlum", "pendulum"), ("slider", "slidercrank"), ("Robot", "robot")])
def test_an_example_is_suggested(name, meant):
    with pytest.raises(
        ModelError, match=f"^{name}: there is no such file or example; did you mean {meant}.? `ncgen list` shows all examples"
    ):
        ncgen.load(name)
    with pytest.raises(ModelError, match="the examples are andrews, "):
        ncgen.load("qqq")
