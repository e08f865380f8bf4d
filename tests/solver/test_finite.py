"""Terms that are no numbers, infinite ones among them: named by their owner and the time, by every engine and method.

The mechanism is a pendulum of 1 m that starts level, at B = (1, 0), and a point C that hangs from it by a rod of 1 m.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import ncgen
from ncgen.errors import DomainError, ModelError
from ncgen.mechanism.run_arguments import InitialState
from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, INTEGRATORS
from ncgen.model import Model
from ncgen.solver.engines.compiled import run
from ncgen.solver.finite import on_the_way
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances


def pendulums(add=None, mass=None) -> Model:
    m = Model("pendulums")
    A = m.point("A", (0, 0), fixed=True)
    B, C = m.point("B", (1, 0)), m.point("C", (1, -1))
    m.body("upper", points=[B], mass=1.0)
    m.body("lower", points=[C], mass=mass(m) if mass else 0.5)
    m.distance(A, B)
    m.distance(B, C)
    m.gravity((0, -9.81, 0))
    if add:
        add(m, A, B, C)
    return m


@cache
def compiled(add=None, mass=None):
    return ncgen.compile(pendulums(add, mass), backend="c")


def edge() -> float:
    """When B passes -0.3 m if √(B.y + 0.3) pulls it up: two particles and two rods by minimal coordinates, with SciPy."""

    def slope(t, y):
        a, b, u, v = y  # of AB from x, of BC from -y; and their rates
        along = np.array([-np.sin(a), np.cos(a)]), np.array([np.cos(b), np.sin(b)])
        inward = np.array([-np.cos(a), -np.sin(a)]), np.array([-np.sin(b), np.cos(b)])
        pull = np.array([0.0, np.sqrt(max(np.sin(a) + 0.3, 0.0)) - 9.81]), np.array([0.0, -0.5 * 9.81])
        bias = u**2 * inward[0], u**2 * inward[0] + v**2 * inward[1]
        mass = np.array([[1.5, 0.5 * along[0] @ along[1]], [0.5 * along[0] @ along[1], 0.5]])
        rest = pull[0] - bias[0], pull[1] - 0.5 * bias[1]
        return [u, v, *np.linalg.solve(mass, [along[0] @ (rest[0] + rest[1]), along[1] @ rest[1]])]

    def at_edge(t, y):
        return np.sin(y[0]) + 0.3

    at_edge.terminal = True
    return solve_ivp(slope, (0.0, 1.0), [0.0] * 4, rtol=1e-8, atol=1e-10, events=at_edge).t[-1]


END = sympy.Rational(1, 10)


def ending(m):
    """0 at first, and a number until t = 0.1 s."""
    return sympy.sqrt(END - m.time) - sympy.sqrt(END)


def broken(t, q, qd, kernels):
    return np.full(kernels.n, np.nan if t > 0.1 else 0.0)


AT_ONCE = {
    "force": (lambda m, A, B, C: m.force(B, (0, 1 / B.y, 0)), r"force on B is not a number at t = 0 s \(.*B\.y = 0"),
    "own name": (lambda m, A, B, C: m.force(C, (sympy.log(B.y.symbol), 0, 0), label="wind"), r"wind is not a number at t = 0 s"),
    "velocity": (lambda m, A, B, C: m.force(B, (0, 1 / B.y.rate, 0)), r"force on B is not a number at t = 0 s"),
    "spring law": (lambda m, A, B, C: m.spring(A, C, law=lambda x, v: sympy.log(v)), r"spring A-C is not a number at t = 0 s"),
    "potential": (lambda m, A, B, C: m.potential(sympy.log(B.y.symbol), label="well"), r"well is not a number at t = 0 s"),
    "torque": (lambda m, A, B, C: m.torque(m.length("s", A, C), 1 / B.y), r"torque on s is not a number at t = 0 s"),
    "parameter": (lambda m, A, B, C: m.force(B, (1 / m.parameter("k", 0.0), 0, 0)), r"force on B is not a number at t = 0 s .*k = 0"),
}
"""What is no number at the start, and how it is told."""

LATER = {
    "force": (lambda m, A, B, C: m.force(B, (ending(m), 0, 0)), r"force on B is not a number at t = 0\.1\d* s"),
    "driver": (lambda m, A, B, C: m.drive(B.y, ending(m)), r"constraint 3 \(.*B\.y.*\) is not a number at t = 0\.1\d* s"),
    "row": (
        lambda m, A, B, C: m.constrain(C.x - B.x + B.x * ending(m), label="guide"),
        r"constraint 3 \(guide, .*\) is not a number at t = 0\.1\d* s",
    ),
    "callback": (lambda m, A, B, C: m.callback(broken), r"callback broken: it must return 4 finite numbers, .* at t = 0\.1"),
}
"""What is no number from 0.1 s on; the rate and the acceleration of the driver and the row are infinite just before."""

METHODS = {
    ("coordinate-partitioning", "dopri5"): {},
    ("coordinate-partitioning", "dop853"): {},
    ("coordinate-partitioning", "rk23"): {},
    ("coordinate-partitioning", "radau"): {},
    ("coordinate-partitioning", "bdf"): {},
    ("coordinate-partitioning", "adams"): {},
    ("coordinate-partitioning", "lsoda"): {},
    ("coordinate-partitioning", "rk4"): {"max_step": 1e-2},
    ("coordinate-partitioning", "trapezoidal"): {"max_step": 1e-2},
    **{(name, "dopri5"): {} for name, formalism in FORMALISMS.items() if formalism.is_constrained and formalism.is_ordinary},
    ("lagrange", "dop853"): {},
    ("lagrange", "radau"): {},
    ("lagrange", "rattle"): {"max_step": 1e-2},
    ("lagrange", "energy-momentum"): {"max_step": 1e-2},
    ("lagrange", "generalized-alpha"): {"max_step": 1e-2},
    ("ali3p", "trapezoidal"): {"max_step": 1e-2},
}

ENGINES = ("auto", "python")

RUNS = [(*method, engine) for method in METHODS for engine in ENGINES if engine == "auto" or INTEGRATORS[method[1]].in_python]


@pytest.fixture(scope="module")
def at_once():
    return compiled(AT_ONCE["force"][0])


@pytest.fixture(scope="module")
def leaving():
    """A force that is a number as long as B is above -0.3 m, which is until about 0.27 s."""
    return compiled(lambda m, A, B, C: m.force(B, (0, sympy.sqrt(B.y + 0.3), 0)))


@pytest.mark.parametrize(("formalism", "integrator", "engine"), RUNS)
def test_every_method_tells_it_at_the_start(at_once, formalism, integrator, engine):
    with pytest.raises(DomainError, match=AT_ONCE["force"][1]) as told:
        ncgen.simulate(at_once, 0.3, formalism=formalism, integrator=integrator, engine=engine, **METHODS[formalism, integrator])
    assert len(str(told.value)) <= 300


@pytest.mark.parametrize(("formalism", "integrator", "engine"), RUNS)
def test_every_method_tells_it_on_the_way(leaving, formalism, integrator, engine):
    """The coordinate that it names is where it should be: at the edge, with a fixed step within one of it."""
    step = METHODS[formalism, integrator]
    with pytest.raises(DomainError, match=r"force on B is not a number at t = 0\.\d+ s \(.*B\.y = -0\.3") as told:
        ncgen.simulate(leaving, 1.5, formalism=formalism, integrator=integrator, engine=engine, rtol=1e-6, **step)
    found = float(str(told.value).split("at t = ")[1].split(" s")[0])
    assert abs(found - edge()) < 2 * step.get("max_step", 1e-3)


@pytest.mark.parametrize(
    ("term", "engine"), [*((term, engine) for term in AT_ONCE for engine in ENGINES), ("force", "emitted"), ("force", "refined")]
)
def test_every_term_is_told_at_the_start(term, engine):
    add, said = AT_ONCE[term]
    with pytest.raises(DomainError, match=said):
        ncgen.simulate(compiled(add), 0.3, engine=engine)


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("term", LATER)
def test_every_term_is_told_when_it_happens(term, engine, formalism):
    add, said = LATER[term]
    with pytest.raises(DomainError, match=said):
        ncgen.simulate(compiled(add), 0.3, engine=engine, formalism=formalism, rtol=1e-4)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_parameter_that_is_none(value, engine):
    kernels = compiled(mass=lambda m: m.parameter("m2", 0.5))
    with pytest.raises(ModelError, match=f"p: m2 is {value}; it must be a finite number"):
        ncgen.simulate(kernels, 0.3, p=[value], engine=engine)


def test_a_mass_that_is_none():
    kernels = compiled(mass=lambda m: 1 / m.parameter("k", 2.0))
    with pytest.raises(ModelError, match=r"^p: with k = 0, body lower: the mass is inf kg; give a positive number$"):
        ncgen.simulate(kernels, 0.3, p=[0.0])


def test_what_one_asks_at_an_instant(at_once, leaving):
    """Statics and small motions meet the same numbers, and say the same."""
    for ask in (ncgen.equilibrium, ncgen.linearise):
        with pytest.raises(DomainError, match=AT_ONCE["force"][1]):
            ask(at_once)
    with pytest.raises(DomainError, match="force on B is not a number"):
        ncgen.equilibrium(leaving)  # it goes down, out of the domain


def test_rows_that_are_none_where_a_position_is_sought():
    kernels = compiled(lambda m, A, B, C: m.constrain(sympy.log(C.x.symbol), label="own"))
    q = kernels.q0.copy()
    q[kernels.index["C.x"]] = -1.0
    for ask in (ncgen.assemble, ncgen.solve_position):
        with pytest.raises(DomainError, match=r"constraint 3 \(own, .*\) is not a number at t = 0 s \(C\.x = -1\)"):
            ask(kernels, q)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_derivative_that_is_infinite(engine):
    """√x has a value at 0 and no slope: implicit methods ask for it."""
    kernels = compiled(lambda m, A, B, C: m.force(B, (0, sympy.sqrt(sympy.Abs(B.y.symbol)), 0)))
    with pytest.raises(DomainError, match="the derivative of force on B is not a number at t = 0 s"):
        ncgen.linearise(kernels)


def test_a_stage_may_leave_the_domain():
    """The bounce on a wall of force 1/y⁴ works with steps that are cut where a trial goes through the wall, in both engines."""
    m = Model("bounce")
    B = m.point("B", (0, 1))
    m.body("ball", points=[B], mass=1.0)
    m.constrain(B.x, label="guide")
    m.gravity((0, -9.81, 0))
    m.force(B, (0, sympy.Rational(1, 1000) * (B.y.symbol) ** sympy.Rational(-5, 2), 0))
    kernels = ncgen.compile(m, backend="c")
    runs = [ncgen.simulate(kernels, 2.0, engine=engine, points=21) for engine in ("c", "python")]
    assert np.allclose(runs[0].q, runs[1].q, atol=1e-4)
    y, speed = runs[0]["B.y"], runs[0]["rate(B.y)"]
    energy = speed**2 / 2 + 9.81 * y + 2e-3 / 3 * y**-1.5
    assert np.allclose(energy, 9.81 + 2e-3 / 3, rtol=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("given", "said"), [
    ({"duration": 0.05, "t0": 1e16}, r"t0: 1e\+16 s with 101 points in 0\.05 s: instants cannot be distinguished .*; begin nearer to 0"),
    ({"duration": 1.0, "formalism": "lagrange", "integrator": "rattle", "max_step": 1e-300}, "max_step: 1e-300 s cannot be distinguished"),
    ({"duration": 1.0, "formalism": "ali3p", "integrator": "trapezoidal", "max_step": 1e-17}, "max_step: 1e-17 s cannot be distinguished"),
    ({"duration": 1.0, "integrator": "rk4", "max_step": 1e-300}, "max_step: 1e-300 s cannot be distinguished"),
    ({"duration": 1.0, "integrator": "trapezoidal", "max_step": 1e-19}, "max_step: 1e-19 s cannot be distinguished"),
])  # fmt: skip
def test_steps_that_the_clock_cannot_tell(engine, given, said):
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    with pytest.raises(ModelError, match=said):
        ncgen.simulate(kernels, engine=engine, **given)


@pytest.mark.parametrize("method", ["rattle", "rk4", "trapezoidal", "dopri5"])
def test_the_runtime_itself_refuses_them(method):
    """Also for those who call it without Python's looking first: with a status, not with rest at all instants."""
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics

    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    dynamics, given = (
        ConstrainedDynamics(kernels),
        dict(initial=InitialState(kernels.q0, np.zeros(2), kernels.p0), formalism=1, tolerance=1e-12, project=1),
    )
    same = dynamics.simulate(method, [1e16, 1e16], max_step=1e-3, **given)
    assert (same.status, len(same.q)) == ("argument", 0)
    if method != "dopri5":
        many = dynamics.simulate(method, [0.0, 1.0], max_step=1e-300, **given)
        assert many.status == "argument" and many.steps == 0
        late = dynamics.simulate(method, [1e16, 1e16 + 100], max_step=0.5, **given)
        assert late.status == "argument" and late.steps == 0


