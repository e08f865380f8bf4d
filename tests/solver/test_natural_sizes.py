"""Natural sizes of coordinates and rows: nothing is found to depend because it is small."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.model import Model


def test_a_length_is_as_large_as_the_mechanism():
    """A pendulum of a gigametre whose rod is measured by a coordinate: all four rows count, one of them being in that coordinate alone."""
    size = 1e9
    m = Model("far")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (size, 0))
    C = m.point("C", (size, -size))
    m.body("upper", points=[B], mass=1.0)
    m.body("lower", points=[C], mass=1.0)
    m.distance(A, B)
    m.distance(B, C)
    m.length("reach", A, C)
    kernels = ncgen.compile(m, "numpy")
    assert kernels.column_sizes[kernels.index["reach"]] == kernels.column_sizes[kernels.index["B.x"]] == size
    found = ncgen.freedom(kernels)
    assert (found.rank, found.rank_here, found.dof) == (3, 3, 2)


@pytest.mark.parametrize("factor", [1e-10, 1.0, 1e10])
def test_rows_of_the_users_own_have_any_size(factor):
    """Two rows on two coordinates, one of them multiplied: both count, and neither implies the other."""
    m = Model("own")
    A = m.point("A", (0.3, 0.4))
    m.body("ball", points=[A], mass=1.0)
    m.constrain(factor * (A.x + A.y - 0.7), label="line")
    kernels = ncgen.compile(m, "numpy")
    B = Model("two")
    P = B.point("P", (0.3, 0.4, 0.0))
    B.body("ball", points=[P], mass=1.0)
    B.constrain(factor * (P.x + P.y - 0.7), label="one")
    B.constrain(P.x - P.y + 0.1, label="other")
    both = ncgen.freedom(ncgen.compile(B, "numpy"))
    assert (ncgen.freedom(kernels).rank, both.rank, len(both.redundant)) == (1, 2, 0)
    assert np.isfinite(kernels.row_sizes).all()


def driven_pendulum(size: float) -> Model:
    """A rod whose end is driven, in a unit of length that makes its numbers large or small."""
    m = Model("driven")
    a = m.point("A", (0.0, 0.0), fixed=True)
    b = m.point("B", (size, 0.0))
    m.body("rod", points=[a, b], mass=1.0, inertia="point")
    m.constrain(b.y - size * m.time)
    return m


@pytest.mark.parametrize("size", (1e-6, 1.0, 1e6))
def test_a_row_given_as_an_expression_is_measured_by_what_it_changes(size):
    """∂(y − size·t)/∂y times the mechanism's length: the row in any unit of length is the same row."""
    kernels = ncgen.compile(driven_pendulum(size), backend="numpy")
    assert kernels.row_sizes[-1] == pytest.approx(size, rel=2e-3)


def test_a_row_that_is_level_at_the_start_is_measured_beside_it():
    """The gradient of (y − x²)² vanishes where the row holds, and that is where mechanisms start."""
    m = Model("level")
    a = m.point("A", (1.0, 1.0))
    m.body("ball", points=[a], mass=1.0)
    m.point("B", (0.0, 0.0), fixed=True)
    m.constrain((a.y - a.x**2) ** 2)
    size = ncgen.compile(m, backend="numpy").row_sizes[-1]
    assert 0.01 < size < 1


def test_small_rolling_rows_hold_for_accelerations():
    """A velocity row in numbers of 1e-9: its accelerations keep it to rounding like any other."""
    m = Model("small")
    a = m.point("A", (0.0, 0.0))
    m.body("ball", points=[a], mass=1.0)
    m.gravity((0.0, -9.81, 0.0))
    m.constrain_velocity(1e-9 * (a.y.rate - a.x * a.x.rate))
    kernels = ncgen.compile(m, backend="numpy")
    run = ncgen.simulate(kernels, 0.1, qd0={"A.x": 1.0}, rtol=1e-9)
    assert np.max(np.abs(kernels.jacobian(run.q[-1]) @ run.qd[-1])) < 1e-9 * 1e-8
    # y' = x x' integrates to y = x²/2
    assert run.q[-1, 1] == pytest.approx(run.q[-1, 0] ** 2 / 2, abs=1e-8)


