"""Φ, Φ_q and γ of the robot against 50 digits, complex steps, differences and the (H, b, c) table."""

import numpy as np
import pytest
from oracles.quadratic import QuadraticRows
from oracles.rows_mp import RowsOracle
from oracles.series import EPSILON

import ncgen

BOUND = 4.0
"""Allowed error in ulps of a row's scale."""

VARIANTS = [(form, scale) for form in ("smooth", "paper", "sine", "cosine") for scale in (True, False)]


def evaluate(kernels, q, qd):
    """{kernel: values at every position}, matrices dense."""
    states = list(zip(q, qd, strict=True))
    return {
        "phi": np.array([kernels.phi(x) for x, _ in states]),
        "phi_q": np.array([kernels.jacobian(x) for x, _ in states]),
        "gamma": np.array([kernels.gamma(x, v) for x, v in states]),
    }


def at_once(kernels, q, qd):
    """The same from the one kernel that computes all of them."""
    phi, phi_q, gamma = zip(*(kernels.constraints(x, v) for x, v in zip(q, qd, strict=True)), strict=True)
    return {"phi": np.array(phi), "phi_q": np.array([j.toarray() for j in phi_q]), "gamma": np.array(gamma)}


def place(kernels, name):
    """Where a point or vector stands in q."""
    first = kernels.index[f"{name}.x"]
    return slice(first, first + 3)


def angles(kernels):
    return [i for i, name in enumerate(kernels.coordinates) if name.startswith("psi")]


def random_positions(kernels, rng, count):
    """Around the initial position, far enough to violate every row, with any angles; and velocities."""
    q = kernels.q0 + 0.3 * rng.normal(size=(count, kernels.n))
    q[:, angles(kernels)] = rng.uniform(-2 * np.pi, 2 * np.pi, (count, len(angles(kernels))))
    return q, rng.normal(size=(count, kernels.n))


def flatten(kernels, q, rng):
    """The parallelogram 2-3-5-4 folded into a line, up to 1e-9."""
    r2, r3, r4, r5 = (place(kernels, name) for name in ("r2", "r3", "r4", "r5"))
    q[r4] = q[r2] + 2.5 * (q[r3] - q[r2]) + 1e-9 * rng.normal(size=3)
    q[r5] = q[r4] + q[r3] - q[r2]


def collapse(kernels, q, rng):
    """Points that should be apart, 1e-9 apart."""
    for one, other in (("r3", "r2"), ("r6", "r5"), ("r8", "r7")):
        q[place(kernels, one)] = q[place(kernels, other)] + 1e-9 * rng.normal(size=3)


def align(kernels, q, rng):
    """Vectors that should be perpendicular, parallel up to 1e-9."""
    q[place(kernels, "u4")] = q[place(kernels, "u3")] + 1e-9 * rng.normal(size=3)
    q[place(kernels, "u5")] = q[place(kernels, "r8")] - q[place(kernels, "r7")]


def square(kernels, q, rng):
    """Angles at multiples of π/2, up to 1e-9: where a sine or a cosine row loses its rank."""
    chosen = angles(kernels)
    q[chosen] = np.pi / 2 * rng.integers(-4, 5, len(chosen)) + 1e-9 * rng.choice([-1.0, 1.0], len(chosen))


def near_singular_positions(kernels, rng, count):
    """Every kind of trouble in turn, on positions that satisfy the other rows nearly."""
    q = kernels.q0 + 1e-3 * rng.normal(size=(count, kernels.n))
    troubles = (flatten, collapse, align, square)
    for number, position in enumerate(q):
        troubles[number % len(troubles)](kernels, position, rng)
    return q, rng.normal(size=q.shape)


def states(kernels, random, singular, seed=2007):
    rng = np.random.default_rng(seed)
    return map(np.concatenate, zip(random_positions(kernels, rng, random), near_singular_positions(kernels, rng, singular)))


def worst(errors, kernels):
    """The greatest error and where it is, in words."""
    index = np.unravel_index(np.argmax(errors), errors.shape)
    column = f", {kernels.coordinates[index[2]]}" if len(index) == 3 else ""
    row = f"row {index[1] + 1} {kernels.rows[index[1]].label}{column}"
    return errors[index], f"{errors[index]:.2f} ulp at position {index[0]}, {row}"


