"""Positions of mechanisms that are driven altogether, and their derivatives by parameters, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model
from ncgen.solver.positions.partition import choose_partitions

CRANK, ROD = 0.3, 0.8


def slider_crank(driven: bool = True, twice: bool = False, way: float = 1.0) -> ncgen.Model:
    """A crank about O, turned by way * t, and a rod to a slider on the x axis; twice: the crank's length is said by two rows."""
    m = Model("slidercrank")
    r, L = m.parameter("r", CRANK), m.parameter("L", ROD)
    O = m.point("O", (0, 0), fixed=True)  # noqa: E741
    A = m.point("A", (CRANK, 0))
    B = m.point("B", (CRANK + ROD, 0), fixed="y")
    m.distance(O, A, r)
    m.distance(A, B, L)
    if twice:
        m.distance(O, A, r)
    if driven:
        x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
        m.drive(m.angle("psi", start=x, end=A - O, axis=z), way * m.time)
    return m


def slider(r, L, turned):
    """Where the slider is, also of complex lengths."""
    return r * np.cos(turned) + np.sqrt(L**2 - (r * np.sin(turned)) ** 2)


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("twice", [False, True])
def test_a_slider_crank(backend, twice):
    kernels = ncgen.compile(slider_crank(twice=twice), backend=backend)
    t, lengths = np.linspace(0.0, 6.0, 25), {"r": 0.25, "L": 0.7}
    found = ncgen.driven_positions(kernels, t, p=lengths)
    at = kernels.index["B.x"]
    assert found.q.shape == (25, kernels.n) and found.q_by.shape == (25, kernels.n, 2)
    np.testing.assert_allclose(found.q[:, at], slider(0.25, 0.7, t), atol=1e-14)
    np.testing.assert_allclose(found.q_by[:, at, 0], slider(0.25 + 1e-30j, 0.7, t).imag / 1e-30, atol=1e-13)
    np.testing.assert_allclose(found.q_by[:, at, 1], slider(0.25, 0.7 + 1e-30j, t).imag / 1e-30, atol=1e-13)
    np.testing.assert_allclose(found.q[:, kernels.index["psi"]], t, atol=1e-14)


def test_far_apart_it_stays_on_its_branch():
    """From one instant to the next the crank turns by 2 rad, which Newton's method does not close at once."""
    kernels = ncgen.compile(slider_crank())
    t = np.array([0.0, 2.0, 4.0, 6.0])
    found = ncgen.driven_positions(kernels, t)
    np.testing.assert_allclose(found.q[:, kernels.index["B.x"]], slider(CRANK, ROD, t), atol=1e-14)


def test_near_other_positions():
    kernels = ncgen.compile(slider_crank())
    t = np.array([0.2, 2.2, 4.1])
    first = ncgen.driven_positions(kernels, t)
    again = ncgen.driven_positions(kernels, t, p=(0.35, 0.75), q0=first.q)
    np.testing.assert_allclose(again.q[:, kernels.index["B.x"]], slider(0.35, 0.75, t), atol=1e-14)
    last = ncgen.driven_positions(kernels, t[2:], q0=again.q[2])
    np.testing.assert_allclose(last.q[0, kernels.index["B.x"]], slider(CRANK, ROD, t[2]), atol=1e-14)


def test_near_what_is_none():
    """Of positions that are near others one may begin far off; one at an angle's other root is refused."""
    kernels, t = ncgen.compile(slider_crank()), np.array([0.2, 2.2, 4.1])
    found = ncgen.driven_positions(kernels, t)
    crank = [kernels.index["A.x"], kernels.index["A.y"]]
    far, turned = found.q.copy(), found.q.copy()
    far[1] += 0.4
    turned[1, crank] *= -1
    np.testing.assert_allclose(ncgen.driven_positions(kernels, t, q0=far).q, found.q, atol=1e-14)
    with pytest.raises(ncgen.ConvergenceError, match="^angle psi: the position found is the mirror root, 180.0 degrees off"):
        ncgen.driven_positions(kernels, t, q0=turned)


