"""Every method in C and in Python at coarse steps, on every example: what stands twice is the same, and keeps what it promises.

A step turns a body by about 0.1 rad, or is a tenth of the fastest period: small steps hide what differs in the third order. The ordinary
suite has a few examples; all of them: python -m pytest -m slow tests/runtime/test_engines_agree.py
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from generic_newton import motion, trapezoidal_residual

import ncgen
from ncgen.errors import NcgenError
from ncgen.methods.table import FORMALISMS, INTEGRATORS, goes_with

STEPS = {
    "andrews": 7.9e-5, "arm": 8.5e-3, "bennett": 7.3e-3, "bricard": 0.057, "cam": 1.25e-3, "cartpole": 0.024, "chain": 4.9e-3,
    "delta": 0.011, "disc": 0.016, "doublependulum": 7.9e-3, "excavator": 6.5e-3, "flyball": 7.7e-5, "fourbar": 3.3e-3, "heavytop": 2.3e-3,
    "jansen": 0.016, "nfourbar": 0.062, "panels": 0.43, "pendulum": 0.023, "quadruped": 2.7e-4, "robot": 0.01, "slidercrank": 6.7e-4,
    "slidercrank3d": 4.1e-3, "stewart": 0.018, "suspension": 7.3e-3, "tree": 3.3e-3,
}  # fmt: skip
"""Seconds: the smaller of 0.1 rad over the largest rate of the first second and a tenth of the fastest period of small motions.

Of the cam a part of 0.1 s, at which the law of its motor changes its formula and a step ends: so rows are ends of steps."""

QUICK = ("pendulum", "slidercrank", "fourbar", "bricard")
COUNT = 6

ALPHA = FORMALISMS["penalty"].options["alpha"]

REDUNDANT = ("bennett", "bricard")

OTHERWISE = {
    ("bennett", "*"),  # without projection C keeps the rows of the start, Python chooses anew at every step
    ("heavytop", "coordinate-partitioning"),  # the engines change their independent coordinates at different steps
}

STEPPERS = ("rattle", "energy-momentum", "generalized-alpha")
METHODS = [
    (formalism.name, integrator.name)
    for formalism in FORMALISMS.values()
    for integrator in INTEGRATORS.values()
    if integrator.has_fixed_step and integrator.in_python and goes_with(formalism, integrator)
]
EVERY = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in STEPS]
REGULAR = [each for each, name in zip(EVERY, STEPS, strict=True) if name not in REDUNDANT]


@cache
def kernels_of(name):
    return ncgen.compile(ncgen.load(name), "c")


def moved(name, formalism, integrator, engine, count=COUNT, **options):
    kernels, h = kernels_of(name), STEPS[name]
    given = {key: value for key, value in kernels.model.simulation_options.items() if key in ("zd0", "z")}
    asked = dict(formalism=formalism, integrator=integrator, max_step=h, points=count + 1, engine=engine)
    return ncgen.simulate(kernels, count * h, **asked, **given, **({"options": options} if options else {}))


def outcome(*asked, **options):
    try:
        return moved(*asked, **options)
    except NcgenError as error:
        return str(error)


def apart(first, second):
    """How far two motions are apart, of positions in natural sizes and of velocities relative to the largest."""
    sizes = first.kernels.column_sizes
    largest = np.max(np.abs(second.qd) / sizes)
    return np.max(np.abs(first.q - second.q) / sizes), np.max(np.abs(first.qd - second.qd) / sizes) / largest


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("integrator", STEPPERS)
def test_steppers_are_the_same_to_rounding(name, integrator):
    """C solves the equations of a step to rounding, and so does one Newton for all methods."""
    if (name, integrator) == ("cam", "energy-momentum"):
        pytest.skip("it begins so slowly that what corrects the energy is rounding over rounding; the next test looks at its energy")
    in_c = moved(name, "lagrange", integrator, "c")
    q, qd = apart(in_c, motion(kernels_of(name), integrator, in_c.q[0], in_c.qd[0], STEPS[name], COUNT))
    assert q < 1e-11
    assert qd < 1e-10


@pytest.mark.parametrize("name", REGULAR)
def test_ali3p_is_the_same_but_for_its_penalty(name):
    """Which takes as many digits from the inertia. Of redundant rows it takes all, whose multipliers the equations leave open."""
    in_c = moved(name, "ali3p", "trapezoidal", "c")
    q, qd = apart(in_c, motion(kernels_of(name), "trapezoidal", in_c.q[0], in_c.qd[0], STEPS[name], COUNT, formalism="ali3p"))
    assert q < 1e3 * ALPHA * np.finfo(float).eps
    assert qd < 1e4 * ALPHA * np.finfo(float).eps


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(("formalism", "integrator"), METHODS)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_ordinary_methods_are_the_same(name, formalism, integrator):
    """Without projection to rounding. A projection is found with the matrix at hand, in C that of the step's start, so it is known up to
    the square of what it moves."""
    if {(name, "*"), (name, formalism)} & OTHERWISE:
        pytest.skip("not the same: see OTHERWISE")
    options = {} if formalism == "coordinate-partitioning" else {"stabilisation": "none"}
    in_c, in_python = (outcome(name, formalism, integrator, engine, **options) for engine in ("c", "python"))
    if isinstance(in_c, str) or isinstance(in_python, str):
        assert in_c == in_python  # both refuse, at the same step
        assert name not in QUICK
        return
    q, qd = apart(in_c, in_python)
    assert q < 1e6 * np.finfo(float).eps
    assert qd < 1e7 * np.finfo(float).eps


@pytest.mark.parametrize("name", REGULAR)
@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange", "augmented-lagrangian", "null-space", "udwadia-phohomsiri"])
def test_the_trapezoidal_rule_is_what_it_says(name, formalism):
    """With the accelerations of Python in its equation; of redundant rows every step chooses some."""
    options = {} if formalism == "coordinate-partitioning" else {"stabilisation": "none"}
    run = outcome(name, formalism, "trapezoidal", "c", **options)
    if isinstance(run, str):  # these steps are too long for Newton's method
        assert "the step of" in run and name not in QUICK
        return
    if run.statistics.partition_changes:
        pytest.skip("its rows are of several choices of independent coordinates")
    if run.partitions is not None and not len(run.partitions.velocity.independent):
        pytest.skip("drivers leave nothing free")
    q, qd = trapezoidal_residual(run)
    assert q < 1e6 * np.finfo(float).eps
    assert qd < 1e7 * np.finfo(float).eps


@pytest.mark.parametrize("name", EVERY)
def test_energy_momentum_keeps_the_energy(name):
    assert moved(name, "lagrange", "energy-momentum", "c", count=100).energy_drift < 1e-10


@pytest.mark.parametrize("name", ["pendulum", "slidercrank", "fourbar", "bricard", "doublependulum", "heavytop", "slidercrank3d"])
def test_rattle_does_not_drift(name):
    """A symplectic method's energy errors are bounded: the means of the fifths of 2,000 steps lie close to one another, beside what the
    energy varies by along the way, and do not go one way."""
    run = moved(name, "lagrange", "rattle", "c", count=2000)
    assert run.engine == "c"
    energy = run.energy()[:, :2].sum(axis=1)
    fifths = energy[:2000].reshape(5, 400).mean(axis=1)
    assert np.ptp(fifths) < 0.3 * np.ptp(energy)
    assert abs(np.polyfit(np.arange(5), fifths, 1)[0]) < 0.05 * np.ptp(energy)
