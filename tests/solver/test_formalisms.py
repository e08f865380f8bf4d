"""Every formalism gives the same accelerations and motions, on every example, and refuses what it cannot do by name."""

from __future__ import annotations

import sys
import warnings
from functools import cache
from itertools import product

import numpy as np
import pytest
from every_example import EVERY
from scipy.special import ellipk

import ncgen
from ncgen.errors import ModelError, SingularError
from ncgen.exchange.examples import example_module
from ncgen.methods.table import FORMALISMS, INTEGRATORS, Formalism
from ncgen.solver import formalisms
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.rank import trial_positions

EXACT = ("null-space", "lagrange", "augmented-lagrangian", "udwadia-phohomsiri")
ALL_COORDINATES = (*EXACT, "penalty")
DURATION = {
    "andrews": 0.003, "cam": 0.02, "delta": 0.02, "excavator": 0.05, "flyball": 0.002, "heavytop": 0.03, "quadruped": 0.005, "robot": 0.05,
    "slidercrank": 0.01, "tree": 0.03,
}  # fmt: skip
"""Seconds a motion is compared for; 0.1 where nothing stands here."""


@cache
def kernels_of(name):
    return ncgen.compile(ncgen.load(name), backend="c")


@pytest.fixture(scope="module")
def pendulum():
    return kernels_of("pendulum")


def states(kernels):
    """Consistent positions and velocities, with the partitions that are good there."""
    generator = np.random.default_rng(5)
    for q in trial_positions(kernels, kernels.q0, 0.0, kernels.p0)[:3]:
        partitions = choose_partitions(kernels, q, 0.0, kernels.p0)
        yield q, partitions.velocity, generator.standard_normal(len(partitions.velocity.independent))


def accelerations(kernels, formalism, q, qd, **options):
    form = accelerations_by(formalism)
    return form.motion(kernels, q, qd, 0.0, kernels.p0, options)


def test_a_penalty_does_not_spoil_the_masses():
    """Python's engine takes the steps of C: M + αΦ_qᵀΦ_q would have lost the masses in the rounding of α, and taken 1,500 steps."""
    robot = ncgen.compile(ncgen.load("robot"), "c")
    asked = {"formalism": "penalty", "integrator": "dopri5", "rtol": 1e-9, "atol": 1e-11, "points": 2}
    c, python = (ncgen.simulate(robot, 0.02, engine=engine, **asked) for engine in ("c", "python"))
    assert python.statistics.steps == c.statistics.steps < 10


@pytest.mark.parametrize("name", EVERY)
def test_accelerations(name):
    """Those of coordinate partitioning to 1e-10, and they satisfy the equations of motion."""
    kernels = kernels_of(name)
    for q, partition, zd in states(kernels):
        known = motion_at(kernels, partition, 0.0, q, zd, kernels.p0)
        jacobian = kernels.jacobian(q)
        for formalism in EXACT:
            found = accelerations(kernels, formalism, q, known.qd, stabilisation="none")
            assert found.qdd == pytest.approx(known.qdd, abs=1e-10 * np.max(np.abs(known.qdd)))
            balance = kernels.mass_matrix(q) @ found.qdd + jacobian.T @ found.lam - kernels.force(q, known.qd)
            size = np.max(np.abs(jacobian.T) @ np.abs(found.lam)) + np.max(np.abs(kernels.force(q, known.qd)))
            assert np.max(np.abs(balance)) < (1e-5 if formalism == "augmented-lagrangian" else 1e-11) * size


@pytest.mark.parametrize("name", EVERY)
def test_motions(name):
    """Those of coordinate partitioning to 1e-8, closed to rounding, by the reference engine and by the fast one."""
    kernels = kernels_of(name)
    given = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    options = dict(rtol=1e-11, atol=1e-13, integrator="dop853", points=3, **given)
    duration = DURATION.get(name, 0.1)
    known = ncgen.simulate(kernels, duration, **options)
    for formalism, engine in product(EXACT, ("python", "auto")):
        found = ncgen.simulate(kernels, duration, formalism=formalism, engine=engine, **options)
        assert found.q / kernels.column_sizes == pytest.approx(known.q / kernels.column_sizes, abs=1e-8)
        assert np.max(found.violation()) <= 1e-11
        assert found.formalism == formalism
        assert found.engine == "python: asked for" or engine == "auto"


