"""What stands in a model as a parameter is one: at any p the kernels are those of the model built with those numbers."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model, ModelError
from ncgen.exchange.toml_writer import to_toml
from ncgen.solver.loads.reactions import reactions

DEFAULTS = {"L": 0.9, "h": 0.3, "a": 0.4}
CHANGED = {"L": 1.15, "h": 0.22, "a": 0.7}
GRAVITY = (0.4, -9.81, 1.3)


def link(m, L, h, a, f):
    """A planar link whose length is L, with its mass and inertia and a point beside it, hinged to a fixed point at a height."""
    A, B = m.point("A", (0, h), fixed=True), m.point("B", (L * f.cos(a), h + L * f.sin(a)))
    body = m.body("link", [A, B], mass=1.5, com=(L / 2 * f.cos(a), h + L / 2 * f.sin(a)), inertia=L**2 / 8)
    C = m.attach_point(body, "C", (0.35, h + L / 3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.angle("psi", x, C - A, z)
    G = m.point("G", (1.2, 0.8), fixed=True)
    m.spring(C, G, 12.0, 0.4)
    m.torsion_spring(m.elements["psi"], 3.0)


def rest_of_basis(m, L, h, a, f):
    """Two hinged bars; the middle of the basis is the centre of mass where none is given."""
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (L, 0.1))
    C = m.point("C", (L + h, -a))
    m.body("first", [A, B], mass=2.0, inertia=0.2)
    m.body("second", [B, C], mass=1.0, inertia="point")
    m.body("bob", [C], mass=0.5)


def frame(m, L, h, a, f):
    """A spatial body on four points and a vector, further ones as combinations of them, and its inertia in full."""
    P = [m.point("P0", (0, 0, 0)), m.point("P1", (L, 0, h)), m.point("P2", (0.1, 1, 0)), m.point("P3", (0, a, 1))]
    u = m.vector("u", (f.cos(a), 0, f.sin(a)))
    tensor = [[0.5 + h, 0.05, 0.02 * a], [0.05, 0.7, 0], [0.02 * a, 0, 0.6]]
    body = m.body("frame", P, [u], mass=3.0, com=(0.2, L / 4, 0.1), inertia=tensor)
    far = m.attach_point(body, "far", (1, h, -L))
    m.attach_vector(body, "w", (0, f.sin(a), f.cos(a)))
    m.spring(far, m.point("wall", (2, h, 0), fixed=True), 20.0)
    m.couple(body, (0.3, a, -0.2))
    m.force(far, (0, 1.0, 0))


def bar(m, L, h, a, f):
    """A bar in space whose line turns with a parameter, and a point on it at a distance of its own."""
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (L * f.cos(a), L * f.sin(a), 0.2 * L))
    body = m.body("bar", [A, B], mass=1.3, inertia="point")
    m.attach_point(body, "C", (h * f.cos(a), h * f.sin(a), 0.2 * h))


def slender(m, L, h, a, f):
    """A body on two points and a vector: its third direction is a cross product."""
    A, B = m.point("A", (0, 0, 0)), m.point("B", (L, 0, h))
    u = m.vector("u", (0, f.cos(a), f.sin(a)))
    m.body("slender", [A, B], [u], mass=2.0, com=(0.3, 0.1, h), inertia=(0.3, 0.4, 0.5))


def completed(m, L, h, a, f):
    """The same with an auxiliary vector."""
    A, B = m.point("A", (0, 0, 0)), m.point("B", (L, 0, h))
    u = m.vector("u", (0, f.cos(a), f.sin(a)))
    m.body("completed", [A, B], [u], mass=2.0, com=(0.3, 0.1, h), inertia=(0.3, 0.4, 0.5), constant_mass=True)


def joints(m, L, h, a, f):
    """Bodies on joints whose points and axes stand at parameters."""
    O = m.point("O", (0, h, 0), fixed=True)
    axis = m.vector("axis", (f.cos(a), f.sin(a), 0), fixed=True)
    A = m.point("A", (L * f.cos(a), h + L * f.sin(a), 0))
    first = m.body("first", [A, m.point("A1", (0.2, h, 1))], mass=1.0, inertia="point")
    m.cylindrical(m.ground, first, O, A, axis)
    s = m.slide("s", O, A, axis)
    m.torsion_spring(s, 50.0)
    u, v = m.vector("u", (0, f.sin(a), f.cos(a))), m.vector("v", (f.cos(h), 0, f.sin(h)))
    second = m.body("second", [A, m.point("B", (1, 1, L))], mass=1.0, inertia="point")
    m.universal(first, second, A, u, v)
    D = m.point("D", (1, L, a))
    m.point_in_plane(second, D, A, v)
    m.length("d", A, D)


def prism(m, L, h, a, f):
    """A slider on a body that moves, without turning on it."""
    P, Q = m.point("P", (0, 0, 0)), m.point("Q", (L * f.cos(a), L * f.sin(a), 0))
    axis = m.vector("axis", (f.cos(a), f.sin(a), 0))
    beam = m.body("beam", [P, m.point("P1", (0, 0.2, h)), m.point("P2", (h, 1, -1))], [axis], mass=2.0, inertia=(0.2, 0.2, 0.2))
    slider = m.body("slider", [Q, m.point("Q1", (1, 0.3, L))], mass=1.0, inertia="point")
    m.prismatic(beam, slider, P, Q, axis)


BUILDERS = (link, rest_of_basis, frame, bar, slender, completed, joints)


def build(builder, numbers=None):
    """With parameters, or with numbers in their place."""
    m = Model("where")
    if numbers is None:
        given = {name: m.parameter(name, value).symbol for name, value in DEFAULTS.items()}
    builder(m, **(given if numbers is None else numbers), f=sympy if numbers is None else np)
    m.gravity(GRAVITY)
    return m


@pytest.fixture(scope="module", params=BUILDERS, ids=lambda builder: builder.__name__)
def pair(request):
    """The kernels with parameters, and those built with the changed numbers."""
    return ncgen.compile(build(request.param), "numpy"), ncgen.compile(build(request.param, CHANGED), "numpy")


P = np.array(list(CHANGED.values()))


def states(kernels):
    random = np.random.default_rng(5)
    for _ in range(2):
        yield random.normal(size=kernels.n), random.normal(size=kernels.n)


def test_the_initial_position_is_the_one_with_those_numbers(pair):
    kernels, numbers = pair
    assert kernels.coordinates == numbers.coordinates
    assert kernels.start(P) == pytest.approx(numbers.q0, abs=1e-14)
    assert np.array_equal(kernels.start(), kernels.q0)
    assert np.max(np.abs(kernels.phi(kernels.start(P), 0.0, P))) < 1e-13
    assert kernels.start(np.array([P, kernels.p0])) == pytest.approx(np.array([numbers.q0, kernels.q0]), abs=1e-14)


def test_kernels_are_those_with_the_numbers(pair):
    """Rows up to the constant that each is divided by, everything else to rounding."""
    kernels, numbers = pair
    for q, qd in states(kernels):
        here, there = kernels.jacobian(q, 0.0, P), numbers.jacobian(q)
        scale = np.sum(here * there, axis=1) / np.sum(there**2, axis=1)
        assert np.all(scale > 0.1)
        assert here == pytest.approx(there * scale[:, None], abs=1e-12)
        assert kernels.phi(q, 0.0, P) == pytest.approx(numbers.phi(q) * scale, abs=1e-11)
        assert kernels.gamma(q, qd, 0.0, P) == pytest.approx(numbers.gamma(q, qd) * scale, abs=1e-10)
        assert kernels.mass_matrix(q, 0.0, P) == pytest.approx(numbers.mass_matrix(q), abs=1e-11)
        assert kernels.force(q, qd, 0.0, P) == pytest.approx(numbers.force(q, qd), rel=1e-11, abs=1e-10)
        assert kernels.energy(q, qd, 0.0, P) == pytest.approx(numbers.energy(q, qd), rel=1e-10, abs=1e-10)


def test_derivatives_by_parameters_are_complex_steps(pair):
    """Φ_p and the derivative of the start against complex steps of the kernels themselves, which share no derivative with them."""
    kernels, _ = pair
    for q, qd in states(kernels):
        for k in range(len(P)):
            step = P + 1e-30j * np.eye(len(P))[k]
            assert kernels.phi_p(q, 0.0, P).toarray()[:, k] == pytest.approx(kernels.phi(q, 0.0, step).imag / 1e-30, rel=1e-11, abs=1e-11)
            acceleration = kernels.jacobian(q, 0.0, step) @ qd - kernels.gamma(q, qd, 0.0, step)
            assert kernels.phidd_p(q, qd, qd, 0.0, P).toarray()[:, k] == pytest.approx(acceleration.imag / 1e-30, rel=1e-10, abs=1e-10)
            lam = np.linspace(1, 2, kernels.m)
            balance = kernels.mass_matrix(q, 0.0, step) @ qd + kernels.jacobian(q, 0.0, step).T @ lam - kernels.force(q, qd, 0.0, step)
            assert kernels.balance_p(q, qd, qd, lam, 0.0, P).toarray()[:, k] == pytest.approx(balance.imag / 1e-30, rel=1e-9, abs=1e-9)


def test_the_slope_of_the_start(pair):
    """∂start/∂p by central differences of models built with numbers."""
    kernels, _ = pair
    h = 1e-6
    for k, name in enumerate(CHANGED):
        after, before = kernels.start(P + h * np.eye(3)[k]), kernels.start(P - h * np.eye(3)[k])
        assert kernels.start_p(P)[:, k] == pytest.approx((after - before) / (2 * h), abs=1e-8), name


def test_a_joint_on_a_body_that_is_not_fixed():
    """Directions across an axis become vectors of their own there: more coordinates, the same position and freedom."""
    kernels, numbers = ncgen.compile(build(prism), "numpy"), ncgen.compile(build(prism, CHANGED), "numpy")
    start = dict(zip(kernels.coordinates, kernels.start(P), strict=True))
    assert np.max(np.abs(kernels.phi(kernels.start(P), 0.0, P))) < 1e-13
    assert [start[name] for name in numbers.coordinates] == pytest.approx(numbers.q0, abs=1e-13)
    assert ncgen.freedom(kernels, p=P).dof == ncgen.freedom(numbers).dof == 7


def test_files_say_the_same(tmp_path):
    """Positions, centres of mass and moments with parameters go through a model file and give the same code."""
    m = build(link)
    (tmp_path / "where.toml").write_text(to_toml(m), encoding="utf-8")
    read = ncgen.load(tmp_path / "where.toml")
    assert to_toml(read) == to_toml(m)
    assert ncgen.generate(read).files == ncgen.generate(m).files


def test_a_sweep_takes_parameters_by_name():
    """As every other door does, also where the initial position depends on them."""
    kernels = ncgen.compile(build(link), "numpy")
    psi = kernels.start(P)[kernels.index["psi"]] + np.array([0.1, 0.2])
    by_name, in_order = (ncgen.sweep(kernels, "psi", psi, p=p) for p in (dict(zip(kernels.parameters, P, strict=True)), P))
    assert np.array_equal(by_name, in_order) and np.allclose(by_name[:, kernels.index["psi"]], psi)


def test_motion_and_loads_are_those_of_the_numbers():
    """A fall of the link with p given at run time, and the load of its hinge."""
    kernels, numbers = ncgen.compile(build(link), "numpy"), ncgen.compile(build(link, CHANGED), "numpy")
    run, expected = ncgen.simulate(kernels, 0.3, p=P, q0=kernels.start(P), points=4), ncgen.simulate(numbers, 0.3, points=4)
    assert run.q == pytest.approx(expected.q, abs=1e-7)
    assert run.energy_drift < 1e-7
    assert reactions(run).force("link", "A") == pytest.approx(reactions(expected).force("link", "A"), rel=1e-6)


def test_compiled_code_has_them_too():
    kernels, numbers = ncgen.compile(build(slender), "c"), ncgen.compile(build(slender, CHANGED), "numpy")
    q, qd = next(states(kernels))
    assert kernels.mass_matrix(q, 0.0, P) == pytest.approx(numbers.mass_matrix(q), abs=1e-12)
    assert kernels.start(P) == pytest.approx(numbers.q0, abs=1e-14)
    assert ncgen.assemble(kernels, p=P) == pytest.approx(numbers.q0, abs=1e-12)


def test_sensitivities_are_differences_of_models_with_numbers():
    """A link of parametric length and place falls; its motion by the parameters against rebuilt models."""
    kernels = ncgen.compile(build(link), "numpy")
    found = ncgen.sensitivities(kernels, 0.4, 12, z=("psi",))
    h = 1e-5
    for k, name in enumerate(DEFAULTS):
        ends = []
        for sign in (1, -1):
            numbers = ncgen.compile(build(link, {**DEFAULTS, name: DEFAULTS[name] + sign * h}), "numpy")
            ends.append(ncgen.sensitivities(numbers, 0.4, 12, z=("psi",)))
        expected = (ends[0].q[-1] - ends[1].q[-1]) / (2 * h)
        assert found.q_by[-1][:, k] == pytest.approx(expected, rel=1e-6, abs=1e-7), name
        assert np.max(np.abs(expected)) > 1e-2
        by_sweep = ncgen.gradient(kernels, 0.4, 12, lambda q, qd: (q[-1, 0], _last(q), None), z=("psi",))
        assert by_sweep.derivatives[name] == pytest.approx(expected[0], rel=1e-6, abs=1e-7)


def _last(q):
    slope = np.zeros_like(q)
    slope[-1, 0] = 1.0
    return slope


REFUSED = {
    "a vector that is one only here": (
        lambda m, p: m.vector("u", (p, 0.8, 0)),
        ["vector u", "length is 1 only at the default of p"],
    ),
    "a point that is on the line only here": (
        lambda m, p: m.attach_point(m.body("b", [m.point("A", (0, 0, 0)), m.point("B", (2, 0, 0))]), "C", (1, p - 0.6, 0)),
        ["body b", "point C", "default of p"],
    ),
    "a point mass that is at its point only here": (
        lambda m, p: [m.body("b", [m.point("A", (p, 0, 0))], mass=1.0, com=(0.6, 0, 0)), ncgen.generate(m)],
        ["body b", "parameters"],
    ),
    "a bar whose centre is on its line only here": (
        lambda m, p: [
            m.body("b", [m.point("A", (0, 0, 0)), m.point("B", (1, p, 0))], mass=1.0, com=(0.5, 0.3, 0), inertia="point"),
            ncgen.generate(m),
        ],
        ["body b", "line", "parameters"],
    ),
    "a bar whose inertia turns": (
        lambda m, p: [
            m.body("b", [m.point("A", (0, 0, 0)), m.point("B", (1, p - 0.6, 0))], mass=1.0, inertia=(0, 1, 1)),
            ncgen.generate(m),
        ],
        ["body b", "symmetric", "parameters"],
    ),
    "a parameter of another model": (
        lambda m, p: m.point("A", (Model("other").parameter("q", 1.0), 0)),
        ["point A, x", "q", "another model"],
    ),
    "a position outside the domain": (lambda m, p: m.point("A", (sympy.sqrt(p - 1), 0)), ["point A, x", "finite"]),
    "a position that moves": (lambda m, p: m.point("A", (p * m.time, 0)), ["point A, x", "t is not a parameter"]),
    "a direction with a parameter as weight": (
        lambda m, p: m.angle("psi", m.vector("u", (1, 0, 0)) * p, m.vector("v", (0, 1, 0)), m.vector("w", (0, 0, 1))),
        ["angle psi", "of u is not a number"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_one_is_refused_by_name(case):
    act, words = REFUSED[case]
    m = Model("refused")
    with pytest.raises(ModelError) as caught:
        act(m, m.parameter("p", 0.6))
    message = str(caught.value)
    assert [word for word in words if word not in message] == [] and len(message) <= 300 and "\n" not in message
