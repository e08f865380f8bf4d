"""Any mechanism: random points, vectors, fixed components and rows of all types, held to the same oracles."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st
from oracles.quadratic import QuadraticRows
from oracles.rows_mp import RowsOracle
from oracles.series import EPSILON

import ncgen

BOUND = 4.0
FIXED = st.sampled_from(["", "", "x", "y", "z", "xy", "yz", "xz", "xyz"])
FORMS = st.sampled_from(["smooth", "smooth", "sine", "cosine", "paper"])


@dataclass
class Drawn:
    """A model under construction and what its rows may speak of."""

    model: ncgen.Model
    points: list
    vectors: list

    @property
    def directions(self):
        """Generic ones: no two are parallel. Segments, vectors, a median, a tilted vector."""
        pairs = list(zip(self.points, self.points[1:]))
        a, b, c = self.points[:3]
        return [q - p for p, q in pairs] + self.vectors + [(a + b) * 0.5 - c, self.vectors[0] * 2 - (b - c) * 0.25]


def add_distance(draw, drawn, number):
    a, b = draw(st.permutations(drawn.points))[:2]
    length = drawn.model.parameter(f"L{number}", draw(st.floats(0.1, 10))) if draw(st.booleans()) else None
    drawn.model.distance(a, b, length=length)


def add_unit(draw, drawn, number):
    drawn.model.unit(draw(st.sampled_from(drawn.vectors)))


def add_vector_segment(draw, drawn, number):
    a, b = draw(st.permutations(drawn.points))[:2]
    drawn.model.vector_segment(draw(st.sampled_from(drawn.vectors)), a - b, cosine=draw(st.sampled_from([None, 0.0])))


def add_vector_vector(draw, drawn, number):
    u, v = draw(st.permutations(drawn.vectors))[:2]
    drawn.model.vector_vector(u, v, cosine=draw(st.sampled_from([None, 0.0])))


def add_angle(draw, drawn, number):
    directions = draw(st.permutations(drawn.directions))[:3]
    signs = draw(st.tuples(*[st.sampled_from([1.0, -1.0])] * 3))
    start, end, axis = (d * s for d, s in zip(directions, signs, strict=True))
    drawn.model.angle(f"psi{number}", start, end, axis, form=draw(FORMS))


ADD = st.sampled_from([add_distance, add_unit, add_vector_segment, add_vector_vector, add_angle, add_angle])


@st.composite
def mechanisms(draw):
    """3-6 points, 2-3 vectors, 1-8 rows; the numbers come from a seed, since only the structure needs to shrink."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    model = ncgen.Model("random", scale=draw(st.booleans()))
    points = [model.point(f"r{i}", rng.normal(size=3), fixed=draw(FIXED)) for i in range(draw(st.integers(3, 6)))]
    directions = rng.normal(size=(draw(st.integers(2, 3)), 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    vectors = [model.vector(f"u{i}", direction, fixed=draw(FIXED)) for i, direction in enumerate(directions)]
    drawn = Drawn(model, points, vectors)
    for number in range(draw(st.integers(1, 8))):
        draw(ADD)(draw, drawn, number)
    return model


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(model=mechanisms(), emission=st.sampled_from(["auto", "unrolled", "tabled"]), seed=st.integers(0, 10**6))
def test_random_mechanism(model, emission, seed):
    kernels = ncgen.compile(model, "numpy", emission)
    rng = np.random.default_rng(seed)
    q = kernels.q0 + rng.normal(size=(4, kernels.n))
    qd = rng.normal(size=q.shape)
    oracle = RowsOracle(model)
    for row in model.rows:
        event(row.type.key)
    exact = oracle.over(q, qd)
    phi, jacobian, gamma = kernels.phi(q), kernels.jacobian(q), kernels.gamma(q, qd)
    assert exact.phi.ulps(phi).max(initial=0) <= BOUND
    assert exact.phi_q.ulps(jacobian).max(initial=0) <= BOUND
    assert exact.gamma.ulps(gamma).max(initial=0) <= BOUND
    check_table(QuadraticRows(model), kernels, q, qd)


def check_table(table, kernels, q, qd):
    for x, v in zip(q, qd, strict=True):
        size = 64 * EPSILON * np.maximum(table.size(x), 1.0)
        assert np.all(np.abs(kernels.phi(x)[table.numbers] - table.phi(x)) <= size)
        assert np.all(np.abs(kernels.jacobian(x)[table.numbers] - table.phi_q(x)) <= size[:, None])
        size = 64 * EPSILON * (v @ v) * np.abs(table.H).max(initial=1)
        assert np.all(np.abs(kernels.gamma(x, v)[table.numbers] - table.gamma(v)) <= size)


@pytest.mark.parametrize("perpendicular", [False, True])
def test_smooth_row_with_and_without_projection(perpendicular):
    """Sides that other rows keep perpendicular to the axis lose the projection term; tilted sides keep it."""
    model = ncgen.Model("angles")
    a, b = (model.vector(name, direction) for name, direction in (("a", (1, 0, 0)), ("b", (0, 1, 0))))
    n = model.point("top", (0.1, 0.2, 2.5)) - model.point("foot", (0.1, 0.2, 0.5))
    if perpendicular:
        model.vector_segment(a, n, cosine=0.0)
        model.vector_segment(b, -n, cosine=0.0)
    model.angle("psi", a, b, n)
    expected = "angle-smooth-perpendicular" if perpendicular else "angle-smooth"
    oracle = RowsOracle(model)
    assert oracle.keys[-1] == expected
    rng = np.random.default_rng(41)
    for backend in ("c", "numpy"):
        kernels = ncgen.compile(model, backend)
        q, qd = rng.normal(size=(2, 50, kernels.n))
        exact = oracle.over(q, qd)
        assert exact.phi.ulps(np.array([kernels.phi(x) for x in q])).max() <= BOUND
        assert exact.phi_q.ulps(np.array([kernels.jacobian(x) for x in q])).max() <= BOUND
        assert exact.gamma.ulps(np.array([kernels.gamma(x, v) for x, v in zip(q, qd, strict=True)])).max() <= BOUND
