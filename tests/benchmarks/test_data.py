"""Data as parameters take the operations that numbers take."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from benchmarks.data import ALL, data_records, first_written_out, operations, with_data_as_parameters

EXAMPLES = ("fourbar", "doublependulum", "slidercrank", "cartpole")


@pytest.mark.parametrize("name", EXAMPLES)
def test_parameters_take_no_more_operations_than_numbers(name):
    """Lengths, directions, inertia, springs and gravity: no operation more than a model with other numbers, and 5 % more than its own."""
    found = {record["tool"]: record for record in data_records(ncgen.load(name))}
    assert found["all data"]["operations"] <= found["other numbers"]["operations"]
    assert found["inertial data"]["ratio"] <= 1.05 and found["all data"]["ratio"] <= 1.05
    assert found["all data"]["data"] >= 5


BEFORE = {"andrews": 609, "flyball": 995, "heavytop": 336, "slidercrank3d": 378}
"""Operations with numbers while common factors still stood inside of sums (docs/sensitivities.md)."""


@pytest.mark.parametrize("name", BEFORE)
def test_parameters_take_what_numbers_took(name):
    """All data as parameters take at most 5 % more than numbers took before common factors were taken out."""
    found = first_written_out(ncgen.load(name), ALL)
    assert found
    changed, count = found
    assert count <= 1.05 * BEFORE[name]
    assert len(changed.parameters) >= 10


@pytest.mark.parametrize("size_alone", [False, True])
def test_a_spatial_loop_takes_the_rows_that_it_takes_with_numbers(size_alone):
    """Its universal joint leaves seven rows for five rates; which are taken decides how many operations follow."""
    model = ncgen.load("slidercrank3d")
    found = {record["tool"]: record["operations"] for record in data_records(model)}
    assert found["all data"] <= found["other numbers"]
    assert operations(with_data_as_parameters(model, size_alone)) <= found["other numbers"]


def test_data_are_what_the_numbers_were():
    """The same accelerations at the defaults, to 1e-12; every parameter counts in them or in where the motion starts."""
    model = ncgen.load("fourbar")
    changed = with_data_as_parameters(model)
    plain, kernels = (ncgen.compile(m, backend="numpy") for m in (model, changed))
    assert kernels.p0 == pytest.approx([abs(x) for x in kernels.p0]) and len(kernels.p0) == 11
    q, qd = plain.q0, np.full(plain.n, 0.1)
    assert np.allclose(kernels.mass(q, p=kernels.p0).toarray(), plain.mass(q).toarray(), rtol=1e-12, atol=0)
    assert np.allclose(kernels.force(q, qd, p=kernels.p0), plain.force(q, qd), rtol=1e-12)
