"""Rigid-body rows chosen by themselves: six degrees of freedom for any body, no row twice, nothing out of the plane."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen


def freedom(m):
    return ncgen.freedom(ncgen.compile(m, backend="numpy"))


@pytest.mark.parametrize("points, vectors", [(2, 1), (3, 0), (3, 1), (4, 0), (2, 2), (5, 3), (1, 3), (1, 2)])
def test_spatial_body_has_six_degrees_of_freedom(points, vectors):
    """Whatever elements describe it, a body that is not a line has six degrees of freedom and no redundant row."""
    generator = np.random.default_rng(points * 10 + vectors)
    m = ncgen.Model("body")
    ps = [m.point(f"P{i}", generator.standard_normal(3)) for i in range(points)]
    us = [m.vector(f"u{i}", v / np.linalg.norm(v)) for i, v in enumerate(generator.standard_normal((vectors, 3)))]
    m.body("body", ps, us)
    found = freedom(m)
    assert found.dof == 6
    assert not found.redundant


@pytest.mark.parametrize("points", [2, 3, 5])
def test_planar_body_has_three(points):
    """A body in the plane has three degrees of freedom; its rows have no z."""
    generator = np.random.default_rng(points)
    m = ncgen.Model("flat")
    m.body("body", [m.point(f"P{i}", generator.standard_normal(2)) for i in range(points)])
    kernels = ncgen.compile(m, backend="numpy")
    assert ncgen.freedom(kernels).dof == 3
    assert len(kernels.rows) == 2 * points - 3
    assert all(name.endswith((".x", ".y")) for name in kernels.coordinates)


def test_bar_has_five():
    """Two points are a line: spin about it cannot be described."""
    m = ncgen.Model("bar")
    m.body("bar", [m.point("A", (0, 0, 0)), m.point("B", (1, 0.5, 0.2)), m.point("C", (2, 1.0, 0.4))])
    assert freedom(m).dof == 5


def test_shared_elements_are_tied_once():
    """Bodies that share two points or a vector do not repeat the distance or the unit norm."""
    m = ncgen.Model("pair")
    A, B = m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))
    u, v = m.vector("u", (0, 1, 0)), m.vector("v", (0, 0.6, 0.8))
    m.body("first", [A, B], [u])
    m.body("second", [A, B], [v])
    labels = [row.label for row in m.rows]
    assert labels.count("distance A-B") == 1
    assert freedom(m).dof == 7
    assert not freedom(m).redundant


def test_further_elements_are_linear_and_keep_no_mirror_image():
    """The fourth coplanar point follows a rotation of the body, found here by the rotation itself."""
    m = ncgen.Model("plate")
    corners = {"A": (0, 0, 0), "B": (2, 0, 0), "C": (0, 1, 0), "D": (2, 1, 0), "E": (0.3, 0.4, 0)}
    points = [m.point(name, at) for name, at in corners.items()]
    m.body("plate", points, [m.vector("n", (0, 0, 1))])
    kernels = ncgen.compile(m, backend="numpy")
    rotation = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    q = np.concatenate([*(rotation @ at for at in corners.values()), rotation[:, 2]])
    assert np.max(np.abs(kernels.phi(q))) < 1e-14


@pytest.mark.parametrize("height", [9e-4, 1e-5, -1e-7])
def test_what_lies_nearly_in_a_plane_stays_beside_it(height):
    """Too near to the plane of the others to be a base direction, and not moved into it: found by the rotation itself."""
    m = ncgen.Model("plate")
    corners = {"A": (0, 0, 0), "B": (2, 0, 0), "C": (0, 1, 0), "D": (0.7, 0.4, height)}
    n = np.array([0.6, 0.8, height]) / np.linalg.norm([0.6, 0.8, height])
    m.body("plate", [m.point(name, at) for name, at in corners.items()], [m.vector("n", n)])
    kernels = ncgen.compile(m, backend="numpy")
    rotation = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    for turn in (np.eye(3), rotation):
        q = np.concatenate([*(turn @ at for at in corners.values()), turn @ n])
        assert np.max(np.abs(kernels.phi(q))) < 1e-14
    assert freedom(m).dof == 6


def test_a_distant_point_hides_no_other():
    """Four points of a plane, one of them 9e18 m away: three do for a base, and the fourth is seen to depend on them."""
    m = ncgen.Model("long")
    corners = {"A": (0, 0, 0.5), "B": (9.2e18, 1.5, 0.5), "C": (-0.3, 1.7, 0.5), "D": (-1.6, 0.9, 0.5)}
    m.body("plate", [m.point(name, at) for name, at in corners.items()])
    assert [row.label for row in m.rows if "D" in row.label] == ["combination D.x", "combination D.y", "combination D.z"]


def test_coinciding_points_are_refused_by_name():
    m = ncgen.Model("wrong")
    with pytest.raises(ncgen.ModelError, match="rod: the points B and A coincide"):
        m.body("rod", [m.point("A", (1, 2, 3)), m.point("B", (1, 2, 3))])


def test_moving_element_cannot_belong_to_ground():
    m = ncgen.Model("wrong")
    with pytest.raises(ncgen.ModelError, match="point A can move"):
        m.extend(m.ground, m.point("A", (0, 0, 0)))


def test_constant_mass_on_request():
    """Two points and one vector have a varying mass; the auxiliary vector makes it constant."""

    def mass_is_constant(**options):
        m = ncgen.Model("body")
        elements = [m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))], [m.vector("u", (0, 1, 0))]
        m.body("body", *elements, mass=2.0, com=(0.4, 0.1, 0.2), inertia=(0.2, 0.3, 0.4), **options)
        kernels = ncgen.compile(m, backend="numpy")
        return kernels.programs.programs["mass"].is_constant

    assert not mass_is_constant()
    assert mass_is_constant(constant_mass=True)
