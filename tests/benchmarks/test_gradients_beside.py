"""The same motion and its gradient by CasADi's reverse mode: another way of differentiating the same steps."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from benchmarks.rivals import casadi_motions

pytest.importorskip("casadi")


def test_casadi_goes_back_through_the_same_motion():
    """A four-bar with a force that changes with time: the sum to 1e-12, its derivatives by all parameters to 1e-10."""
    model = ncgen.Model("linkage")
    crank = model.parameter("crank", 1.0)
    A, D = model.point("A", (0, 0), fixed=True), model.point("D", (2.5, 0.1), fixed=True)
    x, z = model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    B, C = model.point("B", (crank * 0.6, crank * 0.8)), model.point("C", (2.3, 1.7))
    model.body("first", points=[A, B], mass=model.parameter("m", 2.0), inertia="point")
    model.body("second", points=[B, C], mass=3.0, inertia="point")
    model.body("third", points=[C, D], mass=1.5, inertia="point")
    psi = model.angle("psi", start=x, end=B - A, axis=z)
    model.gravity((0, -9.81, 0))
    model.torque(psi, model.parameter("load", 4.0) * sympy.cos(3 * model.time))
    model.independent(psi)
    kernels = ncgen.compile(model)
    by_q, by_qd = np.random.default_rng(1).standard_normal((2, 21, kernels.n))
    q0 = ncgen.assemble(kernels, kernels.q0)
    mine = ncgen.sensitivities(kernels, 0.5, 20, q0=q0)
    made = casadi_motions.motion(kernels, 0.5, 20)
    given = q0, np.zeros(kernels.n), kernels.p0, by_q, by_qd
    assert made.value(*given) == pytest.approx(np.sum(by_q * mine.q) + np.sum(by_qd * mine.qd), rel=1e-12)
    wanted = np.einsum("kn,knc->c", by_q, mine.q_by) + np.einsum("kn,knc->c", by_qd, mine.qd_by)
    of_q, of_qd, of_p = np.split(made.back(*given), [kernels.n, 2 * kernels.n])
    found = of_p + of_q @ mine.q_by[0, :, :3] + of_qd @ mine.qd_by[0, :, :3]  # the crank's length moves the start, too
    assert np.abs(wanted[:3]).min() > 1e-3
    assert found == pytest.approx(wanted[:3], rel=1e-10)
