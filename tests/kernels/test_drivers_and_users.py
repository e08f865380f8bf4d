"""Drivers, users' constraints and forces, and parameters, against 50-digit differences of the same words.

Every mechanism is written once, as functions of (f, t, x, p): f is sympy when the model is made, and mpmath when
numbers are expected; x and v hold coordinates and rates by name, p the parameters.
"""

from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
import sympy

import ncgen

ROUNDING = 1e-14


def laws(f, t, x, p):
    """Constraints by hand: drivers, time-dependent coefficients, every elementary function, parameters."""
    return [
        x.psi - (p.amplitude * f.sin(p.omega * t) + t**2 / 3),
        f.sin(t) * x.Bx**2 + x.By * x.psi - f.exp(-t / 2),
        f.cos(p.omega * t + x.psi) * x.Bz * x.Bx - p.amplitude / (1 + t**2),
        f.sqrt(x.Bx**2 + x.By**2 + 1) - f.log(2 + t * x.Bz) + f.atan(x.psi * t),
        f.tanh(x.Bx * t) * f.sinh(x.By) - f.cosh(x.Bz) + f.tan(x.psi / 3) + f.asin(x.Bx / 4) * f.acos(x.By / 5),
        f.atan2(x.By + t, x.Bx + 2) + (x.Bz**2 + 1) ** f.sin(t) - 1 / x.Bx**3,
        x.Bx * x.Ax - p.reach,
    ]


def forces(f, t, x, v, p):
    """Along B.x, B.y, B.z and psi: springs, dampers, motors."""
    return (
        -p.stiffness * (x.Bx - p.reach) - v.Bx * abs(v.Bx),
        f.sin(t) * x.Bz * v.By - p.stiffness / 7,
        3,
        p.amplitude * f.cos(p.omega * t) - v.psi * x.psi**2,
    )


def potential(f, x, p):
    return p.stiffness / 2 * (f.sqrt(x.Bx**2 + x.By**2 + x.Bz**2) - p.reach) ** 2 + f.cos(x.psi) * p.amplitude


NAMES = ("Bx", "By", "Bz", "psi")
DEFAULTS = dict(amplitude=0.7, omega=2.3, reach=1.1, stiffness=40.0)
CHANGED = dict(amplitude=-0.2, omega=3.1, reach=1.9, stiffness=12.5)


def build(p=None):
    """p: numbers instead of parameters, which makes them constants of the code."""
    m = ncgen.Model("users")
    p = SimpleNamespace(**(p or {name: m.parameter(name, value) for name, value in DEFAULTS.items()}))
    A = m.point("A", (p.reach, 0, 0), fixed=True)
    B = m.point("B", (1.4, 0.6, 0.5))
    n = m.vector("n", (0, 0, 1), fixed=True)
    e = m.vector("e", (1, 0, 0), fixed=True)
    psi = m.angle("psi", start=e, end=B - A, axis=n)
    x = SimpleNamespace(Bx=B.x.symbol, By=B.y.symbol, Bz=B.z.symbol, psi=psi.symbol, Ax=A.x.symbol)
    v = SimpleNamespace(Bx=B.x.rate, By=B.y.rate, Bz=B.z.rate, psi=psi.rate)
    p = SimpleNamespace(**{name: getattr(value, "symbol", value) for name, value in vars(p).items()})
    drive, *others = laws(sympy, m.time, x, p)
    m.drive(psi, psi.symbol - drive)
    for law in others:
        m.constrain(law)
    along = forces(sympy, m.time, x, v, p)
    m.force(B, along[:3])
    m.torque(psi, along[3])
    m.potential(potential(sympy, x, p))
    return m


@pytest.fixture(scope="module")
def sources():
    return ncgen.generate(build())


@pytest.fixture(scope="module", params=["c", "numpy"])
def kernels(request, sources):
    return ncgen.compile(sources, request.param)


@pytest.fixture(params=[DEFAULTS, CHANGED], ids=["defaults", "changed"])
def parameters(request):
    return request.param


def states():
    rng = np.random.default_rng(23)
    for _ in range(5):
        yield rng.uniform(0.1, 2.0), rng.uniform([0.5, -1, -1, -2], [2, 1, 1, 2]), rng.normal(size=4)


def named(values, p):
    """Coordinates by name; the fixed point A stands at a parameter."""
    return SimpleNamespace(**dict(zip(NAMES, values, strict=True)), Ax=p.reach)


