"""Whatever a user calls things, the emitted code compiles without a warning and computes the same."""

from __future__ import annotations

import keyword
import re

import numpy as np
import pytest
import sympy
from c_code import compile_object, run_consumer, run_numpy
from hypothesis import given
from hypothesis import strategies as st

import ncgen
from ncgen import Model, ModelError
from ncgen.emit.naming import RESERVED, Names, identifier
from ncgen.program.ir.functions import FUNCTIONS

C_KEYWORDS = "int long float double static const restrict inline return if for while switch goto union sizeof void".split()
CPP_KEYWORDS = "class new delete template this namespace operator try throw virtual and or not xor bool typename".split()
PYTHON_KEYWORDS = "def lambda None True False import from as is in yield async await global pass del with match self".split()
ARGUMENTS = "q p qd d i R np phi phi_q gamma mass force energy nu out values main errno index x1 x2 x1_2 dpsi psi a_x scale".split()
LIBRARY = "printf abs fabs y0 index isnan stdin assert linux unix M_PI complex I".split()
UNICODE = ["Ö", "中文", "ψ1", "étage", "ª", "Åß", "u4e2d", "µ", "xÖ", "xud6"]
COLLIDING = ["a.b", "a_b", "a__b", "a_b_", "a_b_2", "A.b"]
LONG = ["w" * 300, "w" * 299 + "v", "é" * 300]
EVERY = [*dict.fromkeys(C_KEYWORDS + CPP_KEYWORDS + PYTHON_KEYWORDS + ARGUMENTS + LIBRARY + UNICODE + COLLIDING + LONG)]
HARMLESS = [name for name in EVERY if not keyword.iskeyword(name)]
"""What a model accepts: Python's keywords are those of its expressions, too."""

COLLISIONS = {
    "functions": [*FUNCTIONS, "sinf", "sqrtl"],
    "macros": ["NULL", "NAN", "INFINITY", "HUGE_VAL", "NCGEN_OK", "NCGEN_ABI_VERSION", "NCGEN_RESTRICT", "NCGEN_H"],
    "types": ["ncgen_real", "ncgen_scalar", "ncgen_model", "ncgen_pattern"],
    "own names": ["m_index_1", "m_number_1", "m_phi", "m_model", "m_coordinate_names", "M_H", "M_N_ROWS"],
}


def pendulum(names, name: str = "m") -> Model:
    """A pendulum whose angle is measured again for every name, with a torque on each; every third name is a parameter."""
    model = Model(name)
    pivot, bob = model.point("pivot", (0, 0, 0), fixed=True), model.point("bob", (1, 0, 0))
    axis, zero = model.vector("axis", (0, 0, 1), fixed=True), model.vector("zero", (1, 0, 0), fixed=True)
    model.body("bob", points=[bob], mass=1.5)
    model.distance(pivot, bob)
    model.gravity((0, -9.81, 0))
    for k, word in enumerate(names):
        if k % 3 == 2:
            strength = model.parameter(word, 0.25 + k)
            model.force(bob, (strength * bob.x, strength**2 * sympy.sin(strength * bob.y), 0))
        else:
            psi = model.angle(word, zero, bob - pivot, axis)
            model.torque(psi, -sympy.cos(psi.symbol) * psi.rate)
    return model


