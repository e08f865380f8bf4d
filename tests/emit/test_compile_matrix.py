"""The robot's C in every emission, for every compiler and number type, without a warning and with the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from c_code import compile_object, compilers, run_consumer, run_numpy

import ncgen
from ncgen import Model
from ncgen.program.programs import EMISSIONS

TYPES = {"double": (), "single": ("-DNCGEN_SINGLE",), "long double": ("-DNCGEN_LONG_DOUBLE",), "quad": ("-DNCGEN_QUAD",)}
CLOSE = {"double": 1e-14, "single": 1e-5, "long double": 1e-14, "quad": 1e-14}
"""Difference to doubles in NumPy that is allowed, relative to the largest number of a kernel."""


def assert_close(found, wanted, tolerance):
    """Equal kernels and sizes, and numbers equal to `tolerance` of each kernel's largest."""
    assert set(found) == set(wanted)
    for kernel, values in wanted.items():
        np.testing.assert_allclose(found[kernel], values, rtol=0, atol=tolerance * np.max(np.abs(values)), err_msg=kernel)


def flags_of(kind: str) -> tuple[str, ...]:
    """__float128 is an extension, so pedantry has to be off for it."""
    return (*TYPES[kind], "-Wno-pedantic") if kind == "quad" else TYPES[kind]


# quadmath.h, which __float128 needs, belongs to gcc.
PAIRS = [(compiler, kind) for compiler in compilers() for kind in TYPES if (compiler, kind) != ("clang", "quad")]


@pytest.mark.parametrize(("compiler", "kind"), PAIRS)
@pytest.mark.parametrize("emission", EMISSIONS)
def test_robot(robot_sources, emission, compiler, kind, tmp_path):
    """C object, C++ consumer, linked and run: one text for every number type."""
    sources, flags = robot_sources(emission), flags_of(kind)
    found = run_consumer(compile_object(sources, tmp_path, *flags, compiler=compiler), *flags, compiler="g++")
    assert_close(found, run_numpy(sources), CLOSE[kind])


def test_types_differ(robot_sources, tmp_path):
    """The switches do something: floats have a visible error, and no type gives another's numbers."""
    said = {}
    for kind, flags in ((kind, flags_of(kind)) for kind in TYPES):
        said[kind] = run_consumer(compile_object(robot_sources("tabled"), tmp_path / kind, *flags), *flags)["gamma"]
    assert np.max(np.abs(said["single"] - said["quad"])) > 1e-8
    assert np.max(np.abs(said["double"] - said["quad"])) > 0
    assert np.max(np.abs(said["long double"] - said["quad"])) <= np.max(np.abs(said["double"] - said["quad"]))


def test_the_optimiser_has_no_complaint(robot_sources, tmp_path):
    """Some warnings need an optimiser to be found."""
    compile_object(robot_sources("auto"), tmp_path, "-O2")


def twins(count: int) -> Model:
    """Bodies that share their elements, so that all their contributions meet in the same places."""
    model = Model("twins")
    base, tip, axis = model.point("A", (0, 0, 0)), model.point("B", (1, 0, 0)), model.vector("u", (0, 0, 1))
    model.distance(base, tip)
    for k in range(count):
        model.body(f"twin{k}", points=[base, tip], vectors=[axis], mass=2.0, com=(0.5, 0.25, 0), inertia=(1.0, 1.0, 1.0))
    model.gravity((0, 0, -9.81))
    return model


@pytest.mark.parametrize("emission", EMISSIONS)
def test_contributions_to_one_place_add_up(emission, tmp_path):
    """Four equal bodies on the same elements have four times the mass, force and energy of one, in C and NumPy."""
    one, four = (ncgen.generate(twins(count), emission=emission) for count in (1, 4))
    expected = {name: 4 * values for name, values in run_numpy(one).items() if name in ("mass", "force", "energy")}
    for found in (run_numpy(four), run_consumer(compile_object(four, tmp_path))):
        assert_close({name: found[name] for name in expected}, expected, 1e-14)


def lone_particle() -> Model:
    model = Model("m")
    model.body("b", points=[model.point("B", (0, 0, 1))], mass=2.0)
    model.gravity((0, 0, -9.81))
    return model


def nothing_free() -> Model:
    model = Model("m")
    model.distance(model.point("A", (0, 0, 0), fixed=True), model.point("B", (0, 0, 1), fixed=True))
    return model


def constant_row() -> Model:
    model = Model("m")
    model.point("A", (0, 0, 1))
    model.constrain(model.parameter("c", 2.0) - 2)
    return model


@pytest.mark.parametrize("build", [lone_particle, nothing_free, constant_row, lambda: Model("m")], ids=range(4))
def test_almost_empty_mechanisms(build, tmp_path):
    """No rows, no free coordinate, no Jacobian, nothing at all: still C99 without a warning."""
    sources = ncgen.generate(build())
    assert_close(run_consumer(compile_object(sources, tmp_path)), run_numpy(sources), 0.0)
