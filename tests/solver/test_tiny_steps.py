"""Steps that become too short beside t = 0, where the clock tells any two apart."""

import signal

import numpy as np
import pytest

import ncgen


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="Windows has no timers of processor time")
def test_a_start_that_asks_for_less_than_rounding_ends():
    """A top at 471 rad/s: at t = 0 a velocity is 0 and its slope 2e5, so no step is short enough. Steps fell to the smallest number there
    is, which times 0.9 is itself, for ever."""
    tilt, turn, mass, away = 0.5, 1.7, 1.5, 0.3
    along, across = np.array([np.sin(tilt), 0, np.cos(tilt)]), np.array([np.cos(tilt), 0, -np.sin(tilt)])
    spin = (mass * 9.81 * away + (0.02 + mass * away**2) * turn**2 * np.cos(tilt)) / (0.006 * turn)  # of steady precession
    m = ncgen.Model("fast")
    O = m.point("O", (0, 0, 0), fixed=True)
    axes = {"u": along, "e": across, "f": np.array([0.0, 1.0, 0.0])}
    tensor = 0.006 * np.outer(along, along) + 0.02 * (np.eye(3) - np.outer(along, along))
    m.body("top", [O], [m.vector(name, tuple(axis)) for name, axis in axes.items()], mass=mass, com=tuple(away * along), inertia=tensor)
    m.gravity((0, 0, -9.81))
    omega = np.array([0, 0, turn]) + (spin - turn * np.cos(tilt)) * along
    qd0 = {f"{n}.{x}": float(v) for n, axis in axes.items() for x, v in zip("xyz", np.cross(omega, axis), strict=True)}
    kernels = ncgen.compile(m)

    def too_long(*_):
        raise TimeoutError("it takes for ever")

    before = signal.signal(signal.SIGVTALRM, too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, 60.0)
    try:
        with pytest.raises(ncgen.NcgenError, match="steps become too short"):
            ncgen.simulate(kernels, 0.3, qd0=qd0, rtol=1e-12, points=31)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    run = ncgen.simulate(kernels, 0.3, qd0=qd0, rtol=1e-9, points=3)
    np.testing.assert_allclose(run["u.z"], np.cos(tilt), rtol=0, atol=1e-8)
    turned = np.unwrap(np.arctan2(run["u.y"], run["u.x"]))
    assert turned[-1] == pytest.approx(turn * 0.3, abs=1e-7)