def assert_compiles_and_agrees(model: Model, emission: str, folder):
    """C without a warning, and the NumPy module's numbers."""
    sources = ncgen.generate(model, emission=emission)
    in_c, in_numpy = run_consumer(compile_object(sources, folder)), run_numpy(sources)
    assert set(in_c) == set(in_numpy)
    for kernel, values in in_numpy.items():
        np.testing.assert_allclose(in_c[kernel], values, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("emission", ["unrolled", "tabled"])
def test_hostile_names(emission, tmp_path):
    """Keywords of three languages, arguments of kernels, unicode, collisions and 300 characters, all in one model."""
    assert_compiles_and_agrees(pendulum(HARMLESS), emission, tmp_path)


def test_ordinary_names_are_kept():
    """A name that needs no change gets none: what a user calls `boom` is found under `boom`, its sine under `sin_boom`."""
    sources = ncgen.generate(pendulum(["boom", "spare"]), emission="unrolled")
    assert re.search(r"const ncgen_real sin_boom = sine\[0\];", sources.c["m.c"])
    assert re.search(r"^ +sin_boom = sine\[\.\.\., 0\]$", sources.numpy["m.py"], re.MULTILINE)


@pytest.mark.parametrize("kind", COLLISIONS)
def test_names_that_the_source_uses_itself(kind, tmp_path):
    """Functions, macros, types and tables of the emitted code are no obstacle to a user's names."""
    assert_compiles_and_agrees(pendulum(COLLISIONS[kind]), "unrolled", tmp_path)


@pytest.mark.parametrize("name", ["class", "int", "main", "np", "sin", "math", "Ö", "a.b", "中", "R", "x" * 100])
def test_hostile_model_names(name, tmp_path):
    """The model's name becomes file names, prefixes and include guards, for C++, too."""
    sources = ncgen.generate(pendulum(["psi", "phi"], name))
    assert set(run_consumer(compile_object(sources, tmp_path), compiler="g++")) == {"q0", *sources.programs.programs}


@pytest.mark.parametrize("name", ["ncgen", "NCGEN", "ncgen_math", "ncgen-math"])
def test_models_named_like_the_headers(name, tmp_path):
    """A model may not hide ncgen.h or ncgen_math.h: it is refused, or its files are called otherwise."""
    try:
        model = pendulum(["psi", "phi"], name)
    except ModelError:
        return
    sources = ncgen.generate(model)
    assert len(sources.c) == 4
    run_consumer(compile_object(sources, tmp_path))


def test_a_model_name_is_no_longer_than_a_file_name(tmp_path):
    """A model's name of 300 characters is refused at once, or its files can be written."""
    try:
        model = pendulum(["psi", "phi"], "w" * 300)
    except ModelError:
        return
    compile_object(ncgen.generate(model), tmp_path)


letters = st.sampled_from("abZ09__..--/*\"'\\ \n\0$éßÖ中ψ\u2028²٣😀")
words = st.text(letters, min_size=1, max_size=12) | st.from_regex(r"[A-Za-z_.\-]{1,8}", fullmatch=True) | st.sampled_from(sorted(RESERVED))


@given(words)
def test_any_text_becomes_an_identifier(text):
    """Whatever the text, the identifier is one of C and of Python, and no reserved word."""
    word = identifier(text)
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", word)
    assert word.isidentifier() and not keyword.iskeyword(word) and word not in RESERVED
    assert identifier(word) == word


@given(st.lists(words, max_size=30))
def test_no_identifier_is_given_twice(wishes):
    """Names that look alike after cleaning are told apart, and none takes a name that is taken."""
    names = Names(["phi"])
    given_out = [names(wish) for wish in [*wishes, "phi", "phi_2", "phi"]]
    assert len(set(given_out)) == len(given_out) and "phi" not in given_out


def test_equal_names_are_numbered_from_2_on():
    names = Names(["x_3"])
    assert [names("x") for _ in range(4)] == ["x", "x_2", "x_4", "x_5"]


LABELS = {
    "quotes": ('say "hi"', True),
    "backslash": ("ends with \\", True),
    "docstring": ('"""', True),
    "trigraph": ("what??/", True),
    "nothing": ("\x00", True),
    "comment": ("*/ int x; /* // */", False),
    "newline": ("two\nlines\r\nand more", False),
    "template": ("{{ model }} {% raw %} {# #} %s %d", False),
    "unicode": ("größer als \u2028 中", False),
}


def labelled(label: str) -> Model:
    """A pendulum with a row and a force that carry the label; parameter and time unused in some kernels."""
    model = pendulum(["psi"])
    bob, psi = model.elements["bob"], model.elements["psi"]
    model.parameter("spare", 1.0, unit=label)
    model.constrain(bob.x * bob.y * psi.symbol - sympy.Rational(1, 3), label=label)
    model.force(bob, (bob.x * bob.y, 0, 0), label=label)
    return model


@pytest.mark.parametrize(
    "label",
    [pytest.param(text, id=name) for name, (text, _) in LABELS.items()],
)
def test_hostile_labels(label, tmp_path):
    """A label is free text: it may hold anything that ends a string, a comment or a line in C, Python or a template."""
    assert_compiles_and_agrees(labelled(label), "auto", tmp_path)


@pytest.mark.parametrize("label", ["don't", "p[0], qd[1] and t"])
def test_labels_that_speak_of_arguments(label, tmp_path):
    """A kernel's argument that is mentioned in a comment only is still declared unused."""
    assert_compiles_and_agrees(labelled(label), "auto", tmp_path)


def test_driven_models_have_no_warnings(tmp_path):
    """The equation of a driver mentions t where its derivatives no longer do."""
    model = pendulum(["psi"])
    psi = model.elements["psi"].symbol
    model.constrain(psi**2 - model.time)
    assert_compiles_and_agrees(model, "auto", tmp_path)
