"""A motion that its fixed steps blew up is reported as that, with what is largest, when and the step; rest raises no alarm."""

import warnings

import numpy as np
import pytest

import ncgen
from ncgen.errors import ConvergenceError


@pytest.fixture(scope="module")
def chain():
    """Six light links with strong dampers, for which rk4 would need steps of some microseconds."""
    m = ncgen.Model("chain")
    z, before = m.vector("z", (0, 0, 1), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
    points = [m.point("P0", (0, 0), fixed=True)]
    for k in range(6):
        points.append(m.point(f"P{k + 1}", (0.1 * (k + 1), 0)))
        m.body(f"link{k}", points[-2:], mass=0.01, inertia="rod")
        link = points[-1] - points[-2]
        m.torsion_spring(m.angle(f"psi{k}", before, link, z), 0.0, 1.0, free_angle=0.0)
        before = link
    m.gravity((0, -9.81))
    return ncgen.compile(m)


@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning"])
@pytest.mark.parametrize("engine", ["auto", "python"])
def test_a_blow_up_is_called_so(chain, formalism, engine):
    words = r"chain: the motion has diverged: rate\(.*\) is -?[\d.]+e\+\d+ a second at t = 0.001\d* s; steps of 0.001 s are too long"
    with pytest.raises(ConvergenceError, match=words):
        ncgen.simulate(chain, 1.0, integrator="rk4", max_step=1e-3, points=11, formalism=formalism, engine=engine)


def test_other_failures_keep_their_words():
    """A linkage that cannot reach beyond its stretched position does not diverge there."""
    m = ncgen.Model("locks")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B, C = m.point("B", (0, 1)), m.point("C", (1.5, 1))
    for name, pair in (("crank", [A, B]), ("coupler", [B, C]), ("rocker", [D, C])):
        m.body(name, pair, mass=1.0, inertia="rod")
    psi = m.angle("psi", m.vector("x", (1, 0), fixed=True), B - A, m.vector("z", (0, 0, 1), fixed=True))
    m.drive(psi, np.pi / 2 + m.time)
    with pytest.raises(ncgen.NcgenError) as caught:
        ncgen.simulate(ncgen.compile(m), 2.0, integrator="rk4", max_step=1e-2, points=5)
    assert "diverged" not in str(caught.value)


@pytest.mark.parametrize(("size", "mass", "stiffness"), [(1e-6, 1e-15, 1.0), (1e-6, 1e-12, 10.0), (1.0, 1.0, 1e4)])
def test_no_alarm_where_nothing_moves_but_rounding(size, mass, stiffness):
    """Springs at rest whose lengths are off by the last digit: of a structure of 1 µm the energy is 1e-43 J."""
    m = ncgen.Model("structure")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (size, 0), fixed=True)
    C = m.point("C", (0.37 * size, 0.83 * size))
    m.body("b", [C], mass=mass)
    m.spring(A, C, stiffness)
    m.spring(B, C, stiffness)
    k = ncgen.compile(m)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(k, 1e-3, points=5)
    assert np.max(np.abs(run.q - run.q[0])) < 1e-11 * size
    assert run.energy_drift == 0.0