def test_what_was_reached_is_kept(leaving):
    """The path holds the rows before the edge, and the last state."""
    grid, partitions = np.linspace(0.0, 1.0, 101), choose_partitions(leaving, leaving.q0)
    path = Path.empty(leaving.n, partitions)
    with pytest.raises(DomainError):
        method, tolerances = Method.of("coordinate-partitioning", "dopri5", {}), Tolerances(1e-8, 1e-10, natural=False, span=0.0)
        run(
            path,
            leaving,
            Task(method=method, grid=grid, q=leaving.q0, velocities=np.zeros(2), p=leaving.p0, max_step=np.inf, tolerances=tolerances),
            "dense",
        )
    assert abs(path.stopped - edge()) < 1e-3
    assert len(path.q) == np.searchsorted(grid, path.stopped) + 1
    assert np.all(np.isfinite(path.q)) and np.all(np.isfinite(path.qd)) and np.all(np.isfinite(path.work))


def test_time_alone_is_looked_at_first():
    """A rate that has become very large, as where a run breaks down, leads to places where other terms end: they are not the reason."""
    m = Model("limits")
    P, Q = m.point("P", (0, 0, 0)), m.point("Q", (1, 0, 0))
    m.body("first", [P], mass=1.0)
    m.body("second", [Q], mass=1.0)
    m.force(P, (sympy.sqrt(1 - P.x**2), 0, 0))
    m.force(Q, (sympy.sqrt(1 - m.time), 0, 0))
    kernels = ncgen.compile(m, "numpy")
    fast = np.eye(6)[0] * 1e6
    assert "force on Q" in str(on_the_way(kernels, kernels.q0, fast, 0.9, 1.1))
    assert "force on P" in str(on_the_way(kernels, kernels.q0, fast, 0.1, 0.2))
    assert on_the_way(kernels, kernels.q0, np.zeros(6), 0.1, 0.2) is None
