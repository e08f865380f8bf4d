"""Blocks on two tips, pushed to and fro by less than friction holds: which tip bears the push is not determined, and nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import ncgen

MU, G = 0.3, 9.81
PUSHES = (2.55, 2.7, 2.83, 2.93)
"""In N; friction holds 2.943 N."""


def block(com: tuple[float, float]):
    m = ncgen.Model("block")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    tips = {"left": m.point("A", (0, 0)), "right": m.point("B", (1, 0))}
    body = m.body("block", list(tips.values()), mass=1.0, com=com, inertia=0.1)
    m.gravity((0, -G))
    m.force(tips["left"], (m.parameter("push", 2.8) * sympy.sin(2 * math.pi * m.time), 0))
    for name, P in tips.items():
        m.contact(name, body, P, m.ground, O, normal=up, friction=MU, order="simultaneous")
    return ncgen.compile(m)


@pytest.mark.parametrize("com", [(0.125078, 0.287032), (0.208077, 0.216447), (0.61, 0.08), (0.9, 0.3)])
def test_a_pushed_block_stays(com):
    """By single runs at several tolerances, and many pushes in C."""
    kernels = block(com)
    for push, rtol in zip(PUSHES, (4.5e-9, 1e-4, 1e-11, 1.5e-9), strict=True):
        run = ncgen.simulate(kernels, 2.0, p={"push": push}, rtol=rtol)
        assert not np.any(run.q - run.q[0]) and not np.any(run.qd)
    batch = ncgen.simulate(kernels, 2.0, p={"push": list(PUSHES)}, rtol=4.5e-9)
    assert not np.any(batch.alone)
    assert (
        np.max(np.abs(batch.q - batch.q[:, :1])) < 1e-12 and np.max(np.abs(batch.qd)) < 1e-12
    )  # the matrix of all that may be held rounds
