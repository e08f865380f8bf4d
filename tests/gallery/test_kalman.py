"""The filter on the double pendulum: derivatives against complex steps through Lagrange's equations, doubts against errors."""

from __future__ import annotations

import numpy as np
import pytest

from ncgen.exchange.examples import example_module


@pytest.fixture(scope="module")
def kalman():
    return example_module("doublependulum", "kalman.py")


@pytest.fixture(scope="module")
def pendulum(kalman):
    return kalman.Pendulum()


def lagrange(x):
    """ẋ of two uniform rods, 1 m of 1 kg and 0.8 m of 0.5 kg, by their angles from below."""
    (a, b, v, w), g = x, 9.81
    both = 0.5 * 0.8 / 2 * np.cos(a - b)
    M = np.array([[1 / 3 + 0.5, both], [both, 0.5 * 0.64 / 3]])
    turning = 0.5 * 0.8 / 2 * np.sin(a - b)
    right = np.array([-turning * w**2 - g * (0.5 + 0.5) * np.sin(a), turning * v**2 - g * 0.5 * 0.4 * np.sin(b)])
    return np.concatenate([[v, w], np.linalg.solve(M, right)])


def moved(x, seconds, steps=200):
    h = seconds / steps
    for _ in range(steps):
        k1 = lagrange(x)
        k2 = lagrange(x + h / 2 * k1)
        k3 = lagrange(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + lagrange(x + h * k3))
    return x


def test_states_and_their_derivatives(kalman, pendulum):
    for x in (kalman.START, np.array([-0.7, 2.1, 3.0, -4.0])):
        state, slope = pendulum.moved(x)
        np.testing.assert_allclose(state, moved(x, kalman.PERIOD), rtol=0, atol=1e-11)
        columns = [moved(x + 1e-30j * unit, kalman.PERIOD).imag / 1e-30 for unit in np.eye(4)]
        np.testing.assert_allclose(slope, np.array(columns).T, rtol=0, atol=1e-10)
        seen, slope = pendulum.seen(x)
        steps = [pendulum.seen(x + 1e-6 * unit)[0] - pendulum.seen(x - 1e-6 * unit)[0] for unit in np.eye(4)]
        np.testing.assert_allclose(slope, np.array(steps).T / 2e-6, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_the_filter_knows_how_sure_it_is(kalman, pendulum, monkeypatch, capsys, tmp_path):
    """Over several experiments squared errors in units of the covariance are 4 in the mean, within what such means scatter by; errors are
    far below those of the start left alone."""
    runs = [kalman.experiment(pendulum, 200, seed) for seed in range(6)]
    settled = np.array([np.mean(run.consistency[50:]) for run in runs])
    assert abs(np.mean(settled) - 4.0) < 4 * np.std(settled, ddof=1) / np.sqrt(len(settled))
    for run in runs:
        error, alone = (np.sqrt(np.mean((run.states - x)[50:, :2] ** 2)) for x in (run.estimates, run.alone))
        assert error < 0.02 < alone
    monkeypatch.setattr(
        kalman, "experiment", lambda pendulum: kalman.Histories(*(np.resize(x, (kalman.PICTURES, *x.shape[1:])) for x in runs[0]))
    )
    monkeypatch.setattr(kalman.sys, "argv", ["script", "--plot", str(tmp_path / "plot.png")])
    kalman.main()
    assert "(4 if the filter is right)" in capsys.readouterr().out
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
