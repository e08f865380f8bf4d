"""A run whose steps are so short that it would not end in days says so in seconds, by its own pace and by no clock."""

import time

import pytest

import ncgen
from ncgen import ConvergenceError
from ncgen.errors import SingularError
from ncgen.mechanism import listening
from ncgen.mechanism.listening import MOST_STAGES, STAGES, Progress


def fourbar():
    """A four-bar linkage that a torsion spring of K N m/rad holds where it is."""
    m = ncgen.Model("stiff")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (1, 0), fixed=True)
    B, C = m.point("B", (0.2, 0.3)), m.point("C", (1.1, 0.6))
    for name, ends in (("crank", [A, B]), ("coupler", [B, C]), ("rocker", [C, D])):
        m.body(name, ends, mass=1.0, inertia="rod")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", x, B - A, z)
    m.independent(psi)
    m.gravity((0, -9.81, 0))
    m.torsion_spring(psi, m.parameter("K", 1.0))
    return m


def hear(progress, pace, calls=20):
    """Stages at a pace of so many a second."""
    for k in range(calls):
        progress.spend(k * STAGES / pace, STAGES)


def test_a_run_that_arrives_goes_on():
    hear(Progress(None, "m", end=10.0), 0.9 * MOST_STAGES / 10.0)


def test_a_run_that_does_not_arrive_ends():
    with pytest.raises(ConvergenceError, match=r"m: 4.0e\+06 evaluations came from t = 0 s to .* are left until 10 s; look"):
        hear(Progress(None, "m", end=10.0), 1.1 * MOST_STAGES / 9.9)


def test_a_run_is_to_arrive_at_its_last_time(monkeypatch):
    monkeypatch.setattr(listening, "STAGES", 1)
    monkeypatch.setattr(listening, "MOST_STAGES", 1)
    with pytest.raises(ConvergenceError, match=r" are left until 30 s; look"):
        ncgen.simulate(ncgen.compile(ncgen.load("pendulum")), 30.0, points=4)


def test_only_the_last_pace_counts():
    """A slow beginning is forgotten, and where a stop may end the run nobody judges."""
    progress = Progress(None, "m", end=10.0)
    progress.spend(0.0, STAGES)
    progress.spend(1e-12, STAGES // 2)
    progress.spend(5.0, STAGES // 2)
    hear(Progress(None, "m", end=None), 1e30)


@pytest.mark.slow
@pytest.mark.parametrize("K", [1e10, 1e12, 1e16, 1e20, 1e50, 1e100, 1e200, 1e300])
def test_any_stiffness_is_right_or_refused(K):
    """The motion is less than the load over K, 2e-9 rad; or one line says that it does not go on, within a minute."""
    k = ncgen.compile(fourbar())
    began = time.process_time()
    try:
        run = ncgen.simulate(k, 0.1, p={"K": K}, points=3)
        assert run["psi"] == pytest.approx(k.q0[k.index["psi"]], abs=1e-8)
    except (ConvergenceError, SingularError) as error:
        assert "\n" not in str(error)
    assert time.process_time() - began < 100
