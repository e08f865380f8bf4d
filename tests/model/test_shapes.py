"""Shapes of bodies: they stand where they are said to, and change nothing but pictures."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model, ModelError
from ncgen.exchange.toml_reader import read_toml
from ncgen.exchange.toml_writer import to_toml
from ncgen.model.digest import digest
from ncgen.model.shapes import rotation_of, rotation_to


def excavator_arm(shapes: bool = True) -> Model:
    """A body on a hinge with a hydraulic cylinder, shown in every way there is."""
    m = Model("shaped")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (2, 0, 0))
    C = m.point("C", (0, -1, 0), fixed=True)
    y = m.vector("y", (0, 1, 0), fixed=True)
    arm = m.body("arm", [A, B], [y], mass=3.0, inertia="point")
    m.spring(C, B, 10.0)
    if shapes:
        m.box(arm, (2, 0.1, 0.2))
        m.box("ground", (1, 1, 0.1), (0, 0, -1), (0, 0, 0.5), colour="#102030")
        m.cylinder(arm, 0.1, 0.3, (2, 0, 0), axis=(0, 1, 0))
        m.capsule(arm, 0.1, 0.3, (2, 0, 0), axis=(0, 1, 0))
        m.wheel(arm, 0.3, 0.1, (2, 0, 0))
        m.sphere(arm, 0.3)
        m.ellipsoid(arm, (0.1, 0.2, 0.3), rotation=(0.1, 0.2, 0.3))
        m.polygon(arm, [(0, 0, 0), (2, 0, 0), (1, 0, 0.5)], 0.1)
        m.polygon(m.ground, [(0, 0), (1, 0), (1, 1)])
        m.mesh(arm, "parts/arm.stl", (0, 0, 0.1), (0, 0, np.pi), (0.001, 0.001, 0.001))
        m.bar(A, B, 0.02)
        m.telescope(C, B, 0.05)
        m.telescope(C, B, 0.05, 1.0, colour="#A0b0c0")
    return m


def seen(model: Model) -> list:
    """All that a drawing says of shapes, to the last bit."""
    solids = [
        (s.body.name, s.kind, s.sizes, s.position.tolist(), s.rotation.tolist(), s.colour, s.file, np.array(s.corners).tolist())
        for s in model.drawing.solids
    ]
    return [solids, [(s.start.name, s.end.name, s.radius, s.length, s.colour) for s in model.drawing.struts]]


def test_shapes_change_no_byte_of_code():
    """Nor what tells a model from others, so that nothing is generated again."""
    plain, shaped = excavator_arm(False), excavator_arm()
    assert ncgen.generate(shaped).files == ncgen.generate(plain).files
    assert digest(shaped) == digest(plain) and len(shaped.drawing.solids) == 10 and len(shaped.drawing.struts) == 3


def test_shapes_survive_the_file(tmp_path):
    model = excavator_arm()
    path = tmp_path / "shaped.toml"
    path.write_text(text := to_toml(model), encoding="utf-8")
    again, problems = read_toml(path)
    assert problems == [] and again is not None
    assert seen(again) == seen(model) and to_toml(again) == text


def test_names_of_meshes_begin_in_the_folder_of_the_file(tmp_path):
    path = tmp_path / "shaped.toml"
    path.write_text(to_toml(excavator_arm()), encoding="utf-8")
    assert ncgen.load(path).drawing.folder == tmp_path


def test_a_shape_stands_in_the_middle_of_its_body_unless_it_is_said():
    m = excavator_arm()
    box, slab, cylinder = m.drawing.solids[:3]
    assert box.position.tolist() == [1, 0, 0] and np.array_equal(box.rotation, np.eye(3))
    np.testing.assert_allclose(slab.rotation @ [1, 0, 0], [np.cos(0.5), np.sin(0.5), 0], atol=1e-15)
    np.testing.assert_allclose(cylinder.rotation[:, 2], [0, 1, 0], atol=1e-15)
    assert m.drawing.struts[1].length == pytest.approx(0.6 * np.sqrt(5), rel=1e-15)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (0, 0, -2), (1, 2, 3), (0, 1e-9, -1), (-3, 0, 0)])
def test_an_axis_makes_a_rotation(axis):
    found = rotation_to(np.array(axis, dtype=float))
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(found[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-14)
    assert np.linalg.det(found) > 0


def test_roll_pitch_and_yaw_are_about_fixed_axes():
    """A quarter about x takes y to z; one about z after it takes x to y and leaves z."""
    np.testing.assert_array_equal(rotation_of((np.pi / 2, 0, np.pi / 2)) @ np.array([[0, 1, 0], [1, 0, 0]]).T, [[0, 0], [0, 1], [1, 0]])


REFUSED = {
    "no size": (lambda m, b: m.box(b, (1, 0, 1)), "^box of rod: the size is 0; give a positive number$"),
    "two sizes": (lambda m, b: m.box(b, (1, 1)), "^box of rod: 2 numbers given for the size; give 3$"),
    "negative": (lambda m, b: m.sphere(b, -1), "^sphere of rod: the radius is -1; give a positive number$"),
    "no axis": (lambda m, b: m.wheel(b, 1, 1, axis=(0, 0, 0)), "^wheel of rod: its axis is 0; give a direction$"),
    "colour": (lambda m, b: m.box(b, (1, 1, 1), colour="red"), "^box of rod, colour: 'red' given; write it as #rrggbb, such as #d08030$"),
    "bent": (lambda m, b: m.polygon(b, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1)]), "^polygon of rod: a corner is .* off the plane"),
    "thin": (lambda m, b: m.polygon(b, [(0, 0), (1, 0), (2, 0)]), "^polygon of rod: the corners enclose no area"),
    "two corners": (lambda m, b: m.polygon(b, [(0, 0), (1, 0)]), "^polygon of rod: 2 corners given; give three or more$"),
    "fetched": (lambda m, b: m.mesh(b, "https://a.example/b.stl"), "^mesh of rod: .* is no name of a file; nothing is fetched"),
    "flat": (lambda m, b: m.mesh(b, "b.stl", scale=(1, 0, 1)), "^mesh b.stl: the scale is three numbers that are not 0$"),
    "one point": (lambda m, b: m.bar("A", "A", 1), "^bar A-A: both ends are one point; give two$"),
    "four": (lambda m, b: m.box(b, (1, 1, 1), (1, 2, 3, 4)), "^box of rod: 4 numbers given; give three, or two in the plane$"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_shown_is_refused(case):
    m = Model("refused")
    rod = m.body("rod", [m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))])
    act, words = REFUSED[case]
    with pytest.raises(ModelError, match=words):
        act(m, rod)
    assert m.drawing.solids == [] and m.drawing.struts == [] and len(m.facts) == 3
