"""The scene: what is taken from a model and from a trajectory."""

import numpy as np
import pytest

from ncgen.errors import NcgenError
from ncgen.model import Model
from ncgen.view.figure import figure
from ncgen.view.scene import scene_of


def named(scene):
    """The segments by the names of their points, each pair in alphabetical order."""
    return {tuple(sorted((scene.points[i], scene.points[j]))) for i, j in scene.segments}


def test_the_robot_is_drawn_as_table_7_says(robot_model):
    """Lines and arrows are those of the tables, at the initial position."""
    scene = scene_of(robot_model)
    assert scene.points == tuple(f"r{i}" for i in range(1, 9))
    assert scene.segments == ((0, 1), (1, 2), (0, 2), (1, 3), (2, 4), (3, 4), (4, 5), (5, 3), (5, 6), (6, 7))
    assert [(arrow.point + 1, arrow.name) for arrow in scene.arrows] == [
        (1, "u1"), (1, "u2"), (2, "u3"), (3, "u3"), (4, "u3"), (5, "u3"), (6, "u3"), (7, "u4"), (8, "u5"),
    ]  # fmt: skip
    assert scene.positions.shape == (1, 8, 3)
    assert list(scene.positions[0, 7]) == [0, 1.6427, 1.3757]
    assert list(scene.fixed) == [True] + [False] * 7
    assert not scene.planar


def test_a_run_gives_positions_over_time(robot_run):
    """Positions and directions are the run's, and the bounds hold them all."""
    scene = scene_of(robot_run)
    assert scene.positions.shape == (41, 8, 3)
    assert np.array_equal(scene.positions[:, 7], robot_run.point("r8"))
    assert np.array_equal(scene.arrows[-1].direction, robot_run.vector("u5"))
    low, high = scene.bounds
    assert (low <= scene.positions).all() and (scene.positions <= high).all()
    assert scene.size == (high - low).max()


def test_some_times_of_a_scene(robot_run):
    """`at` takes times, positions and directions alike."""
    some = scene_of(robot_run).at([0, 40])
    assert list(some.t) == [0.0, 2.0]
    assert np.array_equal(some.positions[1, 7], robot_run.point("r8")[40])
    assert np.array_equal(some.arrows[-1].direction, robot_run.vector("u5")[[0, 40]])


def test_without_a_drawing_bodies_and_distances_are_lines():
    """Every two points of a body once, each constant distance, and each body's vectors at its first point."""
    m = Model("plain")
    A, B, C, D = (m.point(name, place) for name, place in zip("ABCD", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]))
    u = m.vector("u", (0, 0, 1))
    m.body("plate", points=[A, B, C], vectors=[u])
    m.body("rod", points=[C, B])
    m.distance(A, D)
    scene = scene_of(m)
    assert len(scene.segments) == 4
    assert named(scene) == {("A", "B"), ("A", "C"), ("B", "C"), ("A", "D")}
    assert [(scene.points[arrow.point], arrow.name) for arrow in scene.arrows] == [("A", "u")]


def test_without_a_drawing_springs_are_dashed_between_their_points():
    """What pulls between two points, not along an angle; a mechanism that asks for lines says all of them itself."""
    m = Model("sprung")
    A, B, C = (m.point(name, place) for name, place in zip("ABC", [(0, 0, 0), (1, 0, 0), (0, 1, 0)]))
    m.spring(A, B, 10.0)
    m.spring(C, A, law=lambda x, v: x**3)
    m.torsion_spring(m.length("s", B, C), 10.0)
    scene = scene_of(m)
    assert [(scene.points[i], scene.points[j]) for i, j in scene.springs] == [("B", "A"), ("A", "C")] and scene.segments == ()
    dashed = [line for line in figure(m).axes[0].lines if line.get_gid() == "spring"]
    assert [line.get_linestyle() for line in dashed] == ["--", "--"]
    m.line(B, C)
    assert scene_of(m).springs == () and named(scene_of(m)) == {("B", "C")}


def test_a_scene_is_planar_if_z_never_differs(flat_model, flat_run):
    """One z for all points and times."""
    assert scene_of(flat_model).planar and scene_of(flat_run).planar
    m = Model("raised")
    m.point("A", (0, 0, 3))
    m.point("B", (1, 0, 3))
    assert scene_of(m).planar
    m.point("C", (0, 0, 3.01))
    assert not scene_of(m).planar


def test_a_single_point_has_a_size():
    """A scene without extent is drawn as if it were a metre wide."""
    m = Model("dot")
    m.point("A", (5, 5, 5))
    assert scene_of(m).size == 1.0


def test_what_cannot_be_drawn_is_refused(flat_model, flat_run):
    """No points; and positions that are not finite, named with their time."""
    with pytest.raises(NcgenError, match="^empty: there is no point to draw"):
        scene_of(Model("empty"))
    broken = type(flat_run)(flat_model, flat_run.t)
    broken.rotation = broken.rotation.copy()
    broken.rotation[7:] = np.nan
    with pytest.raises(NcgenError, match=r"^flat: point A at t = 0.35 s is not a finite number"):
        scene_of(broken)