@pytest.mark.parametrize("integrator", [name for name, entry in INTEGRATORS.items() if entry.in_python and not entry.keeps_history])
def test_every_integrator_with_projection(integrator):
    """Projecting a method's state after its steps keeps the four-bar closed and does not spoil the motion."""
    kernels = kernels_of("fourbar")
    options = dict(zd0={"psi": 12.0}, points=5)
    known = ncgen.simulate(kernels, 0.2, integrator="dop853", rtol=1e-11, atol=1e-13, **options)
    step = {"max_step": 1e-3} if integrator == "rk4" else {}
    found = ncgen.simulate(kernels, 0.2, integrator=integrator, formalism="lagrange", engine="python", **options, **step)
    assert found.q == pytest.approx(known.q, abs=2e-5)
    assert np.max(found.violation()) <= 1e-11
    assert found.statistics.projections >= found.statistics.steps / 2
    assert 0 < found.statistics.largest_projection < 1e-3


def test_multipliers_of_redundant_rows():
    """Of the many multipliers of the Bricard linkage, these two formalisms give those of smallest norm in natural sizes."""
    kernels = kernels_of("bricard")
    q, partition, zd = next(states(kernels))
    known = motion_at(kernels, partition, 0.0, q, zd, kernels.p0)
    jacobian = kernels.jacobian(q) / kernels.row_sizes[:, None]
    load = kernels.force(q, known.qd) - kernels.mass_matrix(q) @ known.qdd
    smallest = np.linalg.pinv((jacobian * kernels.column_sizes).T, rcond=1e-9) @ (kernels.column_sizes * load) / kernels.row_sizes
    for formalism in ("lagrange", "udwadia-phohomsiri"):
        found = accelerations(kernels, formalism, q, known.qd)
        assert found.lam == pytest.approx(smallest, abs=1e-7 * np.max(np.abs(smallest)))


def test_penalty_errs_by_its_inverse(pendulum):
    """λ/α: a hundred times the penalty, a hundredth of the error."""
    q, qd = np.array([0.6, -0.8]), np.array([1.6, 1.2])
    exact = accelerations(pendulum, "lagrange", q, qd).qdd
    errors = [np.linalg.norm(accelerations(pendulum, "penalty", q, qd, alpha=alpha).qdd - exact) for alpha in (1e3, 1e5)]
    assert errors[0] / errors[1] == pytest.approx(100, rel=0.01)
    assert errors[0] > 1e-4


def test_what_holds_the_constraints(pendulum):
    """Nothing: drift grows. Baumgarte: it stays small. Projection: it is rounding."""
    drift = {}
    for stabilisation in ("none", "baumgarte", "projection"):
        options = {"stabilisation": stabilisation}
        run = ncgen.simulate(pendulum, 5.0, formalism="lagrange", rtol=1e-6, atol=1e-8, options=options)
        drift[stabilisation] = run.violation()[-1]
        assert (run.statistics.projections > 0) == (stabilisation == "projection")
    assert drift["none"] > 10 * drift["baumgarte"] > 1e4 * drift["projection"]
    assert drift["projection"] <= 1e-11


def test_penalty_follows_the_fall(pendulum):
    known = ncgen.simulate(pendulum, 0.5, points=6)
    found = ncgen.simulate(pendulum, 0.5, points=6, formalism="penalty")
    assert found.q == pytest.approx(known.q, abs=1e-6)
    assert found.qdd == pytest.approx(known.qdd, abs=1e-4)


