"""Solids: shapes as triangles, meshes of files, and how they move with bodies."""

from __future__ import annotations

import base64
import json
import re
import warnings

import numpy as np
import pytest
from turning import TurningRun

from ncgen.model import Model
from ncgen.view import meshes, triangles
from ncgen.view.figure import figure
from ncgen.view.meshes import mesh_of, simplified
from ncgen.view.page import drawing
from ncgen.view.player import player
from ncgen.view.scene import scene_of
from ncgen.view.still import solids
from ncgen.view.surfaces import Surface
from ncgen.view.triangles import Mesh

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit name="millimeter" meter="0.001"/></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 1000 0 0 0 2000 0</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def volume(mesh: Mesh) -> float:
    """By the divergence theorem: it counts outward triangles once, and inward ones against them."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def is_closed(mesh: Mesh) -> bool:
    """Every edge is run through once in each direction."""
    edges = [(int(t[k]), int(t[(k + 1) % 3])) for t in mesh.triangles for k in range(3)]
    return len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)


def ring(sides: int) -> float:
    """Area of a regular polygon in a circle of radius 1."""
    return sides / 2 * np.sin(2 * np.pi / sides)


L_SHAPE = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)], dtype=float)


@pytest.mark.parametrize(
    ("mesh", "expected", "rel"),
    [
        (triangles.box((1, 2, 3)), 6.0, 1e-12),
        (triangles.cylinder(2.0, 0.0, 3.0), 12 * ring(triangles.SIDES), 1e-12),
        (triangles.polygon(L_SHAPE, 0.5), 2.0, 1e-12),
        (triangles.polygon(L_SHAPE[::-1], 0.5), 2.0, 1e-12),
        (triangles.ball(), 4 / 3 * np.pi, 0.03),
        (triangles.capsule(0.5, 2.0), np.pi * 0.25 * (2.0 + 4 / 3 * 0.5), 0.03),
    ],
)
def test_shapes_are_closed_and_hold_their_volumes(mesh, expected, rel):
    assert is_closed(mesh) and abs(volume(mesh)) == pytest.approx(expected, rel=rel)


def test_a_thin_polygon_is_cut_into_its_own_area():
    """An L is not convex: a fan from its first corner would leave it."""
    flat = triangles.polygon(L_SHAPE, 0.0)
    a, b, c = (flat.vertices[flat.triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.sum() == pytest.approx(4.0) and (areas > 0).all()


def test_a_wheel_fits_its_radius_and_width():
    wheel = triangles.wheel(0.3, 0.1)
    assert np.linalg.norm(wheel.vertices[:, :2], axis=1).max() == pytest.approx(0.3)
    assert np.abs(wheel.vertices[:, 2]).max() == pytest.approx(0.05)


def test_a_spring_winds_about_its_axis():
    """Its wire stays at radius 1, goes from end to end, and counts its turns."""
    spring = triangles.spring()
    middle = spring.vertices[:: triangles.WIRE]
    turns = np.unwrap(np.arctan2(middle[2:-2, 1], middle[2:-2, 0]))
    assert turns[-1] - turns[0] == pytest.approx(2 * np.pi * triangles.WINDINGS)
    assert middle[0].tolist() == [0, 0, 0] and middle[-1].tolist() == [0, 0, 1]
    np.testing.assert_allclose(np.linalg.norm(spring.normals, axis=1), 1.0, atol=1e-12)


# -- files -----------------------------------------------------------------------------------------


def fine(shape, count: int) -> Mesh:
    """The six sides of a cube of edge 2 as grids of triangles, each vertex where `shape` has it."""
    grid = np.linspace(-1, 1, count)
    u, v = (x.ravel() for x in np.meshgrid(grid, grid))
    sides, faces = [], []
    corner = np.arange(count * count).reshape(count, count)
    a, b, c, d = (x.ravel() for x in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            faces += [np.column_stack(t) + len(sides) * count * count for t in ((a, b, c), (a, c, d))]
            sides.append(np.roll(np.column_stack([u, v, np.full(len(u), sign)]), axis, axis=1))
    return Mesh(shape(np.concatenate(sides)), np.concatenate(faces))


def test_a_simplified_sphere_is_round():
    mesh = simplified(fine(lambda v: v / np.linalg.norm(v, axis=1, keepdims=True), 60))
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert meshes.MAX_TRIANGLES / 2 < len(mesh.triangles) <= meshes.MAX_TRIANGLES and np.abs(radii - 1).max() < 0.03


def test_a_simplified_cube_keeps_its_corners():
    """Where means of vertices would round them off."""
    mesh = simplified(fine(lambda v: v, 60))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    gaps = np.linalg.norm(mesh.vertices[:, None] - corners, axis=2).min(axis=0)
    assert len(mesh.triangles) <= meshes.MAX_TRIANGLES and gaps.max() < 0.01


def test_few_triangles_stay_as_they_are():
    box = triangles.box()
    assert len(simplified(box).triangles) == 12 and abs(volume(simplified(box))) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("gone.stl", None, "there is no such file"),
        ("rod.blend", "x", "files of meshes end with .stl, .obj, .dae"),
        ("large.obj", "v 0 0 0\n" * 20, "it has 160 bytes, and 100 are read"),
        ("bomb.dae", '<!DOCTYPE x [<!ENTITY a "aa">]><x>&a;</x>', "document types and entities are not read"),
    ],
)
def test_a_mesh_that_cannot_be_shown_is_told_in_one_line(name, text, words, tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "MAX_FILE_BYTES", 100)
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.warns(UserWarning) as told:
        assert mesh_of(path) is None
    (said,) = told
    assert str(said.message) == f"mesh {path}: {words}; it is left out of the picture"


def test_the_rest_of_a_picture_stays(tmp_path):
    m = Model("partly")
    rod = m.body("rod", [m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))])
    m.mesh(rod, "gone.stl")
    m.box(rod, (1, 0.1, 0.1))
    m.drawing.folder = tmp_path
    with pytest.warns(UserWarning, match=r"gone.stl: there is no such file"):
        assert len(scene_of(m).surfaces) == 1


@pytest.mark.parametrize("suffix", ["obj", "stl"])
def test_a_file_is_read(suffix, tmp_path):
    """What it names beside itself is not opened."""
    pytest.importorskip("trimesh")
    path = tmp_path / f"tetrahedron.{suffix}"
    text = f"mtllib secret.mtl\n{TETRAHEDRON}"
    if suffix == "stl":
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
        facets = ["".join(f"vertex {x} {y} {z}\n" for x, y, z in corners[list(t)]) for t in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
        text = "solid t\n" + "".join(f"facet normal 0 0 0\nouter loop\n{f}endloop\nendfacet\n" for f in facets) + "endsolid t\n"
    path.write_text(text)
    mesh = mesh_of(path)
    assert mesh is not None and is_closed(mesh) and abs(volume(mesh)) == pytest.approx(1.0) and len(mesh.vertices) == 4


def test_a_dae_file_says_its_unit(tmp_path):
    pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    path = tmp_path / "plate.dae"
    path.write_text(DAE)
    mesh = mesh_of(path)
    assert mesh is not None and mesh.vertices.max(axis=0).tolist() == [1, 2, 0]


# -- in motion -------------------------------------------------------------------------------------


def carried() -> Model:
    """Bodies told by two vectors, by points, by a vector and points, and a bar, each with a box that stands askew."""
    m = Model("carried")
    A, B, C = m.point("A", (1, 0, 0)), m.point("B", (1, 1, 0)), m.point("C", (1, 0, 1))
    u, v = m.vector("u", (1, 0, 0)), m.vector("v", (0, 0.6, 0.8))
    up = m.point("D", (1, 0, 2))
    for name, points, vectors in (("vectors", [A], [u, v]), ("points", [A, B, C], []), ("both", [A, B], [u])):
        m.box(m.body(name, points, vectors), (0.1, 0.2, 0.3), (1.5, 0.3, 0.2), (0.3, 0.4, 0.5))
    m.box(m.body("bar", [A, up]), (0.1, 0.2, 0.3), (1, 0, 1.5), (0.3, 0.4, 0))
    m.box(m.ground, (3, 3, 0.1), (0, 0, -1))
    return m


def placed(surface: Surface, scene, frame: int) -> np.ndarray:
    return surface.placed.vertices @ scene.axes[frame, surface.carrier].T + scene.origins[frame, surface.carrier]


def test_shapes_move_with_their_bodies():
    """Turned about z as a whole, every corner turns, but for a bar along z, whose spin nothing tells; the ground stays."""
    m = carried()
    run = TurningRun(m, np.linspace(0, 2, 5), rate=1.3)
    start, scene = scene_of(m), scene_of(run)
    assert len(scene.surfaces) == 5
    for k, (before, now) in enumerate(zip(start.surfaces, scene.surfaces, strict=True)):
        for frame, turn in enumerate(run.rotation):
            expected = placed(before, start, 0) @ (turn.T if k < 3 else np.eye(3))
            if k == 3:
                expected += turn @ [1, 0, 0] - [1, 0, 0]
            np.testing.assert_allclose(placed(now, scene, frame), expected, atol=1e-12)


def test_a_shape_stands_where_it_was_said():
    """A corner of a box that is turned a quarter about z."""
    m = Model("stands")
    rod = m.body("rod", [m.point("A", (0, 0, 0)), m.point("B", (1, 2, 3))])
    m.box(rod, (1, 2, 3), (10, 0, 0), (0, 0, np.pi / 2))
    scene = scene_of(m)
    corners = placed(scene.surfaces[0], scene, 0)
    np.testing.assert_allclose(corners.max(axis=0), [11, 0.5, 1.5], atol=1e-12)
    np.testing.assert_allclose(corners.min(axis=0), [9, -0.5, -1.5], atol=1e-12)
    np.testing.assert_allclose(scene.bounds, [[0, -0.5, -1.5], [11, 2, 3]], atol=1e-12)


def test_the_page_has_the_shapes():
    """Its numbers of 16 bits stand for the corners to a hundred-thousandth of their size; equal meshes are there once."""
    m = carried()
    data = json.loads(re.search(r'id="run">(.*?)</script>', player(TurningRun(m, [0.0, 1.0])), re.S)[1])
    assert len(data["meshes"]) == 1 and len(data["surfaces"]) == 5 and data["carriers"][-1]["origin"] == -1
    (mesh,) = data["meshes"]
    numbers = np.frombuffer(base64.b64decode(mesh["vertices"]), "<u2").reshape(-1, 3)
    found = numbers * mesh["step"] + mesh["low"]
    np.testing.assert_allclose(found, triangles.box().vertices, atol=1e-5)
    assert data["vectors"] == ["u", "v"]


def test_without_shapes_a_page_is_as_small_as_before(flat_model):
    data = drawing(scene_of(flat_model))
    assert data["meshes"] == data["surfaces"] == data["struts"] == data["reach"] == [] and data["coil"] == data["bar"] == -1


def test_springs_and_telescopes():
    """A spring is drawn where no strut stands in its place; the rod of a telescope goes all the way."""
    m = Model("sprung")
    A, B, C = (m.point(name, place) for name, place in zip("ABC", [(0, 0, 0), (0, 0, 2), (3, 0, 0)]))
    m.spring(A, B, 10.0)
    m.spring(A, C, 10.0)
    m.line(A, C)
    m.telescope(B, A, 0.1, 0.5)
    scene = scene_of(m)
    assert [(scene.points[i], scene.points[j]) for i, j in scene.springs] == [("C", "A")]
    found, _ = solids(scene, 0, np.array([0, 0, 1.0]))
    radii = np.hypot(found[..., 0], found[..., 1])
    for radius, low in ((0.055, 0.0), (0.1, 1.5)):
        part = found[(np.abs(radii - radius) < 1e-9).any(axis=1)]
        assert part[..., 2].max() == pytest.approx(2.0) and part[..., 2].min() == pytest.approx(low)


def test_auxiliary_vectors_are_not_drawn_unless_they_are_asked_for():
    m = Model("hidden")
    A, B = m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))
    u = m.vector("u", (0, 0, 1))
    m.body("rod", [A, B], [u], mass=1.0, inertia=(1, 1, 1), constant_mass=True)
    assert "rod.aux" in m.elements and scene_of(m).vectors == ["u"]
    m.arrow(A, "rod.aux")
    assert scene_of(m).vectors == ["rod.aux"]


# -- stills ----------------------------------------------------------------------------------------


def test_a_still_draws_solids_under_points_without_names():
    (axes,) = figure(carried()).axes
    gids = [artist.get_gid() for artist in axes.get_children()]
    assert gids.count("solid") == gids.count("shadow") == 1 and gids.count("point") == 4
    assert "point name" not in gids and "arrow" not in gids
    (axes,) = figure(carried(), names=True).axes
    assert "point name" in [artist.get_gid() for artist in axes.get_children()]


def test_what_is_lit_is_bright():
    """The upper side of a box is brighter than its lower side."""
    m = Model("lit")
    rod = m.body("rod", [m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))])
    m.box(rod, (1, 1, 1), colour="#808080")
    found, colours = solids(scene_of(m), 0, np.array([0.6, 0, 0.8]))
    above, beside = (np.abs(found[..., axis] - at).max(axis=1) < 1e-9 for axis, at in ((2, 0.5), (1, 0.5)))
    assert colours[above].min() > 1.2 * colours[beside].max()


def test_a_planar_still_draws_what_is_higher_last():
    m = Model("layers")
    rod = m.body("rod", [m.point("A", (0, 0)), m.point("B", (1, 0))])
    m.box(rod, (1, 1, 0.1), (0, 0, 0.5), colour="#ff0000")
    m.box(rod, (1, 1, 0.1), (0, 0, 0.1), colour="#00ff00")
    (axes,) = figure(m).axes
    (drawn,) = [artist for artist in axes.get_children() if artist.get_gid() == "solid"]
    assert axes.name == "rectilinear" and drawn.get_facecolor()[-1][0] > 0.3 and drawn.get_facecolor()[-1][1] == 0


def test_pictures_are_made_without_a_word(robot_model):
    """No warning of matplotlib or numpy."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure(robot_model)
