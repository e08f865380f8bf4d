"""What users write beyond smooth functions of the position: time in a potential, kinks, rates where none may stand, numbers without end."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import ModelError


def bob():
    """(model, fixed point A, mass point B on a rod of 1 m)."""
    m = ncgen.Model("bob")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("b", [B], mass=1.0)
    m.distance(A, B)
    return m, A, B


def test_potential_that_changes_in_time_is_in_the_balance():
    """d(T + V)/dt is ∂V/∂t for V = t y: the power, and the energy of a run."""
    m, _, B = bob()
    m.potential(m.time * B.y.symbol)
    k = ncgen.compile(m, "numpy")
    assert k.energy([0.6, 0.8], [0.3, -0.2], 2.0) == pytest.approx([0.065, 1.6, 0.8])
    assert k.force([0.6, 0.8], [0.3, -0.2], 2.0) == pytest.approx([0.0, -2.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(k, 2.0, points=11)
    assert run.energy_drift < 1e-7


def test_potential_without_time_has_no_power():
    m, _, B = bob()
    m.potential(B.y.symbol**3)
    assert ncgen.compile(m, "numpy").energy([0.6, 0.8], [0.3, -0.2], 2.0)[2] == 0.0


def test_kinks_are_derived_beside_the_kink():
    """sign in a potential and in a velocity row: its derivative is zero where it is one."""
    m, _, B = bob()
    m.potential(sympy.sign(B.y.symbol) * B.y.symbol**2)
    m.constrain_velocity(B.x.rate * sympy.sign(B.x.symbol) + B.y.rate * sympy.Abs(B.y.symbol))
    k = ncgen.compile(m, "numpy")
    q, qd = np.array([0.6, -0.8]), np.array([0.3, -0.2])
    assert k.force(q, qd) == pytest.approx([0.0, -1.6])  # V = −y² there
    assert k.jacobian(q)[1] == pytest.approx([1.0, 0.8])
    assert k.gamma(q, qd)[1] == pytest.approx(0.2 * 0.2)  # |y| = −y: −ẏ d|y|/dt = ẏ²


@pytest.mark.parametrize(
    "say",
    [
        lambda m, B: m.potential(B.x.rate**2),
        lambda m, B: m.constrain(B.x.rate - 0.1),
        lambda m, B: m.drive(B.x, 1 - m.time * B.y.rate),
    ],
    ids=["potential", "row", "driver"],
)
def test_rates_where_positions_stand_are_refused(say):
    m, _, B = bob()
    say(m, B)
    with pytest.raises(ModelError, match=r"does not depend on velocities, here on rate\(B\.[xy]\); use m\.") as caught:
        ncgen.generate(m)
    assert "\n" not in str(caught.value)


ENDLESS = {
    "a constant": lambda m, A, B: m.force(B, (sympy.exp(1000), 0, 0)),
    "beside a parameter": lambda m, A, B: m.force(B, (m.parameter("k", 2.0) * sympy.exp(1000) * B.x.symbol, 0, 0)),
    "of parameters": lambda m, A, B: m.spring(A, B, m.parameter("k", 2.0) * sympy.exp(1000)),
    "a spring": lambda m, A, B: m.spring(A, m.point("C", (0, 1), fixed=True), 1e300, free_length=1e300),
    "a weight": lambda m, A, B: (m.body("c", [m.point("C", (0, 1))], mass=1e300), m.gravity((0, -1e200, 0))),
    "at a fixed coordinate": lambda m, A, B: m.force(B, (B.x.symbol / A.x.symbol, 0, 0)),
    "outside the domain": lambda m, A, B: m.force(B, (sympy.log(A.x.symbol - 1) * B.x.symbol, 0, 0)),
    "of many digits": lambda m, A, B: m.force(B, (sympy.Integer(10) ** 4000 * B.x.symbol, 0, 0)),
}


@pytest.mark.parametrize("case", ENDLESS)
@pytest.mark.parametrize("emission", ["auto", "tabled"])
def test_numbers_without_end_are_refused(case, emission):
    """One line that says where, of no more than 300 characters, and no infinity in the sources."""
    m, A, B = bob()
    with pytest.raises(ModelError) as caught:
        ENDLESS[case](m, A, B)  # refuses what is no number by itself
        ncgen.generate(m, emission)
    assert "\n" not in str(caught.value) and len(str(caught.value)) <= 300
    assert "correct" in str(caught.value) or "check" in str(caught.value)


def test_numpy_kernels_say_nothing_of_numbers_that_are_none():
    """They give nan, as in C, and leave the words to those who called them."""
    m, _, B = bob()
    m.force(B, (sympy.log(-1 - B.x.symbol**2), 0, 0))
    k = ncgen.compile(m, "numpy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(k.force(k.q0, 0 * k.q0)[0])
        assert np.isnan(k.damping(k.q0, 0 * k.q0).data).all() or k.damping(k.q0, 0 * k.q0).nnz == 0


def test_kernels_without_contributions_keep_the_shape_of_a_batch():
    m = ncgen.Model("free")
    m.point("P", (0, 0, 0))
    k = ncgen.compile(m, "numpy")
    q = np.zeros((5, 3))
    assert k.phi(q).shape == (5, 0) and k.force(q, q).shape == (5, 3) and k.energy(q, q).shape == (5, 3)
    assert k.jacobian(q).shape == (5, 0, 3) and k.mass_matrix(q).shape == (5, 3, 3)


STEPPERS = {"rattle": "lagrange", "energy-momentum": "lagrange", "generalized-alpha": "lagrange", "trapezoidal": "ali3p"}
WAYS = [(f, "dopri5") for f in ("lagrange", "null-space", "augmented-lagrangian", "udwadia-phohomsiri", "penalty")]


@pytest.mark.parametrize("formalism, integrator", [*WAYS, *((f, name) for name, f in STEPPERS.items())])
@pytest.mark.parametrize("rows", [False, True])
def test_what_cannot_move_stands_still(formalism, integrator, rows, capfd):
    """Without free coordinates every formalism has an answer, and LAPACK nothing to say."""
    m = ncgen.Model("ground")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0), fixed=True)
    if rows:
        m.distance(A, B)
    fixed = {"max_step": 0.05} if integrator in STEPPERS else {}
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 0.1, formalism=formalism, integrator=integrator, points=3, **fixed)
    assert run.q.shape == run.qdd.shape == (3, 0) and np.all(run.lam == 0.0)
    assert capfd.readouterr() == ("", "")


def test_second_derivatives_beside_a_kink():
    """sign of what is no polynomial, in a row: γ is that of the row without it."""
    gammas = []
    for sign in (1, sympy.sign(sympy.acos(sympy.Symbol("B.x", real=True) / 2) - 3)):
        m, _, B = bob()
        m.constrain(sympy.sqrt(B.x.symbol**2 + 1) * sign)
        gammas.append(ncgen.compile(m, "numpy").gamma([0.6, -0.8], [0.3, -0.2])[1])
    assert gammas[0] == pytest.approx(-gammas[1]) != 0.0


@pytest.mark.parametrize("alpha", [1e7, 1.0])
def test_ali3p_where_nothing_has_inertia(alpha, capfd):
    """One line of our own instead of a division by the largest mass there is, which is none."""
    m = ncgen.Model("massless")
    m.point("P", (0, 0, 0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ncgen.SingularError, match="no inertia"):
            ncgen.simulate(
                ncgen.compile(m, "numpy"), 0.1, formalism="ali3p", integrator="trapezoidal", max_step=0.05, options={"alpha": alpha}
            )
    assert capfd.readouterr() == ("", "")


def test_rows_that_nothing_can_satisfy_are_named():
    """A row of time alone opens; there is no coordinate to close it."""
    m = ncgen.Model("clock")
    m.constrain(m.time**2, "the hour")
    with pytest.raises(ncgen.ConvergenceError, match="clock: .* t = "):
        ncgen.simulate(ncgen.compile(m, "numpy"), 1.0)


@pytest.mark.parametrize("engine", ["emitted", "batch"])
def test_motions_without_inertia_are_refused_where_dynamics_are_written_out(engine):
    m, *_ = bob()
    m.point("massless", (2, 0, 0))
    k = ncgen.compile(m, "c")
    with pytest.raises(ncgen.SingularError, match="no inertia"):
        ncgen.simulate(k, 0.1, q0=np.array([k.q0, k.q0])) if engine == "batch" else ncgen.simulate(k, 0.1, engine=engine)