def assert_within_bound(oracle_values, kernels, q, qd):
    for way in (evaluate, at_once):
        for name, computed in way(kernels, q, qd).items():
            error, where = worst(getattr(oracle_values, name).ulps(computed), kernels)
            assert error <= BOUND, f"{kernels.backend} {way.__name__} {name}: {where}"


def test_robot_to_the_last_digits(robot, robot_numpy):
    """The sum of all roundings stays within 4 ulp of the row's scale, on 200 random and 20 near-singular positions."""
    q, qd = states(robot, 200, 20)
    exact = RowsOracle(robot.model).over(q, qd)
    for kernels in (robot, robot_numpy):
        assert_within_bound(exact, kernels, q, qd)


@pytest.mark.parametrize(("form", "scale"), [*VARIANTS[1:4], *(pytest.param(*v, marks=pytest.mark.slow) for v in VARIANTS[4:])])
def test_forms_and_scales(robot_tables, form, scale):
    """Every form of the angle rows, raw and scaled, in both backends and all emissions."""
    model = robot_tables.build(form=form, scale=scale)
    variants = [ncgen.compile(model, "c"), *(ncgen.compile(model, "numpy", emission) for emission in ("unrolled", "tabled"))]
    q, qd = states(variants[0], 12, 8, seed=len(form) + scale)
    exact = RowsOracle(model).over(q, qd)
    for kernels in variants:
        assert_within_bound(exact, kernels, q, qd)