def moved(q, direction, s):
    return [mpmath.mpf(float(a)) + s * mpmath.mpf(float(b)) for a, b in zip(q, direction, strict=True)]


def differences(function, order=1):
    """Derivative at 0 of a function of one mpf that gives a list: central differences at 50 digits, exact to 1e-29."""
    with mpmath.workdps(50):
        step = mpmath.mpf(10) ** -15
        before, here, after = (function(k * step) for k in (-1, 0, 1))
        if order == 1:
            return np.array([float((a - b) / (2 * step)) for a, b in zip(after, before, strict=True)])
        return np.array([float((a - 2 * h + b) / step**2) for a, h, b in zip(after, here, before, strict=True)])


def close(computed, expected):
    assert computed == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * max(1.0, np.abs(expected).max()))


def exact(p):
    return SimpleNamespace(**{name: mpmath.mpf(value) for name, value in p.items()})


def test_rows_of_users(kernels, parameters):
    """Φ, Φ_q, ν = −Φ_t and γ = −d²Φ(q + s q̇, t + s)/ds² of everything but the angle's own row, which is the first."""
    p, array = exact(parameters), np.array(list(parameters.values()))
    for t, q, qd in states():
        clock = mpmath.mpf(t)
        close(kernels.phi(q, t, array)[1:], np.array([float(v) for v in laws(mpmath, clock, named(moved(q, q, 0), p), p)]))
        columns = [differences(lambda s: laws(mpmath, clock, named(moved(q, e, s), p), p)) for e in np.eye(4)]
        close(kernels.jacobian(q, t, array)[1:], np.array(columns).T)
        close(kernels.nu(q, t, array)[1:], -differences(lambda s: laws(mpmath, clock + s, named(moved(q, q, 0), p), p)))
        curvature = differences(lambda s: laws(mpmath, clock + s, named(moved(q, qd, s), p), p), order=2)
        close(kernels.gamma(q, qd, t, array)[1:], -curvature)


def test_forces_of_users(kernels, parameters):
    """Q = forces − ∂V/∂q; the power is that of the forces alone, the energy that of the potential."""
    p, array = exact(parameters), np.array(list(parameters.values()))
    for t, q, qd in states():
        x, v = named(moved(q, q, 0), p), named(moved(qd, qd, 0), p)
        along = np.array([float(F) for F in forces(mpmath, mpmath.mpf(t), x, v, p)])
        gradient = [differences(lambda s: [potential(mpmath, named(moved(q, e, s), p), p)])[0] for e in np.eye(4)]
        close(kernels.force(q, qd, t, array), along - gradient)
        energy = float(potential(mpmath, x, p))
        close(kernels.energy(q, qd, t, array), np.array([0.0, energy, along @ qd]))
        close(kernels.values("power", t, q, qd, array), np.array([along @ qd]))


def test_angle_about_a_parameter(kernels, parameters):
    """The angle's row with the fixed point A at (reach, 0, 0): zero at ψ = atan2(B.y, B.x − reach), for any reach."""
    array = np.array(list(parameters.values()))
    for t, q, _ in states():
        q[3] = np.arctan2(q[1], q[0] - parameters["reach"])
        assert kernels.phi(q, t, array)[0] == pytest.approx(0.0, abs=ROUNDING)
        assert abs(kernels.phi(q + [0, 0, 0, 0.1], t, array)[0]) > 1e-3


def test_parameters_equal_numbers(kernels):
    """Changing p at run time is the same as building the model with those numbers."""
    array = np.array(list(CHANGED.values()))
    numbers = ncgen.compile(build(CHANGED), kernels.backend)
    for t, q, qd in states():
        close(kernels.phi(q, t, array), numbers.phi(q, t))
        close(kernels.jacobian(q, t, array), numbers.jacobian(q, t))
        close(kernels.nu(q, t, array), numbers.nu(q, t))
        close(kernels.gamma(q, qd, t, array), numbers.gamma(q, qd, t))
        close(kernels.force(q, qd, t, array), numbers.force(q, qd, t))
        close(kernels.energy(q, qd, t, array), numbers.energy(q, qd, t))


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_absolute_values_in_constraints(backend):
    """|x| y + sign(y) x², whose derivatives are by hand: away from the kinks sign is constant."""
    m = ncgen.Model("kinks")
    B = m.point("B", (1.4, 0.6, 0.5))
    x, y = B.x.symbol, B.y.symbol
    m.constrain(abs(x) * y + sympy.sign(y) * x**2)
    kernels = ncgen.compile(m, backend)
    for a, b in ((1.5, 0.75), (-1.5, 0.75), (1.5, -0.75), (-1.5, -0.75)):
        q, qd, s, z = np.array([a, b, 0.0]), np.array([0.3, -0.2, 0.1]), np.sign(a), np.sign(b)
        close(kernels.phi(q), np.array([s * a * b + z * a**2]))
        close(kernels.jacobian(q)[0, :2], np.array([s * b + 2 * z * a, s * a]))
        close(kernels.gamma(q, qd), np.array([-(2 * z * 0.3**2 + 2 * s * 0.3 * -0.2)]))


