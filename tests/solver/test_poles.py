"""Poles, zeros and responses of linearised mechanisms, beside closed forms and scipy.signal."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
from driven_models import mass_on_a_slide
from test_state_space import GRAVITY, cart_pole, quarter_car

import ncgen
from ncgen import ModelError
from ncgen.solver.linear.poles import Pole, poles_of, zeros_of
from ncgen.view.response import response


@pytest.fixture(scope="module")
def car():
    return ncgen.linearise(ncgen.compile(quarter_car()))


def test_quarter_car(car):
    """Poles by the characteristic polynomial, gain and zeros of the body's acceleration by its transfer function in s."""
    wheel, body, tyre, spring, damper = 40.0, 300.0, 2e5, 2e4, 1.5e3
    s = np.polynomial.Polynomial([0, 1])
    lower, upper, coupling = wheel * s**2 + damper * s + spring + tyre, body * s**2 + damper * s + spring, damper * s + spring
    characteristic = lower * upper - coupling**2
    poles = characteristic.roots()
    expected = sorted((x for x in poles if x.imag > 0), key=lambda x: x.imag)
    assert np.allclose([pole.value for pole in car.poles], expected, rtol=1e-10)
    assert np.allclose([pole.damping_ratio for pole in car.poles], np.cos(np.pi - np.angle(expected)), rtol=1e-10)
    w = np.geomspace(0.1, 1e3, 200)
    # The actuator pushes the body up and the wheel down.
    comfort = s**2 * (lower - coupling)
    grip = coupling - upper
    for k, above in enumerate((comfort, grip)):
        exact = above(1j * w) / characteristic(1j * w)
        assert np.allclose(car.frequency_response(w)[:, k, 0], exact, rtol=1e-10, atol=1e-10 * np.max(np.abs(exact)))
    assert np.allclose(np.sort(np.abs(car.zeros("comfort"))), np.sort(np.abs(comfort.roots())), rtol=1e-8, atol=1e-5)
    assert np.allclose(np.sort_complex(car.zeros("grip") ** 2), 0.0, atol=1e-6)


@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")
def test_beside_scipy(car):
    w = np.geomspace(0.5, 500, 50)
    for k in range(2):
        _, theirs = scipy.signal.freqresp(scipy.signal.StateSpace(car.A, car.B, car.C[[k]], car.D[[k]]), w)
        ours = car.frequency_response(w)[:, k, 0]
        assert np.allclose(ours, theirs, rtol=0, atol=1e-9 * np.max(np.abs(ours)))


def test_who_moves_in_the_poles_of_a_car(car):
    """The body in the slow one, the wheel in the fast one, as every book on suspensions has it."""
    slow, fast = car.poles
    assert next(iter(slow.participation)) == "high" and slow.participation["high"] > 0.8
    assert next(iter(fast.participation)) == "low" and fast.participation["low"] > 0.8
    assert sum(slow.participation.values()) == pytest.approx(1.0)
    assert str(slow).startswith(f"{slow.value.real:.6g} ± {slow.value.imag:.6g}i 1/s: high ")


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_who_moves_does_not_depend_on_the_unit_of_time(scale):
    """Poles of -1, -1, -1.01, and ± 2i on three others: whoever shares a pole shares its motion, the others do not."""
    A = np.array([[-1.0, 0, 0, 0, 0], [0, -1.0, 0, 0, 0], [0, 0, -1.01, 0, 0], [0, 0, 0, 0, 2.0], [0, 0, 0, -2.0, 0]]) * scale
    poles = poles_of(A, np.linalg.eigvals(A), "abcde")
    found = {str(np.round(pole.value / scale, 9)): pole.participation for pole in poles}
    both, single, pair = {"a": 0.5, "b": 0.5}, {"c": 1.0}, {"d": 0.5, "e": 0.5}
    for value, expected in ((-1.0, both), (-1.01, single), (2j, pair)):
        assert found[str(complex(value))] == pytest.approx(dict.fromkeys("abcde", 0.0) | expected, abs=1e-9)