def test_singular_positions_are_starts_too():
    """Where the flat four-bar has an extra motion, a motion over all coordinates can begin; a partition cannot."""
    model = ncgen.Model("flat")
    a, d = model.point("A", (0, 0), fixed=True), model.point("D", (1, 0), fixed=True)
    b, c = model.point("B", (1, 0)), model.point("C", (2, 0))
    for one, other in ((a, b), (b, c), (d, c)):
        model.body(f"{one.name}{other.name}", points=[one, other], mass=1.0, inertia=1 / 12)
    kernels = ncgen.compile(model, backend="numpy")
    with pytest.raises(SingularError, match="rank 2 where 3 is general"):
        ncgen.simulate(kernels, 0.1, formalism="coordinate-partitioning")
    with pytest.warns(UserWarning, match="rank 2 where 3 is general"):
        run = ncgen.simulate(kernels, 0.2, formalism="lagrange", qd0={"B.y": 1.0, "C.y": 1.0})
    # The parallelogram branch: every bar keeps turning at one rate, B and C go round side by side.
    angle = np.arctan2(run["B.y"], run["B.x"])
    assert angle == pytest.approx(run.t, abs=1e-6)
    assert run["C.x"] - run["B.x"] == pytest.approx(np.ones(101), abs=1e-6)


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", *ALL_COORDINATES])
def test_massless_motions_are_refused(formalism):
    model = ncgen.Model("nothing")
    a, b = model.point("A", (1, 0)), model.point("B", (2, 0))
    model.body("bar", points=[a], mass=1.0)
    model.distance(model.point("P", (0, 0)), b)
    kernels = ncgen.compile(model, backend="numpy")
    with pytest.raises(SingularError, match="nothing: a motion of the mechanism has no inertia: B.y, P.y, B.x, P.x can move without any"):
        ncgen.simulate(kernels, 0.1, formalism=formalism)


REFUSED = [
    (
        {"formalism": "lagrange", "options": {"beta": 1.0}},
        "option beta: lagrange with dopri5 has no such option; it has stabilisation, omega, xi",
    ),
    (
        {"options": {"alpha": 1.0}, "formalism": "coordinate-partitioning", "integrator": "dopri5"},
        "option alpha: coordinate-partitioning with dopri5 has no such option; it has none",
    ),
    ({"formalism": "penalty", "options": {"alpha": "much"}}, "option alpha: much given; it must be a number from 0 on"),
    ({"formalism": "lagrange", "options": {"stabilisation": "hope"}}, "stabilisation 'hope' is unknown; choose one of projection"),
    ({"formalism": "lagrange", "integrator": "bdf", "engine": "c"}, "engine 'c': bdf runs in Python; in C there are"),
    ({"qd0": {"B.z": 1.0}}, "qd0: the mechanism has no free coordinate B.z; it has B.x, B.y"),
    ({"qd0": {"B.x": np.nan}}, "qd0: B.x is nan; it must be a finite number"),
    ({"qd0": [1.0]}, r"qd0: \[1.0\] given; give 2 numbers, one a free coordinate, or {name: rate}"),
    ({"qd0": [0.0, 0.0], "zd0": [0.0]}, "zd0 and qd0 are both given"),
]


@pytest.mark.parametrize(("options", "message"), REFUSED, ids=[str(options) for options, _ in REFUSED])
def test_refused(pendulum, options, message):
    with pytest.raises(ModelError, match=message):
        ncgen.simulate(pendulum, 0.1, **options)


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
def test_velocities_of_any_coordinates(formalism):
    """Velocities of all coordinates, or of some by name, start the same motion as those of the independent one."""
    kernels = kernels_of("fourbar")
    known = ncgen.simulate(kernels, 0.1, zd0={"psi": 12.0}, points=3)
    for given in (known.qd[0], {"C.x": known["rate(C.x)"][0]}):
        found = ncgen.simulate(kernels, 0.1, qd0=given, points=3, formalism=formalism)
        assert found.q == pytest.approx(known.q, abs=1e-7)


def test_velocities_that_contradict_are_projected(pendulum):
    """The bar is level: its end can move up and down only, and the nearest velocity is the given one without its x."""
    with pytest.warns(UserWarning, match=r"rate\(B.x\) changed most, from 3 to 0"):
        run = ncgen.simulate(pendulum, 0.1, qd0=[3.0, 2.0], points=2)
    assert run.qd[0] == pytest.approx([0.0, 2.0], abs=1e-12)


def test_other_velocities_have_the_least_energy():
    """Two masses on a bar that floats: when one is moved sideways, the other stays."""
    model = ncgen.Model("dumbbell")
    a, b = model.point("A", (0, 0)), model.point("B", (1, 0))
    model.distance(a, b)
    model.body("a", points=[a], mass=1.0)
    model.body("b", points=[b], mass=1.0)
    kernels = ncgen.compile(model, backend="numpy")
    sideways = ncgen.simulate(kernels, 0.01, qd0={"B.y": 1.0}, formalism="lagrange", points=2)
    along = ncgen.simulate(kernels, 0.01, qd0={"B.x": 1.0}, formalism="lagrange", points=2)
    assert sideways.qd[0] == pytest.approx([0, 0, 0, 1], abs=1e-12)
    assert along.qd[0] == pytest.approx([1, 0, 1, 0], abs=1e-12)


