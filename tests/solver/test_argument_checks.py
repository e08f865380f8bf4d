"""Positions, parameters and names, as callers give them."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.solver.argument_checks import names_of, parameters, position


@pytest.fixture(scope="module")
def slider():
    """A mass on a spring and a damper, k and c of which are parameters."""
    m = ncgen.Model("slider")
    k, c = m.parameter("k", 3.0), m.parameter("c", 0.5)
    wall, mass = m.point("wall", (0, 0, 0), fixed=True), m.point("M", (1, 0, 0), fixed="yz")
    m.body("block", points=[mass], mass=2.0)
    m.spring(wall, mass, stiffness=k, damping=c, free_length=1.0)
    return ncgen.compile(m, backend="numpy")


@pytest.mark.parametrize(
    "given", [None, [3.0, 0.5], (3, 0.5), np.array([3, 0.5]), {}, {"k": 3}, {"c": np.float64(0.5)}, {"k": np.array(3.0)}]
)
def test_parameters_are_taken_by_name_or_in_order(slider, given):
    assert parameters(slider, given).tolist() == [3.0, 0.5]


def test_parameters_not_named_keep_their_defaults(slider):
    assert parameters(slider, {"c": 7}).tolist() == [3.0, 7.0]


def test_what_comes_out_is_the_callers_own(slider):
    """Changing it changes neither the defaults nor what was given."""
    mine = np.array([1.0, 2.0])
    for given in (None, mine):
        parameters(slider, given)[0] = 99.0
    position(slider)[0] = 99.0
    assert slider.p0.tolist() == [3.0, 0.5] and mine.tolist() == [1.0, 2.0] and slider.q0.tolist() == [1.0]


@pytest.mark.parametrize(
    "given, sentence",
    [
        ({"kk": 1}, "p: the mechanism has no parameter kk; it has k, c"),
        ({3: 1}, "p: the mechanism has no parameter 3; it has k, c"),
        ([1, 2, 3], "p: 3 numbers given, 2 needed: k, c"),
        ([1], "p: 1 number given, 2 needed: k, c"),
        (1.0, "p: an array of shape () given, 2 needed: k, c"),
        ([np.nan, 1], "p: k is nan; it must be a finite number"),
        ({"k": float("inf")}, "p: k is inf; it must be a finite number"),
        ({"k": "1"}, "p: k is '1'; it must be a finite number"),
        ({"k": 10**400}, "it must be a finite number"),
        (["1", "2"], "p: ['1', '2'] given, 2 needed: k, c"),
        ("ab", "p: ab given, 2 needed: k, c"),
        ([1j, 2], "p: [1j, 2] given, 2 needed: k, c"),
        ([[1], [1, 2]], "2 needed: k, c"),
        ("x" * 4000, "2 needed: k, c"),
    ],
)
def test_wrong_parameters_get_a_line(slider, given, sentence):
    with pytest.raises(ModelError) as caught:
        parameters(slider, given)
    assert sentence in str(caught.value) and len(str(caught.value)) <= 300 and "\n" not in str(caught.value)


def test_positions_are_taken_the_same_way(slider):
    assert position(slider).tolist() == [1.0] and position(slider, {"M.x": 2}).tolist() == [2.0] and position(slider, [3]).tolist() == [3.0]
    with pytest.raises(ModelError, match="^q: 3 numbers given, 1 needed: M.x$"):
        position(slider, [1, 2, 3])
    with pytest.raises(ModelError, match="^q0: M.x is nan; it must be a finite number$"):
        position(slider, [np.nan], label="q0")


def test_many_names_are_not_all_listed():
    kernels = ncgen.compile(ncgen.load("robot"), backend="numpy")
    with pytest.raises(ModelError, match=r"^q: the mechanism has no free coordinate psi9; did you mean psi\d\?$"):
        position(kernels, {"psi9": 1.0})
    with pytest.raises(ModelError, match=r"^q: 2 numbers given, 36 needed: .*, … \(36 of them\)$") as caught:
        position(kernels, [1, 2])
    assert len(str(caught.value)) <= 300


@pytest.mark.parametrize("thing", ["slider", None, 3, ncgen.Model("bare")])
def test_what_is_no_kernels_is_refused_with_the_remedy(thing):
    with pytest.raises(ModelError, match=r"^kernels needed, .* given; ncgen.compile\(model\) makes them$"):
        parameters(thing)


def test_one_name_is_one_name():
    assert names_of("psi", "z") == ("psi",)
    assert names_of(None, "z") == ()
    assert names_of(["a", "b"], "z") == names_of(np.array(["a", "b"]), "z") == names_of({"a": 1, "b": 2}, "z") == ("a", "b")


@pytest.mark.parametrize(
    "given, sentence",
    [
        (3, "z: 3 is no name; give one name or a list of names"),
        ([None], "z: None is no name; give one name or a list of names"),
        (["a", "a"], "z: a is named twice; name it once"),
        ("c", "z: the mechanism has no free coordinate c; it has a, b"),
    ],
)
def test_wrong_names_get_a_line(given, sentence):
    with pytest.raises(ModelError) as caught:
        names_of(given, "z", ("a", "b"))
    assert str(caught.value) == sentence
