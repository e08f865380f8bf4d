"""Results in the hand: names, equality, and what they say of themselves."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

PACKAGE = Path(ncgen.__file__).parent


def test_a_trajectory_has_names(turning):
    """It is gone through like a dictionary of histories."""
    assert "psi" in turning and "rate(psi)" in turning
    assert "phi" not in turning and "rate(phi)" not in turning and 3 not in turning and ["psi"] not in turning
    assert list(turning) == list(turning.keys()) == ["B.x", "B.y", "C.x", "C.y", "psi"]
    assert len(turning) == 5
    assert np.array_equal(dict(turning)["psi"], turning["psi"])


@pytest.mark.parametrize(
    "asked, sentence",
    [
        (3, "fourbar: a coordinate is asked for by its name, not by 3; instants are rows of run.t, run.q, run.qd"),
        (["psi"], "fourbar: a coordinate is asked for by its name, not by ['psi']; instants are rows of run.t, run.q, run.qd"),
        ("nope", "fourbar has no free coordinate nope; it has B.x, B.y, C.x, C.y, psi"),
        ("rate(psy)", "fourbar has no free coordinate psy; it has B.x, B.y, C.x, C.y, psi"),
        ("B", "fourbar: B is a point of three coordinates, B.x and others; run.point('B') has them all"),
        ("x" * 4000, "fourbar has no free coordinate " + "x" * 39 + "…; it has B.x, B.y, C.x, C.y, psi"),
    ],
)
def test_what_it_does_not_have_is_said_in_a_line(turning, asked, sentence):
    with pytest.raises(ModelError) as caught:
        turning[asked]
    assert str(caught.value) == sentence


def test_among_many_names_the_nearest_is_offered(spatial):
    with pytest.raises(ModelError, match=r"^robot has no free coordinate psi_1; did you mean psi1\?$"):
        spatial["psi_1"]
    with pytest.raises(ModelError, match=r"^robot has no point psi1; it has r1, r2"):
        spatial.point("psi1")


def test_a_trajectory_is_equal_to_itself_alone(turning):
    """Comparison of arrays has no truth value; a copy is another motion."""
    assert turning == turning and turning != replace(turning) and turning != 3
    assert {turning: "kept"}[turning] == "kept"


def test_a_trajectory_says_in_a_line_what_it_is(turning):
    assert repr(turning) == "<Trajectory fourbar: 21 instants from 0 to 1 s, 5 coordinates, coordinate-partitioning, dop853>"


def test_results_say_in_a_line_what_they_are(fourbar, turning):
    results = [ncgen.equilibrium(fourbar), ncgen.freedom(fourbar), ncgen.inverse_dynamics(turning), turning.reactions()]
    results += [ncgen.solve_position(fourbar, fourbar.q0)]
    for result in results:
        assert len(repr(result)) < 200 and "\n" not in repr(result) and type(result).__name__ in repr(result)


def array_classes():
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ClassDef):
                continue
            fields = [ast.unparse(f.annotation) for f in node.body if isinstance(f, ast.AnnAssign)]
            if any("ndarray" in f and "Callable" not in f for f in fields):
                yield node.name, [ast.unparse(d) for d in node.decorator_list]


def test_what_holds_arrays_compares_by_identity():
    """Arrays compare element by element, so that an equality made of them raises."""
    classes = list(array_classes())
    compared = [
        name for name, decorators in classes for d in decorators if d.startswith("dataclass") and "frozen=True" in d and "eq=False" not in d
    ]
    assert len(classes) > 30 and not compared