def test_a_formalism_that_is_slow_for_many_degrees_of_freedom_says_so():
    """60 links have 120 degrees of freedom; where all coordinates are integrated nothing is said."""
    chain = ncgen.compile(example_module("chain").build(n=60))
    short = {"points": 2, "integrator": "rk4", "max_step": 1e-3}
    with pytest.warns(UserWarning, match="chain: coordinate partitioning solves densely for 120 degrees of freedom") as said:
        partitioned = ncgen.simulate(chain, 1e-3, formalism="coordinate-partitioning", **short)
    assert "\n" not in str(said[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sparse = ncgen.simulate(chain, 1e-3, formalism="lagrange", **short)
    np.testing.assert_allclose(partitioned.q[-1], sparse.q[-1], rtol=0, atol=1e-12)


SCHUR = '''
import numpy as np


def schur_complement(now, least):
    """λ first, from Φ_q M⁻¹ Φ_qᵀ λ = Φ_q M⁻¹ Q − γ, for regular M and independent rows."""
    inverse = np.linalg.inv(now.mass + least * np.eye(len(now.force)))
    lam = np.linalg.solve(now.jacobian @ inverse @ now.jacobian.T, now.jacobian @ inverse @ now.force - now.gamma)
    return inverse @ (now.force - now.jacobian.T @ lam), lam
'''


def test_a_module_and_an_entry_are_a_formalism(tmp_path, monkeypatch):
    """Its function is found by the formalism's name and its options by those of its arguments; a run with it is the closed form's."""
    (tmp_path / "schur_complement.py").write_text(SCHUR, encoding="utf-8")
    monkeypatch.setattr(formalisms, "__path__", [*formalisms.__path__, str(tmp_path)])
    options = {"stabilisation": "projection", "omega": 10.0, "xi": 1.0, "least": 0.0}
    monkeypatch.setitem(
        FORMALISMS, "schur-complement", Formalism(name="schur-complement", help="the same, λ first", in_c=False, options=options)
    )
    model = ncgen.Model("falling")
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (1, 0))
    model.distance(A, B)
    model.body("bob", points=[B], mass=2.0)
    model.gravity((0, -9.81, 0))
    kernels = ncgen.compile(model, "numpy")
    run = ncgen.simulate(kernels, 0.3, formalism="schur-complement", integrator="dop853", rtol=1e-11, atol=1e-12)
    # A pendulum let go where it is level: the speed after a fall by h is √(2gh), and the rod bears three times the weight's share.
    assert np.hypot(*run.qd[-1]) == pytest.approx(np.sqrt(-2 * 9.81 * run.q[-1][1]), rel=1e-9)
    assert np.linalg.norm(kernels.jacobian(run.q[-1]).T @ run.lam[-1]) == pytest.approx(-3 * 2.0 * 9.81 * run.q[-1][1], rel=1e-7)
    del sys.modules["ncgen.solver.formalisms.schur_complement"]
    accelerations_by.cache_clear()


@pytest.mark.parametrize("pace", [1.0, 1e-7, 1e7])
def test_iterations_on_a_small_penalty_end_at_rounding_in_any_units(pace):
    """A pendulum that falls from level is at the bottom after K(1/2) √(L/g), of nanoseconds as of months.

    With so small a penalty accelerations take several iterations, which end where corrections are small beside them.
    """
    model, length, gravity = ncgen.Model("pendulum"), 0.7, 9.81 * pace**2
    bob = model.point("B", (length, 0))
    model.body("bob", points=[bob], mass=1.3)
    model.distance(model.point("O", (0, 0), fixed=True), bob)
    model.gravity((0, -gravity, 0))
    quarter = float(ellipk(0.5) * np.sqrt(length / gravity))
    steps = {"integrator": "rk4", "max_step": quarter / 200, "points": 2}
    run = ncgen.simulate(ncgen.compile(model), quarter, formalism="augmented-lagrangian", options={"alpha": 10.0}, engine="c", **steps)
    assert run.q[-1] == pytest.approx([0, -length], abs=1e-9)
