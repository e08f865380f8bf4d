"""Models with Python functions run in C: against twins whose forces are expressions, and with what Python does besides."""

from __future__ import annotations

import signal
import threading

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import DomainError, ModelError
from ncgen.exchange.examples import example_module
from ncgen.methods.table import FORMALISMS, INTEGRATORS

DRAG, PULL = 0.7, 3.0


def pulled(t, q, qd, kernels):
    """Drag along x, and a pull that changes with place and time, on the bob."""
    force, x = np.zeros(kernels.n), kernels.index["B.x"]
    force[x] = -DRAG * qd[x] - PULL * q[x] ** 2 + np.sin(3 * t)
    return force


def pendulum(links=1, function=None):
    """A pendulum of some links; with a function its forces, else the same as an expression."""
    m = ncgen.Model("pendulum")
    last = m.point("O", (0, 0), fixed=True)
    for k in range(links):
        point = m.point("B" if k == links - 1 else f"P{k}", (k + 1.0, 0))
        m.body(f"link{k}", points=[last, point], mass=1.0, inertia="rod")
        m.distance(last, point)
        last = point
    m.gravity((0, -9.81))
    if function:
        m.callback(function)
    else:
        x = last.x
        m.force(last, (-DRAG * x.rate - PULL * x**2 + sympy.sin(3 * m.time), 0))
    return m


@pytest.fixture(scope="module")
def twins():
    return ncgen.compile(pendulum(2, pulled), "c"), ncgen.compile(pendulum(2), "c")


METHODS = {
    **{(name, "dop853"): {} for name, entry in FORMALISMS.items() if entry.is_ordinary},
    ("lagrange", "radau"): {},
    ("coordinate-partitioning", "radau"): {},
    **{("lagrange", name): {} for name, entry in INTEGRATORS.items() if "lagrange" in entry.steps},
    ("ali3p", "trapezoidal"): {},
    ("coordinate-partitioning", "trapezoidal"): {},
}


@pytest.mark.parametrize("formalism, integrator", METHODS)
def test_a_callback_moves_as_its_twin(twins, formalism, integrator):
    """The implicit methods find the derivatives of its forces by differences."""
    step = 2e-3 if INTEGRATORS[integrator].has_fixed_step else np.inf
    called, written = (ncgen.simulate(k, 0.4, formalism=formalism, integrator=integrator, rtol=1e-9, max_step=step) for k in twins)
    assert not called.engine.startswith("python") and called.engine == written.engine
    assert np.max(np.abs(called.q - written.q)) < 1e-7 and np.max(np.abs(called.work - written.work)) < 1e-7


def test_forces_are_an_input_of_the_recursion(twins):
    called, written = (ncgen.simulate(k, 1.0, rtol=1e-10) for k in twins)
    assert called.engine == written.engine == "emitted"
    assert np.max(np.abs(called.q - written.q)) < 1e-9 and abs(called.work[-1] - written.work[-1]) < 1e-9
    assert called.statistics.fallbacks == 0 and abs(called.work[-1]) > 0.1


def test_a_long_arm_in_loops_over_tables():
    called, written = (example_module("arm").build(70) for _ in range(2))
    psi = next(c for c in written.components if c.name == "psi1")
    written.torque("psi1", -3.0 * psi.rate + written.time)

    @called.callback
    def motor(t, q, qd, kernels):
        force, i = np.zeros(kernels.n), kernels.index["psi1"]
        force[i] = -3.0 * qd[i] + t
        return force

    one, other = (ncgen.simulate(ncgen.compile(m, "c"), 0.1, points=3, zd0={"psi1": 0.5}) for m in (called, written))
    assert one.engine == other.engine == "tree"
    assert np.max(np.abs(one.q - other.q)) < 1e-9 and one.work[-1] == pytest.approx(other.work[-1], rel=1e-9)