def test_printed_tables(robot_tables):
    """Table 5 as printed, with the rule of the paper: Table 4's vector equations, component by component."""
    model = robot_tables.build(angles=robot_tables.PRINTED_ANGLES, form="paper", scale=False)
    kernels = ncgen.compile(model, "numpy")
    rng = np.random.default_rng(5)
    (q,), _ = random_positions(kernels, rng, 1)
    at = {name: model.elements[name].initial for name in ("r1", "u1", "u2")}
    at |= {name: q[place(kernels, name)] for name in ("r2", "r4", "r6", "r7", "r8", "u3", "u4", "u5")}
    psi = q[angles(kernels)]
    L24, L46, L67, L78 = (getattr(robot_tables, name) for name in ("L24", "L46", "L67", "L78"))
    r = {i: at[f"r{i}"] for i in (1, 2, 4, 6, 7, 8)}
    table_5 = [  # a, b, n/|n|, |a||b| by Table 4; 1014 measures to r_i − r_j of `k i j l`
        (at["u3"], at["u2"], at["u1"], 1.0),
        (at["u1"], r[4] - r[2], at["u3"], L24),
        (r[4] - r[6], r[7] - r[6], at["u3"], L46 * L67),
        (at["u3"], at["u4"], (r[7] - r[6]) / L67, 1.0),
        (r[6] - r[7], r[8] - r[7], at["u4"], L67 * L78),
        (at["u5"], at["u4"], (r[8] - r[7]) / L78, 1.0),
    ]
    for choice in range(4):  # 0: scalar product, 1-3: components x, y, z of the vector product
        p = np.tile(np.eye(4)[choice], 6)
        for (a, b, n, product), angle, row in zip(table_5, psi, kernels.phi(q, p=p)[25:], strict=True):
            vector = np.cross(a, b) - n * product * np.sin(angle)
            expected = [a @ b - product * np.cos(angle), *vector][choice]
            assert row == pytest.approx(expected, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_emissions_agree(robot_model, robot, backend):
    """Loops over index tables and straight-line code sum in different orders, and in no other way."""
    variants = [ncgen.compile(robot_model, backend, emission) for emission in ("auto", "unrolled", "tabled")]
    q, qd = states(robot, 30, 10, seed=3)
    first, *others = ([*evaluate(k, q, qd).values(), *_dynamics(k, q, qd)] for k in variants)
    for other in others:
        for a, b in zip(first, other, strict=True):
            size = np.abs(a).max(axis=tuple(range(1, a.ndim)), keepdims=True)
            assert np.all(np.abs(a - b) <= 8 * EPSILON * size)


def _dynamics(kernels, q, qd):
    yield np.array([kernels.mass_matrix(x) for x in q])
    yield np.array([kernels.force(x, v) for x, v in zip(q, qd, strict=True)])
    yield np.array([kernels.energy(x, v) for x, v in zip(q, qd, strict=True)])


def test_complex_step(robot_numpy):
    """Φ_q w = Im Φ(q + i h w)/h holds to rounding, since h² vanishes: along every coordinate, at 20 positions."""
    q, _ = states(robot_numpy, 15, 5, seed=7)
    h = 1e-30
    steps = q[:, None, :] + 1j * h * np.eye(robot_numpy.n)
    derivative = np.moveaxis(robot_numpy.phi(steps).imag / h, 1, 2)
    jacobian = robot_numpy.jacobian(q)
    size = np.abs(jacobian).max(axis=2, keepdims=True)
    assert np.all(np.abs(derivative - jacobian) <= 1e-14 * size)


def test_gamma_is_the_curvature_along_a_straight_motion(robot, robot_numpy):
    """γ = −d/ds [Φ_q(q + s q̇) q̇], by central differences of fourth order."""
    q, qd = states(robot, 15, 5, seed=11)
    step = 1e-3
    for kernels in (robot, robot_numpy):
        for x, v in zip(q, qd, strict=True):
            rate = [kernels.jacobian(x + k * step * v) @ v for k in (-2, -1, 1, 2)]
            expected = -(rate[0] - 8 * rate[1] + 8 * rate[2] - rate[3]) / (12 * step)
            size = max(1.0, np.abs(expected).max())
            assert kernels.gamma(x, v) == pytest.approx(expected, rel=0, abs=1e-9 * size)


@pytest.mark.parametrize("scale", [True, False])
def test_quadratic_table(robot_tables, scale):
    """All rows of Table 3 from ½ qᵀHq + bᵀq + c, up to the rounding of either sum."""
    model = robot_tables.build(scale=scale)
    table = QuadraticRows(model)
    assert table.numbers == list(range(25))
    for backend in ("c", "numpy"):
        kernels = ncgen.compile(model, backend)
        for x, v in zip(*states(kernels, 20, 8, seed=13), strict=True):
            tolerance = 64 * EPSILON * np.maximum(table.size(x), 1.0)
            assert np.all(np.abs(kernels.phi(x)[:25] - table.phi(x)) <= tolerance)
            assert np.all(np.abs(kernels.jacobian(x)[:25] - table.phi_q(x)) <= tolerance[:, None])
            curvature = np.einsum("i,rij,j->r", abs(v), abs(table.H), abs(v))
            assert np.all(np.abs(kernels.gamma(x, v)[:25] - table.gamma(v)) <= 64 * EPSILON * curvature)


@pytest.mark.parametrize("emission", ["unrolled", "tabled"])
@pytest.mark.parametrize("form", ["smooth", "paper"])
def test_batches(robot_tables, form, emission):
    """Leading axes of q and qd are batches: the same numbers as position by position, bit by bit or a last bit apart."""
    kernels = ncgen.compile(robot_tables.build(form=form), "numpy", emission)
    for shape in ((5,), (2, 3)):
        count = int(np.prod(shape))
        q, qd = random_positions(kernels, np.random.default_rng(count), count)
        batched = (*shape, kernels.n)
        for name in ("phi", "jacobian", "mass_matrix", "gamma", "force", "energy"):
            kernel = getattr(kernels, name)
            with_rates = name in ("gamma", "force", "energy")
            single = np.array([kernel(*state) if with_rates else kernel(state[0]) for state in zip(q, qd, strict=True)])
            batch = kernel(q.reshape(batched), qd.reshape(batched)) if with_rates else kernel(q.reshape(batched))
            assert batch.shape == (*shape, *single.shape[1:]), name
            size = np.abs(single).max()
            assert np.all(np.abs(batch.reshape(single.shape) - single) <= 4 * EPSILON * size), name


def test_batches_of_parameters(robot_tables):
    """p may be a batch too: here the choice of the paper's rows."""
    kernels = ncgen.compile(robot_tables.build(form="paper"), "numpy")
    rng = np.random.default_rng(17)
    q, qd = random_positions(kernels, rng, 4)
    p = np.eye(4)[rng.integers(0, 4, (4, 6))].reshape(4, 24)
    for name in ("phi", "jacobian"):
        kernel = getattr(kernels, name)
        single = np.array([kernel(x, p=w) for x, w in zip(q, p, strict=True)])
        assert kernel(q, p=p) == pytest.approx(single, rel=1e-15, abs=1e-15)
        assert kernel(q[0], p=p).shape == single.shape
    single = np.array([kernels.gamma(x, v, p=w) for x, v, w in zip(q, qd, p, strict=True)])
    assert kernels.gamma(q, qd, p=p) == pytest.approx(single, rel=1e-15, abs=1e-15)
