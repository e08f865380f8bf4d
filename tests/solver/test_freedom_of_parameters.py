"""What rank remembers it tells apart by the parameters that rows read: lengths, not masses."""

from __future__ import annotations

import numpy as np

import ncgen
from ncgen.solver.positions import rank


def crank(name: str) -> ncgen.Model:
    """A four-bar; lengths are measured, and follow the offset."""
    m = ncgen.Model(name)
    mass, offset = m.parameter("mass", 2.0), m.parameter("offset", 0.2)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0, 1)), m.point("C", (2, offset))
    m.body("first", [A, B], mass=mass, inertia="point")
    m.body("second", [B, C], mass=1.0, inertia="point")
    m.distance(C, m.point("D", (3, 0), fixed=True))
    return m


def test_what_rows_read():
    kernels = ncgen.compile(crank("read"), "numpy")
    assert kernels.of_rows(np.array([7.0, 0.3])).tolist() == [0.3]


def test_masses_are_not_asked_again_and_lengths_are(monkeypatch):
    kernels = ncgen.compile(crank("asked"), "numpy")
    asked = []
    found = rank._freedom
    monkeypatch.setattr(rank, "_freedom", lambda kernels, q, t, p: (asked.append(p), found(kernels, q, t, p))[1])
    for mass, offset in ((2.0, 0.2), (3.0, 0.2), (2.0, 0.3)):
        p = np.array([mass, offset])
        assert ncgen.freedom(kernels, kernels.q0, p=p).dof == 1
    assert [p.tolist() for p in asked] == [[2.0, 0.2], [2.0, 0.3]]