@pytest.mark.parametrize("engine", ["auto", "c"])
@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning"])
def test_what_is_raised_arrives_unchanged(engine, formalism):
    """And at once: no function is called again."""
    failure, calls = LookupError("no table at 0.2 s"), []

    def broken(t, q, qd, kernels):
        calls.append(t)
        if t > 0.2:
            raise failure
        return 0 * q

    kernels = ncgen.compile(pendulum(2, broken), "c")
    with pytest.raises(LookupError) as caught:
        ncgen.simulate(kernels, 1.0, formalism=formalism, engine=engine)
    assert caught.value is failure and sum(t > 0.2 for t in calls) == 1
    with pytest.raises(LookupError):  # and nothing of it is left in the next run
        ncgen.simulate(kernels, 1.0, formalism=formalism, engine=engine)
    assert len(ncgen.simulate(kernels, 0.1, formalism=formalism, engine=engine).q) == 101


def test_a_wrong_shape_is_named():
    kernels = ncgen.compile(pendulum(2, lambda t, q, qd, kernels: np.zeros(3 if t > 0.2 else 4)), "c")
    with pytest.raises(ModelError, match=r"callback <lambda>: it must return 4 finite numbers, .* at t = 0\.2"):
        ncgen.simulate(kernels, 1.0)


@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning"])
def test_nan_is_reported_by_name(formalism):
    def magnet(t, q, qd, kernels):
        assert np.all(np.isfinite(q)) and np.all(np.isfinite(qd)), "a state that is no state"
        return np.full(4, np.nan) if t > 0.2 else np.zeros(4)

    with pytest.raises(DomainError, match=r"callback magnet: it must return 4 finite numbers, .* at t = 0\.2"):
        ncgen.simulate(ncgen.compile(pendulum(2, magnet), "c"), 1.0, formalism=formalism)


def test_ctrl_c_ends_a_run(heard):
    def pressed(t, q, qd, kernels):
        if t > 0.2:
            signal.raise_signal(signal.SIGINT)
        return 0 * q

    with pytest.raises(KeyboardInterrupt):
        ncgen.simulate(ncgen.compile(pendulum(2, pressed), "c"), 1.0)


def test_arguments_can_be_kept():
    """They are copies: C goes on in its own memory."""
    seen = []
    kernels = ncgen.compile(pendulum(2, lambda t, q, qd, kernels: seen.append((q, q.copy())) or 0 * q), "c")
    ncgen.simulate(kernels, 0.5)
    assert all(np.array_equal(*pair) for pair in seen) and not np.array_equal(seen[0][0], seen[len(seen) // 2][0])


def test_runs_in_threads_know_nothing_of_each_other(twins):
    def failing(t, q, qd, kernels):
        if threading.current_thread().name == "bad" and t > 0.1:
            raise LookupError("bad")
        return pulled(t, q, qd, kernels)

    kernels, found = ncgen.compile(pendulum(2, failing), "c"), {}

    def run():
        try:
            found[threading.current_thread().name] = ncgen.simulate(kernels, 0.4, rtol=1e-9)
        except LookupError as error:
            found["bad"] = error

    ncgen.simulate(kernels, 0.01)
    threads = [threading.Thread(target=run, name=name) for name in ("good", "bad", "other")]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    alone = ncgen.simulate(twins[0], 0.4, rtol=1e-9)
    assert isinstance(found["bad"], LookupError)
    assert np.array_equal(found["good"].q, found["other"].q) and np.max(np.abs(found["good"].q - alone.q)) < 1e-12


@pytest.mark.parametrize(
    "asked, reason",
    [
        ({"engine": "emitted"}, "whose forces are not in what is written out; use engine='auto'"),
        ({"number": "float"}, "which computes with doubles, not float; use number='double'"),
    ],
)
def test_what_would_leave_its_forces_out_is_refused(twins, asked, reason):
    with pytest.raises(ModelError, match=f"the model calls a Python function, {reason}"):
        ncgen.simulate(twins[0], 0.1, **asked)