def test_a_pole_is_told_without_those_that_do_not_move():
    """Whole percents: what has less than half of one is left out."""
    assert str(Pole(-2.0, {"a": 0.75, "b": 0.2455, "c": 0.0045})) == "-2 1/s: a 75 %, b 25 %"


@pytest.mark.parametrize("up", [True, False])
def test_gantry_and_inverted_pendulum(up):
    """s = ±√((M + m) g / M l), imaginary where it hangs, and 0 twice: that is the cart alone. The cart stands still under a force at the
    pendulum's own frequency √(g / l)."""
    M, m, l = 1.3, 0.4, 0.6
    near = ncgen.linearise(ncgen.compile(cart_pole(M, m, l, up)))
    own = np.sqrt((M + m) * GRAVITY / (M * l))
    expected = [0, 0, -own, own] if up else [0, 0, 1j * own]
    values = np.array([pole.value for pole in near.poles])
    assert np.allclose(sorted(values, key=lambda x: (abs(x), x.real)), expected, rtol=1e-10, atol=1e-10)
    still = [pole for pole in near.poles if abs(pole.value) < 1e-6]
    assert all(pole.participation["s"] > 0.999 for pole in still)
    zeros = near.zeros("place", "F")
    assert np.allclose(np.sort_complex(zeros**2), (1 if up else -1) * GRAVITY / l, rtol=1e-10)
    assert len(near.zeros("angle")) == 2 and np.allclose(near.zeros("angle"), 0.0, atol=1e-6)
    w = 3.0
    exact = (-GRAVITY / l * (1 if up else -1) - w**2) / (M * w**2 * (w**2 + (1 if up else -1) * own**2))
    assert near.frequency_response([w])[0, 0, 0] == pytest.approx(exact, rel=1e-10)


def test_shares_do_not_depend_on_units(car):
    from ncgen.solver.linear.poles import poles_of

    scale = np.diag([1e3, 1e-2, 1e4, 1.0])
    other = poles_of(scale @ car.A @ np.linalg.inv(scale), car.eigenvalues, ("low", "high") * 2)
    for pole, same in zip(car.poles, other, strict=True):
        assert pole.participation == pytest.approx(same.participation, rel=1e-8)


def test_drawn(car):
    chart = response(car)
    gain, phase = chart.axes
    assert [line.get_label() for line in gain.get_lines()] == ["comfort", "grip"]
    f, values = gain.get_lines()[0].get_data()
    exact = np.abs(car.frequency_response(2 * np.pi * np.asarray(f)[[0, 100, 399]])[:, 0, 0])
    assert np.allclose(np.asarray(values)[[0, 100, 399]], exact)
    assert (gain.get_title(), phase.get_xlabel()) == ("by F", "frequency (Hz)")


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
def test_what_is_refused(car):
    with pytest.raises(ModelError, match=r"the model has no input; declare it with m\.input"):
        ncgen.linearise(ncgen.compile(ncgen.load("pendulum"))).frequency_response([1.0])
    with pytest.raises(ModelError, match="zeros: the mechanism has no output wind; it has comfort, grip"):
        car.zeros("wind")
    block = ncgen.linearise(ncgen.compile(mass_on_a_slide()))
    with pytest.raises(ModelError, match="w: 0 rad/s is a pole, where the response has no bound; leave it out"):
        block.frequency_response([0.0])


@pytest.mark.parametrize("unit", [1e-10, 1.0, 1e10])
def test_zeros_do_not_depend_on_the_unit_of_the_input(unit):
    """(s + 2) (s + 3) / ((s + 1) (s + 4)) = 1 + 2/3 / (s + 1) - 2/3 / (s + 4), and the same without what goes through at once."""
    A, b, c = np.diag([-1.0, -4.0]), unit * np.array([2 / 3, -2 / 3]), np.ones(2)
    assert np.sort_complex(zeros_of(A, b, c, unit)) == pytest.approx([-3.0, -2.0], rel=1e-9)
    assert len(zeros_of(A, b, c, 0.0)) == 0  # 2 / ((s + 1) (s + 4))
