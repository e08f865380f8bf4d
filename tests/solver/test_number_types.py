"""Runs in float and in long double: the same motion, to the digits of the type."""

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import ncgen


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), "c")


def fallen(kernels, t) -> np.ndarray:
    """From rest at 90°: sin(θ/2) = √½ sn(K − √(g/l) t | ½)."""
    length = float(np.hypot(*kernels.q0))
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81 / length) * t, 0.5)
    s = np.sqrt(0.5) * sn
    return length * np.column_stack([-2 * s * dn, 2 * s * s - 1])


@pytest.mark.parametrize("engine", ["c", "emitted"])
@pytest.mark.parametrize("number, tolerance, allowed", [("float", 1e-6, 2e-5), ("long double", 1e-14, 1e-13)])
def test_the_pendulum_falls_as_elliptic_functions_say(pendulum, engine, number, tolerance, allowed):
    run = ncgen.simulate(pendulum, 1.0, engine=engine, number=number, rtol=tolerance, atol=tolerance, points=11, integrator="dopri5")
    assert run.number == number and run.q.dtype == float
    assert np.max(np.abs(run.q - fallen(pendulum, run.t))) < allowed


def test_float_has_the_digits_of_float(pendulum):
    """It is computed in float indeed: the constraint is open by its rounding, not by double's."""
    opened = ncgen.simulate(pendulum, 1.0, number="float", rtol=1e-5, points=11).violation()
    assert 1e-9 < np.max(opened) < 1e-6


def test_tolerances_finer_than_rounding_do_not_stop_float(pendulum):
    run = ncgen.simulate(pendulum, 1.0, number="float", rtol=1e-15, atol=1e-300, points=11)
    assert np.max(np.abs(run.q - fallen(pendulum, run.t))) < 5e-5 and run.statistics.steps < 100


def test_all_coordinates_in_float(pendulum):
    run = ncgen.simulate(pendulum, 1.0, formalism="lagrange", number="float", rtol=1e-5, atol=1e-6, points=11)
    assert np.max(np.abs(run.q - fallen(pendulum, run.t))) < 1e-4


@pytest.mark.parametrize(
    "options, message",
    [
        ({"number": "half"}, "number 'half' is unknown; choose one of double, float, long double"),
        (
            {"number": "float", "integrator": "radau"},
            "in C with float: radau takes derivatives of the kernels, which are double; use number='double'",
        ),
        ({"number": "float", "integrator": "bdf"}, "bdf runs in Python"),
        ({"number": "float", "engine": "python"}, "number 'float': Python computes with doubles; leave out engine='python'"),
    ],
)
def test_refused(pendulum, options, message):
    with pytest.raises(ncgen.ModelError, match=message):
        ncgen.simulate(pendulum, 1.0, **options)


@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
def test_a_thousand_times_larger_is_the_same_in_float(integrator):
    """Lengths and gravity times 1024 change no digit of a motion, so no step either: atol is raised to the rounding of its lengths."""

    def run(size):
        m = ncgen.Model("scaled")
        A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (size, 0)), m.point("C", (size, size))
        m.body("first", [B], mass=1.0)
        m.body("second", [C], mass=1.0)
        m.distance(A, B)
        m.distance(B, C)
        m.gravity((0, -10.0 * size, 0))
        options = {"formalism": "coordinate-partitioning", "integrator": integrator, "engine": "c", "number": "float"}
        return ncgen.simulate(ncgen.compile(m, "c"), 0.5, rtol=1e-15, atol=1e-300, points=3, **options)

    small, large = run(1.0), run(1024.0)
    assert large.statistics.steps == small.statistics.steps
    assert large.q / 1024 == pytest.approx(small.q, abs=1e-5)
