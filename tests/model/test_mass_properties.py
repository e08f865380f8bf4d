"""What a body's inertia can be called, and a body that can rotate without one: refused instead of a point mass in silence."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.toml_writer import to_toml

LENGTH, MASS, GRAVITY = 1.3, 2.0, 9.81


def hinged(**said):
    """A rod with its end A on a hinge, level."""
    m = ncgen.Model("hinged")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (LENGTH, 0))
    m.body("rod", [A, B], mass=MASS, **said)
    m.gravity((0, -GRAVITY, 0))
    return m


def tip_acceleration(model):
    """Of B from rest (m/s²)."""
    run = ncgen.simulate(ncgen.compile(model, "numpy"), 0.01, points=2)
    return run.qdd[0, run.kernels.index["B.y"]]


@pytest.mark.parametrize(("word", "share"), [("rod", 1.5), ("point", 2.0)])
def test_a_rod_falls_as_a_rod_and_a_point_mass_as_one(word, share):
    """The end of a uniform rod that is let go begins to fall with 3/2 g, that of a massless one with the mass in its middle with 2 g."""
    assert tip_acceleration(hinged(inertia=word)) == pytest.approx(-share * GRAVITY, rel=1e-14)


def test_a_rod_in_space_is_a_rod():
    """Skew in space: the kinetic energy of a rod about its end is m L²/6 ω², and the rod's axis has no moment."""
    A, B = np.array([0.1, -0.2, 0.3]), np.array([0.7, 0.4, -0.5])
    m = ncgen.Model("skew")
    body = m.body("rod", [m.point("A", A), m.point("B", B)], [m.vector("u", (0, 0, 1))], mass=MASS, inertia="rod")
    d = B - A
    assert np.allclose(body.inertia.tensor, MASS / 12 * (d @ d * np.eye(3) - np.outer(d, d)), rtol=1e-15, atol=0)
    assert np.allclose(body.inertia.com, (A + B) / 2, rtol=1e-15, atol=0)


def test_a_rod_follows_its_parameters():
    """With a length and a mass as parameters, the rod is that of the numbers in their places."""
    m = ncgen.Model("hinged")
    L, mass = m.parameter("L", 1.0, "m"), m.parameter("m", 1.0, "kg")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (L, 0))
    m.body("rod", [A, B], mass=mass, inertia="rod")
    k = ncgen.compile(m, "numpy")
    q = [LENGTH, 0.0]
    assert np.allclose(k.mass(q, p=[LENGTH, MASS]).toarray(), MASS / 3 * np.eye(2), rtol=1e-15)


@pytest.mark.parametrize("word", ["rod", "point"])
def test_words_go_through_model_files(word, tmp_path):
    text = to_toml(hinged(inertia=word))
    assert f'inertia = "{word}"' in text
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    again = ncgen.load(tmp_path / "m.toml")
    assert to_toml(again) == text
    assert tip_acceleration(again) == tip_acceleration(hinged(inertia=word))


def test_a_parameter_called_like_a_word_stays_a_parameter(tmp_path):
    m = ncgen.Model("m")
    rod = m.parameter("rod", 0.7)
    m.body("b", [m.point("A", (0, 0)), m.point("B", (1, 0))], mass=1.0, inertia=rod)
    (tmp_path / "m.toml").write_text(to_toml(m), encoding="utf-8")
    again = ncgen.load(tmp_path / "m.toml")
    assert str(again.bodies["b"].inertia.tensor[2, 2]) == "1.0*rod"
    with pytest.raises(ncgen.ModelError, match="rod is the name of a parameter, too; rename"):
        m.body("c", [m.point("C", (0, 0)), m.point("D", (1, 0))], mass=1.0, inertia="rod")


def flat(m, **held):
    return m.point("A", (0, 0), **held), m.point("B", (1, 0), **held)


CAN_ROTATE = {
    "two points in the plane": lambda m: m.body("b", flat(m), mass=1.0),
    "two points, one on a hinge": lambda m: m.body("b", [m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))], mass=1.0),
    "two points in space": lambda m: m.body("b", [m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))], mass=1.0),
    "a point and a vector": lambda m: m.body("b", [m.point("A", (0, 0, 0))], [m.vector("u", (1, 0, 0))], mass=1.0),
    "rows of one's own": lambda m: m.body("b", flat(m), mass=1.0, rigid=False),
    "a mass by a parameter": lambda m: m.body("b", flat(m), mass=m.parameter("m", 0.0)),
    "a centre": lambda m: m.body("b", flat(m), mass=1.0, com=(0.5, 0)),
    "a point mass that grows": lambda m: m.extend(m.body("b", [m.point("A", (0, 0))], mass=1.0), m.point("B", (1, 0))),
    "a point mass with a point more": lambda m: m.attach_point(m.body("b", [m.point("A", (0, 0))], mass=1.0), "B", (1, 0)),
}

CANNOT = {
    "a point": lambda m: m.body("b", [m.point("A", (0, 0, 0))], mass=1.0),
    "no mass": lambda m: m.body("b", flat(m)),
    "a mass of 0": lambda m: m.body("b", flat(m), mass=0.0),
    "a carriage on a line": lambda m: m.body("b", flat(m, fixed="y"), mass=1.0),
    "what rests": lambda m: m.body("b", flat(m, fixed=True), mass=1.0),
    "a point and a direction that rests": lambda m: m.body(
        "b", [m.point("A", (0, 0, 0))], [m.vector("u", (1, 0, 0), fixed=True)], mass=1.0
    ),
}


@pytest.mark.parametrize("case", CAN_ROTATE)
def test_a_body_that_can_rotate_needs_an_inertia(case):
    m = ncgen.Model("m")
    with pytest.raises(ncgen.ModelError, match='body b: it has mass and can rotate, but no inertia; .*inertia="point"'):
        CAN_ROTATE[case](m)


@pytest.mark.parametrize("case", CANNOT)
def test_others_need_none(case):
    CANNOT[case](ncgen.Model("m"))


WRONG = {
    "an unknown word": ({"inertia": "disc"}, "'disc' given; give numbers"),
    "a rod with a centre": ({"inertia": "rod", "com": (0.1, 0)}, "leave com out"),
    "a rod of three points": ({"inertia": "rod", "three": True}, "is between two points, and it has 3"),
}


@pytest.mark.parametrize("case", WRONG)
def test_words_that_cannot_be(case):
    said, words = WRONG[case]
    m = ncgen.Model("m")
    points = [*flat(m), *([m.point("C", (0.5, 0.5))] if said.pop("three", False) else [])]
    with pytest.raises(ncgen.ModelError, match=f"body b.*{words}"):
        m.body("b", points, mass=1.0, **said)


def test_a_model_file_without_an_inertia_is_told_with_its_line(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(to_toml(hinged(inertia="rod")).replace('inertia = "rod"\n', ""), encoding="utf-8")
    with pytest.raises(ncgen.ModelError, match=r'm\.toml, line 12: body rod: .*inertia="rod"'):
        ncgen.load(path)