# -- parameters in the rows of the catalogue ------------------------------------------------------------


def linkage(L=None, cosine=None, height=None):
    """A distance, an angle of vectors and a base height that are parameters, or numbers."""
    m = ncgen.Model("linkage")
    L = m.parameter("L", 1.5) if L is None else L
    cosine = m.parameter("cosine", 0.3) if cosine is None else cosine
    height = m.parameter("height", 0.25) if height is None else height
    A = m.point("A", (0, 0, 2 * height), fixed=True)
    B = m.point("B", (1, 1, 0.5))
    C = m.point("C", (1, 2, height), fixed="z")
    u = m.vector("u", (0.6, 0.8, 0))
    w = m.vector("w", (0, 0, 1), fixed=True)
    m.distance(A, B, length=L)
    m.distance(B, C, length=L / 2)
    m.vector_vector(u, w, cosine=cosine)
    m.vector_segment(u, C - B, length=L * 2, cosine=cosine)
    m.unit(u)
    return m


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_parameters_of_rows(backend):
    """Lengths, cosines and fixed coordinates: p against the same model written with numbers, and against 50 digits."""
    from oracles.rows_mp import RowsOracle

    p = dict(L=2.2, cosine=-0.4, height=-0.7)
    model = linkage()
    symbolic, numeric = ncgen.compile(model, backend), ncgen.compile(linkage(**p), backend)
    array = np.array(list(p.values()))
    rng = np.random.default_rng(31)
    q, qd = rng.normal(size=(2, 20, symbolic.n))
    for oracle, values in ((RowsOracle(model), None), (RowsOracle(model, p), array)):
        exact = oracle.over(q, qd)
        assert exact.phi.ulps(np.array([symbolic.phi(x, p=values) for x in q])).max() <= 4
        assert exact.phi_q.ulps(np.array([symbolic.jacobian(x, p=values) for x in q])).max() <= 4
        assert exact.gamma.ulps(np.array([symbolic.gamma(x, v, p=values) for x, v in zip(q, qd, strict=True)])).max() <= 4
    for x, v in zip(q, qd, strict=True):
        close(symbolic.phi(x, p=array), numeric.phi(x))
        close(symbolic.jacobian(x, p=array), numeric.jacobian(x))
        close(symbolic.gamma(x, v, p=array), numeric.gamma(x, v))


def test_driver_at_the_start(kernels):
    """At t = 0 the driver ψ = a sin ωt + t²/3 has ψ̇ = a ω and ψ̈ = 2/3: by hand."""
    q, qd = np.array([1.0, 0.2, 0.3, 0.0]), np.zeros(4)
    assert kernels.phi(q)[1] == 0.0
    assert kernels.nu(q)[1] == pytest.approx(0.7 * 2.3, rel=ROUNDING)
    assert kernels.gamma(q, qd)[1] == pytest.approx(2 / 3, rel=ROUNDING)


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_rows_of_time_alone_are_in_all_constraints_at_once(backend):
    """Φ_q has no entry at all here: Φ and γ are there nevertheless. γ = −d²(t³)/dt² = −6 t."""
    m = ncgen.Model("clock")
    m.body("ball", points=[m.point("A", (1.0, 2.0))], mass=1.0)
    m.constrain(m.time**3)
    kernels = ncgen.compile(m, backend)
    phi, phi_q, gamma = kernels.constraints(kernels.q0, np.zeros(kernels.n), 0.5)
    assert (phi, phi_q.nnz, gamma) == (pytest.approx([0.125]), 0, pytest.approx([-3.0]))