@pytest.mark.parametrize("away", [100.0, 1e3, 1e5])
def test_far_from_the_origin_a_mechanism_has_no_masses_that_are_rounding(monkeypatch, away):
    """Bennett's linkage moves there as at the origin, by the matrix, too; its axes had masses of 1e-29 kg."""
    module = example_module("bennett")
    near = ncgen.simulate(ncgen.compile(module.build()), 0.5)
    monkeypatch.setattr(module, "CORNERS", module.CORNERS + [away, -away, 0.0])
    kernels = ncgen.compile(module.build())
    axes = [kernels.index[name] for name in kernels.coordinates if name.startswith("u")]
    assert not kernels.mass_matrix(kernels.q0)[axes].any()
    for engine in ("auto", "c"):
        far = ncgen.simulate(kernels, 0.5, engine=engine)
        assert far["theta2"][-1] == pytest.approx(near["theta2"][-1], abs=1e-7 + 1e-12 * away)


@pytest.mark.parametrize("size", [1e-9, 1e-7, 1.0, 1e6])
def test_a_row_of_a_model_that_was_one_point_has_the_size_of_all_of_it(size):
    """A ball that slides on a slope through its own centre, told before all else: g − (g·n) n. Its row was as large as 1 m, next to which a
    tenth of a micrometre was nothing, so that it fell through the slope."""
    m = Model("slope")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0, 0, 0))
    n = m.vector("n", (0.6, 0.0, 0.8), fixed=True)
    m.point_in_plane(m.ground, B, A, n)
    C = m.point("C", (size, 0.3 * size, 0.2 * size))
    m.body("ball", points=[B], mass=1.0)
    m.body("free", points=[C], mass=1.0)
    m.gravity((0, 0, -9.81 * size))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 1e-3, points=2)
    expected = np.array([9.81 * 0.8 * 0.6, 0, -9.81 * 0.6 * 0.6, 0, 0, -9.81])
    assert run.qdd[0] / size == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1e-7, 1.0, 1e6])
def test_what_is_welded_to_the_ground_rests(size):
    """A body of one point is all of its model, and there is nothing but its inertia to measure lengths with."""
    m = Model("welded")
    A, u, v = m.point("A", (1.2 * size, 0.4 * size, 0.0)), m.vector("u", (1, 0, 0)), m.vector("v", (0, 0.6, 0.8))
    body = m.body("b", points=[A], vectors=[u, v], mass=7.0, inertia=size**2 * np.diag([3.9, 2.6, 5.7]))
    m.rigid(m.ground, body)
    m.gravity((0, -9.81 * size, 0))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 0.05, points=2)
    assert np.max(np.abs(run.qdd)) <= 1e-12 * 9.81 * size


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-5])
@pytest.mark.parametrize("is_first", [True, False])
def test_sizes_do_not_depend_on_when_a_row_is_made(gap, is_first):
    """A plane through two points that coincide but for rounding, made before there are other points or after: in natural sizes its gradient
    is its normal. Made first it was divided by the gap, and no size made up for that."""
    m = Model("slope")

    def plane():
        A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (gap, 0, -0.75 * gap))
        m.point_in_plane(m.ground, B, A, m.vector("n", (0.6, 0.0, 0.8), fixed=True))

    if is_first:
        plane()
    m.point("C", (2.0, 0.5, 0.0))
    if not is_first:
        plane()
    kernels = ncgen.compile(m, "numpy")
    gradient = kernels.jacobian(kernels.q0)[0] * kernels.column_sizes / kernels.row_sizes[0]
    columns = [kernels.index[name] for name in ("B.x", "B.y", "B.z")]
    assert gradient[columns] == pytest.approx([0.6, 0.0, 0.8], rel=1e-12)


@pytest.mark.parametrize(("x", "y", "size"), [(0.006, 0.008, 0.01), (0.006, 0.0, 0.006), (0.0, 0.0, 2.0)])
def test_a_point_of_a_small_body_is_held_by_its_own_distance(x, y, size):
    """D is a combination of other points of its body, which is small in a mechanism of 2 m: its rows are as large as D is away from the
    origin of the body, and only where it is there as large as the mechanism. They were so everywhere."""
    m = Model("small")
    A, B, C, D = (m.point(*each) for each in (("A", (0, 0, 0)), ("B", (0.01, 0, 0)), ("C", (0, 0.01, 0)), ("D", (x, y, 0))))
    m.point("F", (2.0, 0.0, 0.0), fixed=True)
    m.body("plate", points=[A, B, C, D], mass=1.0, com=(0.003, 0.003, 0), inertia=1e-5 * np.eye(3))
    kernels = ncgen.compile(m, "numpy")
    sizes = [s for row, s in zip(kernels.rows, kernels.row_sizes, strict=True) if row.label.startswith("combination D")]
    assert sizes == pytest.approx([size] * 3)