def test_what_derivatives_foresee():
    """To first order, and what is closed from there is the position."""
    kernels, lengths = ncgen.compile(slider_crank()), np.array([0.35, 0.75])
    t, at = np.array([0.2, 2.2, 4.1]), kernels.index["B.x"]
    first = ncgen.driven_positions(kernels, t)
    near = first.foreseen({"r": 0.35, "L": 0.75})
    along = slider(CRANK + 1e-30j * (0.35 - CRANK), ROD + 1e-30j * (0.75 - ROD), t).imag / 1e-30
    np.testing.assert_allclose(near[:, at], slider(CRANK, ROD, t) + along, atol=1e-13)
    np.testing.assert_allclose(ncgen.driven_positions(kernels, t, p=lengths, q0=near).q[:, at], slider(0.35, 0.75, t), atol=1e-14)


def test_no_instants():
    kernels = ncgen.compile(slider_crank(), backend="numpy")
    found = ncgen.driven_positions(kernels, [])
    assert found.q.shape == (0, kernels.n) and found.q_by.shape == (0, kernels.n, 2) and found.foreseen(found.p).shape == found.q.shape


def test_refusals():
    kernels = ncgen.compile(slider_crank(), backend="numpy")
    with pytest.raises(ncgen.ModelError, match=r"q0 has shape \(2, 3\); it must be \(4,\) or \(1, 4\)"):
        ncgen.driven_positions(kernels, [0.0], q0=np.zeros((2, 3)))
    with pytest.raises(ncgen.ModelError, match=r"t\[1\]"):
        ncgen.driven_positions(kernels, [0.0, np.nan])
    with pytest.raises(ncgen.ModelError, match="slidercrank: 1 freedom is not driven"):
        ncgen.driven_positions(ncgen.compile(slider_crank(driven=False), backend="numpy"), [0.0])
    with pytest.raises(ncgen.ModelError, match="what rolls has positions that depend on its way"):
        ncgen.driven_positions(ncgen.compile(ncgen.load("disc"), backend="numpy"), [0.0])


def test_where_the_mechanism_cannot_go():
    """The rod is shorter than the crank: it comes no further than where the crank stands at asin(L / r)."""
    kernels = ncgen.compile(slider_crank(), backend="numpy")
    ends = np.arcsin(0.2 / CRANK)
    with pytest.raises(ncgen.ConvergenceError):
        ncgen.driven_positions(kernels, [0.0, 0.9 * ends, 1.1 * ends], p={"L": 0.2}, q0=(CRANK, 0.0, CRANK + 0.2, 0.0))
    beside = ends - 1e-4
    there = ncgen.driven_positions(kernels, [0.0, beside], p={"L": 0.2}, q0=(CRANK, 0.0, CRANK + 0.2, 0.0))
    expected = slider(CRANK + 1e-30j, 0.2, beside).imag / 1e-30, slider(CRANK, 0.2 + 1e-30j, beside).imag / 1e-30
    np.testing.assert_allclose(there.q_by[-1, kernels.index["B.x"]], expected, rtol=1e-9)


def test_a_singular_position_has_no_derivative():
    """A crank and a rod of one length: at a right angle the slider is at the crank's own point, where two branches meet."""
    kernels = ncgen.compile(slider_crank(), backend="numpy")
    found = ncgen.driven_positions(kernels, [0.0, 1.0], p={"L": CRANK}, q0=(CRANK, 0.0, 2 * CRANK, 0.0))
    found.t[1], found.q[1] = np.pi / 2, (0.0, CRANK, 0.0, np.pi / 2)
    with pytest.raises(ncgen.SingularError, match=r"the position at t = 1\.5708 s is singular"):
        found.q_by  # noqa: B018


def test_what_is_independent_in_a_slot_that_turns():
    """Along y at first, along x a quarter of a turn later: a partition without a time is that of t = 0."""
    model = ncgen.Model("slot")
    point = model.point("P", (0, 0.3))
    model.body("bead", points=[point], mass=1.0)
    model.constrain(sympy.cos(model.time) * point.x + sympy.sin(model.time) * point.y)
    kernels = ncgen.compile(model, "numpy")
    for given, q, name in (((), [0, 0.3], "P.y"), ((np.pi / 2,), [0.3, 0], "P.x")):
        assert choose_partitions(kernels, np.array(q), *given).position.names(kernels) == (name,)
