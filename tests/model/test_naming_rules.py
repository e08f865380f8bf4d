"""Names: what is one, which are the same, and which would mean something else."""

from __future__ import annotations

import keyword
import unicodedata

import numpy as np
import pytest

import ncgen
from ncgen import Model, ModelError

MICRO, MU = "\u00b5", "\u03bc"


class Scene:
    """A model that gives names to things of every kind."""

    def __init__(self):
        m = self.model = Model("scene")
        self.A, self.B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0))
        self.x, self.z = m.vector("ex", (1, 0, 0), fixed=True), m.vector("ez", (0, 0, 1), fixed=True)
        self.bar = m.body("bar", [self.A, self.B], [self.z])


CLAIMS = {
    "point": lambda s, name: s.model.point(name, (0, 1, 0)),
    "vector": lambda s, name: s.model.vector(name, (0, 1, 0)),
    "angle": lambda s, name: s.model.angle(name, s.x, s.B - s.A, s.z),
    "length": lambda s, name: s.model.length(name, s.A, s.B),
    "slide": lambda s, name: s.model.slide(name, s.A, s.B, s.x),
    "parameter": lambda s, name: s.model.parameter(name, 1.0),
    "body": lambda s, name: s.model.body(name),
    "attached point": lambda s, name: s.model.attach_point(s.bar, name, (0.5, 0, 0)),
    "attached vector": lambda s, name: s.model.attach_vector(s.bar, name, (0, 1, 0)),
}
SCALARS = ("angle", "length", "slide", "parameter")
NO_NAMES = [
    "class",
    "for",
    "None",
    "True",
    "and",
    "lambda",
    "a.class",
    "a..b",
    "a.",
    "a.1",
    "①",
    "²",
    "a b",
    "",
    "a-b",
    "x" * 501,
    "1a",
    None,
    3,
]


@pytest.mark.parametrize("kind", CLAIMS)
@pytest.mark.parametrize("name", NO_NAMES, ids=lambda name: repr(name)[:12])
def test_no_name(kind, name):
    """What no expression could mention is refused where it is claimed, in a line that says so."""
    with pytest.raises(ModelError, match=" name ") as refusal:
        CLAIMS[kind](Scene(), name)
    assert len(str(refusal.value)) <= 300


@pytest.mark.parametrize("word", keyword.kwlist)
def test_every_keyword(word):
    with pytest.raises(ModelError, match=f"{word} is a keyword"):
        Model("m").parameter(word, 1.0)


@pytest.mark.parametrize("kind", SCALARS)
@pytest.mark.parametrize("name", ["t", "pi"])
def test_names_of_constants(kind, name):
    """An expression would mean time and π; a point called so is told by its dot."""
    with pytest.raises(ModelError, match=f"{name}: that is the name of"):
        CLAIMS[kind](Scene(), name)
    assert CLAIMS["point"](Scene(), name).x.name == f"{name}.x"


@pytest.mark.parametrize("kind", CLAIMS)
def test_names_are_kept_in_normal_form(kind):
    """µ and μ, ² and 2, ﬁ and fi are one, as they are for Python's parser."""
    for written in (MICRO, "a²", "ﬁ", "é"):
        assert CLAIMS[kind](Scene(), unicodedata.normalize("NFD", written) if written == "é" else written).name == unicodedata.normalize(
            "NFKC", written
        )


@pytest.mark.parametrize("kind", [kind for kind in CLAIMS if kind != "body"])
@pytest.mark.parametrize("other", [kind for kind in CLAIMS if kind != "body"])
def test_names_that_look_alike_are_one(kind, other):
    """The second that claims the name is refused, whatever code it was written with."""
    scene = Scene()
    CLAIMS[kind](scene, MICRO)
    with pytest.raises(ModelError, match="already used for"):
        CLAIMS[other](scene, MU)


def test_bodies_that_look_alike_are_one():
    scene = Scene()
    scene.model.body(MICRO)
    with pytest.raises(ModelError, match="already a body"):
        scene.model.body(MU)
    with pytest.raises(ModelError, match="already a body"):
        scene.model.body("ground")


@pytest.mark.parametrize("kind", SCALARS)
def test_names_of_coordinates(kind):
    """B.x is a coordinate of B: neither before nor after B is declared can something else be called so."""
    with pytest.raises(ModelError, match="already used for coordinate B.x"):
        CLAIMS[kind](Scene(), "B.x")
    scene = Scene()
    CLAIMS[kind](scene, "C.y")
    with pytest.raises(ModelError, match="point C: the name C.y is already used"):
        scene.model.point("C", (0, 0, 1))


def test_names_are_found_in_either_form():
    m = Model("m")
    A, B = m.point("A", (0, 0), fixed=True), m.point(MICRO, (1, 0))
    m.distance(A, MICRO)
    m.distance(A, MU)
    m.independent(MICRO + ".y")
    m.simulation(zd0={MICRO + ".y": 1.0}, z=[MICRO + ".y"])
    assert m.elements[MU] is B and m.chosen_independent == (f"{MU}.y",)
    assert m.simulation_options == {"zd0": {f"{MU}.y": 1.0}, "z": [f"{MU}.y"]}


def test_names_that_are_unambiguous_are_names():
    """A call is told from a name by its parentheses, and a name of one's own goes before the constant e."""
    m = Model("class")
    for name in ("e", "sin", "rate", "match", "_".join("ab"), "E", "I", "scale", "λ"):
        m.parameter(name, 1.0)
    assert Model("3".join("ab")).name == "a3b"


def spring_with(order):
    """A spring with a law, in a model that has a parameter x; told in this order."""
    m = Model("m")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    steps = {"law": lambda: m.spring(A, B, law=lambda x, v: 2 * x), "parameter": lambda: m.parameter("x", 1.0)}
    for step in order:
        steps[step]()


@pytest.mark.parametrize("order", [("law", "parameter"), ("parameter", "law")])
def test_a_parameter_called_like_the_symbol_of_a_law(order):
    with pytest.raises(ModelError, match="law.*x|x.*law"):
        spring_with(order)


@pytest.mark.parametrize("name", ["k", "a_x", "a_y", "rate", "x1"])
def test_parameters_of_a_law_have_their_values(name):
    """However a parameter is called, a law of tension = parameter·(length − 1) pulls with that: 3·(2 − 1) towards A."""
    m = Model("m")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (2, 0, 0))
    m.body("b", [B], mass=1.0)
    strength = m.parameter(name, 3.0)
    m.spring(A, B, law=lambda x, v: strength * (x - 1))
    kernels = ncgen.compile(m, backend="numpy")
    assert np.allclose(kernels.force(kernels.q0, np.zeros(3), 0.0, kernels.p0), [-3, 0, 0], atol=1e-15)
