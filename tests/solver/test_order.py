"""The observed order of the methods whose step can be halved, on the pendulum's fall in closed form.

Methods with error control take equal steps where the tolerance asks for nothing and the longest step is given. Adams, BDF and
LSODA choose their order themselves, so they have none. Those for constrained equations are in test_steppers.py.
"""

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import ncgen

DURATION = 1.5
ORDERS = {"rk4": (4, 1024), "rk23": (3, 256), "dopri5": (5, 64), "dop853": (8, 16), "radau": (5, 256), "trapezoidal": (2, 256)}
"""Theory, and steps from which on the leading term of the error is what one sees and rounding is not."""


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="c")


def fallen(t):
    """x and y of the pendulum, by elliptic functions."""
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81) * t, 0.5)
    half = np.sqrt(0.5) * sn
    return np.array([-2 * half * dn, 2 * half**2 - 1])


def error(pendulum, name, count):
    anything = {"rtol": 0.5, "atol": 1e9, "max_step": DURATION / count}
    run = ncgen.simulate(pendulum, DURATION, formalism="lagrange", integrator=name, points=2, **anything)
    return np.max(np.abs(run.q[-1] - fallen(DURATION)))


@pytest.mark.parametrize("name", ORDERS)
def test_halving_the_step(pendulum, name):
    """Within 0.1 of theory; the error of dop853 vanishes before it settles, there it is not lower."""
    order, count = ORDERS[name]
    observed = np.log2(error(pendulum, name, count) / error(pendulum, name, 2 * count))
    assert observed > order - 0.1
    assert observed < order + 0.1 or name == "dop853"
